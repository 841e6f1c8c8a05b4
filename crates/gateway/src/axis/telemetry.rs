//! How much hosts are told of the frames that a motor sends by itself: it may be one each
//! millisecond.

use crate::time::Instant;
use serde::{Deserialize, Serialize};

/// Of each kind one frame is told in this time, µs. Samples, at the pace that a host asks for, have
/// the values of all.
const PERIOD_US: u32 = 1_000_000;

/// What has been told of one axis.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Telemetry {
    /// When the period under way began, the low bits of its µs.
    since: u32,
    /// Frames not told since the latest that was.
    unreported: u16,
    /// The kinds told in this period, a bit for each.
    told: u8,
}

impl Telemetry {
    pub const NONE: Self = Self { since: 0, unreported: 0, told: 0 };

    /// A frame of this kind has come. Whether hosts are told, and how many were left out before it.
    pub fn tells(&mut self, now: Instant, kind: u8) -> Option<u16> {
        if now.low_bits().wrapping_sub(self.since) >= PERIOD_US {
            (self.since, self.told) = (now.low_bits(), 0);
        }
        let bit = 1u8.checked_shl(u32::from(kind)).unwrap_or_default();
        if self.told & bit != 0 {
            self.unreported = self.unreported.saturating_add(1);
            return None;
        }
        self.told |= bit;
        Some(core::mem::take(&mut self.unreported))
    }
}

#[cfg(test)]
#[path = "../../tests/unit/telemetry.rs"]
mod tests;
