//! The gateway's end of one bus, as its contract in the core asks for it.

use std::collections::VecDeque;
use std::time::Duration;

use gateway::port::TRANSMIT_SLOTS;
use gateway::{BusSetup, Outgoing, PAUSE_BITS, Transmit};
use host_protocol::{BusKind, CanFrame};

use super::behind_reply::BehindReply;
use crate::bus::{BusFault, Station, Wire, bit_time};
use crate::can::CanBus;
use crate::motors::Outgoing as MotorMessage;
use crate::rs485::SerialLine;

/// The medium of a bus.
#[derive(Debug)]
pub(super) enum Medium {
    Can(CanBus),
    Serial { line: SerialLine, next: BehindReply },
}

/// A bus and what the gateway has handed to it.
#[derive(Debug)]
pub(super) struct Port {
    pub(super) medium: Medium,
    setup: Option<BusSetup>,
    /// Bitrate of the motor that was connected first.
    motors_bitrate: Option<u32>,
    /// A foreign station is connected.
    has_stranger: bool,
    /// What the stranger sends again and again, one after the other.
    babble: VecDeque<CanFrame>,
    held: [bool; TRANSMIT_SLOTS],
}

impl Port {
    pub(super) fn new(kind: BusKind) -> Self {
        let medium = match kind {
            BusKind::Can => Medium::Can(CanBus::default()),
            BusKind::Rs485 => {
                Medium::Serial { line: SerialLine::default(), next: BehindReply::default() }
            }
        };
        let held = [false; TRANSMIT_SLOTS];
        Self {
            medium,
            setup: None,
            motors_bitrate: None,
            has_stranger: false,
            babble: VecDeque::new(),
            held,
        }
    }

    pub(super) fn connect_motor(&mut self, motor: Station, bitrate: u32) {
        self.motors_bitrate.get_or_insert(bitrate);
        match &mut self.medium {
            Medium::Can(bus) => bus.start(Duration::ZERO, motor, bitrate),
            Medium::Serial { line, .. } => line.start(motor, bitrate, false),
        }
    }

    /// A motor has another bitrate from now on.
    pub(super) fn restart_motor(&mut self, now: Duration, motor: Station, bitrate: u32) {
        match &mut self.medium {
            Medium::Can(bus) => bus.start(now, motor, bitrate),
            Medium::Serial { line, .. } => line.start(motor, bitrate, false),
        }
    }

    /// Starts the gateway's controller if the setup is new; whether it was.
    pub(super) fn set_up(&mut self, now: Duration, setup: Option<BusSetup>) -> bool {
        if setup.is_none() && self.setup.is_some() {
            self.reset(now);
        }
        let Some(new) = setup.filter(|new| self.setup != Some(*new)) else { return false };
        self.setup = setup;
        self.held = [false; TRANSMIT_SLOTS];
        match &mut self.medium {
            Medium::Can(bus) => bus.start_in(now, Station::Gateway, new.bitrate, new.mode),
            Medium::Serial { line, next } => {
                *next = BehindReply::default();
                line.start(Station::Gateway, new.bitrate, true);
            }
        }
        true
    }

    /// The gateway's controller is switched off until it is set up again.
    pub(super) fn reset(&mut self, now: Duration) {
        self.setup = None;
        self.held = [false; TRANSMIT_SLOTS];
        match &mut self.medium {
            Medium::Can(bus) => bus.stop(now, Station::Gateway),
            Medium::Serial { line, next } => {
                *next = BehindReply::default();
                line.stop(Station::Gateway);
            }
        }
    }

    /// Whether the gateway may hand a frame over.
    pub(super) fn takes_frames(&self) -> bool {
        let running = match &self.medium {
            Medium::Can(bus) => bus.is_running(Station::Gateway),
            Medium::Serial { .. } => true,
        };
        self.setup.is_some() && running
    }

    /// Takes a frame of the gateway.
    ///
    /// # Panics
    /// If the core breaks the contract of its port: a slot still in use, or a frame for another
    /// kind of bus.
    pub(super) fn take(&mut self, now: Duration, transmit: Transmit) {
        let Transmit { slot, frame, behind_reply, .. } = transmit;
        let held =
            self.held.get_mut(usize::from(slot)).expect("the core used a slot that does not exist");
        assert!(
            !std::mem::replace(held, true),
            "the core used slot {slot} while its frame had not left"
        );
        match (&mut self.medium, frame) {
            (Medium::Can(bus), Outgoing::Can(frame)) => {
                bus.send(Station::Gateway, slot, frame, false)
            }
            (Medium::Serial { next, .. }, Outgoing::Serial(bytes)) if behind_reply => {
                next.keep(slot, bytes.to_vec());
            }
            (Medium::Serial { line, next }, Outgoing::Serial(bytes)) => {
                next.began(bytes.len());
                line.send(now, Station::Gateway, slot, bytes.to_vec());
            }
            (_, frame) => panic!("the core sent {frame:?} to the wrong kind of bus"),
        }
    }

    /// The gateway asks a frame back. Returns whether it has it at once; a CAN controller says later
    /// what has become of it.
    pub(super) fn cancel(&mut self, slot: u8) -> bool {
        match &mut self.medium {
            Medium::Can(bus) => {
                bus.cancel(Station::Gateway, slot);
                false
            }
            Medium::Serial { next, .. } => next.give_back(slot) && self.release(slot),
        }
    }

    /// The gateway hears a byte. Returns whether it ends the reply that a frame waits for.
    pub(super) fn hears(&mut self, now: Duration) -> bool {
        let (Medium::Serial { next, .. }, Some(setup)) = (&mut self.medium, self.setup) else {
            return false;
        };
        next.hears(now, bit_time(PAUSE_BITS, setup.bitrate))
    }

    /// A frame of the gateway has left; whether it held one in that slot.
    pub(super) fn release(&mut self, slot: u8) -> bool {
        self.held.get_mut(usize::from(slot)).is_some_and(std::mem::take)
    }

    /// The controller has dropped every frame.
    pub(super) fn release_all(&mut self) {
        self.held = [false; TRANSMIT_SLOTS];
    }

    pub(super) fn send_motor(&mut self, now: Duration, motor: Station, message: MotorMessage) {
        match (&mut self.medium, message.wire) {
            (Medium::Can(bus), Wire::Can(frame)) => bus.send(motor, 0, frame, message.corrupt),
            (Medium::Serial { line, .. }, Wire::Serial(bytes)) => line.send(now, motor, 0, bytes),
            // A motor is made for the kind of bus that it is wired to.
            _ => {}
        }
    }

    /// A foreign station sends something, at the bitrate that is usual there.
    /// A wire of another kind of bus goes nowhere.
    pub(super) fn send_stranger(&mut self, now: Duration, wire: Wire) {
        let bitrate = self.setup.map(|setup| setup.bitrate).or(self.motors_bitrate);
        let Some(bitrate) = bitrate else { return };
        let is_new = !std::mem::replace(&mut self.has_stranger, true);
        match (&mut self.medium, wire) {
            (Medium::Can(bus), Wire::Can(frame)) => {
                if is_new {
                    bus.start(now, Station::Stranger, bitrate);
                }
                bus.send(Station::Stranger, 0, frame, false);
            }
            (Medium::Serial { line, .. }, Wire::Serial(bytes)) => {
                if is_new {
                    line.start(Station::Stranger, bitrate, false);
                }
                line.send(now, Station::Stranger, 0, bytes);
            }
            _ => {}
        }
    }

    /// The stranger sends these frames in turn, as fast as the bus takes them; none to end it.
    pub(super) fn babble(&mut self, now: Duration, frames: VecDeque<CanFrame>) {
        let was_silent = self.babble.is_empty();
        self.babble = frames;
        if was_silent {
            self.go_on_babbling(now);
        }
    }

    /// The stranger's frame has left: the next one.
    pub(super) fn go_on_babbling(&mut self, now: Duration) {
        if let Some(frame) = self.babble.front().copied() {
            self.babble.rotate_left(1);
            self.send_stranger(now, Wire::Can(frame));
        }
    }

    pub(super) fn set_fault(&mut self, now: Duration, fault: BusFault) {
        match &mut self.medium {
            Medium::Can(bus) => bus.set_fault(now, fault),
            Medium::Serial { line, .. } => line.set_fault(fault),
        }
    }

    pub(super) fn set_plugged(&mut self, now: Duration, motor: Station, plugged: bool) {
        match &mut self.medium {
            Medium::Can(bus) => bus.set_plugged(now, motor, plugged),
            Medium::Serial { line, .. } => line.set_plugged(motor, plugged),
        }
    }

    pub(super) fn next_event(&self) -> Option<Duration> {
        match &self.medium {
            Medium::Can(bus) => bus.next_event(),
            Medium::Serial { line, next } => {
                line.next_event().into_iter().chain(next.begins_at()).min()
            }
        }
    }

    pub(super) fn finish(&mut self, now: Duration) {
        match &mut self.medium {
            Medium::Can(bus) => bus.finish(now),
            Medium::Serial { line, next } => {
                line.finish(now);
                if let Some((slot, bytes)) = next.take_due(now) {
                    next.began(bytes.len());
                    line.send(now, Station::Gateway, slot, bytes);
                }
            }
        }
    }

    /// Starts what may start, after everybody has handed over what they have at this instant.
    pub(super) fn arbitrate(&mut self, now: Duration) {
        if let Medium::Can(bus) = &mut self.medium {
            bus.arbitrate(now);
        }
    }
}
