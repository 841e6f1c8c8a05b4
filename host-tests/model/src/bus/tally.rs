//! What has been on a bus since the start, counted (G7).

use super::Bus;

/// Within this and so many frames a frame must be acknowledged (G3).
pub(crate) const ACKNOWLEDGE_US: u64 = 20_000;
pub(crate) const ACKNOWLEDGE_FRAMES: u64 = 4;

/// Counts of a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Tally {
    pub sent: u32,
    /// Allowance: frames that left at the very instant at which the controller was started anew.
    pub sent_or_not: u32,
    /// CAN: frames that came in.
    pub received: u32,
    pub overflows: u32,
    pub missed: u32,
    /// Allowance: frames that were dropped at the very instant at which nobody had acknowledged
    /// them for too long.
    pub missed_or_not: u32,
    pub cancelled: u32,
    pub bus_offs: u32,
}

impl Bus {
    /// The last instant at which a frame that is handed over now is acknowledged in time. One that
    /// takes the place of another has no more time than that had.
    pub fn acknowledged_by(&self, now: u64, motion_within: Option<u64>) -> u64 {
        let within = ACKNOWLEDGE_US + self.can_frames_us(ACKNOWLEDGE_FRAMES);
        let by = now + within.min(motion_within.unwrap_or(within));
        self.carried_us.map_or(by, |carried| carried.min(by))
    }

    /// Time has passed: counts what nobody has acknowledged.
    pub fn count_missed(&mut self, now: u64) {
        for held in &mut self.held {
            if held.missed_us.is_none() && held.acknowledged_by <= now {
                held.missed_us = Some(now);
                self.tally.missed += 1;
                self.carried_us = None;
            }
        }
    }
}
