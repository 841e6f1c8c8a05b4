//! What has happened, kept once for all who are told: the hosts, and the log.

use heapless::Deque;
use host_protocol::Event;

use crate::MAX_AXES;
use crate::each::Each;
use crate::log::LogEntry;
use serde::{Deserialize, Serialize, Serializer};

/// Entries that are kept: those of an e-stop of all axes, and some more.
pub(crate) const RING: usize = MAX_AXES + 8;

/// Something that has happened.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Entry {
    pub time_us: u64,
    /// Events before this, those of before the ring too; wraps around.
    events_before: u32,
    pub what: LogEntry,
}

/// Who is told remembers how far; both wrap around.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Cursor {
    /// The next entry.
    pub entry: u32,
    /// The next event.
    pub event: u32,
}

/// The latest entries. A new one takes the place of the oldest, whether everybody has been told of
/// that or not.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Ring {
    entries: Deque<Entry, RING>,
    end: Cursor,
    /// The entry of the latest event.
    latest_event: u32,
}

impl Ring {
    /// Into how many pieces a snapshot divides it.
    pub const PIECES: usize = 4;

    /// A piece of it in a snapshot. All, one behind the other, are what its `Deserialize` reads.
    pub fn piece<S: Serializer>(&self, piece: usize, to: S) -> Result<S::Ok, S::Error> {
        const LAST: usize = Ring::PIECES - 1;
        const ENTRIES: usize = RING.div_ceil(Ring::PIECES);
        let Ring { entries, end, latest_event } = self;
        let these = Each(|| entries.iter().skip(piece * ENTRIES).take(ENTRIES));
        match piece {
            0 => (entries.len(), these).serialize(to),
            LAST => (these, end, latest_event).serialize(to),
            _ => these.serialize(to),
        }
    }

    pub const fn new() -> Self {
        Self { entries: Deque::new(), end: Cursor { entry: 0, event: 0 }, latest_event: 0 }
    }

    /// Where what is still to happen comes.
    pub fn end(&self) -> Cursor {
        self.end
    }

    pub fn push(&mut self, time_us: u64, what: LogEntry) {
        if self.entries.is_full() {
            self.entries.pop_front();
        }
        let Cursor { entry, event } = self.end;
        if matches!(what, LogEntry::Event(_)) {
            self.latest_event = entry;
            self.end.event = event.wrapping_add(1);
        }
        self.end.entry = entry.wrapping_add(1);
        // It fits: there is room now.
        let _ = self.entries.push_back(Entry { time_us, events_before: event, what });
    }

    /// Whether an event waits behind a cursor.
    pub fn has_event(&self, cursor: Cursor) -> bool {
        cursor.event != self.end.event
            && self.end.entry.wrapping_sub(self.latest_event) as usize <= self.entries.len()
    }

    /// The next entry behind a cursor, how many have lost their places between, and the cursor
    /// behind it.
    pub fn next(&self, cursor: Cursor) -> Option<(&Entry, u32, Cursor)> {
        // Lossless: below RING.
        #[allow(clippy::cast_possible_truncation)]
        let held = self.entries.len() as u32;
        let behind = self.end.entry.wrapping_sub(cursor.entry);
        let lost = behind.saturating_sub(held);
        let entry = self.entries.get((held - behind.min(held)) as usize)?;
        let is_event = matches!(entry.what, LogEntry::Event(_));
        let event = entry.events_before.wrapping_add(is_event.into());
        let behind_it = Cursor { entry: cursor.entry.wrapping_add(lost + 1), event };
        Some((entry, lost, behind_it))
    }

    /// The next event behind a cursor, when it happened, and how many have lost their places
    /// between. Moves the cursor behind it.
    pub fn next_event(&self, cursor: &mut Cursor) -> Option<(u64, &Event, u32)> {
        loop {
            let (entry, _, behind_it) = self.next(*cursor)?;
            let lost = entry.events_before.wrapping_sub(cursor.event);
            // The events that are lost are not told of yet.
            *cursor = Cursor { event: cursor.event, ..behind_it };
            if let LogEntry::Event(event) = &entry.what {
                cursor.event = behind_it.event;
                return Some((entry.time_us, event, lost));
            }
        }
    }
}
