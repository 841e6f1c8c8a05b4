//! The session of one host link: bytes in, requests out; results and events in, bytes out.
//!
//! A link executes nothing and knows no axis. It sees to it that a request is executed at most once
//! and has one result, that a reply has its place before its request is executed, and that a host
//! that does not read costs nothing but its own events.

mod baud;
mod events;
mod links;
mod replies;
mod ring;
mod subscription;
#[cfg(test)]
#[path = "../../tests/unit/link.rs"]
mod tests;

pub(crate) use links::Links;
pub use replies::{Identity, Slot};
use ring::{Cursor, Ring};

use baud::Baud;
use events::Events;
use host_protocol::{
    Deframer, EncodeError, Error, Frame, Kind, MAX_FRAME, PROTOCOL_MAJOR, Reply, Request,
    StateFields, class, requests::Subscribe,
};
use replies::{Replies, Reserved};
use serde::{Deserialize, Serialize, Serializer};
use subscription::Subscription;

/// A host that has sent nothing valid for so long is told no samples any more, and its link runs at
/// the default rate again, µs.
const SILENCE_US: u64 = 5_000_000;

/// What one link may cost in RAM, bytes.
const MEMORY_BUDGET: usize = 7 * 1024;

const _: () = assert!(size_of::<Link>() <= MEMORY_BUDGET);

/// The session of one host link.
#[derive(Clone, Deserialize)]
pub struct Link {
    deframer: Deframer,
    replies: Replies,
    events: Events,
    /// When the last frame of a request came, whatever is in it, repeated ones too; 0 before that.
    last_valid_us: u64,
    subscription: Option<Subscription>,
    pub(crate) baud: Baud,
}

impl Link {
    /// A link that has not been told its rates yet. All its 5 KB are zeros, and made where they
    /// stay: a constant of them would be in the image.
    #[inline(always)]
    pub(crate) fn blank() -> Self {
        Self {
            deframer: Deframer::new(),
            replies: Replies::new(),
            events: Events::new(),
            last_valid_us: 0,
            subscription: None,
            baud: Baud::NONE,
        }
    }

    /// Takes `bytes` of the host off their front, as far as the end of a frame or all. The frame is
    /// given if it is a request, which is then to be [admitted](Self::admit).
    pub(crate) fn receive(&mut self, now_us: u64, bytes: &mut &[u8]) -> Option<Frame<'_>> {
        match self.deframer.take(bytes)? {
            Ok(frame) if matches!(frame.kind, Kind::Request | Kind::WatcherRequest) => {
                self.last_valid_us = now_us;
                self.baud.heard();
                Some(frame)
            }
            // A frame of ours that comes back is no request and no fault: reporting it would go
            // round for ever.
            Ok(_) => None,
            Err(error) => {
                self.events.frame_rejected(now_us, &error);
                self.baud.unreadable(now_us);
                None
            }
        }
    }

    /// Whether a request, or why it could not be read, which is then its result, is to be executed
    /// now, once; and where its result goes. That is `None` for a stop, e-stop or disarm that is
    /// repeated, and for them and native commands where no place is left for their result: of the
    /// native commands those that stop are executed even so. Repeated requests are answered inside,
    /// and what cannot be executed for want of a slot is counted.
    ///
    /// `watches`: it came for a program that only watches, whose hello opens no session. `end`:
    /// where what is still to happen comes in the ring.
    pub(crate) fn admit(
        &mut self,
        now_us: u64,
        identity: Identity,
        watches: bool,
        request: &Result<Request, Error>,
        end: Cursor,
    ) -> Option<Option<Slot>> {
        if let Ok(Request::Hello(hello)) = request
            && !watches
            && !self.replies.contains(identity)
        {
            self.replies.clear();
            self.events.start_session(hello.protocol_major == PROTOCOL_MAJOR, end);
            self.subscription = None;
            self.baud.forget_next();
        }
        let unanswered = |is: fn(&Request) -> bool| request.as_ref().is_ok_and(is).then_some(None);
        let stops = |request: &Request| request.is(class::STOPS);
        match self.replies.reserve(identity) {
            Reserved::Slot(slot) => Some(Some(slot)),
            Reserved::Repeated => unanswered(stops),
            Reserved::Forgotten => {
                self.events.request_dropped(now_us);
                unanswered(stops)
            }
            Reserved::Full => {
                self.events.request_dropped(now_us);
                // Whether a native command stops only its bytes tell, which the link does not know.
                unanswered(|r| r.is(class::STOPS) || matches!(r, Request::Native(_)))
            }
        }
    }

    /// Takes the result of a request. It is dropped if a new session has begun since.
    pub fn reply(&mut self, slot: Slot, result: Result<&Reply, Error>) {
        self.replies.store(slot, result);
    }

    /// Whether the host is told of events: it has said hello.
    #[must_use]
    pub fn is_told(&self) -> bool {
        self.events.is_open()
    }

    /// Replaces the host's subscription.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] if the period is too short or too long; the subscription before then
    /// stays.
    pub fn subscribe(&mut self, now_us: u64, request: &Subscribe) -> Result<(), Error> {
        self.subscription = Subscription::new(now_us, request)?;
        self.tick(now_us);
        Ok(())
    }

    /// Whether the host has subscribed to this axis.
    #[must_use]
    pub fn watches(&self, axis: u8) -> bool {
        self.subscription.as_ref().is_some_and(|subscription| subscription.watches(axis))
    }

    /// Begins the subscription's next period, or ends it when the host is silent, as its rate does.
    /// Returns whether it has ended.
    pub fn tick(&mut self, now_us: u64) -> bool {
        let silent_at_us = self.silent_at_us();
        self.baud.tick(now_us, silent_at_us);
        let Some(subscription) = &mut self.subscription else { return false };
        if now_us >= silent_at_us {
            self.subscription = None;
            return true;
        }
        subscription.tick(now_us);
        false
    }

    /// When [`tick`](Self::tick) is due, µs.
    #[must_use]
    pub fn deadline(&self) -> Option<u64> {
        let silent_at_us = self.silent_at_us();
        match &self.subscription {
            Some(subscription) => Some(subscription.next_us.min(silent_at_us)),
            None => self.baud.deadline(silent_at_us),
        }
    }

    /// When the host counts as silent if nothing valid comes before.
    fn silent_at_us(&self) -> u64 {
        self.last_valid_us + SILENCE_US
    }

    /// The next axis to tell of, and what of it, which is then to be [written](Self::write).
    pub fn next_sample(&mut self) -> Option<(u8, StateFields)> {
        if !self.events.is_open() {
            return None;
        }
        let (axis, fields, missed) = self.subscription.as_mut()?.take()?;
        self.events.count_dropped(missed);
        Some((axis, fields))
    }

    /// Has an event of this link alone written, a sample or a period of the cycle, with its
    /// sequence and how many were lost before it. Returns its length.
    pub fn write(
        &mut self,
        encode: impl FnOnce(u16, u32) -> Result<usize, EncodeError>,
    ) -> Option<usize> {
        self.events.is_open().then(|| self.events.write(encode)).flatten()
    }

    /// Writes the next frame for the host to `out` and returns its length: replies first, then
    /// events.
    pub(crate) fn poll_transmit(
        &mut self,
        ring: &Ring,
        out: &mut [u8; MAX_FRAME],
    ) -> Option<usize> {
        let reply = self.replies.poll_transmit(out);
        if !self.replies.has_output() {
            self.baud.replies_have_left();
        }
        reply.or_else(|| self.events.poll_transmit(ring, out))
    }

    /// Into how many pieces a snapshot divides a link.
    pub(crate) const PIECES: usize = Replies::PIECES + 2;

    /// One of them. All, one behind the other, are what its `Deserialize` reads.
    pub(crate) fn piece<S: Serializer>(&self, piece: usize, to: S) -> Result<S::Ok, S::Error> {
        let Self { deframer, replies, events, last_valid_us, subscription, baud } = self;
        let Some(behind) = piece.checked_sub(1) else { return deframer.serialize(to) };
        match replies.piece(behind) {
            Some(reply) => reply.serialize(to),
            None => (replies.rest(), events, last_valid_us, subscription, baud).serialize(to),
        }
    }

    /// Writes what can influence the link from now on (see `Gateway::write_state`).
    pub(crate) fn write_state(&self, to: &mut impl core::fmt::Write) -> core::fmt::Result {
        let Self { deframer: _, replies, events, last_valid_us, subscription, baud } = self;
        let owed = replies.owed().count();
        write!(to, "{owed} {} {last_valid_us} {subscription:?} {baud:?}", events.is_open())?;
        replies.owed().try_for_each(|slot| write!(to, "{slot:?}"))
    }

    /// Whether [`poll_transmit`](Self::poll_transmit) has a frame.
    #[must_use]
    pub(crate) fn has_output(&self, ring: &Ring) -> bool {
        let sample =
            self.events.is_open() && self.subscription.as_ref().is_some_and(Subscription::is_due);
        self.replies.has_output() || self.events.has_output(ring) || sample
    }
}
