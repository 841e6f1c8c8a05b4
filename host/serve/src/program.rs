//! The session of one program: what it asked, what it is answered, what it is told.

use std::collections::VecDeque;
use std::time::Duration;

use host_protocol::requests::Subscribe;
use host_protocol::{Deframer, Error, FrameError, Kind, MAX_FRAME, encode_body};

use crate::ask::Ask;
use crate::events::{Inbox, Told};

/// Requests that are remembered, and results that can be owed: a setpoint of each axis and as many
/// again, as the cable takes a few at a time.
pub(crate) const WINDOW: usize = 32;
/// A program that has sent nothing valid for so long has no subscription any more, as on a link.
const SUBSCRIPTION_ENDS_AFTER: Duration = Duration::from_secs(5);
/// A program that has sent no sign of life for so long may hang: what it has left waiting is none
/// any more. A client sends again after 80 ms what has no result.
const MAY_HANG_AFTER: Duration = Duration::from_millis(100);

/// Where a request is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Fate {
    /// It waits for its turn on the cable.
    Waits,
    /// It is under way, under this number of the cable.
    Asked(u16),
    /// The frame of its result, and whether that waits for the program to read it.
    Answered { frame: Vec<u8>, unsent: bool },
}

/// A remembered request.
#[derive(Debug)]
pub(crate) struct Kept {
    /// Which of the program's requests.
    pub order: u64,
    pub ask: Ask,
    pub since: Duration,
    pub fate: Fate,
}

impl Kept {
    fn is_owed(&self) -> bool {
        !matches!(self.fate, Fate::Answered { unsent: false, .. })
    }
}

/// What a program wants on the cable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Turn {
    /// This request of its.
    New(u64),
    /// The same bytes again, of what is under way under this number.
    Again(u16),
    /// A stop whose result nobody waits for.
    Unanswered(Ask),
}

/// One program.
pub(crate) struct Program {
    deframer: Deframer,
    /// What it is called where others are told of it.
    pub name: String,
    /// It has shown the token, or needs none.
    pub proved: bool,
    /// The latest first.
    kept: VecDeque<Kept>,
    orders: u64,
    /// Stops that wait for the cable, and everything else.
    pub stops: VecDeque<Turn>,
    pub queue: VecDeque<Turn>,
    /// The requests whose results wait to be read.
    results: VecDeque<u64>,
    pub inbox: Inbox,
    pub subscription: Option<Subscribe>,
    heard_at: Duration,
    /// When it sent the last request that is not a watcher's, which is its sign of life.
    lived_at: Duration,
    /// Its connection is to be closed when it has read what it is owed.
    pub over: bool,
}

impl Program {
    pub fn new(now: Duration, proved: bool) -> Self {
        Self {
            deframer: Deframer::new(),
            name: String::new(),
            proved,
            kept: VecDeque::new(),
            orders: 0,
            stops: VecDeque::new(),
            queue: VecDeque::new(),
            results: VecDeque::new(),
            inbox: Inbox::default(),
            subscription: None,
            heard_at: now,
            lived_at: now,
            over: false,
        }
    }

    /// The next request in `bytes`, which are taken off their front. Garbage is counted.
    pub fn receive(&mut self, now: Duration, bytes: &mut &[u8]) -> Option<Ask> {
        while !bytes.is_empty() {
            match self.deframer.take(bytes)? {
                Ok(frame) => {
                    if let Some(ask) = Ask::of(&frame) {
                        self.heard_at = now;
                        if !ask.watches {
                            self.lived_at = now;
                        }
                        return Some(ask);
                    }
                }
                Err(error) => self.reject(&error),
            }
        }
        None
    }

    fn reject(&mut self, error: &FrameError) {
        self.inbox.reject(error);
    }

    /// The remembered request that is the same.
    pub fn known(&mut self, ask: &Ask) -> Option<&mut Kept> {
        self.kept.iter_mut().find(|kept| kept.ask == *ask)
    }

    pub fn kept(&mut self, order: u64) -> Option<&mut Kept> {
        self.kept.iter_mut().find(|kept| kept.order == order)
    }

    /// Remembers a new request; `None` where so many results are owed that there is no place.
    pub fn keep(&mut self, now: Duration, ask: Ask) -> Option<u64> {
        if self.kept.iter().filter(|kept| kept.is_owed()).count() >= WINDOW {
            return None;
        }
        self.orders += 1;
        let order = self.orders;
        self.kept.push_front(Kept { order, ask, since: now, fate: Fate::Waits });
        while self.kept.len() > WINDOW
            && let Some(oldest) = self.kept.iter().rposition(|kept| !kept.is_owed())
        {
            self.kept.remove(oldest);
        }
        Some(order)
    }

    /// Whether it has asked anything since it connected.
    pub fn has_asked(&self) -> bool {
        self.orders > 0
    }

    /// The cable has no result of a request and gets none any more.
    pub fn forget(&mut self, order: u64) {
        self.kept.retain(|kept| kept.order != order || !matches!(kept.fate, Fate::Asked(_)));
    }

    /// Keeps the result of a request.
    pub fn answer(&mut self, order: u64, kind: Kind, number: u16, body: &[u8]) {
        let Some(kept) = self.kept(order) else { return };
        let mut out = [0; MAX_FRAME];
        // It fits: it came in a frame of this size.
        let length = encode_body(kind, kept.ask.sequence, number, body, &mut out).unwrap_or(0);
        let frame = out.get(..length).unwrap_or_default().to_vec();
        kept.fate = Fate::Answered { frame, unsent: true };
        if kept.ask.opens_session() && kind == Kind::Reply {
            self.inbox.open();
        }
        self.results.push_back(order);
    }

    /// As [`answer`](Self::answer), by the server itself.
    pub fn refuse(&mut self, order: u64, error: Error) {
        let mut out = [0; MAX_FRAME];
        let length = error.encode_frame(0, &mut out).unwrap_or(0);
        if let Some(Ok(frame)) = Deframer::new().take(&mut out.get(..length).unwrap_or_default()) {
            self.answer(order, Kind::Error, frame.number, frame.body);
        }
    }

    /// The result of a repeated request goes out once more.
    pub fn answer_again(&mut self, order: u64) {
        if let Some(Kept { fate: Fate::Answered { unsent: unsent @ false, .. }, .. }) =
            self.kept(order)
        {
            *unsent = true;
            self.results.push_back(order);
        }
    }

    /// The stops that have not gone out yet, as ones whose results nobody waits for.
    pub fn take_stops(&mut self) -> Vec<Turn> {
        let stops = std::mem::take(&mut self.stops);
        let unanswered = |turn| match turn {
            Turn::New(order) => self.kept(order).map(|kept| Turn::Unanswered(kept.ask.clone())),
            other => Some(other),
        };
        stops.into_iter().filter_map(unanswered).collect()
    }

    /// A new session: what was before it is forgotten, but for stops.
    pub fn begin_session(&mut self) {
        self.stops = self.take_stops().into();
        self.kept.clear();
        self.queue.clear();
        self.results.clear();
        self.inbox = Inbox::default();
        self.subscription = None;
    }

    /// Everything that has no result gets this one, but for stops: who repeats those reaches the
    /// gateway when it can be reached.
    pub fn refuse_owed(&mut self, error: Error, is_meant: impl Fn(&Kept) -> bool) {
        let unanswered = |kept: &&Kept| {
            !matches!(kept.fate, Fate::Answered { .. }) && !kept.ask.stops() && is_meant(kept)
        };
        let orders: Vec<u64> = self.kept.iter().filter(unanswered).map(|one| one.order).collect();
        for order in orders.into_iter().rev() {
            self.queue.retain(|turn| *turn != Turn::New(order));
            self.refuse(order, error);
        }
    }

    /// Ends a subscription whose program is silent; whether it has ended.
    pub fn lapse(&mut self, now: Duration) -> bool {
        let ends = now.saturating_sub(self.heard_at) >= SUBSCRIPTION_ENDS_AFTER;
        ends && self.subscription.take().is_some()
    }

    /// Whether its last sign of life is too old for another one to be sent for it.
    pub fn may_hang(&self, now: Duration) -> bool {
        now > self.lived_at + MAY_HANG_AFTER
    }

    /// A request that has not been sent gets no result; repeated, it is a new one.
    pub fn drop_request(&mut self, order: u64) {
        self.kept.retain(|kept| kept.order != order);
        self.inbox.request_dropped();
    }

    /// The next frame for the program.
    pub fn next_frame(&mut self, gateway_us: u64) -> Option<Vec<u8>> {
        while let Some(order) = self.results.pop_front() {
            if let Some(Kept { fate: Fate::Answered { frame, unsent }, .. }) = self.kept(order) {
                *unsent = false;
                return Some(frame.clone());
            }
        }
        if self.over {
            return None;
        }
        self.inbox.next_frame(gateway_us)
    }

    /// Tells it of an event; samples only as it has subscribed.
    pub fn tell(&mut self, told: &Told, period_us: u32) {
        self.inbox.tell(told, self.subscription.as_ref(), period_us);
    }
}
