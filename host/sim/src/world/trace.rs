//! What was on the buses.

use std::collections::VecDeque;
use std::time::Duration;

use crate::bus::{Station, Wire};

/// Entries kept until they are taken; the oldest go first.
const KEPT: usize = 200_000;

/// One frame or message that was sent, and on CAN acknowledged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TraceEntry {
    /// When its first bit was sent, µs.
    pub time_us: u64,
    /// When its last bit had been sent, µs.
    pub end_us: u64,
    /// Index of the bus.
    pub bus: u8,
    /// Who sent it.
    pub from: Station,
    /// What was sent. On a serial line it may have been garbled on the way.
    pub wire: Wire,
}

/// The entries not yet taken.
#[derive(Debug, Clone, Default)]
pub(super) struct Trace {
    entries: VecDeque<TraceEntry>,
}

impl Trace {
    pub(super) fn add(
        &mut self,
        bus: u8,
        from: Station,
        wire: Wire,
        start: Duration,
        end: Duration,
    ) {
        if self.entries.len() == KEPT {
            self.entries.pop_front();
        }
        self.entries.push_back(TraceEntry {
            time_us: micros(start),
            end_us: micros(end),
            bus,
            from,
            wire,
        });
    }

    pub(super) fn take(&mut self) -> Vec<TraceEntry> {
        self.entries.drain(..).collect()
    }
}

/// Whole microseconds, as the gateway counts time.
pub(super) fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}
