//! The ports of the core: what it takes in and hands out, with the model as witness.

use super::{MAX_AT_ONCE, World};
use crate::bus::{arbitration, can_frame};
use crate::plant::{BUSES, LINKS};
use gateway::{
    Event, FlightPage, FlightReadError, Gateway, Instant, MAX_SNAPSHOT, Outgoing, SaveError, Set,
    Then, Transmit, port::TRANSMIT_SLOTS,
};
use host_protocol::{BusState, Deframer, EventMessage, Kind, MAX_FRAME, Reply};
use promise_model::Frame;

/// Frames that a link may have for its host at one moment.
const MAX_OUTPUT: usize = 300;

/// So often the gateway goes on from a snapshot.
const EVENTS_PER_SNAPSHOT: u64 = 1_000;

/// An event on its way to the core.
#[derive(Debug, Clone)]
pub(super) enum Input {
    Host { link: u8, bytes: Vec<u8> },
    Can { bus: u8, id: u32, data: Vec<u8> },
    Serial { bus: u8, bytes: Vec<u8> },
    Transmitted { bus: u8, slot: u8 },
    Cancelled { bus: u8, slot: u8 },
    State { bus: u8, off: bool },
    Errors { bus: u8, transmit: u16, receive: u16 },
    Overflow { bus: u8 },
    Pin { open: bool },
    Stored { done: bool },
    Flight(Result<&'static [u8], FlightReadError>),
    Tick,
}

/// Something that a bus was told.
enum Sent {
    AskedBack { bus: u8, slot: u8 },
    Handed { bus: u8, transmit: Transmit },
}

impl World {
    pub(super) fn feed(&mut self, input: Input) {
        self.inputs.push_back(input);
        let mut at_once = 0;
        while let Some(input) = self.inputs.pop_front() {
            at_once += 1;
            if at_once > MAX_AT_ONCE {
                self.oracle.never_rests(self.now_us);
                self.inputs.clear();
                return;
            }
            if matches!(input, Input::Host { .. }) && self.life.links_open_by().is_some() {
                continue;
            }
            self.take_in(&input);
            let sent = self.send();
            self.tell();
            if self.life.is_reset() {
                self.reset(true);
                continue;
            }
            // What the frames follow from, the model learns from what the hosts are told.
            sent.into_iter().for_each(|sent| self.witness(sent));
            self.oracle.settle(self.now_us);
            self.count();
            // Of stops of many axes a tick leaves the next ones due.
            let may_be_due = self.gateway.stops_under_way();
            if matches!(input, Input::Tick) && self.inputs.is_empty() && !may_be_due {
                let deadline = self.gateway.next_deadline().map(Instant::as_micros);
                let is_over = deadline.is_none_or(|at| at > self.now_us);
                assert!(is_over, "{} µs: a tick leaves {deadline:?} due", self.now_us);
            }
        }
    }

    /// The core takes in an event, and the model sees what it was.
    fn take_in(&mut self, input: &Input) {
        let now = self.now_us;
        if !matches!(input, Input::Tick) {
            self.note(|| format!("in  {input:X?}"));
        }
        if let Input::State { bus, off } = input {
            self.buses[usize::from(*bus)].is_off = *off;
            if *off {
                self.drop_held(*bus);
            }
        }
        let oracle = &mut self.oracle;
        let event = match input {
            Input::Host { link, bytes } => {
                oracle.to_gateway(now, *link, bytes);
                Event::HostBytes { link: *link, bytes }
            }
            Input::Can { bus, id, data } => {
                let Some(frame) = can_frame(*id, data) else { return };
                oracle.received(now, *bus, Frame::Can(*id, data));
                Event::CanReceived { bus: *bus, frame }
            }
            Input::Serial { bus, bytes } => {
                oracle.received(now, *bus, Frame::Serial(bytes));
                let next = self.buses[usize::from(*bus)].hears(now, bytes.len());
                if let Some(Outgoing::Serial(next)) = &next {
                    oracle.begins(now, *bus, next);
                    self.counts.behind_replies += 1;
                }
                let then = if next.is_some() { Then::Frame } else { Then::Bytes };
                Event::SerialReceived { bus: *bus, bytes, then }
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
            Input::Errors { bus, transmit: transmit_errors, receive: receive_errors } => {
                let state = match transmit_errors.max(receive_errors) {
                    ..96 => BusState::Active,
                    96..128 => BusState::Warning,
                    _ => BusState::Passive,
                };
                let (transmit_errors, receive_errors) = (*transmit_errors, *receive_errors);
                Event::BusState { bus: *bus, state, transmit_errors, receive_errors }
            }
            Input::Overflow { bus } => {
                oracle.overflow(*bus, 1);
                Event::ReceiveOverflow { bus: *bus, lost: 1 }
            }
            Input::Pin { open } => {
                self.life.set_e_stop(*open);
                oracle.e_stop_input(now, *open);
                Event::EStopInput { open: *open }
            }
            Input::Stored { done } => {
                let result = if *done { Ok(()) } else { Err(SaveError::Failed) };
                Event::Saved { result }
            }
            Input::Flight(bytes) => {
                let page = |bytes| FlightPage { id: 1, parts: 1, length: 10, bytes };
                Event::FlightRecord { result: bytes.map(page) }
            }
            Input::Tick => Event::Tick,
        };
        self.tick_is_late = !matches!(input, Input::Tick) && self.tick_due_us <= now;
        self.counts.events += 1;
        self.counts.busy += u64::from(self.oracle.is_busy());
        self.life.suspend_reset(self.oracle.is_configuring());
        self.go_on_from_a_snapshot();
        let changes = self.gateway.handle(Instant::from_micros(now), event, &mut self.life.store());
        self.named = self.named.with(changes.buses);
        self.life.stored(self.oracle.latches(now));
        if changes.save {
            self.store();
        }
        if changes.flight_read {
            self.read_flight_record();
        }
    }

    /// The flight recorder has something, refuses, or does not answer; the time chooses which.
    fn read_flight_record(&mut self) {
        let Some(read) = self.gateway.take_flight_read() else { return };
        self.note(|| format!("out the flight recorder: {read:?}"));
        let bytes = [&[7; 10][..], &[]][usize::from(read.offset > 9)];
        let answer = match self.now_us % 4 {
            0 => return,
            1 => Err(FlightReadError::Recording),
            _ => Ok(bytes),
        };
        self.inputs.push_back(Input::Flight(answer));
    }

    /// Now and then the gateway is another one, which goes on from a snapshot: nobody notices.
    fn go_on_from_a_snapshot(&mut self) {
        if !self.counts.events.is_multiple_of(EVENTS_PER_SNAPSHOT) {
            return;
        }
        let mut bytes = vec![0; MAX_SNAPSHOT];
        let taken = self.gateway.snapshot(&mut bytes).expect("it fits").to_vec();
        let board = self.gateway.board();
        let (mut resumed, behind) = Gateway::resume(board, &taken).expect("it can be read");
        assert_eq!(behind, [], "it is all of it");
        assert_eq!(resumed.snapshot(&mut bytes), Some(&taken[..]), "it is the same");
        *self.gateway = resumed;
    }

    /// Everything that the gateway has to say to its hosts, when the buses have had their frames.
    fn tell(&mut self) {
        while !self.gateway.save_some(&mut self.life.store()) {}
        let now = self.now_us;
        let mut out = [0; MAX_FRAME];
        for link in 0..LINKS {
            if now < self.hosts[usize::from(link)].unread_until
                || self.life.links_open_by().is_some()
            {
                continue;
            }
            let mut frames = 0;
            loop {
                let length = self.gateway.poll_host(link, &mut out, &mut self.life.store());
                let Some(length) = length else { break };
                if !self.life.takes_step(false) {
                    return;
                }
                frames += 1;
                assert!(frames <= MAX_OUTPUT, "link {link} does not stop talking");
                self.oracle.from_gateway(now, link, &out[..length]);
                self.note(|| format!("host {link} {}", told(&out[..length])));
            }
            if !self.life.is_reset() {
                self.oracle.drained(now, link);
            }
        }
    }

    /// Everything that the gateway wants to send on its buses: what the model has to see of it.
    fn send(&mut self) -> Vec<Sent> {
        let mut sent = Vec::new();
        let now = self.now_us;
        let at = Instant::from_micros(now);
        for bus in 0..BUSES {
            if self.life.is_reset() || self.start_bus(bus) {
                continue;
            }
            while let Some(slot) = self.gateway.poll_cancel(at, bus) {
                self.check_named(bus);
                if !self.life.takes_step(false) {
                    return sent;
                }
                self.note(|| format!("out bus {bus} slot {slot} is asked back"));
                sent.push(Sent::AskedBack { bus, slot });
                if self.buses[usize::from(bus)].give_back(now, slot) {
                    self.inputs.push_back(Input::Cancelled { bus, slot });
                }
            }
            let (mut frames, mut goes_alone) = (0, false);
            while let Some(transmit) = self.gateway.poll_transmit(at, bus) {
                self.check_named(bus);
                if !self.life.takes_step(false) {
                    return sent;
                }
                frames += 1;
                assert!(frames <= TRANSMIT_SLOTS, "bus {bus} is handed more than it can hold");
                assert!(!goes_alone, "bus {bus} is handed a frame beside one that goes alone");
                goes_alone = transmit.is_alone;
                #[cfg(test)]
                if self.swallows.is_some_and(|swallows| swallows(&transmit.frame)) {
                    self.inputs.push_back(Input::Transmitted { bus, slot: transmit.slot });
                    continue;
                }
                #[cfg(test)]
                if self.returns {
                    self.inputs.push_back(Input::Cancelled { bus, slot: transmit.slot });
                    continue;
                }
                self.note(|| format!("out bus {bus} slot {} {:X?}", transmit.slot, transmit.frame));
                sent.push(Sent::Handed { bus, transmit: transmit.clone() });
                self.buses[usize::from(bus)].take(transmit);
            }
            self.buses[usize::from(bus)].begin(now);
            self.named = self.named.without(Set::of(bus));
        }
        self.named = self.named.with(self.gateway.take_changes().buses);
        sent
    }

    /// Who polls only the buses that the core names misses nothing, but for what a tick that is late
    /// will name.
    fn check_named(&mut self, bus: u8) {
        if !self.named.has(bus) && !self.tick_is_late {
            self.oracle.not_named(self.now_us, bus);
        }
    }

    /// The model sees what the buses were handed.
    fn witness(&mut self, sent: Sent) {
        match sent {
            Sent::AskedBack { bus, slot } => self.oracle.asked_back(self.now_us, bus, slot),
            Sent::Handed { bus, transmit } => {
                let frame = match &transmit.frame {
                    Outgoing::Can(frame) => Frame::Can(arbitration(frame), frame.data()),
                    Outgoing::Serial(bytes) => Frame::Serial(bytes),
                };
                match transmit.behind_reply {
                    true => self.oracle.handed_behind_reply(self.now_us, bus, transmit.slot, frame),
                    false => self.oracle.handed(self.now_us, bus, transmit.slot, frame),
                }
            }
        }
    }

    /// Starts a bus if the gateway wants it otherwise.
    fn start_bus(&mut self, bus: u8) -> bool {
        let index = usize::from(bus);
        let generation = self.gateway.bus_setup(bus).map(|setup| setup.generation);
        let starts = self.buses[index].generation != generation;
        if starts {
            self.buses[index].generation = generation;
            self.drop_held(bus);
            let off = self.now_us < self.buses[index].short_until;
            self.inputs.push_back(Input::State { bus, off });
        }
        starts
    }
}

/// What a frame for a host says.
fn told(bytes: &[u8]) -> String {
    let mut deframer = Deframer::new();
    let mut said = String::new();
    for byte in bytes {
        let Some(Ok(frame)) = deframer.push(*byte) else { continue };
        said = match frame.kind {
            Kind::Reply => {
                format!("{} {:?}", frame.sequence, Reply::decode(frame.number, frame.body))
            }
            Kind::Error => {
                format!(
                    "{} {:?}",
                    frame.sequence,
                    host_protocol::Error::decode(frame.number, frame.body)
                )
            }
            _ => format!(
                "{:?}",
                EventMessage::decode(frame.number, frame.body).map(|message| message.event)
            ),
        };
    }
    said
}
