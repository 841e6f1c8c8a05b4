//! The session of one host link: which request is new, and whose result this is (G9).

use crate::wire::{Change, Deframer, Kind, Message, Request};
use std::collections::VecDeque;

/// Within so many requests a repeated one is known.
const WINDOW: usize = 8;

/// A request that was executed, or refused.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    pub message: Vec<u8>,
    pub sequence: u16,
    pub number: u16,
    pub request: Request,
    pub at_us: u64,
    /// What was sent for it.
    pub result: Option<Vec<u8>>,
    /// When.
    pub result_us: u64,
    /// The result may be sent again.
    pub again: bool,
    /// Another link had authority: it must be refused.
    pub must_be_refused: bool,
    /// It took authority.
    pub took: bool,
    /// There may have been no place for its result.
    pub may_be_dropped: bool,
    /// It has set several motors in motion; `None` where that may have been another one, too.
    pub has_started: Option<bool>,
    /// When.
    pub started_us: Option<u64>,
}

/// One link.
#[derive(Debug, Clone, Default)]
pub(crate) struct Link {
    pub incoming: Deframer,
    pub outgoing: Deframer,
    /// The latest first.
    pub records: VecDeque<Record>,
    /// Since when the host has read everything at every instant.
    pub reads_since: Option<u64>,
    pub drained_us: Option<u64>,
    /// Changes of the configuration that its host has not made yet.
    pub changes: Vec<Change>,
}

/// What a message of a host is.
pub(crate) enum Arrival {
    /// To be executed: its record is the first.
    New,
    /// It was there before.
    Repeated(Request),
    /// No place for its result.
    NoPlace(Request),
}

impl Link {
    pub fn arrive(&mut self, now: u64, message: Message) -> Arrival {
        let request = Request::read(&message);
        let watches = message.kind == Kind::WatcherRequest;
        let known = |(index, record): (usize, &Record)| {
            record.message == message.bytes && (index < WINDOW || record.result.is_none())
        };
        if let Some(index) = self.records.iter().enumerate().position(known) {
            let record = &mut self.records[index];
            if record.result.is_some() {
                record.again = true;
            }
            return Arrival::Repeated(request);
        }
        if request == Request::Hello && !watches {
            self.records.clear();
        }
        let open = |record: &&Record| record.result.is_none();
        let owed = self.records.iter().filter(open).filter(|record| !record.may_be_dropped).count();
        // A result that was asked for again is owed again, if its bytes are still kept: nobody can
        // tell.
        let again = self
            .records
            .iter()
            .filter(|r| r.again || r.may_be_dropped && r.result.is_none())
            .count();
        if owed >= WINDOW {
            return Arrival::NoPlace(request);
        }
        let old = |(index, record): (usize, &Record)| {
            index < 4 * WINDOW || record.result.is_none() && !record.may_be_dropped
        };
        let keep: Vec<bool> = self.records.iter().enumerate().map(old).collect();
        let mut keep = keep.into_iter();
        self.records.retain(|_| keep.next().unwrap_or(true));
        self.records.push_front(Record {
            sequence: message.sequence,
            number: message.number,
            message: message.bytes,
            request,
            at_us: now,
            result: None,
            result_us: 0,
            again: false,
            must_be_refused: false,
            took: false,
            may_be_dropped: owed + again >= WINDOW,
            has_started: Some(false),
            started_us: None,
        });
        Arrival::New
    }

    /// Whether a request that comes again may be known or not: it is no longer among the latest, and
    /// its result left so late that its place may not have been given away yet.
    pub fn may_know(&self, message: &[u8]) -> bool {
        let Some(index) = self.records.iter().position(|record| record.message == message) else {
            return false;
        };
        let record = &self.records[index];
        let came_after = self.records.iter().filter(|later| later.at_us >= record.result_us);
        index >= WINDOW && record.result.is_some() && (record.again || came_after.count() < WINDOW)
    }

    /// A request without a result, if it waits for too long.
    pub fn overdue(&self, now: u64, within_us: u64) -> Option<&Record> {
        let reads_since = self.reads_since?;
        let late = |record: &&Record| {
            record.result.is_none()
                && !record.may_be_dropped
                && now.saturating_sub(record.at_us.max(reads_since)) > within_us
        };
        self.records.iter().find(late)
    }
}
