//! A CAN bus for the unit tests of nodes: the test plays the controller, which acknowledges
//! everything.

use std::any::Any;
use std::time::Duration;

use host_protocol::CanFrame;
use rigless::chip::Timeline;
use rigless::chip::can::{Fault, Frame, INTERMISSION_BITS, Peer};
use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::mcu::{Operate, Single};
use rigless::soc::stm32h743::builder;
use rigless::soc::stm32h743::generated::fdcan1::Register;
use rigless::time::{EventId, NANOS_PER_SECOND, VirtualNanos};

use super::{from_bus, instant, since_start, to_bus};

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    Delivered,
    /// A node broke it.
    Disturbed,
    /// It was sent with a fault.
    Damaged(Fault),
}

/// A frame that was on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry {
    pub(crate) start: Duration,
    pub(crate) frame: CanFrame,
    pub(crate) outcome: Outcome,
}

/// The frame of a node on its way.
struct Flight {
    nth: usize,
    entry: Entry,
    valid: Option<EventId>,
    end: EventId,
}

struct Medium {
    peers: Vec<Box<dyn Peer>>,
    bitrate: u64,
    flight: Option<Flight>,
    free_at: VirtualNanos,
    log: Vec<Entry>,
}

impl Medium {
    fn after(&self, start: VirtualNanos, bits: u32) -> VirtualNanos {
        VirtualNanos(start.0 + u64::from(bits) * NANOS_PER_SECOND / self.bitrate)
    }

    fn deliver(&mut self, frame: &Frame, except: Option<usize>, context: &mut DeviceContext<'_>) {
        for (nth, peer) in self.peers.iter_mut().enumerate() {
            if Some(nth) != except {
                peer.receive(frame, &mut Timeline::new(context));
            }
        }
    }

    /// Starts the frame of the node that wins, or comes back when one may start.
    fn arbitrate(&mut self, context: &mut DeviceContext<'_>) {
        if self.flight.is_some() {
            return;
        }
        let now = context.now();
        let offers =
            || self.peers.iter().enumerate().filter_map(|(nth, peer)| Some((nth, peer.offer()?)));
        let Some(start) = offers().map(|(_, offer)| offer.since.max(self.free_at)).min() else {
            return;
        };
        if start > now {
            context.schedule(start);
            return;
        }
        let ready = offers().filter(|(_, offer)| offer.since <= now);
        let Some((nth, offer)) =
            ready.min_by(|(_, one), (_, other)| one.frame.arbitrates(&other.frame))
        else {
            return;
        };
        let outcome = offer.fault.map_or(Outcome::Delivered, Outcome::Damaged);
        let frame = from_bus(&offer.frame).expect("a frame of the project");
        let valid = (outcome == Outcome::Delivered)
            .then(|| context.schedule(self.after(now, offer.frame.bits_until_valid())));
        let end = self.after(now, offer.frame.bits_on_the_wire());
        self.free_at = self.after(end, INTERMISSION_BITS);
        let entry = Entry { start: since_start(now), frame, outcome };
        self.flight = Some(Flight { nth, entry, valid, end: context.schedule(end) });
    }
}

impl Device for Medium {
    type Register = Register;

    fn on_event(
        &mut self,
        event: EventId,
        _registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if let Some(flight) = self.flight.take_if(|flight| flight.end == event) {
            let acknowledged = flight.entry.outcome == Outcome::Delivered;
            self.log.push(flight.entry);
            self.peers[flight.nth].sent(acknowledged, &mut Timeline::new(context));
        } else if let Some(Flight { nth, entry, .. }) =
            self.flight.as_ref().filter(|flight| flight.valid == Some(event))
        {
            let (nth, frame) = (*nth, to_bus(&entry.frame));
            self.deliver(&frame, Some(nth), context);
        }
        for peer in &mut self.peers {
            peer.on_event(event, &mut Timeline::new(context));
        }
        self.arbitrate(context);
    }
}

/// The bus.
pub(crate) struct TestBus {
    part: Single<Medium>,
    now: Duration,
}

impl TestBus {
    pub(crate) fn new(bitrate: u64) -> Self {
        let medium = Medium {
            peers: Vec::new(),
            bitrate,
            flight: None,
            free_at: VirtualNanos(0),
            log: Vec::new(),
        };
        let part = Single::new(builder(), "FDCAN1", medium).expect("the part has the controller");
        Self { part, now: Duration::ZERO }
    }

    /// Hangs a node on the bus; its index.
    pub(crate) fn attach(&mut self, peer: impl Peer) -> usize {
        self.part.model.peers.push(Box::new(peer));
        self.part.model.peers.len() - 1
    }

    /// A node, as the type that it was hung as.
    pub(crate) fn peer<P: Peer>(&mut self, nth: usize) -> &mut P {
        let peer: &mut dyn Any = &mut *self.part.model.peers[nth];
        peer.downcast_mut().expect("a node of this type")
    }

    /// Changes a node now.
    pub(crate) fn drive<P: Peer>(
        &mut self,
        nth: usize,
        change: impl FnOnce(&mut P, &mut Timeline<'_, '_>),
    ) {
        self.part.drive(instant(self.now), |medium, _, context| {
            let peer: &mut dyn Any = &mut *medium.peers[nth];
            let peer = peer.downcast_mut().expect("a node of this type");
            change(peer, &mut Timeline::new(context));
            medium.arbitrate(context);
        });
    }

    /// The part has restarted and every event is gone.
    pub(crate) fn restart_part(&mut self) {
        self.part.reset_every_model();
        self.part.model.flight = None;
        self.part.drive(instant(self.now), |medium, _, context| {
            medium.peers.iter_mut().for_each(|peer| peer.restarted(&mut Timeline::new(context)));
        });
    }

    /// The frames that nodes have sent.
    pub(crate) fn log(&self) -> &[Entry] {
        &self.part.model.log
    }

    /// Lets time pass.
    pub(crate) fn run_until(&mut self, until: Duration) {
        self.part.drive(instant(self.now), |medium, _, context| medium.arbitrate(context));
        self.part.advance_to(instant(until));
        self.now = until;
    }

    /// Lets time pass up to `at`, then sends a frame of the controller, which takes its time.
    pub(crate) fn send(&mut self, at: Duration, frame: &CanFrame) -> Outcome {
        self.run_until(at);
        let frame = to_bus(frame);
        let medium = &mut self.part.model;
        // Every node sees the frame.
        let disturbed =
            medium.peers.iter_mut().fold(false, |any, peer| peer.disturbs(&frame) | any);
        let valid = medium.after(instant(at), frame.bits_until_valid());
        medium.free_at = medium.after(instant(at), frame.bits_on_the_wire() + INTERMISSION_BITS);
        self.part.advance_to(valid);
        self.now = since_start(valid);
        if disturbed {
            return Outcome::Disturbed;
        }
        self.part.drive(valid, |medium, _, context| medium.deliver(&frame, None, context));
        Outcome::Delivered
    }
}
