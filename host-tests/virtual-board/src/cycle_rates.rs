//! How often a free-running cycle serves its axes: against what the wire could do, at both speeds
//! of the core, and what of the core that takes.
//!
//! One board serves every line of a speed: as many RMDs hang on each CAN bus as a line asks for at
//! most, and a line arms those that it is about.

mod table;

pub use table::{Row, Table};

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::panic::resume_unwind;
use std::path::Path;
use std::rc::Rc;
use std::time::Duration;
use std::{fmt, thread};

use host_protocol::requests::Cycle;
use host_protocol::{
    AxisParameter, CycleEvent, CycleMessage, Deframer, FixedU32, GatewayParameter, Incident, Kind,
    MAX_FRAME, Overruns, Request, Setpoint, StateField, StateFields, StopAction, StopTarget, Value,
};
use mgw_client::{AxisSetpoint, Client, ClientError, make_velocity};
use mgw_sim::Injection;
use virtual_stm32::fdcan::{FrameEnd, FrameRecord, Sender};

use crate::board::Board;
use crate::host_uart::HostUart;
use crate::machine::{Builder, Line, Machine};
use crate::measure::{Fetches, Functions, NotMeasurable, Profiler, STAGES, Traced};
use crate::nodes::since_start;
use crate::outside::Outside;
use crate::transport::BoardTransport;
use crate::usual;

/// Decides what is left to chance.
const SEED: u64 = 1;
/// Bits per second of the buses.
const BITRATE: u32 = 1_000_000;
/// Bits of an RMD's request and its reply on the wire, as they are stuffed on average: what the
/// limits are worked out from. A line says what its own frames took.
const EXCHANGE_BITS: u32 = 236;
/// Axes of a bus at most.
const PER_BUS: u8 = 4;
/// The rate of the host's line.
const BAUD: u32 = 3_000_000;
/// Periods that are looked at.
const PERIODS: u32 = 400;
/// Those that are traced.
const TRACED: u32 = 5;
/// Those until a cycle runs as it goes on.
const SETTLED: u32 = 20;
/// Nothing expires meanwhile.
const TTL: Duration = Duration::from_secs(50);
const LINK_SILENCE_US: u32 = 10_000_000;
const MOTOR_TIMEOUT_MS: u32 = 1_000;
/// For motors to stop, and to be seen to.
const STOPPED: Duration = Duration::from_millis(300);
/// RMD V3.6 §2.20: a velocity setpoint.
const VELOCITY_COMMAND: u8 = 0xA2;
/// A sequence number that the client has not used lately.
const SEQUENCE: u16 = 0x7000;
const FIELDS: StateFields =
    StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current]);

/// A line of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Situation {
    /// Axes on each bus.
    pub per_bus: u8,
    /// Buses, from the first.
    pub buses: u8,
    /// What a motor takes to begin its reply.
    pub delay: Duration,
    /// The period is so much of the shortest that the wire allows, percent.
    pub period_percent: u32,
    /// The host gives every axis a new setpoint in each period.
    pub has_setpoints: bool,
}

impl Situation {
    /// As many axes as a board has here, whose motors answer at once.
    fn usual(board: Board) -> Self {
        Self {
            per_bus: PER_BUS,
            buses: u8::try_from(board.can_ports.len()).expect("a few"),
            delay: Duration::ZERO,
            period_percent: 105,
            has_setpoints: false,
        }
    }

    /// All of a board.
    pub fn all(board: Board) -> Vec<Self> {
        let usual = Self::usual(board);
        let delayed = Duration::from_micros(200);
        let mut all = Vec::new();
        for delay in [Duration::ZERO, delayed] {
            all.push(Self { per_bus: 1, buses: 1, delay, period_percent: 111, ..usual });
            all.push(Self { per_bus: 1, delay, period_percent: 111, ..usual });
            all.push(Self { buses: 1, delay, ..usual });
            all.push(Self { delay, ..usual });
        }
        all.push(Self { period_percent: 100, ..usual });
        all.push(Self { period_percent: 125, ..usual });
        all.push(Self { has_setpoints: true, ..usual });
        all
    }

    /// The shortest period that the wire allows: its frames one behind the other, and behind a
    /// single request the motor's own time.
    fn wire_us(&self) -> u32 {
        let alone = EXCHANGE_BITS + u32::try_from(self.delay.as_micros()).expect("short");
        alone.max(EXCHANGE_BITS * u32::from(self.per_bus))
    }

    fn period_us(&self) -> u32 {
        (self.wire_us() * self.period_percent).div_ceil(100)
    }

    fn axes(&self) -> Vec<u8> {
        let of_bus = |bus| (0..self.per_bus).map(move |place| bus * PER_BUS + place);
        (0..self.buses).flat_map(of_bus).collect()
    }
}

impl fmt::Display for Situation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { per_bus, buses, delay, period_percent, has_setpoints } = self;
        let delay = delay.as_micros();
        write!(f, "{per_bus} x {buses}, {delay} us, period {period_percent} %")?;
        f.write_str(if *has_setpoints { ", setpoints" } else { "" })
    }
}

/// Measures the lines whose names contain `filter`, at both speeds. `is_traced`: of the usual line
/// at the higher speed also which stage of the work the instructions belong to.
/// Fails if the file is no image.
/// Panics if the gateway does not do what it is asked for.
pub fn measure(image: &Path, filter: &str, is_traced: bool) -> Result<Table, NotMeasurable> {
    let functions = &is_traced.then(|| Functions::of(image)).transpose()?;
    let board = &|| Builder::new(image).expect("the image that was just read");
    let wanted = &|| {
        let all = Situation::all(Board::chosen()).into_iter();
        all.filter(|situation| situation.to_string().contains(filter))
    };
    let of_speed = |speed| {
        let mut rig = Rig::power_on(board().instructions_per_second(speed));
        let [fast, _] = Board::chosen().speeds;
        let usual = Situation::usual(Board::chosen());
        let measured = |situation| {
            let traced = functions.as_ref().filter(|_| speed == fast && situation == usual);
            let (row, traced) = rig.measure(situation, speed, traced);
            (row, traced.map(|traced| by_stage(situation, &traced)))
        };
        wanted().map(measured).collect::<Vec<_>>()
    };
    let rows = thread::scope(|scope| {
        let runs = Board::chosen().speeds.map(|speed| scope.spawn(move || of_speed(speed)));
        runs.map(|run| run.join().unwrap_or_else(|panic| resume_unwind(panic))).concat()
    });
    let (rows, stages): (Vec<Row>, Vec<_>) = rows.into_iter().unzip();
    Ok(Table { rows, stages: stages.into_iter().flatten().collect() })
}

/// Where the instructions of the usual line go on a core of the higher speed, for each axis and
/// period, by function and by line.
/// Fails if the file is no image.
/// Panics as [`measure`] does.
pub fn profile(image: &Path) -> Result<String, NotMeasurable> {
    let functions = Functions::of(image)?;
    let profiler = Profiler::new(image, functions.clone())?;
    let [fast, _] = Board::chosen().speeds;
    let board = Builder::new(image).map_err(|error| NotMeasurable(error.to_string()))?;
    let usual = Situation::usual(Board::chosen());
    let (_, traced) =
        Rig::power_on(board.instructions_per_second(fast)).measure(usual, fast, Some(&functions));
    let executed = traced.expect("asked for").executed;
    Ok(profiler.table(&usual.to_string(), &executed, axis_periods(usual)))
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
    machine: Rc<RefCell<Machine>>,
    outside: Outside,
    client: Client<BoardTransport>,
}

impl Rig {
    /// Switches it on, and has its host's line run faster.
    /// Panics if the gateway refuses it.
    fn power_on(mut board: Builder) -> Self {
        let buses = 0..u8::try_from(board.board().can_ports.len()).expect("a few");
        let motors: Vec<_> = buses
            .clone()
            .flat_map(|bus| (1..=PER_BUS).map(move |node| usual::rmd(bus, node, BITRATE)))
            .collect();
        let outside = Outside::connect(&mut board, &motors, SEED).expect("a sound wiring");
        let machine = Rc::new(RefCell::new(board.power_on()));
        let transport = BoardTransport::new(&machine, outside.hosts[0]);
        let mut client = Client::connect_as(transport, 1, 1).expect("hello");
        let configured = client.set_baud(BAUD).and_then(|()| configure(&mut client, buses));
        configured.unwrap_or_else(|error| panic!("{error}"));
        Self { machine, outside, client }
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
        let setpoints: Vec<AxisSetpoint> =
            axes.iter().map(|axis| make_velocity(*axis, 2.0)).collect();
        let period_us = situation.period_us();
        let period = Duration::from_micros(period_us.into());
        let begun = self.client.arm_together(&axes).and_then(|epoch| {
            self.client.cycle(epoch, &setpoints, FIELDS, TTL)?;
            self.client.run_cycle(&axes, FIELDS, period)?;
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
        self.run(PERIODS, period, &mut listener, &mut told);
        let after = self.look();
        let events = listener.take();
        let row = Row::of(situation, speed, &first, &events, &before, &after);
        let over = self.client.run_cycle(&[], FIELDS, period).and_then(|()| {
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
        let frames = ports.iter().map(|port| machine.can_mut(*port).take_log()).collect();
        Look { at: machine.now(), instructions: machine.instructions(), frames }
    }
}

fn configure(
    client: &mut Client<BoardTransport>,
    buses: std::ops::Range<u8>,
) -> Result<(), ClientError> {
    client.configure_gateway(GatewayParameter::LinkSilenceUs, Value::Unsigned(LINK_SILENCE_US))?;
    for bus in buses {
        usual::start_rmd_bus(client, bus, BITRATE)?;
        for place in 0..PER_BUS {
            let axis = bus * PER_BUS + place;
            let ttl_us = u32::try_from(TTL.as_micros()).expect("less than an hour");
            let values = [
                (AxisParameter::Bus, bus.into()),
                (AxisParameter::Protocol, host_protocol::Protocol::Rmd.into()),
                (AxisParameter::Node, u32::from(place) + 1),
                (AxisParameter::StopAction, StopAction::Hold.into()),
                (AxisParameter::TtlUs, ttl_us),
            ];
            usual::set_axis(client, axis, &values)?;
            client.provision_motor_timeout(axis, MOTOR_TIMEOUT_MS)?;
        }
    }
    Ok(())
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
    frames: Vec<Vec<FrameRecord>>,
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
        // The request of a setpoint and its reply carry the same command.
        let motions = |record: &&FrameRecord| {
            record.frame.payload().first() == Some(&VELOCITY_COMMAND)
                && record.outcome == FrameEnd::Acknowledged
        };
        let length = |record: &FrameRecord| {
            u64::try_from((since_start(record.end) - since_start(record.start)).as_nanos())
                .expect("short")
        };
        // Three bits between two frames are of the wire, too.
        let intermission = 3_000;
        let mut rates = BTreeSet::new();
        let (mut busy, mut wire, mut exchanges) = (0, 0, 0);
        for frames in to.frames.iter().take(situation.buses.into()) {
            busy = busy.max(frames.iter().map(|frame| length(frame) + intermission).sum::<u64>());
            let of_motions: Vec<_> = frames.iter().filter(motions).collect();
            wire += of_motions.iter().map(|frame| length(frame) + intermission).sum::<u64>();
            let replies = of_motions.iter().filter(|frame| frame.sender != Sender::Controller);
            let mut by_id = BTreeMap::new();
            for reply in replies {
                *by_id.entry(reply.frame.id.value()).or_insert(0_u64) += 1;
            }
            if by_id.len() < usize::from(situation.per_bus) {
                rates.insert(0);
            }
            exchanges += by_id.values().sum::<u64>();
            rates.extend(by_id.into_values().map(|count| count * 10_000_000_000 / nanos));
        }
        let tenths_hz = *rates.first().expect("a bus");
        let limit_tenths = 10_000_000 / u64::from(situation.wire_us());
        let periods = u64::from(PERIODS);
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
                per(wire / 100, exchanges),
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
        }
    }
}
