//! The other nodes of a bus: a peer with its own bit rate and its own error counters.

use rigless::chip::can::{Frame, Offer, Peer};
use rigless::chip::{Place, Timeline};
use rigless::device::DeviceContext;
use rigless::snapshot::store;
use rigless::time::{EventId, VirtualNanos};
use serde::{Deserialize, Serialize};

use super::BitTime;
use super::controller::SEQUENCE_BITS;

/// Error counters of a node (ISO 11898-1).
const PASSIVE: u16 = 128;
const BUS_OFF: u16 = 256;
const HEAVY: u16 = 8;
/// Sequences of 11 recessive bits after which a node that went bus-off comes back by itself.
const RECOVERY_SEQUENCES: u64 = 128;

/// How the controller is wired to the other nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Wiring {
    /// As it should be.
    #[default]
    Connected,
    /// The cable is off: the controller is alone, and what the others do meanwhile is not
    /// simulated.
    Cut,
    /// CANH touches CANL: the line stays recessive whatever a node sends.
    Shorted,
}

/// One node.
#[derive(Debug)]
pub struct Node {
    place: Place<dyn Peer>,
    /// `None`: the controller's own, whatever that is.
    bit: Option<BitTime>,
    health: Health,
}

store!(Node { values: [bit, health], parts: [place], built: [] });

/// Error counters and what follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Health {
    transmit: u16,
    receive: u16,
    /// It sends nothing before this instant.
    suspended_until: VirtualNanos,
    /// It is bus-off before this instant.
    off_until: VirtualNanos,
}

impl Node {
    pub(super) fn new(peer: Box<dyn Peer>, bitrate: Option<u32>) -> Self {
        Self {
            place: Place::new(peer),
            bit: bitrate.and_then(BitTime::of_bitrate),
            health: Health {
                transmit: 0,
                receive: 0,
                suspended_until: VirtualNanos(0),
                off_until: VirtualNanos(0),
            },
        }
    }

    /// What hangs here, as the type that it was hung as.
    ///
    /// # Panics
    ///
    /// If it is another type.
    pub fn peer_mut<P: Peer>(&mut self) -> &mut P {
        self.place.chip_as().expect("a node of the type that was hung here")
    }

    /// Cuts this node off, or connects it again: silent it hears nothing, sends nothing and
    /// acknowledges nothing.
    pub fn silence(&mut self, silent: bool) {
        self.place.silence(silent);
    }

    /// Has it run at another bitrate from now on, in bits per second.
    pub fn set_bitrate(&mut self, bitrate: u32) {
        self.bit = BitTime::of_bitrate(bitrate);
    }

    /// Its transmit and receive error counters.
    #[must_use]
    pub fn error_counters(&self) -> (u16, u16) {
        (self.health.transmit, self.health.receive)
    }

    /// Whether it takes part in the bus.
    pub(super) fn is_on(&mut self, now: VirtualNanos) -> bool {
        now >= self.health.off_until && self.place.answering().is_some()
    }

    /// Whether its error flags destroy frames.
    pub(super) fn is_error_active(&self) -> bool {
        self.health.transmit < PASSIVE && self.health.receive < PASSIVE
    }

    /// Its bit, where the controller has this one.
    pub(super) fn bit(&self, controller: Option<BitTime>) -> Option<BitTime> {
        self.bit.or(controller)
    }

    /// What it wants to send, and from when on it may.
    pub(super) fn offer(&mut self) -> Option<(Offer, VirtualNanos)> {
        let offer = self.place.answering()?.offer()?;
        Some((offer, offer.since.max(self.health.suspended_until).max(self.health.off_until)))
    }

    /// Whether it drives an error flag into a frame of the controller.
    pub(super) fn disturbs(&mut self, frame: &Frame) -> bool {
        self.place.answering().is_some_and(|peer| peer.disturbs(frame))
    }

    /// A frame from another node is valid.
    pub(super) fn receive(&mut self, frame: &Frame, context: &mut DeviceContext<'_>) {
        self.health.receive = self.health.receive.min(PASSIVE).saturating_sub(1);
        self.hand(context, |peer, timeline| peer.receive(frame, timeline));
    }

    /// A frame from another node is destroyed; `first`: it was the first to say so.
    pub(super) fn receive_failed(&mut self, first: bool) {
        let by = if first { 1 + HEAVY } else { 1 };
        self.health.receive = (self.health.receive + by).min(PASSIVE);
    }

    /// The frame that it sent has ended well.
    pub(super) fn sent(&mut self, context: &mut DeviceContext<'_>) {
        self.health.transmit = self.health.transmit.saturating_sub(1);
        self.hand(context, |peer, timeline| peer.sent(true, timeline));
    }

    /// The frame that it sent has failed, for want of an acknowledgement or not. The bus is free at
    /// `free`.
    pub(super) fn send_failed(
        &mut self,
        unacknowledged: bool,
        free: VirtualNanos,
        bit: BitTime,
        context: &mut DeviceContext<'_>,
    ) {
        if self.is_error_active() || !unacknowledged {
            self.health.transmit += HEAVY;
        }
        if self.health.transmit >= BUS_OFF {
            self.health.transmit = 0;
            self.health.receive = 0;
            self.health.off_until = bit.after(free, RECOVERY_SEQUENCES * SEQUENCE_BITS);
        } else if !self.is_error_active() {
            self.health.suspended_until =
                bit.after(free, u64::from(rigless::chip::can::SUSPEND_BITS));
        }
        self.hand(context, |peer, timeline| peer.sent(false, timeline));
    }

    /// An event of the controller's slot: perhaps the peer's.
    pub(super) fn on_event(&mut self, event: EventId, context: &mut DeviceContext<'_>) {
        self.place.chip_mut().on_event(event, &mut Timeline::new(context));
    }

    pub(super) fn part_restarted(&mut self, context: &mut DeviceContext<'_>) {
        self.place.chip_mut().restarted(&mut Timeline::new(context));
    }

    /// Hands the peer a call as one transaction of its place.
    fn hand(
        &mut self,
        context: &mut DeviceContext<'_>,
        call: impl FnOnce(&mut dyn Peer, &mut Timeline<'_, '_>),
    ) {
        self.place.begin();
        if let Some(peer) = self.place.answering() {
            call(peer, &mut Timeline::new(context));
        }
        self.place.release();
    }
}
