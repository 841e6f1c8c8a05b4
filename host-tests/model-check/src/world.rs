//! The gateway, its hosts, buses and motors, and the model that watches them.

mod counts;
mod life;
mod ports;
mod state_key;
mod steps;
mod storage;

pub use counts::Counts;

use crate::action::{Action, Ask, Step};
use crate::bus::{Bus, OnWire, arbitration, crc16};
use crate::host::Host;
use crate::motor::Motor;
use crate::panics;
use crate::plant::{BOARD, BUSES, KINDS, LINE, LINKS, LISTENER, MOTORS, all_motors, extended_id};
use gateway::{Gateway, Instant, MAX_AXES, Outgoing, Set};
use host_protocol::Protocol;
use life::{FIRST_RANDOM_NUMBER, Life};
use ports::Input;
use promise_model::{EXTENDED, Oracle, Told, Violation};
use std::collections::VecDeque;

/// The firmware looks at its deadlines late by less than this, µs: within g of G5.
const LATE_US: u64 = 90;
/// Bytes of a frame on a serial line.
const SERIAL_FRAME: usize = 13;
/// Id of a request to every RMD motor.
const RMD_ALL: u32 = 0x280;
/// D5: id of all motors, on the bus and in the frame.
const D5_ALL: u8 = 0xFE;
/// Events that may be due one after another at one moment.
const MAX_AT_ONCE: u32 = 1_000;

/// A run.
#[derive(Clone)]
pub struct World {
    start_us: u64,
    now_us: u64,
    gateway: Box<Gateway>,
    oracle: Oracle,
    hosts: Vec<Host>,
    buses: Vec<Bus>,
    motors: Vec<Motor>,
    /// The latest bytes that the motors of the serial line heard of the gateway.
    line: Vec<u8>,
    inputs: VecDeque<Input>,
    epochs: [u32; MOTORS.len()],
    told: [Told; MOTORS.len()],
    counts: Counts,
    life: Life,
    /// Buses that the core has named and that have not been polled since.
    named: Set,
    /// When the core wants the next tick, as it said last.
    tick_due_us: u64,
    /// That tick was due when the latest event came, which is none: it names what time has brought.
    tick_is_late: bool,
    /// What was on the wires, if it is kept.
    trace: Option<Vec<String>>,
    /// The core has panicked: nothing follows any more.
    has_panicked: bool,
    /// Frames that do not reach their bus although the core believes so: a fault that must be
    /// found.
    #[cfg(test)]
    pub(crate) swallows: Option<fn(&Outgoing) -> bool>,
    /// Every frame comes back at once, which nobody has asked for: one more.
    #[cfg(test)]
    pub(crate) returns: bool,
}

impl World {
    /// A gateway that has just started, at this time of its clock.
    #[must_use]
    pub fn new(start_us: u64) -> Self {
        let mut world = Self {
            start_us,
            now_us: start_us,
            gateway: Box::new(Gateway::new(&BOARD, Some(FIRST_RANDOM_NUMBER))),
            oracle: Oracle::new(&KINDS, LINKS.into(), LISTENER, MAX_AXES),
            hosts: (0..LINKS).map(|_| Host::default()).collect(),
            buses: (0..usize::from(BUSES)).map(Bus::new).collect(),
            motors: all_motors().map(Motor::new).collect(),
            line: Vec::new(),
            inputs: VecDeque::new(),
            epochs: [0; MOTORS.len()],
            told: [Told::Unconfigured; MOTORS.len()],
            counts: Counts::default(),
            life: Life::new(),
            named: Set::ALL,
            tick_due_us: u64::MAX,
            tick_is_late: false,
            trace: None,
            has_panicked: false,
            #[cfg(test)]
            swallows: None,
            #[cfg(test)]
            returns: false,
        };
        let at = Instant::from_micros(start_us);
        world.gateway.restore(at, &[]);
        world.life.storage.load(at, &mut world.gateway);
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
        let (motions, started_together) = (self.oracle.motions(), self.oracle.started_together());
        Counts { motions, started_together, ..self.counts }
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
        self.guarded(|world| {
            world.pass(step.at_us);
            world.act(&step.action);
        });
    }

    /// Lets time pass.
    pub fn run_to(&mut self, since_start_us: u64) {
        self.guarded(|world| world.pass(since_start_us));
    }

    /// Makes a panic the last promise that is broken: it is told, and can be made shorter, like any
    /// other.
    fn guarded(&mut self, act: impl FnOnce(&mut Self)) {
        if self.has_panicked {
            return;
        }
        if let Err(said) = panics::caught(|| act(self)) {
            self.has_panicked = true;
            self.oracle.panicked(self.now_us, said);
        }
    }

    fn pass(&mut self, since_start_us: u64) {
        let end = self.start_us + since_start_us;
        let mut stuck = 0;
        while let Some(next) = self.next_us() {
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

    /// When something happens next by itself.
    fn next_us(&mut self) -> Option<u64> {
        let tick = self.tick_us();
        let buses = self.buses.iter().filter_map(|bus| bus.next_us(self.now_us));
        let written = self.life.storage.written_at();
        let next = buses.chain(tick).chain(self.life.links_open_by()).chain(written).min();
        next.map(|at| at.max(self.now_us))
    }

    /// Lets the next thing happen, and all that happens at that moment.
    pub fn run_to_next(&mut self) {
        if let Some(next) = self.next_us() {
            self.run_to(next - self.start_us);
        }
    }

    /// When the firmware looks at the next deadline.
    fn tick_us(&mut self) -> Option<u64> {
        self.tick_due_us = self.gateway.next_deadline().map_or(u64::MAX, Instant::as_micros);
        let at = Some(self.tick_due_us).filter(|at| *at < u64::MAX)?;
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
        if self.open_links() {
            return;
        }
        if self.life.storage.written_at().is_some_and(|at| at <= self.now_us) {
            self.stored(true);
            return;
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
                self.hear(bus, arbitration(&frame), frame.data());
            }
            OnWire::Ours { slot, frame: Outgoing::Serial(bytes), garbled } => {
                for bytes in self.echo(bytes.to_vec(), garbled) {
                    self.feed(Input::Serial { bus, bytes });
                }
                self.feed(Input::Transmitted { bus, slot });
                if !garbled {
                    self.hear_bytes(bus, &bytes);
                }
            }
            // A controller that is off hears nothing (ISO 11898-1, bus off).
            OnWire::Can { .. } if self.buses[usize::from(bus)].is_off => {}
            OnWire::Can { id, data } => self.feed(Input::Can { bus, id, data }),
            OnWire::Serial(bytes) => self.feed(Input::Serial { bus, bytes }),
        }
    }

    /// What the gateway hears of its own bytes, in two parts: of garbled ones a bit is wrong, or
    /// nothing is heard. The time chooses which.
    fn echo(&self, mut bytes: Vec<u8>, garbled: bool) -> [Vec<u8>; 2] {
        let any = |end: usize| usize::try_from(self.now_us).unwrap_or(0) % end.max(1);
        let (part, place) = (any(bytes.len()), any(bytes.len()));
        if garbled && any(3) == 0 {
            bytes.clear();
        } else if let Some(byte) = bytes.get_mut(place).filter(|_| garbled) {
            *byte ^= 1 << any(8);
        }
        let behind = bytes.split_off(part.min(bytes.len()));
        [bytes, behind]
    }

    /// The motors of a serial line hear bytes: wherever a frame begins in them, they find it.
    fn hear_bytes(&mut self, bus: u8, bytes: &[u8]) {
        for byte in bytes {
            self.line.push(*byte);
            let start = self.line.len().saturating_sub(SERIAL_FRAME);
            self.line.drain(..start);
            let [0x3E, node, 8, data @ .., low, high] = self.line.as_slice() else { continue };
            let sum = crc16(&self.line[..self.line.len() - 2]).to_le_bytes();
            if data.len() == 8 && sum == [*low, *high] {
                let (node, data) = (u32::from(*node), data.to_vec());
                self.hear(bus, node, &data);
            }
        }
    }

    /// The motors of a bus hear a frame.
    fn hear(&mut self, bus: u8, id: u32, data: &[u8]) {
        let is_serial = bus == LINE;
        for (index, wired) in all_motors().enumerate().filter(|(_, wired)| wired.bus == bus) {
            let node = u32::from(wired.node);
            let motion_mode = wired.protocol == Protocol::Rmd && !is_serial && id == 0x400 + node;
            let is_for_it = match wired.protocol {
                Protocol::Rmd if is_serial => id == node,
                Protocol::Rmd => id == 0x140 + node || id == RMD_ALL,
                Protocol::Thruster => id == 0x300 + node,
                Protocol::D5 => {
                    (id == node || id == extended_id(wired.node))
                        && data.get(..2) == Some(&[0xD5, wired.node])
                }
            };
            let motor = &mut self.motors[index];
            if is_for_it && wired.protocol == Protocol::D5 {
                motor.own_id = id;
            }
            let answers = match wired.protocol {
                _ if motion_mode || is_for_it => motor.hear(self.now_us, data, motion_mode),
                Protocol::D5
                    if (id & !EXTENDED) == D5_ALL.into()
                        && data.get(..2) == Some(&[0xD5, D5_ALL]) =>
                {
                    // What goes to all is answered by nobody (PROTOCOL-NOTES D10).
                    motor.hear(self.now_us, data, false);
                    Vec::new()
                }
                Protocol::D5 => motor.objects(self.now_us, data).into_iter().collect(),
                Protocol::Rmd | Protocol::Thruster => Vec::new(),
            };
            let own_id = motor.own_id;
            for answer in answers {
                self.buses[usize::from(bus)].answer(self.now_us, wired, own_id, answer);
            }
        }
    }
}
