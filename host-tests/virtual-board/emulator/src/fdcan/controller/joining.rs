//! The controller's way to the bus and from it, and what follows from time alone.

use rigless::time::VirtualNanos;

use super::{Controller, Presence, RECOVERY_SEQUENCES};
use crate::fdcan::registers::{cccr, ir};
use crate::fdcan::wire::Recessive;

/// Recessive bits that make a sequence: the bus is idle.
pub const SEQUENCE_BITS: u64 = 11;

impl Controller {
    /// Counts the sequences for which the line has been recessive. True if it has joined.
    pub fn count_recessive(&mut self, line: Option<Recessive>) -> bool {
        while let Some(end) =
            self.sequence_end(line).filter(|end| line.is_some_and(|line| *end <= line.until))
        {
            let Presence::Waiting { left, .. } = &mut self.kept.presence else { return false };
            *left -= 1;
            let done = *left == 0;
            let left = *left;
            if self.kept.errors.is_bus_off() {
                self.kept.errors.recessive_sequence();
            }
            if done {
                let flags = self.kept.errors.joined();
                self.kept.interrupts.raise(flags);
                self.kept.presence = Presence::On;
                return true;
            }
            self.kept.presence = Presence::Waiting { left, since: end };
        }
        false
    }

    /// When the sequence ends that runs now, if nobody starts before.
    pub fn next_sequence(&self, line: Option<Recessive>) -> Option<VirtualNanos> {
        self.sequence_end(line.filter(|line| !line.over))
    }

    fn sequence_end(&self, line: Option<Recessive>) -> Option<VirtualNanos> {
        let Presence::Waiting { since, .. } = self.kept.presence else { return None };
        Some(self.bit()?.after(since.max(line?.since), SEQUENCE_BITS))
    }

    /// Sequences counted on the way back from bus-off.
    pub(super) fn counted(&self) -> Option<u16> {
        match self.kept.presence {
            Presence::Waiting { left, .. } if self.kept.errors.is_bus_off() => {
                Some(RECOVERY_SEQUENCES - left)
            }
            _ => None,
        }
    }

    /// CSR was set and nothing is pending any more: stops, once the bus is idle. True if it did.
    pub fn stop_clock(&mut self, bus_is_idle: bool) -> bool {
        let asked = self.is_set(cccr::CSR) && !self.is_set(cccr::CSA);
        if !asked || self.kept.transmitter.is_pending() || !(bus_is_idle || self.is_set(cccr::INIT))
        {
            return false;
        }
        self.kept.cccr |= cccr::CSA | cccr::INIT;
        self.leave_bus();
        true
    }

    /// What follows from time alone. Returns when to look again.
    pub fn pass_time(&mut self, now: VirtualNanos) -> Option<VirtualNanos> {
        if self.kept.timestamp.take_wrap(now) {
            self.kept.interrupts.raise(ir::TSW);
        }
        self.kept.timestamp.next_wrap(now)
    }
}
