//! The gateway, its hosts, buses and motors, and the model that watches them.

use crate::action::{Action, Ask, Step};
use crate::bus::{Bus, OnWire};
use crate::host::Host;
use crate::motor::Motor;
use crate::plant::{BOARD, BUSES, KINDS, LINKS, LISTENER, MOTORS};
use embedded_can::Id;
use gateway::{Event, Gateway, Instant, MAX_AXES, Outgoing, port::TRANSMIT_SLOTS};
use host_protocol::{BusState, CanFrame, Deframer, EventMessage, Kind, MAX_FRAME, Protocol, Reply};
use promise_model::{Frame, Oracle, Told, Violation};
use std::collections::VecDeque;

/// The firmware looks at its deadlines late by less than this, µs: within g of G5.
const LATE_US: u64 = 90;
/// Frames that a link may have for its host at one moment.
const MAX_OUTPUT: usize = 300;
/// Events that may be due one after another at one moment.
const MAX_AT_ONCE: u32 = 1_000;

/// What has happened so far.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counts {
    /// Events that the core took in.
    pub events: u64,
    /// Of them while an axis was armed, active or stopping.
    pub busy: u64,
    /// Motion frames.
    pub motions: u64,
    /// Armings.
    pub armed: u64,
    /// Trips.
    pub trips: u64,
    /// Stops that were confirmed.
    pub confirmed: u64,
}

impl Counts {
    /// The sum of two.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            events: self.events + other.events,
            busy: self.busy + other.busy,
            motions: self.motions + other.motions,
            armed: self.armed + other.armed,
            trips: self.trips + other.trips,
            confirmed: self.confirmed + other.confirmed,
        }
    }
}

/// An event on its way to the core.
#[derive(Debug)]
enum Input {
    Host { link: u8, bytes: Vec<u8> },
    Can { bus: u8, id: u16, data: Vec<u8> },
    Serial { bus: u8, bytes: Vec<u8> },
    Transmitted { bus: u8, slot: u8 },
    Cancelled { bus: u8, slot: u8 },
    State { bus: u8, off: bool },
    Overflow { bus: u8 },
    Pin { open: bool },
    Tick,
}

/// A run.
pub struct World {
    start_us: u64,
    now_us: u64,
    gateway: Box<Gateway>,
    oracle: Oracle,
    hosts: Vec<Host>,
    buses: Vec<Bus>,
    motors: Vec<Motor>,
    inputs: VecDeque<Input>,
    epochs: [u32; MOTORS.len()],
    told: [Told; MOTORS.len()],
    counts: Counts,
    /// What was on the wires, if it is kept.
    trace: Option<Vec<String>>,
}

impl World {
    /// A gateway that has just started, at this time of its clock.
    #[must_use]
    pub fn new(start_us: u64) -> Self {
        let mut world = Self {
            start_us,
            now_us: start_us,
            gateway: Box::new(Gateway::new(&BOARD)),
            oracle: Oracle::new(&KINDS, LINKS.into(), LISTENER, MAX_AXES),
            hosts: (0..LINKS).map(|_| Host::default()).collect(),
            buses: (0..usize::from(BUSES)).map(Bus::new).collect(),
            motors: MOTORS.iter().map(|wired| Motor::new(*wired)).collect(),
            inputs: VecDeque::new(),
            epochs: [0; MOTORS.len()],
            told: [Told::Unconfigured; MOTORS.len()],
            counts: Counts::default(),
            trace: None,
        };
        world.gateway.restore(Instant::from_micros(start_us), &[]);
        world.feed(Input::Pin { open: false });
        world.act(&Action::Ask { link: LISTENER, ask: Ask::Hello });
        world
    }

    /// Time since the start, µs.
    #[must_use]
    pub fn since_start_us(&self) -> u64 {
        self.now_us - self.start_us
    }

    /// What has happened.
    #[must_use]
    pub fn counts(&self) -> Counts {
        Counts { motions: self.oracle.motions(), ..self.counts }
    }

    /// What the model knows.
    #[must_use]
    pub fn oracle(&self) -> &Oracle {
        &self.oracle
    }

    /// Keeps from now on what is on the wires.
    pub fn keep_trace(&mut self) {
        self.trace = Some(Vec::new());
    }

    /// What was on the wires since it is kept: `time direction bytes`.
    #[must_use]
    pub fn trace(&self) -> &[String] {
        self.trace.as_deref().unwrap_or_default()
    }

    fn note(&mut self, what: impl FnOnce() -> String) {
        if let Some(trace) = &mut self.trace {
            trace.push(format!("{:>9} {}", self.now_us - self.start_us, what()));
        }
    }

    /// The first promise that was broken.
    #[must_use]
    pub fn broken(&self) -> Option<&Violation> {
        self.oracle.violations().first()
    }

    /// Whether the host of a link reads what it is told.
    #[must_use]
    pub fn reads(&self, link: u8) -> bool {
        self.hosts.get(usize::from(link)).is_some_and(|host| host.unread_until <= self.now_us)
    }

    /// Lets time pass until a step, and does it.
    pub fn step(&mut self, step: &Step) {
        self.run_to(step.at_us);
        self.act(&step.action);
    }

    /// Lets time pass.
    pub fn run_to(&mut self, since_start_us: u64) {
        let end = self.start_us + since_start_us;
        let mut stuck = 0;
        loop {
            let buses = self.buses.iter().filter_map(|bus| bus.next_us(self.now_us));
            let Some(next) = buses.chain(self.tick_us()).min().map(|at| at.max(self.now_us)) else { break };
            if next > end {
                break;
            }
            stuck = if next == self.now_us { stuck + 1 } else { 0 };
            assert!(stuck < MAX_AT_ONCE, "{} µs: a deadline stays due", self.now_us);
            self.now_us = next;
            self.happen();
        }
        self.now_us = end.max(self.now_us);
    }

    /// When the firmware looks at the next deadline.
    fn tick_us(&self) -> Option<u64> {
        let at = self.gateway.next_deadline()?.as_micros();
        Some(at + at.wrapping_mul(0x9E37_79B9_7F4A_7C15) % LATE_US)
    }

    /// What is due now: the end of what is on a wire, or else a tick.
    fn happen(&mut self) {
        let mut ended = false;
        for bus in 0..BUSES {
            let index = usize::from(bus);
            if let Some(what) = self.buses[index].ended(self.now_us) {
                ended = true;
                self.arrive(bus, what);
            }
            self.buses[index].begin(self.now_us);
        }
        if !ended && self.tick_us().is_some_and(|at| at <= self.now_us) {
            self.feed(Input::Tick);
        }
    }

    /// Something has been on a wire.
    fn arrive(&mut self, bus: u8, what: OnWire) {
        match what {
            OnWire::Ours { slot, frame: Outgoing::Can(frame), .. } => {
                self.feed(Input::Transmitted { bus, slot });
                if let Id::Standard(id) = frame.id() {
                    self.hear(bus, id.as_raw(), frame.data());
                }
            }
            OnWire::Ours { slot, frame: Outgoing::Serial(bytes), garbled } => {
                let mut echo = bytes.to_vec();
                if let Some(byte) = echo.get_mut(4).filter(|_| garbled) {
                    *byte ^= 0x10;
                }
                self.feed(Input::Serial { bus, bytes: echo });
                self.feed(Input::Transmitted { bus, slot });
                if let [0x3E, node, 8, data @ .., _, _] = bytes.as_slice()
                    && !garbled
                {
                    self.hear(bus, u16::from(*node), data);
                }
            }
            OnWire::Can { id, data } => self.feed(Input::Can { bus, id, data }),
            OnWire::Serial(bytes) => self.feed(Input::Serial { bus, bytes }),
        }
    }

    /// The motors of a bus hear a frame.
    fn hear(&mut self, bus: u8, id: u16, data: &[u8]) {
        for (index, wired) in MOTORS.iter().enumerate().filter(|(_, wired)| wired.bus == bus) {
            let node = u16::from(wired.node);
            let is_serial = usize::from(bus) == KINDS.len() - 1;
            let motion_mode = wired.protocol == Protocol::Rmd && !is_serial && id == 0x400 + node;
            let base = match wired.protocol {
                Protocol::Rmd if !is_serial => 0x140,
                Protocol::Thruster => 0x300,
                Protocol::Rmd | Protocol::D5 => 0,
            };
            if motion_mode || id == base + node {
                for answer in self.motors[index].hear(self.now_us, data, motion_mode) {
                    self.buses[usize::from(bus)].answer(self.now_us, index, answer);
                }
            }
        }
    }

    /// Does what a step says.
    pub fn act(&mut self, action: &Action) {
        let now = self.now_us;
        match action {
            Action::Ask { link, ask } => {
                let epoch =
                    axis_of(ask).and_then(|axis| self.epochs.get(usize::from(axis))).copied().unwrap_or(0);
                let Some(host) = self.hosts.get_mut(usize::from(*link)) else { return };
                let bytes = host.ask(now, ask, epoch);
                self.feed(Input::Host { link: *link, bytes });
            }
            Action::Again { link, back } => {
                let bytes = self.hosts.get(usize::from(*link)).and_then(|host| host.again(*back));
                if let Some(bytes) = bytes {
                    self.feed(Input::Host { link: *link, bytes });
                }
            }
            Action::Bytes { link, bytes } => self.feed(Input::Host { link: *link, bytes: bytes.clone() }),
            Action::Unread { link, for_us } => {
                if let Some(host) = self.hosts.get_mut(usize::from(*link)).filter(|_| *link != LISTENER) {
                    host.unread_until = now + for_us;
                }
            }
            Action::EStopInput { open } => self.feed(Input::Pin { open: *open }),
            Action::Motor { motor, does } => {
                if let Some(motor) = self.motors.get_mut(usize::from(*motor)) {
                    motor.does(now, does);
                }
            }
            Action::Stray { bus, id, data } => {
                let what = OnWire::Can { id: *id, data: data.clone() };
                self.on_bus(*bus, |bus| bus.stray(now, what));
            }
            Action::Noise { bus, bytes } => {
                self.on_bus(*bus, |bus| bus.stray(now, OnWire::Serial(bytes.clone())));
            }
            Action::Cut { bus, for_us } => self.on_bus(*bus, |bus| bus.cut(now + for_us)),
            Action::Foreign { bus, id, pause_us, for_us } => {
                self.on_bus(*bus, |bus| bus.load(now, *id, *pause_us, *for_us));
            }
            Action::Stubborn { bus, for_us } => self.on_bus(*bus, |bus| bus.stubborn_until = now + for_us),
            Action::Short { bus, for_us } => {
                self.on_bus(*bus, |bus| bus.short_until = now + for_us);
                if usize::from(*bus) < self.buses.len() {
                    self.drop_held(*bus);
                    self.feed(Input::State { bus: *bus, off: true });
                }
            }
            Action::Overflow { bus } => self.feed(Input::Overflow { bus: *bus }),
        }
    }

    fn on_bus(&mut self, bus: u8, act: impl FnOnce(&mut Bus)) {
        let now = self.now_us;
        if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
            act(bus);
            bus.begin(now);
        }
    }

    /// The controller of a bus forgets what it held.
    fn drop_held(&mut self, bus: u8) {
        let state = &mut self.buses[usize::from(bus)];
        for slot in state.slots() {
            self.oracle.withdrawn(self.now_us, bus, slot);
        }
        state.forget();
    }

    fn feed(&mut self, input: Input) {
        self.inputs.push_back(input);
        while let Some(input) = self.inputs.pop_front() {
            self.take_in(&input);
            self.say();
            self.oracle.settle(self.now_us);
            self.count();
        }
    }

    /// The core takes in an event, and the model sees what it was.
    fn take_in(&mut self, input: &Input) {
        let now = self.now_us;
        if !matches!(input, Input::Tick) {
            self.note(|| format!("in  {input:X?}"));
        }
        let oracle = &mut self.oracle;
        let event = match input {
            Input::Host { link, bytes } => {
                oracle.to_gateway(now, *link, bytes);
                Event::HostBytes { link: *link, bytes }
            }
            Input::Can { bus, id, data } => {
                let Some(frame) = CanFrame::standard(*id, data) else { return };
                oracle.received(now, *bus, Frame::Can((*id).into(), data));
                Event::CanReceived { bus: *bus, frame }
            }
            Input::Serial { bus, bytes } => {
                oracle.received(now, *bus, Frame::Serial(bytes));
                Event::SerialReceived { bus: *bus, bytes }
            }
            Input::Transmitted { bus, slot } => {
                oracle.left(now, *bus, *slot);
                Event::Transmitted { bus: *bus, slot: *slot }
            }
            Input::Cancelled { bus, slot } => {
                oracle.withdrawn(now, *bus, *slot);
                Event::Cancelled { bus: *bus, slot: *slot }
            }
            Input::State { bus, off } => {
                oracle.bus_state(now, *bus, *off);
                let state = if *off { BusState::BusOff } else { BusState::Active };
                Event::BusState { bus: *bus, state, transmit_errors: 0, receive_errors: 0 }
            }
            Input::Overflow { bus } => Event::ReceiveOverflow { bus: *bus, lost: 1 },
            Input::Pin { open } => {
                oracle.e_stop_input(now, *open);
                Event::EStopInput { open: *open }
            }
            Input::Tick => Event::Tick,
        };
        self.counts.events += 1;
        self.counts.busy += u64::from(self.oracle.is_busy());
        self.gateway.handle(Instant::from_micros(now), event);
    }

    /// Everything that the gateway has to say: to its hosts first, then to its buses.
    fn say(&mut self) {
        let now = self.now_us;
        let mut out = [0; MAX_FRAME];
        for link in 0..LINKS {
            if now < self.hosts[usize::from(link)].unread_until {
                continue;
            }
            let mut frames = 0;
            while let Some(length) = self.gateway.poll_host(link, &mut out) {
                frames += 1;
                assert!(frames <= MAX_OUTPUT, "link {link} does not stop talking");
                self.oracle.from_gateway(now, link, &out[..length]);
                self.note(|| format!("host {link} {}", told(&out[..length])));
            }
            self.oracle.drained(now, link);
        }
        for bus in 0..BUSES {
            self.start_bus(bus);
            let at = Instant::from_micros(now);
            while let Some(slot) = self.gateway.poll_cancel(at, bus) {
                self.oracle.asked_back(now, bus, slot);
                self.note(|| format!("out bus {bus} slot {slot} is asked back"));
                if self.buses[usize::from(bus)].give_back(now, slot) {
                    self.inputs.push_back(Input::Cancelled { bus, slot });
                }
            }
            let mut frames = 0;
            while let Some(transmit) = self.gateway.poll_transmit(at, bus) {
                frames += 1;
                assert!(frames <= TRANSMIT_SLOTS, "bus {bus} is handed more than it can hold");
                let frame = match &transmit.frame {
                    Outgoing::Can(frame) => Frame::Can(arbitration(frame), frame.data()),
                    Outgoing::Serial(bytes) => Frame::Serial(bytes),
                };
                self.oracle.handed(now, bus, transmit.slot, frame);
                self.note(|| format!("out bus {bus} slot {} {:X?}", transmit.slot, transmit.frame));
                self.buses[usize::from(bus)].take(transmit);
            }
            self.buses[usize::from(bus)].begin(now);
        }
    }

    /// Starts a bus as the gateway wants it.
    fn start_bus(&mut self, bus: u8) {
        let index = usize::from(bus);
        let generation = self.gateway.bus_setup(bus).map(|setup| setup.generation);
        if self.buses[index].generation != generation {
            self.buses[index].generation = generation;
            self.drop_held(bus);
            let off = self.now_us < self.buses[index].short_until;
            self.inputs.push_back(Input::State { bus, off });
        }
    }

    fn count(&mut self) {
        for (axis, told) in (0u8..).zip(&mut self.told) {
            let now = self.oracle.told(axis);
            let before = std::mem::replace(told, now);
            if before == now {
                continue;
            }
            let (was_tripped, is_tripped) =
                (matches!(before, Told::Tripped { .. }), matches!(now, Told::Tripped { .. }));
            self.counts.armed += u64::from(now == Told::Armed);
            self.counts.trips += u64::from(is_tripped && !was_tripped);
            let stopped = before == Told::Stopping && now == Told::Idle;
            self.counts.confirmed += u64::from(stopped || now == Told::Tripped { confirmed: true });
        }
        for (axis, epoch) in (0u8..).zip(&mut self.epochs) {
            *epoch = self.oracle.epoch(axis).unwrap_or(*epoch);
        }
    }
}

/// The axis whose epoch a request carries.
fn axis_of(ask: &Ask) -> Option<u8> {
    match ask {
        Ask::Setpoint { permit, .. } | Ask::Move { permit, .. } | Ask::Native { permit, .. } => {
            Some(permit.axis)
        }
        _ => None,
    }
}

/// What a frame for a host says.
fn told(bytes: &[u8]) -> String {
    let mut deframer = Deframer::new();
    let mut said = String::new();
    for byte in bytes {
        let Some(Ok(frame)) = deframer.push(*byte) else { continue };
        said = match frame.kind {
            Kind::Reply => format!("{} {:?}", frame.sequence, Reply::decode(frame.number, frame.body)),
            Kind::Error => {
                format!("{} {:?}", frame.sequence, host_protocol::Error::decode(frame.number, frame.body))
            }
            _ => format!("{:?}", EventMessage::decode(frame.number, frame.body).map(|message| message.event)),
        };
    }
    said
}

/// The id of a frame with its flags, as the model knows it.
fn arbitration(frame: &CanFrame) -> u32 {
    match frame.id() {
        Id::Standard(id) => id.as_raw().into(),
        Id::Extended(id) => id.as_raw() | 1 << 31,
    }
}
