//! How often a free-running cycle serves its axes: against what the wire could do, at both speeds
//! of the core, and what of the core that takes.
//!
//! One board serves every line of a speed with the same motors: as many hang on each bus as a line
//! asks for at most, and a line arms those that it is about.

mod situation;
mod table;
mod wire;

pub use situation::{Motors, Situation};
pub use table::{Row, Table};

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::panic::resume_unwind;
use std::path::Path;
use std::rc::Rc;
use std::thread;
use std::time::Duration;

use host_protocol::requests::Cycle;
use host_protocol::{
    AxisParameter, CycleEvent, CycleMessage, Deframer, FixedU32, GatewayParameter, Incident, Kind,
    MAX_FRAME, Overruns, ProtocolSet, Request, Setpoint, StateFields, StopTarget, Value,
};
use mgw_client::{AxisSetpoint, Client, ClientError};
use mgw_sim::Injection;

use crate::board::Board;
use crate::host_uart::HostUart;
use crate::machine::{Builder, Line, Machine};
use crate::measure::{Fetches, Functions, NotMeasurable, Profiler, STAGES, Traced};
use crate::outside::Outside;
use crate::transport::BoardTransport;
use crate::usual;
use situation::PER_BUS;
use wire::Passage;

/// Decides what is left to chance.
const SEED: u64 = 1;
/// The rate of the host's line.
const BAUD: u32 = 3_000_000;
/// Periods that are looked at; fewer where they are long.
const PERIODS: u32 = 400;
const LONG_PERIODS: u32 = 100;
const LONG_US: u32 = 2_000;
/// What an exchange takes on average is what the limit goes by, within a fiftieth.
const ASSUMED_WITHIN: u64 = 50;
/// Those that are traced.
const TRACED: u32 = 5;
/// Those until a cycle runs as it goes on.
const SETTLED: u32 = 20;
/// Nothing expires meanwhile.
const TTL: Duration = Duration::from_secs(50);
/// A slow bus, bit/s, and how often its motors are told or asked beside the cycle.
const SLOW: u32 = 250_000;
const SLOW_US: u32 = 1_000_000;
const LINK_SILENCE_US: u32 = 10_000_000;
const MOTOR_TIMEOUT_MS: u32 = 1_000;
/// For motors to stop, and to be seen to.
const STOPPED: Duration = Duration::from_millis(300);
/// A sequence number that the client has not used lately.
const SEQUENCE: u16 = 0x7000;

/// Measures the lines whose names contain `filter`, at both speeds. `is_traced`: of the usual line
/// at the higher speed also which stage of the work the instructions belong to.
/// Fails if the file is no image.
/// Panics if the gateway does not do what it is asked for.
pub fn measure(image: &Path, filter: &str, is_traced: bool) -> Result<Table, NotMeasurable> {
    let functions = &is_traced.then(|| Functions::of(image)).transpose()?;
    let board = &|| Builder::new(image).expect("the image that was just read");
    let wanted = &|| {
        let all = Situation::all().into_iter();
        all.filter(|situation| situation.to_string().contains(filter))
    };
    let of_motors = |motors, speed| {
        let mut lines = wanted().filter(|situation| situation.motors == motors).peekable();
        if lines.peek().is_none() {
            return Vec::new();
        }
        let mut rig = Rig::power_on(board().instructions_per_second(speed), motors);
        let [fast, _] = Board::chosen().speeds;
        let usual = Situation::usual(Motors::Rmd);
        let measured = |situation| {
            let traced = functions.as_ref().filter(|_| speed == fast && situation == usual);
            let (row, traced) = rig.measure(situation, speed, traced);
            (row, traced.map(|traced| by_stage(situation, &traced)))
        };
        lines.map(measured).collect()
    };
    let of_speed =
        |speed| Motors::ALL.into_iter().flat_map(|motors| of_motors(motors, speed)).collect();
    let rows = thread::scope(|scope| {
        let runs = Board::chosen().speeds.map(|speed| scope.spawn(move || of_speed(speed)));
        let joined = runs.map(|run| run.join().unwrap_or_else(|panic| resume_unwind(panic)));
        <[Vec<(Row, Option<String>)>]>::concat(&joined)
    });
    let (rows, stages): (Vec<Row>, Vec<_>) = rows.into_iter().unzip();
    Ok(Table { rows, stages: stages.into_iter().flatten().collect() })
}

/// Where the instructions of a line go on a core of the higher speed, for each axis and period, by
/// function and by line: of the first whose name contains `filter`, or of the usual one.
/// Fails if the file is no image, or there is no such line.
/// Panics as [`measure`] does.
pub fn profile(image: &Path, filter: Option<&str>) -> Result<String, NotMeasurable> {
    let functions = Functions::of(image)?;
    let profiler = Profiler::new(image, functions.clone())?;
    let [fast, _] = Board::chosen().speeds;
    let board = Builder::new(image).map_err(|error| NotMeasurable(error.to_string()))?;
    let wanted = match filter {
        Some(filter) => Situation::all().into_iter().find(|line| line.to_string().contains(filter)),
        None => Some(Situation::usual(Motors::Rmd)),
    };
    let line = wanted.ok_or_else(|| NotMeasurable("there is no such line".to_owned()))?;
    let mut rig = Rig::power_on(board.instructions_per_second(fast), line.motors);
    let (_, traced) = rig.measure(line, fast, Some(&functions));
    let executed = traced.expect("asked for").executed;
    Ok(profiler.table(&line.to_string(), &executed, axis_periods(line)))
}

/// How often an axis is served in what is traced.
fn axis_periods(situation: Situation) -> u64 {
    u64::from(TRACED) * situation.axes().len() as u64
}

/// Which stage of the work the instructions belong to, for each axis and period.
fn by_stage(situation: Situation, traced: &Traced) -> String {
    let stage = |((stage, _), count): (&(&str, _), &u64)| {
        format!("{stage} {}", count / axis_periods(situation))
    };
    let stages: Vec<String> = STAGES.iter().zip(&traced.stages).map(stage).collect();
    format!("{situation}, instructions for each axis and period by stage: {}", stages.join(", "))
}

/// A board with its motors, configured.
struct Rig {
    motors: Motors,
    machine: Rc<RefCell<Machine>>,
    outside: Outside,
    client: Client<BoardTransport>,
}

impl Rig {
    /// Switches it on, and has its host's line run faster.
    /// Panics if the gateway refuses it.
    fn power_on(mut board: Builder, motors: Motors) -> Self {
        let wiring = motors.wiring();
        let outside = Outside::connect(&mut board, &wiring, SEED).expect("a sound wiring");
        let machine = Rc::new(RefCell::new(board.power_on()));
        let transport = BoardTransport::new(&machine, outside.hosts[0]);
        let mut client = Client::connect_as(transport, 1, 1).expect("hello");
        let configured = client.set_baud(BAUD).and_then(|()| configure(&mut client, motors));
        configured.unwrap_or_else(|error| panic!("{error}"));
        Self { motors, machine, outside, client }
    }

    /// Runs a cycle, and looks at it. With the functions of the image, some periods are traced.
    /// Panics if the gateway refuses it, or tells of none.
    fn measure(
        &mut self,
        situation: Situation,
        speed: u64,
        functions: Option<&Functions>,
    ) -> (Row, Option<Traced>) {
        let axes = situation.axes();
        let delay = Injection::ReplyTime(Some(situation.delay));
        for motor in 0..self.outside.motors() {
            self.outside.inject(&mut self.machine.borrow_mut(), motor, delay);
        }
        let (setpoint, fields) = (self.motors.setpoint(), self.motors.fields());
        let setpoints: Vec<AxisSetpoint> =
            axes.iter().map(|axis| AxisSetpoint { axis: *axis, setpoint }).collect();
        let period_us = situation.period_us();
        let period = Duration::from_micros(period_us.into());
        let begun = self.client.arm_together(&axes).and_then(|epoch| {
            self.client.cycle(epoch, &setpoints, fields, TTL)?;
            self.client.run_cycle(&axes, fields, period)?;
            Ok(epoch)
        });
        let epoch = begun.unwrap_or_else(|error| panic!("{situation}: {error}"));
        let expires = self.client.expiry(TTL * 9 / 10);
        let mut listener = Listener::default();
        let mut told =
            |round: u32| situation.has_setpoints.then(|| frame(&axes, round, epoch, expires));
        self.run(SETTLED, period, &mut listener, &mut told);
        let traced = functions.map(|functions| self.traced(situation, functions.clone()));
        listener = Listener::default();
        self.run(2, period, &mut listener, &mut told);
        let before = self.look();
        let first = listener.take();
        self.run(periods(situation), period, &mut listener, &mut told);
        let after = self.look();
        let events = listener.take();
        let row = Row::of(situation, speed, &first, &events, &before, &after);
        let over = self.client.run_cycle(&[], fields, period).and_then(|()| {
            self.client.stop(StopTarget::All)?;
            self.machine.borrow_mut().run_for(STOPPED);
            self.client.incidents()
        });
        // More than the processor can do is done late; it must not be the end of the run.
        let incidents = over.unwrap_or_else(|error| panic!("{situation}: {error}"));
        assert!(
            incidents.iter().all(|incident| matches!(incident, Incident::Started { start: 1, .. })),
            "{situation}, {speed} instructions a second: {incidents:?}"
        );
        (row, traced)
    }

    /// What some periods execute.
    fn traced(&mut self, situation: Situation, functions: Functions) -> Traced {
        let mut machine = self.machine.borrow_mut();
        let mut fetches = Fetches::begin(&mut machine, functions);
        for _ in 0..TRACED {
            machine.run_for(Duration::from_micros(situation.period_us().into()));
        }
        let traced = fetches.look(&mut machine);
        fetches.end(&mut machine);
        traced
    }

    /// Runs for so many periods, and hears what is told.
    fn run(
        &mut self,
        periods: u32,
        period: Duration,
        listener: &mut Listener,
        told: &mut impl FnMut(u32) -> Option<Vec<u8>>,
    ) {
        let mut machine = self.machine.borrow_mut();
        let host: Line<HostUart> = self.outside.hosts[0];
        for round in 0..periods {
            if let Some(frame) = told(round) {
                machine.line(host).send(&frame);
            }
            machine.run_for(period);
            listener.hear(&machine.line(host).take());
        }
    }

    /// What has happened by now; of the frames, those since the last look.
    fn look(&mut self) -> Look {
        let mut machine = self.machine.borrow_mut();
        let ports = machine.board().can_ports;
        let mut carried = |(bus, _): (u8, u32)| match ports.get(usize::from(bus)) {
            Some(port) => wire::of_frames(&machine.can_mut(*port).take_log(), self.motors),
            None => {
                let line = machine.line(self.outside.rs485);
                let passages = wire::of_line(line.sent(), line.replies(), self.motors);
                line.clear_sent();
                passages
            }
        };
        let passages = self.motors.buses().into_iter().map(&mut carried).collect();
        Look { at: machine.now(), instructions: machine.instructions(), passages }
    }
}

fn configure(client: &mut Client<BoardTransport>, motors: Motors) -> Result<(), ClientError> {
    client.configure_gateway(GatewayParameter::LinkSilenceUs, Value::Unsigned(LINK_SILENCE_US))?;
    let protocols = ProtocolSet::of(&[motors.protocol()]);
    let mut axes = 0..;
    for (bus, bitrate) in motors.buses() {
        client.configure_bus(bus, bitrate, protocols, false, usual::REPLY_WINDOW)?;
        for (node, axis) in (1..=PER_BUS).zip(&mut axes) {
            let usual = usual::Axis {
                bus,
                protocol: motors.protocol(),
                node: node.into(),
                stop_action: motors.stop_action(),
            };
            // What is sent beside the cycle takes a quarter of a slow bus else.
            let rare =
                [AxisParameter::RefreshUs, AxisParameter::StatePollUs, AxisParameter::FaultPollUs];
            let slow = rare.map(|parameter| (parameter, SLOW_US));
            let slow = if bitrate < SLOW { slow.as_slice() } else { &[] };
            usual::set_axis(client, axis, slow)?;
            usual.configure(client, axis)?;
            let ttl_us = u32::try_from(TTL.as_micros()).expect("less than an hour");
            usual::set_axis(client, axis, &[(AxisParameter::TtlUs, ttl_us)])?;
            if usual.has_motor_timeout() {
                client.provision_motor_timeout(axis, MOTOR_TIMEOUT_MS)?;
            }
        }
    }
    Ok(())
}

/// How many periods are looked at.
fn periods(situation: Situation) -> u32 {
    if situation.period_us() < LONG_US { PERIODS } else { LONG_PERIODS }
}

/// A new setpoint for each of these axes.
fn frame(axes: &[u8], round: u32, epoch: u32, expires_at_us: u32) -> Vec<u8> {
    #[allow(clippy::cast_precision_loss, reason = "a few hundred")]
    let setpoint = Setpoint::Velocity { velocity_rad_s: 2.0 + round as f32 / 1_000.0 };
    let request = Request::Cycle(Cycle {
        epoch: FixedU32(epoch),
        expires_at_us: FixedU32(expires_at_us),
        fields: StateFields::NONE,
        axes: axes.iter().fold(0, |axes, axis| axes | 1 << axis),
        setpoints: axes.iter().map(|_| setpoint).collect(),
    });
    let mut frame = [0; MAX_FRAME];
    let sequence = SEQUENCE.wrapping_add(u16::try_from(round).expect("a few hundred"));
    let length = request.encode_frame(sequence, &mut frame).expect("a request of the table");
    frame[..length].to_vec()
}

/// What a board had done by an instant.
struct Look {
    at: Duration,
    instructions: u64,
    /// By bus.
    passages: Vec<Vec<Passage>>,
}

/// Hears the events of a cycle.
#[derive(Default)]
struct Listener {
    deframer: Deframer,
    /// A frame has ended since it began to listen: what comes next is whole.
    is_in_step: bool,
    heard: Vec<CycleEvent>,
}

impl Listener {
    fn hear(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let Some(frame) = self.deframer.push(*byte) else { continue };
            if !std::mem::replace(&mut self.is_in_step, true) {
                continue;
            }
            let frame = frame.expect("a sound frame");
            if frame.kind == Kind::Event && frame.number == CycleEvent::NUMBER {
                let message = CycleMessage::decode(frame.body).expect("the event of a cycle");
                self.heard.push(message.event);
            }
        }
    }

    fn take(&mut self) -> Vec<CycleEvent> {
        std::mem::take(&mut self.heard)
    }
}

impl Row {
    /// What came of a cycle between two looks. `before`: the events that had been told by the
    /// first.
    fn of(
        situation: Situation,
        speed: u64,
        before: &[CycleEvent],
        events: &[CycleEvent],
        from: &Look,
        to: &Look,
    ) -> Self {
        let per = |count: u64, of: u64| count / of.max(1);
        let lasted = to.at - from.at;
        let nanos = u64::try_from(lasted.as_nanos()).expect("short");
        let motors = situation.motors;
        let buses = motors.buses().into_iter().zip(&to.passages).take(situation.buses.into());
        let mut rates = BTreeSet::new();
        let (mut busy, mut bits, mut exchanges, mut gaps) = (0, 0, 0, Vec::new());
        for ((bus, bitrate), passages) in buses {
            let is_can = bus < Board::chosen().rs485_bus();
            let of_bus = wire::Use::of(passages, is_can, bitrate);
            // Tenths of a bit.
            let tenths = |nanos: u64| nanos * u64::from(bitrate) / 100_000_000;
            busy = busy.max(of_bus.busy);
            if of_bus.answered.len() < usize::from(situation.per_bus) {
                rates.insert(0);
            }
            rates.extend(of_bus.answered.values().map(|count| count * 10_000_000_000 / nanos));
            // On RS485 they are always the same.
            if is_can || situation.buses == 1 {
                bits += tenths(of_bus.exchanges_took);
                exchanges += of_bus.answered.values().sum::<u64>();
                gaps.extend(of_bus.gaps.into_iter().map(tenths));
            }
        }
        let bits = per(bits, exchanges);
        let assumed = u64::from(motors.exchange_bits()) * 10;
        assert!(
            exchanges == 0 || bits.abs_diff(assumed) * ASSUMED_WITHIN <= assumed,
            "{situation}: {bits} tenths of a bit, the limit is that of {assumed}"
        );
        let tenths_hz = *rates.first().expect("a bus");
        let limit_tenths = 10_000_000 / u64::from(situation.wire_us());
        let periods = u64::from(periods(situation));
        let told = events.len() as u64 * 1_000 / periods;
        // What has come before the first that is told here counts where nothing was told before.
        let ends = before.last().or(events.first()).zip(events.last());
        let overran = |of: fn(&Overruns) -> u32| {
            let ends = ends.map(|(first, last)| (of(&first.overruns), of(&last.overruns)));
            ends.map_or(1_000, |(first, last)| u64::from(last - first) * 1_000 / periods)
        };
        let instructions = to.instructions - from.instructions;
        let axis_cycles = periods * u64::from(situation.per_bus) * u64::from(situation.buses);
        Self {
            what: situation.to_string(),
            speed: speed / 1_000_000,
            // In the order of the table's heads.
            values: [
                situation.period_us().into(),
                tenths_hz,
                tenths_hz * 1_000 / limit_tenths,
                bits,
                busy * 1_000 / nanos,
                told,
                overran(|overruns| overruns.bus),
                overran(|overruns| overruns.motor),
                overran(|overruns| overruns.host),
                overran(|overruns| overruns.gateway),
                events.iter().map(|event| event.late_us.into()).max().unwrap_or(0),
                per(instructions, axis_cycles),
                instructions * 1_000_000 / (nanos * (speed / 1_000_000)),
            ],
            gaps: wire::distribution(gaps).filter(|_| situation.is_always_due()),
        }
    }
}
