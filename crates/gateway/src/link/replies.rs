//! The last requests of a link and their results, kept as the bytes that were sent.

use core::num::NonZeroU64;

use heapless::Deque;
use host_protocol::{EncodeError, Error, Filled, Frame, MAX_FRAME, Reply, frame_message};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Requests that are remembered, and replies that can wait.
const WINDOW: usize = 8;

/// The place of one request's result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Slot {
    index: usize,
    /// Which request of the link it belongs to: tells a late result from that of a later request
    /// in the same place.
    order: u32,
}

/// What became of a request.
#[derive(Debug, PartialEq, Eq)]
pub enum Reserved {
    /// It was there before: its reply is sent again, once there is one.
    Repeated,
    /// It was there before, and the place of its reply has been given away: it is not executed
    /// again.
    Forgotten,
    /// It is new.
    Slot(Slot),
    /// It is new and every slot still owes its reply.
    Full,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum State {
    Executing = 1,
    /// The reply is to be sent, and no frame yet: what follows from its request goes first.
    Written = 2,
    /// The reply is to be sent again.
    Waiting = 3,
    /// The reply was handed out and is kept for a repeated request. 0: see [`Link::blank`].
    ///
    /// [`Link::blank`]: super::Link::blank
    Sent = 0,
}

/// What tells a request from another, in one word, as each is compared with all that are
/// remembered: 1 and the bytes of the body, the sequence, and the checksum of header and body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity(NonZeroU64);

impl Identity {
    /// That of a request's frame.
    pub fn of(frame: &Frame<'_>) -> Self {
        // A body has at most a few hundred.
        let length = frame.body.len() as u64 + 1;
        let rest = u64::from(frame.sequence) << 32 | u64::from(frame.checksum);
        Self(NonZeroU64::new(length << 48 | rest).unwrap_or(NonZeroU64::MAX))
    }

    fn sequence(self) -> u16 {
        let [_, _, high, low, ..] = self.0.get().to_be_bytes();
        u16::from_be_bytes([high, low])
    }
}

#[derive(Clone)]
struct Entry {
    state: State,
    /// When the request came, counted in requests from 1.
    order: u32,
    /// Bytes of the reply.
    length: u16,
    reply: [u8; MAX_FRAME],
}

/// The reply is as long as it is.
impl Serialize for Entry {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Self { state, order, length, reply } = self;
        (state, order, Filled::of(reply, (*length).into())).serialize(to)
    }
}

impl<'de> Deserialize<'de> for Entry {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let (state, order, sent): (_, _, Filled<'_>) = Deserialize::deserialize(from)?;
        let length = u16::try_from(sent.0.len()).map_err(D::Error::custom)?;
        Ok(Self { state, order, length, reply: sent.array()? })
    }
}

impl Entry {
    const EMPTY: Self = Self { state: State::Sent, order: 0, length: 0, reply: [0; MAX_FRAME] };

    /// So much of the reply is there. Every message of the table fits, as host-protocol asserts;
    /// there is nobody to tell otherwise.
    fn has(&mut self, length: Result<usize, EncodeError>) {
        self.length = length.ok().and_then(|length| u16::try_from(length).ok()).unwrap_or(0);
    }
}

/// The window of remembered requests. A snapshot has its fields in their order.
#[derive(Clone, Deserialize)]
pub struct Replies {
    entries: [Entry; WINDOW],
    /// The requests of the entries, and behind them the last ones: while replies are owed, the place
    /// of a sent one is given away before as many requests have come.
    remembered: [Option<Identity>; 2 * WINDOW],
    /// Requests so far.
    requests: u32,
    /// Where the next request looks for a place first, and then on round: one that comes late to be
    /// [sent](State::Sent) is not given away at once, though its request is the oldest.
    next: usize,
    /// The entries whose replies wait, in the order of their results.
    waiting: Deque<usize, WINDOW>,
}

impl Replies {
    pub const fn new() -> Self {
        Self {
            entries: [Entry::EMPTY; WINDOW],
            remembered: [None; 2 * WINDOW],
            requests: 0,
            next: 0,
            waiting: Deque::new(),
        }
    }

    /// How many pieces of its own a snapshot has of it, before the [rest](Self::rest).
    pub const PIECES: usize = WINDOW;

    /// One of them.
    pub fn piece(&self, piece: usize) -> Option<&impl Serialize> {
        self.entries.get(piece)
    }

    /// What comes behind them.
    pub fn rest(&self) -> impl Serialize {
        (self.remembered, self.requests, self.next, &self.waiting)
    }

    /// Whether this very request is remembered.
    pub fn contains(&self, request: Identity) -> bool {
        self.remembered.contains(&Some(request))
    }

    /// Forgets everything; results that are still to come will be dropped.
    pub fn clear(&mut self) {
        for entry in &mut self.entries {
            (entry.state, entry.length) = (State::Sent, 0);
        }
        self.remembered = [None; 2 * WINDOW];
        self.waiting.clear();
    }

    /// Finds the request among the remembered ones, or a slot for it.
    pub fn reserve(&mut self, request: Identity) -> Reserved {
        let request = Some(request);
        if let Some(at) = self.remembered.iter().position(|remembered| *remembered == request) {
            let Some(entry) = self.entries.get(at) else { return Reserved::Forgotten };
            if entry.state == State::Sent {
                self.queue(at, State::Waiting);
            }
            return Reserved::Repeated;
        }
        let is_free =
            |at: &usize| self.entries.get(*at).is_some_and(|entry| entry.state == State::Sent);
        // A snapshot may say anything of the first one.
        let found = (0..WINDOW).map(|turn| self.next.wrapping_add(turn) % WINDOW).find(is_free);
        let Some(index) = found else { return Reserved::Full };
        let Some(entry) = self.entries.get_mut(index) else { return Reserved::Full };
        let now = self.requests.wrapping_add(1);
        (entry.state, entry.order) = (State::Executing, now);
        self.next = index + 1;
        // Nobody reads it any more, and a snapshot has room for it.
        entry.length = 0;
        self.requests = now;
        for place in [index, WINDOW + now as usize % WINDOW] {
            if let Some(remembered) = self.remembered.get_mut(place) {
                *remembered = request;
            }
        }
        Reserved::Slot(Slot { index, order: now })
    }

    /// The reply of an entry is to be sent.
    fn queue(&mut self, index: usize, state: State) {
        if let Some(entry) = self.entries.get_mut(index) {
            entry.state = state;
            // It fits: none waits twice.
            let _ = self.waiting.push_back(index);
        }
    }

    /// Keeps the result of a request and queues it.
    pub fn store(&mut self, slot: Slot, result: Result<&Reply, Error>) {
        let Some(entry) = self.entries.get_mut(slot.index) else { return };
        if entry.order != slot.order || entry.state != State::Executing {
            return;
        }
        let Some(Some(request)) = self.remembered.get(slot.index) else { return };
        let sequence = request.sequence();
        let written = match result {
            Ok(reply) => reply.write_message(sequence, &mut entry.reply),
            Err(error) => error.write_message(sequence, &mut entry.reply),
        };
        entry.has(written);
        self.queue(slot.index, State::Written);
    }

    /// Writes the reply that has waited longest.
    pub fn poll_transmit(&mut self, out: &mut [u8; MAX_FRAME]) -> Option<usize> {
        let entry = self.entries.get_mut(self.waiting.pop_front()?)?;
        if entry.state == State::Written {
            let framed = frame_message(entry.length.into(), &mut entry.reply);
            entry.has(framed);
        }
        let length = usize::from(entry.length);
        if let (Some(to), Some(reply)) = (out.get_mut(..length), entry.reply.get(..length)) {
            to.copy_from_slice(reply);
        }
        entry.state = State::Sent;
        Some(length)
    }

    /// The places of requests that have no result yet.
    pub fn owed(&self) -> impl Iterator<Item = Slot> {
        let executing = |(_, entry): &(usize, &Entry)| entry.state == State::Executing;
        let slot = |(index, entry): (usize, &Entry)| Slot { index, order: entry.order };
        self.entries.iter().enumerate().filter(executing).map(slot)
    }

    pub fn has_output(&self) -> bool {
        !self.waiting.is_empty()
    }
}
