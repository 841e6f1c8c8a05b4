//! The line under test: a host link of the simulated gateway with faults, in virtual time, and a
//! record of what was written.

use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::messages::request_name;
use host_protocol::requests::{EStop, ReadState, Stop};
use host_protocol::{
    BootReason, Call, DEFAULT_BAUD, Deframer, Kind, MAX_FRAME, StopTarget, encode,
};
use mgw_client::{Interrupt, Transport};
use mgw_sim::World;

use super::action::{Action, Hostile, Moment, Ways};
use super::channel::{Channel, Faults};
use super::forge;

/// The host link of the line under test, and that of the other host.
const LINK: u8 = 0;
const OTHER_LINK: u8 = 2;
/// How fast endless bytes come.
const FLOOD_PERIOD: Duration = Duration::from_micros(200);
/// An action at a time comes up to this much later: the seeds differ by it.
const HESITATION: Duration = Duration::from_millis(12);

/// A frame that the program wrote.
#[derive(Debug, Clone)]
pub struct Written {
    /// When, since the command began.
    pub at: Duration,
    /// The name of the request.
    pub name: &'static str,
}

/// An action that has happened.
#[derive(Debug, Clone)]
pub struct Mark {
    pub name: &'static str,
    /// When, since the command began.
    pub at: Duration,
    /// How many frames had been written then.
    pub written: usize,
}

/// Another host that asks again and again.
#[derive(Debug)]
struct Poller {
    axis: u8,
    period: Duration,
    next: Duration,
}

/// The line, and what happens on it.
pub struct Line {
    world: Rc<RefCell<World>>,
    pub random: fastrand::Rng,
    /// When the command began.
    began: Duration,
    to_gateway: Channel,
    to_host: Channel,
    /// Bytes of a frame of the gateway that is not yet complete.
    partial: Vec<u8>,
    /// Arrived at the program, not yet read.
    unread: Vec<u8>,
    /// The rate that the program's port is opened with.
    pub wanted_baud: Option<u32>,
    has_stuck_baud: bool,
    hostile: Option<Hostile>,
    next_flood: Duration,
    closed: bool,
    closed_until: Duration,
    frozen_until: Duration,
    poller: Option<Poller>,
    other_sequence: u16,
    /// What is still to happen, with its time where that is known.
    to_come: Vec<(Option<Duration>, Moment, Action)>,
    pub interrupt: Interrupt,
    pub written: Vec<Written>,
    pub marks: Vec<Mark>,
}

impl Line {
    pub fn new(world: Rc<RefCell<World>>, seed: u64) -> Self {
        Self {
            world,
            random: fastrand::Rng::with_seed(seed),
            began: Duration::ZERO,
            to_gateway: Channel::default(),
            to_host: Channel::default(),
            partial: Vec::new(),
            unread: Vec::new(),
            wanted_baud: None,
            has_stuck_baud: false,
            hostile: None,
            next_flood: Duration::ZERO,
            closed: false,
            closed_until: Duration::ZERO,
            frozen_until: Duration::ZERO,
            poller: None,
            other_sequence: 0,
            to_come: Vec::new(),
            interrupt: Interrupt::default(),
            written: Vec::new(),
            marks: Vec::new(),
        }
    }

    pub fn now(&self) -> Duration {
        Duration::from_micros(self.world.borrow().now().as_micros())
    }

    /// Since the command began.
    pub fn elapsed(&self) -> Duration {
        self.now() - self.began
    }

    /// When the command began.
    pub fn began(&self) -> Duration {
        self.began
    }

    /// A command begins: what is recorded counts from here.
    pub fn begin(&mut self) {
        self.began = self.now();
        self.interrupt = Interrupt::default();
        self.written.clear();
        self.marks.clear();
        self.unread.clear();
        self.partial.clear();
        // A program begins with the default, whatever the one before it left.
        self.world.borrow_mut().set_host_baud(LINK, DEFAULT_BAUD);
        for (at, moment, _) in &mut self.to_come {
            if let Moment::At(time) = moment {
                *at = Some(self.began + *time + HESITATION.mul_f64(self.random.f64()));
            }
        }
    }

    /// Something is to happen in the next command.
    pub fn plan(&mut self, moment: Moment, action: Action) {
        self.to_come.push((None, moment, action));
    }

    /// The rate of the gateway's end.
    pub fn baud(&self) -> u32 {
        self.world.borrow().baud(LINK)
    }

    /// What has not happened.
    pub fn still_to_come(&self) -> Option<&Action> {
        self.to_come.first().map(|(_, _, action)| action)
    }

    /// Something happens.
    pub fn happen(&mut self, action: &Action) {
        let now = self.now();
        self.marks.push(Mark {
            name: action.name(),
            at: now.saturating_sub(self.began),
            written: self.written.len(),
        });
        match *action {
            Action::Interrupt => self.interrupt.raise(),
            Action::Cut(ways) => self.each(ways, |way| way.faults.cut = true),
            Action::Clean => {
                let both = Ways { to_gateway: true, to_host: true };
                self.each(both, |way| way.faults = Faults::default());
                (self.hostile, self.poller) = (None, None);
            }
            Action::Close(time) => (self.closed, self.closed_until) = (true, now + time),
            Action::Lose(part, ways) => self.each(ways, |way| way.faults.loss = part),
            Action::LoseNext(count, ways) => self.each(ways, |way| way.faults.lose_next = count),
            Action::Delay(time, ways) => self.each(ways, |way| way.faults.delay = time),
            Action::Jitter(time, ways) => self.each(ways, |way| way.faults.jitter = time),
            Action::Duplicate(part, ways) => self.each(ways, |way| way.faults.duplicates = part),
            Action::Bytes(part, ways) => self.each(ways, |way| way.faults.byte_errors = part),
            Action::Stall(time, ways) => self.each(ways, |way| way.hold(now + time)),
            Action::Freeze(time) => self.frozen_until = now + time,
            Action::Hostile(hostile) => (self.hostile, self.next_flood) = (Some(hostile), now),
            Action::OtherPolls(axis, period) => {
                self.poller = Some(Poller { axis, period, next: now })
            }
            Action::OtherStops(axis) => self.other_says(&Stop { target: StopTarget::Axis(axis) }),
            Action::OtherEStops => self.other_says(&EStop {}),
            Action::StuckBaud => self.has_stuck_baud = true,
            Action::Reset => self.world.borrow_mut().reset(BootReason::Pin, ""),
        }
    }

    fn each(&mut self, ways: Ways, mut what: impl FnMut(&mut Channel)) {
        if ways.to_gateway {
            what(&mut self.to_gateway);
        }
        if ways.to_host {
            what(&mut self.to_host);
        }
    }

    fn other_says<C: Call>(&mut self, request: &C) {
        let mut frame = [0; MAX_FRAME];
        self.other_sequence = self.other_sequence.wrapping_add(1);
        let length = encode(Kind::Request, self.other_sequence, C::NUMBER, request, &mut frame);
        let bytes = frame.get(..length.unwrap_or(0)).unwrap_or_default();
        self.world.borrow_mut().host_send(OTHER_LINK, bytes);
    }

    /// Lets time pass, at most to `until`, and no further than to the arrival of bytes if the
    /// program waits for them.
    pub fn advance(&mut self, until: Duration, awaits_bytes: bool) {
        loop {
            self.do_what_is_due();
            let now = self.now();
            let is_frozen = now < self.frozen_until;
            if awaits_bytes && !is_frozen && !self.unread.is_empty() {
                return;
            }
            let until = until.max(self.frozen_until);
            if now >= until {
                return;
            }
            let world = self.world.borrow_mut().next_event();
            let planned = self.to_come.iter().filter_map(|(at, _, _)| *at);
            let next = world
                .map(|at| Duration::from_micros(at.as_micros()))
                .into_iter()
                .chain(planned)
                .chain(self.to_gateway.next())
                .chain(self.to_host.next())
                .chain(self.poller.as_ref().map(|poller| poller.next))
                .chain(self.floods().then_some(self.next_flood))
                .fold(until, Duration::min);
            let micros = u64::try_from(next.as_nanos().div_ceil(1_000)).unwrap_or(u64::MAX);
            self.world.borrow_mut().run_until(gateway::Instant::from_micros(micros));
        }
    }

    fn floods(&self) -> bool {
        matches!(self.hostile, Some(Hostile::Events | Hostile::Noise))
    }

    fn do_what_is_due(&mut self) {
        let now = self.now();
        while let Some(at) =
            self.to_come.iter().position(|(at, _, _)| at.is_some_and(|at| at <= now))
        {
            let (_, _, action) = self.to_come.remove(at);
            self.happen(&action);
        }
        while let Some(poller) = self.poller.as_mut().filter(|poller| poller.next <= now) {
            poller.next += poller.period;
            let axis = poller.axis;
            self.other_says(&ReadState { axis });
        }
        while let Some(bytes) = self.to_gateway.pop(now) {
            self.world.borrow_mut().host_send(LINK, &bytes);
        }
        self.world.borrow_mut().host_receive(OTHER_LINK);
        let received = self.world.borrow_mut().host_receive(LINK);
        for byte in received {
            self.partial.push(byte);
            if byte == 0 && self.partial.iter().any(|byte| *byte != 0) {
                let frame = std::mem::take(&mut self.partial);
                let frame = forge::forge(self.hostile, &frame, &mut self.random).unwrap_or(frame);
                self.to_host.push(now, &frame, &mut self.random);
            }
        }
        if self.floods() && self.next_flood <= now {
            self.next_flood = now + FLOOD_PERIOD;
            let bytes = forge::flood(self.hostile, &mut self.random);
            self.to_host.push(now, &bytes, &mut self.random);
        }
        while let Some(bytes) = self.to_host.pop(now) {
            self.unread.extend(bytes);
        }
    }

    fn note(&mut self, bytes: &[u8]) {
        let mut deframer = Deframer::new();
        let mut names = Vec::new();
        for byte in bytes {
            if let Some(Ok(frame)) = deframer.push(*byte) {
                names.push(request_name(frame.number).unwrap_or("?"));
            }
        }
        for name in names {
            let at = self.elapsed();
            self.written.push(Written { at, name });
            let count = self.written.iter().filter(|written| written.name == name).count();
            let now = self.now();
            for (at, moment, _) in &mut self.to_come {
                if let Moment::Frame { name: wanted, count: nth, plus } = moment
                    && wanted == name
                    && *nth == count
                {
                    *at = Some(now + *plus);
                }
            }
        }
    }
}

/// The program's end of the line.
#[derive(Clone)]
pub struct Wire(pub Rc<RefCell<Line>>);

impl Transport for Wire {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut line = self.0.borrow_mut();
        let now = line.now();
        line.advance(now, false);
        if line.closed {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let now = line.now();
        let Line { to_gateway, random, .. } = &mut *line;
        to_gateway.push(now, bytes, random);
        line.note(bytes);
        line.do_what_is_due();
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut line = self.0.borrow_mut();
        if line.floods() && line.unread.is_empty() {
            // A program that reads as fast as it can always finds something.
            let next = line.next_flood;
            line.advance(next, false);
        }
        let until = line.now().saturating_add(timeout);
        line.advance(until, true);
        if line.closed {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let count = line.unread.len().min(buffer.len());
        for (place, byte) in buffer.iter_mut().zip(line.unread.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn now(&self) -> Duration {
        self.0.borrow().now()
    }

    fn sleep(&mut self, duration: Duration) {
        let mut line = self.0.borrow_mut();
        let until = line.now().saturating_add(duration);
        line.advance(until, false);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        let mut line = self.0.borrow_mut();
        if line.now() < line.closed_until {
            return Err(io::ErrorKind::ConnectionRefused.into());
        }
        line.closed = false;
        line.unread.clear();
        line.to_gateway.clear();
        line.to_host.clear();
        line.world.borrow_mut().set_host_baud(LINK, DEFAULT_BAUD);
        Ok(())
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        let line = self.0.borrow();
        if !line.has_stuck_baud {
            line.world.borrow_mut().set_host_baud(LINK, baud);
        }
        Ok(())
    }

    fn wanted_baud(&self) -> Option<u32> {
        self.0.borrow().wanted_baud
    }
}
