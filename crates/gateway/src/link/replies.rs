//! The last requests of a link and their results, kept as the bytes that were sent.

use host_protocol::{Error, Frame, MAX_FRAME, Reply};

/// Requests that are remembered, and replies that can wait.
const WINDOW: usize = 8;

/// The place of one request's result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Empty,
    Executing,
    /// The reply is to be sent; the number orders those that wait, and wraps around.
    Waiting(u16),
    /// The reply was handed out and is kept for a repeated request.
    Sent,
}

/// What tells a request from another. The checksum covers header and body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Identity {
    sequence: u16,
    /// Bytes of the body; there are never more than a message holds.
    length: u16,
    checksum: u32,
}

impl Identity {
    const NONE: Self = Self { sequence: 0, length: 0, checksum: 0 };

    fn of(frame: &Frame<'_>) -> Self {
        let length = u16::try_from(frame.body.len()).unwrap_or(u16::MAX);
        Self { sequence: frame.sequence, length, checksum: frame.checksum }
    }
}

#[derive(Clone)]
struct Entry {
    state: State,
    request: Identity,
    /// When the request came, counted in requests.
    order: u32,
    /// Bytes of the reply.
    length: u16,
    reply: [u8; MAX_FRAME],
}

impl Entry {
    const EMPTY: Self = Self {
        state: State::Empty,
        request: Identity::NONE,
        order: 0,
        length: 0,
        reply: [0; MAX_FRAME],
    };

    /// How many requests ago this entry can be given away, the more the better; `None` while it
    /// owes its reply.
    fn free_for(&self, now: u32) -> Option<u32> {
        match self.state {
            State::Empty => Some(u32::MAX),
            State::Sent => Some(now.wrapping_sub(self.order)),
            State::Executing | State::Waiting(_) => None,
        }
    }
}

/// The window of remembered requests.
#[derive(Clone)]
pub struct Replies {
    entries: [Entry; WINDOW],
    /// The last requests, the latest first. While replies are owed their places are fewer than
    /// these.
    recent: [Option<Identity>; WINDOW],
    /// Requests so far.
    requests: u32,
    /// Replies queued so far, wrapping around.
    queued: u16,
}

impl Replies {
    pub const fn new() -> Self {
        Self { entries: [Entry::EMPTY; WINDOW], recent: [None; WINDOW], requests: 0, queued: 0 }
    }

    /// Whether this very request is remembered.
    pub fn contains(&self, frame: &Frame<'_>) -> bool {
        let request = Identity::of(frame);
        let kept = self
            .entries
            .iter()
            .any(|entry| entry.state != State::Empty && entry.request == request);
        kept || self.recent.contains(&Some(request))
    }

    /// Forgets everything; results that are still to come will be dropped.
    pub fn clear(&mut self) {
        for entry in &mut self.entries {
            entry.state = State::Empty;
        }
        self.recent = [None; WINDOW];
    }

    /// Finds the request among the remembered ones, or a slot for it.
    pub fn reserve(&mut self, frame: &Frame<'_>) -> Reserved {
        let request = Identity::of(frame);
        let known = self
            .entries
            .iter_mut()
            .find(|entry| entry.state != State::Empty && entry.request == request);
        if let Some(entry) = known {
            if entry.state == State::Sent {
                entry.state = State::Waiting(self.queued);
                self.queued = self.queued.wrapping_add(1);
            }
            return Reserved::Repeated;
        }
        if self.recent.contains(&Some(request)) {
            return Reserved::Forgotten;
        }
        let now = self.requests;
        let free =
            self.entries.iter_mut().enumerate().filter(|(_, entry)| entry.free_for(now).is_some());
        let Some((index, entry)) = free.max_by_key(|(_, entry)| entry.free_for(now)) else {
            return Reserved::Full;
        };
        self.requests = now.wrapping_add(1);
        self.recent.rotate_right(1);
        if let Some(latest) = self.recent.first_mut() {
            *latest = Some(request);
        }
        entry.state = State::Executing;
        entry.request = request;
        entry.order = now;
        Reserved::Slot(Slot { index, order: now })
    }

    /// Keeps the result of a request and queues it.
    pub fn store(&mut self, slot: Slot, result: &Result<Reply, Error>) {
        let Some(entry) = self.entries.get_mut(slot.index) else { return };
        if entry.order != slot.order || entry.state != State::Executing {
            return;
        }
        let sequence = entry.request.sequence;
        let encoded = match result {
            Ok(reply) => reply.encode_frame(sequence, &mut entry.reply),
            Err(error) => error.encode_frame(sequence, &mut entry.reply),
        };
        // Every message of the table fits, as host-protocol asserts; there is nobody to tell
        // otherwise.
        entry.length = encoded.ok().and_then(|length| u16::try_from(length).ok()).unwrap_or(0);
        entry.state = State::Waiting(self.queued);
        self.queued = self.queued.wrapping_add(1);
    }

    /// Writes the reply that has waited longest.
    pub fn poll_transmit(&mut self, out: &mut [u8; MAX_FRAME]) -> Option<usize> {
        let queued = self.queued;
        let (_, entry) = self
            .entries
            .iter_mut()
            .filter_map(|entry| match entry.state {
                State::Waiting(place) => Some((queued.wrapping_sub(place), entry)),
                _ => None,
            })
            .max_by_key(|(waiting, _)| *waiting)?;
        let length = usize::from(entry.length);
        if let (Some(to), Some(reply)) = (out.get_mut(..length), entry.reply.get(..length)) {
            to.copy_from_slice(reply);
        }
        entry.state = State::Sent;
        Some(length)
    }

    /// The places of requests that have no result yet.
    #[cfg(feature = "state-text")]
    pub fn owed(&self) -> impl Iterator<Item = Slot> {
        let executing = |(_, entry): &(usize, &Entry)| entry.state == State::Executing;
        let slot = |(index, entry): (usize, &Entry)| Slot { index, order: entry.order };
        self.entries.iter().enumerate().filter(executing).map(slot)
    }

    pub fn has_output(&self) -> bool {
        self.entries.iter().any(|entry| matches!(entry.state, State::Waiting(_)))
    }
}
