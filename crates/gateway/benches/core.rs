//! What the core costs on a computer: time of one operation, and with `count OPERATION TIMES` the
//! operation itself, in [`measured`], for a profiler that counts instructions (`.ci/core-cost`).
//!
//! Eight RMD axes, four on each of two CAN buses, armed and turning, as on the virtual board.

use std::hint::black_box;

use criterion::Criterion;
use gateway::{
    Board, BusPort, Event, Gateway, Instant, LinkPort, Outgoing, RETAINED_WORDS, Transmit,
};
use host_protocol::{
    AxisParameter, BootReason, BusKind, BusState, CanFrame, Deframer, Kind, MAX_FRAME, Protocol,
    ProtocolSet, Reply, Request, Setpoint, StopAction, StopTarget, Value, replies, requests,
};

const AXES: u8 = 8;
const BUSES: u8 = 2;
const BITRATES: &[u32] = &[1_000_000];
/// A frame and its reply, µs.
const EXCHANGE_US: u64 = 260;
/// How long an answer is waited for, in steps of so many µs.
const MOST_STEPS: u32 = 1_000;
const STEP_US: u64 = 1_000;
/// What a setpoint lives, µs.
const TTL_US: u64 = 90_000;

static BOARD: Board = Board {
    name: "bench",
    firmware: "0.1.0",
    build_id: "bench",
    boot: BootReason::PowerOn,
    crash_report: "",
    e_stop_input: true,
    enable_output: true,
    buses: &[
        BusPort { kind: BusKind::Can, bitrates: BITRATES },
        BusPort { kind: BusKind::Can, bitrates: BITRATES },
    ],
    bus_limit: None,
    links: &[LinkPort { bauds: &[] }],
};

/// A gateway with its motors.
struct Bench {
    gateway: Box<Gateway>,
    memory: Vec<u32>,
    now_us: u64,
    sequence: u16,
    epochs: [u32; AXES as usize],
    started: [Option<u32>; BUSES as usize],
    /// Frames that the buses carry.
    on_wire: Vec<(u8, Transmit)>,
    /// What the host was told.
    told: Vec<u8>,
}

impl Bench {
    /// All axes are armed and turn.
    fn moving() -> Self {
        let mut bench = Self::idle();
        for axis in 0..AXES {
            let reply = bench.ask(&Request::Arm(requests::Arm { axis }));
            let Reply::Arm(replies::Armed { epoch, .. }) = reply else { panic!("{reply:?}") };
            bench.epochs[usize::from(axis)] = epoch;
        }
        for axis in 0..AXES {
            let frame = bench.setpoint(axis);
            bench.handle(Event::HostBytes { link: 0, bytes: &frame });
        }
        bench.settle();
        bench
    }

    /// All axes are configured and idle.
    fn idle() -> Self {
        let mut bench = Self {
            gateway: Box::new(Gateway::new(&BOARD, Some(1))),
            memory: vec![0; RETAINED_WORDS],
            now_us: 1_000,
            sequence: 0,
            epochs: [0; AXES as usize],
            started: [None; BUSES as usize],
            on_wire: Vec::new(),
            told: Vec::new(),
        };
        bench.gateway.restore(Instant::from_micros(0), &[]);
        bench.handle(Event::EStopInput { open: false });
        let hello = requests::Hello { protocol_major: 1, protocol_minor: 0, session: 7 };
        bench.ask(&Request::Hello(hello));
        for bus in 0..BUSES {
            bench.ask(&Request::ConfigureBus(requests::ConfigureBus {
                bus,
                bitrate: 1_000_000,
                protocols: ProtocolSet::of(&[Protocol::Rmd]),
                exclusive: false,
                reply_window_us: 5_000,
            }));
        }
        for axis in 0..AXES {
            let unsigned = |value: u8| Value::Unsigned(value.into());
            for (parameter, value) in [
                (AxisParameter::Bus, unsigned(axis % BUSES)),
                (AxisParameter::Protocol, unsigned(Protocol::Rmd.number())),
                (AxisParameter::Node, unsigned(axis + 1)),
                (AxisParameter::StopAction, unsigned(StopAction::Hold.number())),
                (AxisParameter::AllowUnknownMotorTimeout, Value::Bool(true)),
            ] {
                let parameter = parameter.number();
                bench.ask(&Request::ConfigureAxis(requests::ConfigureAxis {
                    axis,
                    parameter,
                    value,
                }));
            }
        }
        bench
    }

    fn encode(&mut self, request: &Request) -> Vec<u8> {
        self.sequence = self.sequence.wrapping_add(1);
        let mut frame = [0; MAX_FRAME];
        let length = request.encode_frame(self.sequence, &mut frame).expect("it fits");
        frame[..length].to_vec()
    }

    fn setpoint(&mut self, axis: u8) -> Vec<u8> {
        let epoch = self.epochs[usize::from(axis)];
        let expires_at_us = Instant::from_micros(self.now_us + TTL_US).low_bits();
        let velocity_rad_s = 1.0 + f32::from(self.sequence % 7);
        let setpoint = Setpoint::Velocity { velocity_rad_s };
        self.encode(&Request::Setpoint(requests::Setpoint { axis, epoch, expires_at_us, setpoint }))
    }

    /// Sends a request and plays the motors until it is answered.
    fn ask(&mut self, request: &Request) -> Reply {
        let frame = self.encode(request);
        self.told.clear();
        self.handle(Event::HostBytes { link: 0, bytes: &frame });
        self.settle();
        for _ in 0..MOST_STEPS {
            if let Some(reply) = self.reply() {
                return reply;
            }
            self.run(STEP_US);
        }
        panic!("{request:?} is not answered");
    }

    /// The reply to the latest request, if the host has been told it.
    fn reply(&self) -> Option<Reply> {
        let mut deframer = Deframer::new();
        self.told.iter().find_map(|byte| {
            let frame = deframer.push(*byte)?.expect("whole frames");
            assert_ne!(frame.kind, Kind::Error, "{frame:?}");
            (frame.kind == Kind::Reply && frame.sequence == self.sequence)
                .then(|| Reply::decode(frame.number, frame.body).expect("a reply"))
        })
    }

    /// The core takes in an event and is asked for all that follows.
    fn handle(&mut self, event: Event<'_>) {
        let Self { gateway, memory, now_us, .. } = self;
        let now = Instant::from_micros(*now_us);
        let changes = gateway.handle(now, event, &mut |index, word| memory[index] = word);
        for bus in (0..BUSES).filter(|bus| changes.buses.has(*bus)) {
            let setup = self.gateway.bus_setup(bus).map(|setup| setup.generation);
            if self.started[usize::from(bus)] != setup {
                self.started[usize::from(bus)] = setup;
                let (state, transmit_errors, receive_errors) = (BusState::Active, 0, 0);
                self.handle(Event::BusState { bus, state, transmit_errors, receive_errors });
            }
            while let Some(slot) = self.gateway.poll_cancel(now, bus) {
                self.on_wire.retain(|(other, waiting)| (*other, waiting.slot) != (bus, slot));
                self.handle(Event::Cancelled { bus, slot });
            }
            while let Some(transmit) = self.gateway.poll_transmit(now, bus) {
                self.on_wire.push((bus, transmit));
            }
        }
        let mut out = [0; MAX_FRAME];
        let Self { gateway, memory, told, .. } = self;
        while changes.links.has(0u8)
            && let Some(length) = gateway.poll_host(0, &mut out, &mut |at, word| memory[at] = word)
        {
            told.extend_from_slice(&out[..length]);
        }
        while changes.log && gateway.take_log().is_some() {}
        black_box(gateway.next_deadline());
    }

    /// Plays the motors until no frame is on a bus.
    fn settle(&mut self) {
        while let Some((bus, transmit)) = self.on_wire.pop() {
            self.exchange(bus, &transmit);
        }
    }

    /// The bus carries a frame, and the motor answers.
    fn exchange(&mut self, bus: u8, transmit: &Transmit) {
        self.now_us += EXCHANGE_US / 2;
        self.handle(Event::Transmitted { bus, slot: transmit.slot });
        self.now_us += EXCHANGE_US / 2;
        let frame = answer(transmit, self.now_us);
        self.handle(Event::CanReceived { bus, frame });
    }

    /// Time passes, and whatever falls due happens.
    fn run(&mut self, us: u64) {
        let end = self.now_us + us;
        while let Some(due) =
            self.gateway.next_deadline().map(Instant::as_micros).filter(|at| *at <= end)
        {
            self.now_us = due.max(self.now_us);
            self.handle(Event::Tick);
            self.settle();
        }
        self.now_us = end.max(self.now_us);
    }
}

/// What an RMD answers: zeros, as one that stands still; the speed that it was told; and for how long
/// it has run.
fn answer(transmit: &Transmit, now_us: u64) -> CanFrame {
    let Outgoing::Can(frame) = &transmit.frame else { panic!("no CAN frame") };
    let embedded_can::Id::Standard(id) = frame.id() else { panic!("an extended id") };
    let mut data = [0; 8];
    data.copy_from_slice(frame.data());
    if data[0] == 0xA2 {
        let centidegrees = i32::from_le_bytes([data[4], data[5], data[6], data[7]]);
        let [low, high] = i16::try_from(centidegrees / 100).expect("slow enough").to_le_bytes();
        data = [0xA2, 30, 0, 0, low, high, 0, 0];
    }
    if data[0] == 0xB1 {
        let run_time_ms = u32::try_from(now_us / 1_000).expect("short");
        let [a, b, c, d] = run_time_ms.to_le_bytes();
        data = [0xB1, 0, 0, 0, a, b, c, d];
    }
    CanFrame::standard(id.as_raw() + 0x100, &data).expect("an id of a motor")
}

/// One operation, as it is named on the command line.
type Operation = (&'static str, fn(&mut Bench) -> Bytes, fn(&mut Bench, &[u8]), fn() -> Bench);
type Bytes = Vec<u8>;

const OPERATIONS: [Operation; 7] = [
    ("setpoint", prepare_setpoint, host_bytes, Bench::moving),
    (
        "stop",
        |bench| {
            let target = StopTarget::Axis(0);
            bench.encode(&Request::Stop(requests::Stop { target }))
        },
        host_bytes,
        Bench::moving,
    ),
    (
        "estop",
        |bench| bench.encode(&Request::EStop(requests::EStop {})),
        first_frame,
        Bench::moving,
    ),
    ("reply", prepare_reply, can_reply, Bench::idle),
    ("foreign", |_| Bytes::new(), foreign_frame, Bench::moving),
    ("round", |_| Bytes::new(), round, Bench::moving),
    ("idle", |_| Bytes::new(), idle_second, Bench::idle),
];

/// All go on turning, and one is told another speed.
fn prepare_setpoint(bench: &mut Bench) -> Bytes {
    round(bench, &[]);
    bench.setpoint(0)
}

/// From the last byte of a request to its frame.
fn host_bytes(bench: &mut Bench, bytes: &[u8]) {
    bench.handle(Event::HostBytes { link: 0, bytes });
    assert!(!bench.on_wire.is_empty());
}

/// From the last byte of a request to the first of its frames.
fn first_frame(bench: &mut Bench, bytes: &[u8]) {
    let now = Instant::from_micros(bench.now_us);
    let Bench { gateway, memory, .. } = bench;
    let event = Event::HostBytes { link: 0, bytes };
    gateway.handle(now, event, &mut |index, word| memory[index] = word);
    assert_eq!(gateway.poll_cancel(now, 0), None);
    assert!(gateway.poll_transmit(now, 0).is_some());
}

/// The host asks for the state; all but the last reply of the motor have come.
fn prepare_reply(bench: &mut Bench) -> Bytes {
    let frame = bench.encode(&Request::ReadState(requests::ReadState { axis: 0 }));
    bench.handle(Event::HostBytes { link: 0, bytes: &frame });
    loop {
        let (bus, transmit) = bench.on_wire.pop().expect("a frame");
        let mut after = Bench {
            gateway: bench.gateway.clone(),
            memory: bench.memory.clone(),
            on_wire: Vec::new(),
            told: Vec::new(),
            ..*bench
        };
        after.exchange(bus, &transmit);
        bench.now_us += EXCHANGE_US / 2;
        bench.handle(Event::Transmitted { bus, slot: transmit.slot });
        bench.now_us += EXCHANGE_US / 2;
        let frame = answer(&transmit, bench.now_us);
        if after.on_wire.is_empty() {
            let embedded_can::Id::Standard(id) = frame.id() else { unreachable!() };
            let [low, high] = id.as_raw().to_le_bytes();
            return [&[bus, low, high], frame.data()].concat();
        }
        bench.handle(Event::CanReceived { bus, frame });
    }
}

fn can_reply(bench: &mut Bench, bytes: &[u8]) {
    let [bus, low, high, data @ ..] = bytes else { unreachable!() };
    let frame = CanFrame::standard(u16::from_le_bytes([*low, *high]), data).expect("as it was");
    bench.told.clear();
    bench.handle(Event::CanReceived { bus: *bus, frame });
    assert!(!bench.told.is_empty());
}

/// A frame that none of the motors has sent.
fn foreign_frame(bench: &mut Bench, _: &[u8]) {
    let frame = CanFrame::standard(0x7F0, &[0; 8]).expect("an id");
    bench.handle(Event::CanReceived { bus: 0, frame });
    assert!(bench.on_wire.is_empty());
}

/// A setpoint for each axis, its frame, the motor's reply.
fn round(bench: &mut Bench, _: &[u8]) {
    for axis in 0..AXES {
        let bytes = bench.setpoint(axis);
        bench.handle(Event::HostBytes { link: 0, bytes: &bytes });
    }
    bench.settle();
}

fn idle_second(bench: &mut Bench, _: &[u8]) {
    bench.run(1_000_000);
}

#[inline(never)]
fn measured(act: fn(&mut Bench, &[u8]), bench: &mut Bench, bytes: &[u8]) {
    act(black_box(bench), black_box(bytes));
}

fn count(operation: &str, times: usize) {
    let known = OPERATIONS.iter().find(|(name, ..)| *name == operation);
    let (_, prepare, act, make) = known.unwrap_or_else(|| panic!("no operation {operation}"));
    let mut bench = make();
    for _ in 0..times {
        // Between two of them a motor has answered, and the phase of the polls is another one.
        if matches!(operation, "stop" | "estop") {
            bench = make();
        }
        bench.run(1_730);
        let bytes = prepare(&mut bench);
        measured(*act, &mut bench, &bytes);
        bench.settle();
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, verb, operation, times] = arguments.as_slice()
        && verb == "count"
    {
        return count(operation, times.parse().expect("how often"));
    }
    let mut criterion = Criterion::default().configure_from_args();
    for (name, prepare, act, make) in OPERATIONS {
        let ready = || {
            let mut bench = make();
            bench.run(1_730);
            let bytes = prepare(&mut bench);
            (bench, bytes)
        };
        criterion.bench_function(name, |bencher| {
            bencher.iter_batched(
                ready,
                |(mut bench, bytes)| measured(act, &mut bench, &bytes),
                criterion::BatchSize::LargeInput,
            );
        });
    }
    criterion.final_summary();
}
