//! A gateway, its buses, its motors and its host links, in virtual time.
//!
//! Everything happens at instants of whole nanoseconds, in a fixed order within one instant: what
//! is over on the buses, what the motors and others on the buses do by themselves, what has arrived
//! from the hosts, the gateway's own deadline, and then what starts on the buses. So a run depends
//! on wiring, seed and input only, not on how it is cut into pieces.

mod behind_reply;
mod host_link;
mod life;
mod port;
mod shelf;
mod strangers;
mod trace;

use std::time::Duration;

use flight_recorder::Recorded;
use gateway::{Event, Gateway, Instant, MAX_LINKS, Set, Then};
use host_protocol::{BusState, MAX_FRAME, Trip};

pub use self::trace::TraceEntry;

use self::host_link::HostLink;
use self::life::Life;
use self::port::{Medium, Port};
use self::shelf::Halves;
use self::strangers::Strangers;
use self::trace::{Trace, micros};
use crate::bus::{BusFault, Station, Wire};
use crate::can::CanOutcome;
use crate::motors::{Injection, Motor};
use crate::rs485::SerialOutcome;
use crate::wiring::{Wiring, WiringError};

/// The gateway's clock.
const TICK: Duration = Duration::from_micros(1);

/// A gateway and everything around it.
pub struct World {
    now: Duration,
    gateway: Box<Recorded<Halves>>,
    /// Of the flight recorder after each call.
    flight_turns: usize,
    ports: Vec<Port>,
    motors: Vec<Motor>,
    links: Vec<HostLink>,
    strangers: Strangers,
    trace: Trace,
    life: Life,
    /// Buses that the gateway has named and that have not been polled since.
    named: Set,
    /// A deadline that the gateway leaves in the past is due again only then, so that time goes
    /// on.
    not_before: Duration,
}

impl World {
    /// A world at time 0, with an unconfigured gateway.
    ///
    /// # Panics
    /// If the wiring asks for what cannot be; [`World::try_new`] says so instead.
    pub fn new(wiring: Wiring) -> Self {
        Self::try_new(wiring).unwrap_or_else(|error| panic!("{error}"))
    }

    /// A world at time 0, with an unconfigured gateway.
    ///
    /// # Errors
    /// If a motor cannot be connected as the wiring asks.
    pub fn try_new(wiring: Wiring) -> Result<Self, WiringError> {
        let Wiring { board, motors: wired, seed, random_number, flight } = wiring;
        let mut ports: Vec<Port> = board.buses.iter().map(|bus| Port::new(bus.kind)).collect();
        let mut motors = Vec::new();
        for (index, motor) in wired.into_iter().enumerate() {
            let refused = WiringError::Bus { bus: motor.bus, buses: board.buses.len() };
            let port = ports.get_mut(usize::from(motor.bus)).ok_or(refused)?;
            port.connect_motor(Station::Motor(index), motor.bitrate);
            let is_serial = matches!(port.medium, Medium::Serial { .. });
            motors.push(Motor::new(motor, is_serial, seed.wrapping_add(index as u64))?);
        }
        let links = board.links.iter().take(MAX_LINKS).map(|_| HostLink::default()).collect();
        let mut life = Life::new(board, random_number);
        let gateway = Gateway::new(board, life.take_random_number());
        let gateway = Box::new(Recorded::new(gateway, board, Halves::new(flight.half)));
        let (strangers, trace, not_before) =
            (Strangers::new(seed), Trace::default(), Duration::ZERO);
        let (now, named) = (Duration::ZERO, Set::ALL);
        let mut world = Self {
            now,
            gateway,
            flight_turns: flight.turns,
            ports,
            motors,
            links,
            strangers,
            trace,
            life,
            named,
            not_before,
        };
        world.start_gateway();
        Ok(world)
    }

    /// The gateway's core, for what can be asked of it from outside.
    pub fn core(&self) -> &Gateway {
        &self.gateway
    }

    /// The time since this world began, which is also when its gateway was started first.
    pub fn now(&self) -> Instant {
        Instant::from_micros(micros(self.now))
    }

    /// When something will happen next, rounded up to a whole microsecond.
    pub fn next_event(&mut self) -> Option<Instant> {
        self.next_time().map(|at| Instant::from_micros(micros(at + TICK - Duration::from_nanos(1))))
    }

    /// Lets everything happen up to `until`, that instant included.
    pub fn run_until(&mut self, until: Instant) {
        self.run_to(Duration::from_micros(until.as_micros()));
    }

    /// Lets everything happen for a while.
    pub fn run_for(&mut self, span: Duration) {
        self.run_to(self.now + span);
    }

    /// Sends bytes to the gateway over a host link, at the pace of the link. A link that does not
    /// exist takes nothing.
    pub fn host_send(&mut self, link: u8, bytes: &[u8]) {
        let now = self.now;
        if let Some(link) = self.links.get_mut(usize::from(link)) {
            link.send(now, bytes);
        }
    }

    /// What has arrived from the gateway over a host link since the last call.
    pub fn host_receive(&mut self, link: u8) -> Vec<u8> {
        self.links.get_mut(usize::from(link)).map(HostLink::take_received).unwrap_or_default()
    }

    /// How many bytes are still on their way to the gateway over a host link.
    pub fn host_backlog(&self, link: u8) -> usize {
        self.links.get(usize::from(link)).map_or(0, HostLink::backlog)
    }

    /// Sets the rate of the host's end of a link. Before that it has whatever rate the gateway has,
    /// as a connection that has none.
    pub fn set_host_baud(&mut self, link: u8, baud: u32) {
        let now = self.now;
        if let Some(link) = self.links.get_mut(usize::from(link)) {
            link.set_host_baud(now, baud);
        }
    }

    /// The rate that the gateway's end of a host link runs at.
    pub fn baud(&self, link: u8) -> u32 {
        self.gateway.baud(link)
    }

    /// Forgets what is on its way over a host link in either direction, as when its cable is
    /// pulled.
    pub fn host_reset(&mut self, link: u8) {
        self.links.get_mut(usize::from(link)).into_iter().for_each(HostLink::reset);
    }

    /// How many host links there are.
    pub fn host_links(&self) -> u8 {
        u8::try_from(self.links.len()).unwrap_or(u8::MAX)
    }

    /// What the flight recorder has kept, as [`flight_recorder::Recording::read`] takes it; nothing
    /// where it has kept nothing.
    pub fn flight_record(&self) -> Vec<u8> {
        shelf::record(self.gateway.recorder())
    }

    /// The trip that it has kept, and that of which axis.
    pub fn recorded_trip(&self) -> Option<(u8, Trip)> {
        self.gateway.recorder().trip()
    }

    /// Whether the flight recorder adds to what it has kept at present.
    pub fn is_recording(&self) -> bool {
        self.gateway.recorder().is_recording()
    }

    /// The motors, in the order of the wiring.
    pub fn motors(&self) -> &[Motor] {
        &self.motors
    }

    /// The motor with this index in the wiring.
    ///
    /// # Panics
    /// If there is none.
    pub fn motor(&self, index: usize) -> &Motor {
        &self.motors[index]
    }

    /// Puts a fault into a motor, or takes it out again.
    ///
    /// # Panics
    /// If there is no such motor.
    pub fn inject(&mut self, motor: usize, injection: Injection) {
        let now = self.now;
        self.motors[motor].inject(now, injection);
        if let Injection::Unplugged(off) = injection
            && let Some(port) = self.ports.get_mut(usize::from(self.motors[motor].bus()))
        {
            port.set_plugged(now, Station::Motor(motor), !off);
        }
    }

    /// Switches a motor off and on again. Its shaft keeps its speed for that moment.
    ///
    /// # Panics
    /// If there is no such motor.
    pub fn power_cycle(&mut self, motor: usize) {
        let now = self.now;
        let before = self.motors[motor].bitrate();
        self.motors[motor].power_cycle(now);
        let (bus, bitrate) = (self.motors[motor].bus(), self.motors[motor].bitrate());
        if let Some(port) = self.ports.get_mut(usize::from(bus)).filter(|_| bitrate != before) {
            port.restart_motor(now, Station::Motor(motor), bitrate);
        }
    }

    /// Breaks the cable of a bus, or repairs it; whether there is such a bus.
    pub fn set_bus_fault(&mut self, bus: u8, fault: BusFault) -> bool {
        let now = self.now;
        let port = self.ports.get_mut(usize::from(bus));
        port.map(|port| port.set_fault(now, fault)).is_some()
    }

    /// What was on the buses since the last call, in the order of its end; at most the last 200 000
    /// entries.
    pub fn trace(&mut self) -> Vec<TraceEntry> {
        self.trace.take()
    }

    fn next_time(&mut self) -> Option<Duration> {
        let deadline = self.gateway_deadline().map(|at| at.max(self.not_before));
        let ports = self.ports.iter().filter_map(Port::next_event);
        let motors = self.motors.iter().filter_map(Motor::next_event);
        let links = self.links.iter().filter_map(HostLink::next_event);
        let strangers = self.strangers.next_event();
        deadline
            .into_iter()
            .chain(ports)
            .chain(motors)
            .chain(links)
            .chain(strangers)
            .min()
            .map(|at| at.max(self.now))
    }

    fn run_to(&mut self, until: Duration) {
        while let Some(at) = self.next_time().filter(|at| *at <= until) {
            self.now = at;
            self.step();
        }
        self.now = self.now.max(until);
    }

    /// Everything that is due at the present instant.
    fn step(&mut self) {
        let now = self.now;
        for port in &mut self.ports {
            port.finish(now);
        }
        self.settle();
        self.run_motors();
        self.run_strangers();
        for link in 0..self.links.len() {
            self.run_link(link);
        }
        if self.gateway_deadline().is_some_and(|at| at <= now) && self.not_before <= now {
            self.not_before = now + TICK;
            self.tell(Event::Tick);
        }
        self.settle();
        for port in &mut self.ports {
            port.arbitrate(now);
        }
    }

    fn run_motors(&mut self) {
        let now = self.now;
        for (index, motor) in self.motors.iter_mut().enumerate() {
            if motor.next_event().is_none_or(|at| at > now) {
                continue;
            }
            motor.advance(now);
            let Some(port) = self.ports.get_mut(usize::from(motor.bus())) else { continue };
            while let Some(message) = motor.take_ready(now) {
                port.send_motor(now, Station::Motor(index), message);
            }
        }
    }

    fn run_link(&mut self, index: usize) {
        let now = self.now;
        let number = u8::try_from(index).unwrap_or(u8::MAX);
        if let Some(link) = self.links.get_mut(index) {
            link.finish(now);
        }
        let is_open = self.links_are_open();
        while let Some(link) = self.links.get_mut(index) {
            let Some(bytes) = link.arrived(now) else { break };
            if is_open && !link.is_readable() {
                self.tell(Event::HostLineError { link: number });
            }
            if is_open {
                self.tell(Event::HostBytes { link: number, bytes: &bytes });
            }
        }
        self.poll_link(index);
    }

    /// Hands an event to the gateway and takes what it then wants to send.
    fn tell(&mut self, event: Event<'_>) {
        self.handle(event);
        self.poll_gateway();
        self.save();
        self.read_flight_record();
        self.restart();
    }

    fn poll_gateway(&mut self) {
        if !self.runs() {
            return;
        }
        self.set_up_ports();
        let now = self.gateway_now();
        let named = std::mem::take(&mut self.named).with(self.gateway.take_changes().buses);
        let mut given_back = Vec::new();
        for (bus, port) in (0..).zip(&mut self.ports).filter(|(bus, _)| named.has(*bus)) {
            while let Some(slot) = self.gateway.poll_cancel(now, bus) {
                if port.cancel(slot) {
                    given_back.push((bus, slot));
                }
            }
            while port.takes_frames()
                && let Some(transmit) = self.gateway.poll_transmit(now, bus)
            {
                let is_alone = transmit.is_alone;
                port.take(self.now, transmit);
                if is_alone {
                    break;
                }
            }
        }
        for link in 0..self.links.len() {
            self.poll_link(link);
        }
        for (bus, slot) in given_back {
            self.tell(Event::Cancelled { bus, slot });
        }
    }

    fn set_up_ports(&mut self) {
        for bus in 0..u8::try_from(self.ports.len()).unwrap_or(u8::MAX) {
            let Some(port) = self.ports.get_mut(usize::from(bus)) else { return };
            let started = port.set_up(self.now, self.gateway.bus_setup(bus));
            if started && matches!(port.medium, Medium::Serial { .. }) {
                // A CAN bus reports its start by itself.
                let (state, transmit_errors, receive_errors) = (BusState::Active, 0, 0);
                self.handle(Event::BusState { bus, state, transmit_errors, receive_errors });
            }
        }
    }

    fn poll_link(&mut self, index: usize) {
        if !self.links_are_open() {
            return;
        }
        let Some(link) = self.links.get_mut(index).filter(|link| link.is_free()) else { return };
        let mut frame = [0; MAX_FRAME];
        let number = u8::try_from(index).unwrap_or(u8::MAX);
        link.set_baud(self.now, self.gateway.baud(number));
        let length = self.gateway.poll_host(number, &mut frame, &mut self.life.store());
        if let Some(bytes) = length.and_then(|length| frame.get(..length)) {
            link.begin(self.now, bytes);
        }
    }

    /// Tells everybody what has happened on the buses, until nothing more does at this instant.
    fn settle(&mut self) {
        self.poll_gateway();
        loop {
            let mut quiet = true;
            for bus in 0..self.ports.len() {
                while self.settle_one(bus) {
                    quiet = false;
                }
            }
            if quiet {
                return;
            }
        }
    }

    /// Passes on one outcome of a bus; whether there was one.
    fn settle_one(&mut self, index: usize) -> bool {
        let Some(port) = self.ports.get_mut(index) else { return false };
        let bus = u8::try_from(index).unwrap_or(u8::MAX);
        match &mut port.medium {
            Medium::Can(can) => match can.poll() {
                Some(outcome) => self.pass_on_can(bus, outcome),
                None => return false,
            },
            Medium::Serial { line, .. } => match line.poll() {
                Some(outcome) => self.pass_on_serial(bus, outcome),
                None => return false,
            },
        }
        true
    }

    fn pass_on_can(&mut self, bus: u8, outcome: CanOutcome) {
        match outcome {
            CanOutcome::Sent { from, slot, frame, start, end, to } => {
                self.trace.add(bus, from, Wire::Can(frame), start, end);
                self.tell_motors(&to, |motor, now| motor.hear_frame(now, &frame));
                if from == Station::Gateway {
                    self.transmitted(bus, slot);
                }
                if to.contains(&Station::Gateway) {
                    self.tell(Event::CanReceived { bus, frame });
                }
                if from == Station::Stranger {
                    self.go_on_babbling(bus);
                }
            }
            CanOutcome::Overheard { frame, to } => {
                if to.contains(&Station::Gateway) {
                    self.tell(Event::CanReceived { bus, frame });
                }
            }
            CanOutcome::Cancelled { station: Station::Gateway, slot } => {
                let held =
                    self.ports.get_mut(usize::from(bus)).is_some_and(|port| port.release(slot));
                if held {
                    self.tell(Event::Cancelled { bus, slot });
                }
            }
            CanOutcome::Cancelled { .. } => {}
            CanOutcome::State { station: Station::Gateway, state, transmit, receive } => {
                if state == BusState::BusOff
                    && let Some(port) = self.ports.get_mut(usize::from(bus))
                {
                    port.release_all();
                }
                let (transmit_errors, receive_errors) = (transmit, receive);
                self.tell(Event::BusState { bus, state, transmit_errors, receive_errors });
            }
            CanOutcome::State { .. } => {}
        }
    }

    fn pass_on_serial(&mut self, bus: u8, outcome: SerialOutcome) {
        match outcome {
            SerialOutcome::Byte { value, to } => {
                self.tell_motors(&to, |motor, now| motor.hear_byte(now, value));
                if to.contains(&Station::Gateway) {
                    let now = self.now;
                    let port = self.ports.get_mut(usize::from(bus));
                    let is_answer = port.is_some_and(|port| port.hears(now));
                    let then = if is_answer { Then::Frame } else { Then::Bytes };
                    self.tell(Event::SerialReceived { bus, bytes: &[value], then });
                }
            }
            SerialOutcome::Sent { from, slot, bytes, start, end } => {
                self.trace.add(bus, from, Wire::Serial(bytes), start, end);
                if from == Station::Gateway {
                    self.transmitted(bus, slot);
                }
            }
        }
    }

    fn transmitted(&mut self, bus: u8, slot: u8) {
        let held = self.ports.get_mut(usize::from(bus)).is_some_and(|port| port.release(slot));
        if held {
            self.tell(Event::Transmitted { bus, slot });
        }
    }

    fn tell_motors(&mut self, stations: &[Station], what: impl Fn(&mut Motor, Duration)) {
        for station in stations {
            if let Station::Motor(index) = station
                && let Some(motor) = self.motors.get_mut(*index)
            {
                what(motor, self.now);
            }
        }
    }
}
