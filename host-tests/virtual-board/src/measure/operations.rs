//! The operations that are measured, each over and over at other phases of the firmware's own
//! timers.

use std::time::Duration;

use host_protocol::requests::{
    Arm, Clear, ConfigureAxis, ConfigureBus, ConfigureGateway, EStop, Hello, Ping,
    ProvisionMotorTimeout, ReadState, ReleaseAuthority, SetBaud, Setpoint, Stop,
};
use host_protocol::{
    AxisParameter, ClearTarget, GatewayParameter, PROTOCOL_MAJOR, PROTOCOL_MINOR, Protocol,
    ProtocolSet, Reply, Request, Setpoint as Target, StopAction, StopTarget, Value,
};

use super::bench::{AXES, Answer, BITRATE, Bench, Exchange, Span, place};
use crate::nodes::since_start;
use virtual_stm32::fdcan::{FrameRecord, Sender};

/// How often each operation is repeated.
pub(super) const PHASES: u32 = 100;
/// How much later each repetition is, seen from the firmware's own periods of 10 ms and 20 ms: all
/// of them is covered.
const PHASE: Duration = Duration::from_micros(201);
/// Between the repetitions of what leaves the motors turning: between two refreshes of the
/// setpoint, which come every 20 ms.
const PERIOD: Duration = Duration::from_millis(30);
/// What the gateway and its motors have to do within it is done by then.
const WINDOW: Duration = Duration::from_millis(20);
/// The same two on a bus that is idle: a control loop's.
const LOOP_PERIOD: Duration = Duration::from_millis(10);
const LOOP_WINDOW: Duration = Duration::from_millis(8);
/// What the gateway sends by itself is so far apart then.
const RARELY: Duration = Duration::from_secs(1);
/// The rate of that loop's line.
const LOOP_BAUD: u32 = 2_000_000;
/// Between two steps of the set-up.
const STEP: Duration = Duration::from_millis(40);
/// Between the repetitions of a stop: arming, turning, stopping until the motor is seen to stand.
const STOP_PERIOD: Duration = Duration::from_millis(300);
/// How often all axes are stopped together: each time they are cleared and armed again, one by
/// one.
const E_STOPS: u32 = 10;
/// Until a motor that was stopped is seen to stand.
const STOPPING: Duration = Duration::from_millis(200);
/// When the board is asked for the first time.
const START: Duration = Duration::from_millis(100);

/// How far ahead setpoints expire: never, as far as a measurement goes.
const TTL: Duration = Duration::from_secs(50);
/// How long the host may be silent.
const LINK_SILENCE: Duration = Duration::from_secs(10);
/// The motors' own timeout.
const MOTOR_TIMEOUT: Duration = Duration::from_secs(1);
/// How long a motor's reply is awaited.
const REPLY_WINDOW: Duration = Duration::from_millis(5);

/// The first velocity, and what each setpoint adds so that its frame differs from the one before.
const VELOCITY_RAD_S: f32 = 2.0;
const VELOCITY_STEP_RAD_S: f32 = 0.01;
/// RMD V3.6 §2.20: a velocity setpoint. Requests have CAN id 0x140 + node, replies 0x240 + node.
const VELOCITY_COMMAND: u8 = 0xA2;
const REQUEST_ID: u32 = 0x140;
const REPLY_ID: u32 = 0x240;
/// RMD V3.6 §2.16: the stop.
const STOP_COMMAND: u8 = 0x81;

/// From a frame's validity at its receivers to its end: one bit.
const LAST_BIT: Duration = Duration::from_nanos(1_000_000_000 / BITRATE as u64);

/// What the computer knows while it measures.
#[derive(Debug)]
pub(super) struct Session {
    /// What the gateway's clock is ahead of the virtual one.
    clock_lead: Duration,
    /// When something else may begin.
    free: Duration,
    /// Between two repetitions, and what comes of one within it.
    period: Duration,
    window: Duration,
}

impl Session {
    /// Says hello to a board that starts.
    pub(super) fn open(bench: &mut Bench) -> Self {
        let mut session =
            Self { clock_lead: Duration::ZERO, free: START, period: PERIOD, window: WINDOW };
        session.ask(bench, hello(1));
        let Answer { asked, reply, .. } = session.ask(bench, Ping {});
        let Reply::Ping(pong) = reply else { unreachable!("the reply of a ping") };
        // Somewhen between the ping's arrival and its answer: near enough for an expiry.
        session.clock_lead = Duration::from_micros(pong.time_us).saturating_sub(asked);
        session
    }

    /// Configures both buses and all axes, and leaves them without authority.
    pub(super) fn configure(&mut self, bench: &mut Bench) {
        let (parameter, value) =
            (GatewayParameter::LinkSilenceUs.number(), Value::Unsigned(micros(LINK_SILENCE)));
        self.ask(bench, ConfigureGateway { parameter, value });
        for bus in [0, 1] {
            let protocols = ProtocolSet::of(&[Protocol::Rmd]);
            let reply_window_us = micros(REPLY_WINDOW);
            self.ask(
                bench,
                ConfigureBus {
                    bus,
                    bitrate: BITRATE,
                    protocols,
                    exclusive: false,
                    reply_window_us,
                },
            );
        }
        for axis in 0..AXES {
            let (bus, node) = place(axis);
            let values = [
                (AxisParameter::Bus, bus.into()),
                (AxisParameter::Protocol, Protocol::Rmd.into()),
                (AxisParameter::Node, node.into()),
                (AxisParameter::StopAction, StopAction::Hold.into()),
                (AxisParameter::TtlUs, micros(TTL)),
            ];
            for (parameter, value) in values {
                let (parameter, value) = (parameter.number(), Value::Unsigned(value));
                self.ask(bench, ConfigureAxis { axis, parameter, value });
            }
            let timeout_ms = micros(MOTOR_TIMEOUT) / 1_000;
            self.ask(bench, ProvisionMotorTimeout { axis, timeout_ms });
        }
        self.ask(bench, ReleaseAuthority {});
    }

    /// Leaves the buses to a control loop, whose line is fast: nothing else is sent but what the
    /// gateway asks once a second.
    pub(super) fn calm(&mut self, bench: &mut Bench) {
        for axis in 0..AXES {
            let rare =
                [AxisParameter::RefreshUs, AxisParameter::StatePollUs, AxisParameter::FaultPollUs];
            for parameter in rare {
                let (parameter, value) = (parameter.number(), Value::Unsigned(micros(RARELY)));
                self.ask(bench, ConfigureAxis { axis, parameter, value });
            }
        }
        self.ask(bench, SetBaud { baud: LOOP_BAUD });
        bench.set_baud(LOOP_BAUD);
        self.ask(bench, Ping {});
        (self.period, self.window) = (LOOP_PERIOD, LOOP_WINDOW);
    }

    /// The loop goes on over USB.
    pub(super) fn move_to_usb(&mut self, bench: &mut Bench) {
        self.ask(bench, ReleaseAuthority {});
        bench.plug_usb(self.free);
        self.free = bench.now() + STEP;
        self.ask(bench, hello(2));
    }

    /// One step of a set-up.
    fn ask(&mut self, bench: &mut Bench, request: impl Into<Request>) -> Answer {
        let begin = self.free;
        self.free += STEP;
        let mut exchange = bench.exchange(begin, self.free, &[request.into()]);
        exchange.answers.remove(0)
    }

    /// Arms axes and lets their motors turn, at an instant that is free.
    fn turn(&mut self, bench: &mut Bench, axes: impl IntoIterator<Item = u8>) -> Vec<Turning> {
        let turn = |axis| {
            let Reply::Arm(armed) = self.ask(bench, Arm { axis }).reply else {
                unreachable!("the reply of arming")
            };
            let (bus, node) = place(axis);
            let (bus, node) = (usize::from(bus), u32::from(node));
            let mut turning = Turning {
                axis,
                bus,
                node,
                epoch: armed.epoch,
                clock_lead: self.clock_lead,
                velocity: VELOCITY_RAD_S,
                told: Vec::new(),
            };
            let begin = self.free;
            self.free += STEP;
            let request = turning.faster(begin);
            let exchange = bench.exchange(begin, self.free, &[request]);
            turning.new_setpoint(&exchange);
            turning
        };
        axes.into_iter().map(turn).collect()
    }

    /// When the repetitions of what leaves the motors turning begin. The session goes on behind the
    /// last.
    fn repetitions(&mut self) -> impl Iterator<Item = Duration> + use<> {
        let (first, apart) = (self.free, self.period + PHASE);
        self.free += apart * PHASES;
        (0..PHASES).map(move |phase| first + apart * phase)
    }

    /// Stops motors one after the other and sees that they stand.
    fn stop(&mut self, bench: &mut Bench, axes: &[Turning]) {
        for axis in axes {
            let begin = self.free;
            self.free += STOPPING;
            bench.exchange(begin, self.free, &[axis.stop()]);
        }
    }
}

/// A motor that turns, and what it was told last.
#[derive(Debug)]
struct Turning {
    axis: u8,
    bus: usize,
    node: u32,
    epoch: u32,
    /// What the gateway's clock is ahead of the virtual one.
    clock_lead: Duration,
    velocity: f32,
    /// The payload of its last new setpoint.
    told: Vec<u8>,
}

impl Turning {
    /// A setpoint that is sent at an instant and differs from the one before.
    fn faster(&mut self, at: Duration) -> Request {
        self.velocity += VELOCITY_STEP_RAD_S;
        // Only the low 32 bits are sent. A little less than what is allowed, as the request takes a
        // while.
        let expires = (at + self.clock_lead + TTL * 9 / 10).as_micros() % (1 << 32);
        let expires_at_us = u32::try_from(expires).expect("32 bits");
        let setpoint = Target::Velocity { velocity_rad_s: self.velocity };
        Setpoint { axis: self.axis, epoch: self.epoch, expires_at_us, setpoint }.into()
    }

    fn stop(&self) -> Request {
        Stop { target: StopTarget::Axis(self.axis) }.into()
    }

    /// The first frame to the motor for which the condition holds, and those behind it on its bus.
    fn frame_to<'e>(
        &self,
        exchange: &'e Exchange,
        holds: impl Fn(&[u8]) -> bool,
    ) -> (&'e FrameRecord, &'e [FrameRecord]) {
        let frames = &exchange.frames[self.bus];
        let ours = |record: &FrameRecord| {
            record.sender == Sender::Controller
                && record.frame.id.value() == REQUEST_ID + self.node
                && holds(record.frame.payload())
        };
        let at = frames.iter().position(ours).expect("the motor is told");
        (&frames[at], &frames[at + 1..])
    }

    /// The frame that tells the motor of its new setpoint, and those behind it.
    fn new_setpoint<'e>(&mut self, exchange: &'e Exchange) -> (&'e FrameRecord, &'e [FrameRecord]) {
        let found = self.frame_to(exchange, |payload| {
            payload[0] == VELOCITY_COMMAND && payload != self.told.as_slice()
        });
        self.told = found.0.frame.payload().to_vec();
        found
    }

    /// When frames from the motor among these were valid at the board.
    fn replies<'e>(&self, frames: &'e [FrameRecord]) -> impl Iterator<Item = (Duration, &'e [u8])> {
        let from_it = |record: &&FrameRecord| {
            matches!(record.sender, Sender::Node(_))
                && record.frame.id.value() == REPLY_ID + self.node
        };
        frames
            .iter()
            .filter(from_it)
            .map(|record| (since_start(record.end) - LAST_BIT, record.frame.payload()))
    }
}

fn hello(session: u32) -> Hello {
    Hello { protocol_major: PROTOCOL_MAJOR, protocol_minor: PROTOCOL_MINOR, session }
}

/// A second in which nobody says anything.
pub(super) fn idle_second(bench: &mut Bench, session: &mut Session) -> Vec<Span> {
    let from = session.free;
    let to = from + Duration::from_secs(1);
    session.free = to;
    bench.run_to(to);
    vec![Span { from, to }]
}

/// A setpoint for a motor that turns: from the last bit of the request to the first bit of its CAN
/// frame.
pub(super) fn setpoint(bench: &mut Bench, session: &mut Session) -> Vec<Span> {
    let mut axes = session.turn(bench, [0]);
    let (axis, window) = (&mut axes[0], session.window);
    let repeat = |begin: Duration| {
        let request = axis.faster(begin);
        let exchange = bench.exchange(begin, begin + window, &[request]);
        let (frame, _) = axis.new_setpoint(&exchange);
        Span { from: exchange.answers[0].asked, to: since_start(frame.start) }
    };
    let spans = session.repetitions().map(repeat).collect();
    session.stop(bench, &axes);
    spans
}

/// A stop of a motor that turns: from the last bit of the request to the first bit of its CAN
/// frame.
pub(super) fn stop(bench: &mut Bench, session: &mut Session) -> Vec<Span> {
    let first = session.free;
    let repeat = |phase: u32| {
        session.free = first + STOP_PERIOD * phase;
        let axes = session.turn(bench, [0]);
        let begin = session.free + PHASE * phase;
        let end = first + STOP_PERIOD * (phase + 1);
        let exchange = bench.exchange(begin, end, &[axes[0].stop()]);
        let (frame, _) = axes[0].frame_to(&exchange, |payload| payload[0] == STOP_COMMAND);
        Span { from: exchange.answers[0].asked, to: since_start(frame.start) }
    };
    let spans = (0..PHASES).map(repeat).collect();
    session.free = first + STOP_PERIOD * PHASES;
    spans
}

/// An e-stop while all axes are armed: from the last bit of the request to the first bit of the
/// first stop on CAN.
pub(super) fn e_stop(bench: &mut Bench, session: &mut Session) -> Vec<Span> {
    let repeat = |phase: u32| {
        for axis in 0..AXES {
            session.ask(bench, Arm { axis });
        }
        let begin = session.free + PHASE * phase;
        session.free += STOPPING;
        let exchange = bench.exchange(begin, session.free, &[EStop {}.into()]);
        let asked = exchange.answers[0].asked;
        let axes = (0..AXES).map(ClearTarget::Axis);
        for target in [ClearTarget::Gateway].into_iter().chain(axes) {
            session.ask(bench, Clear { target });
        }
        let is_stop = |record: &&FrameRecord| {
            record.sender == Sender::Controller && record.frame.payload()[0] == STOP_COMMAND
        };
        let stops = exchange.frames.iter().flatten().filter(is_stop);
        let first = stops.map(|record| since_start(record.start)).min();
        Span { from: asked, to: first.expect("the motors are stopped") }
    };
    (0..E_STOPS).map(repeat).collect()
}

/// The state of a motor that turns: from the validity of the motor's last reply at the board to the
/// first bit of the answer on the host UART.
pub(super) fn state(bench: &mut Bench, session: &mut Session) -> Vec<Span> {
    let axes = session.turn(bench, [0]);
    let (axis, window) = (&axes[0], session.window);
    let repeat = |begin: Duration| {
        let exchange =
            bench.exchange(begin, begin + window, &[ReadState { axis: axis.axis }.into()]);
        let Answer { asked, first_bit, .. } = exchange.answers[0];
        let replies = axis.replies(&exchange.frames[axis.bus]).map(|(valid, _)| valid);
        let reply = replies.take_while(|valid| *valid < first_bit).last();
        let from = reply.filter(|valid| *valid > asked).expect("the motor was asked");
        Span { from, to: first_bit }
    };
    let spans = session.repetitions().map(repeat).collect();
    session.stop(bench, &axes);
    spans
}

/// A setpoint for each of eight motors that turn, sent one right behind the other: from the first
/// bit of the first request until all are acknowledged to the host and each motor's reply to its
/// setpoint is valid at the board.
pub(super) fn round(bench: &mut Bench, session: &mut Session) -> Vec<Span> {
    let mut axes = session.turn(bench, 0..AXES);
    let repeat = |begin: Duration| {
        let requests: Vec<Request> = axes.iter_mut().map(|axis| axis.faster(begin)).collect();
        let exchange = bench.exchange(begin, begin + WINDOW, &requests);
        let mut to = exchange.answers.iter().map(|answer| answer.end).max().expect("eight answers");
        for axis in &mut axes {
            let (_, behind) = axis.new_setpoint(&exchange);
            let mut replies =
                axis.replies(behind).filter(|(_, payload)| payload[0] == VELOCITY_COMMAND);
            let (valid, _) = replies.next().expect("each motor replies");
            to = to.max(valid);
        }
        Span { from: exchange.begin, to }
    };
    let spans = session.repetitions().map(repeat).collect();
    session.stop(bench, &axes);
    spans
}

fn micros(duration: Duration) -> u32 {
    u32::try_from(duration.as_micros()).expect("less than an hour")
}
