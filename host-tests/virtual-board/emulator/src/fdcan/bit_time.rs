//! How long a bit lasts.

use rigless::time::{NANOS_PER_SECOND, VirtualNanos};
use serde::{Deserialize, Serialize};

/// The relative difference of two bit rates, in parts per thousand, from which nodes do not
/// understand each other. Classic CAN tolerates at most 1.58 % between two oscillators, and less
/// with late sample points.
const TOLERANCE_PER_MILLE: u128 = 10;

/// The duration of a bit: cycles of a clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct BitTime {
    cycles: u64,
    hz: u64,
}

impl BitTime {
    /// `cycles` of a clock of `hz`; `None` while the clock stands or the bit has no length.
    #[must_use]
    pub fn of_cycles(cycles: u64, hz: u64) -> Option<Self> {
        (cycles > 0 && hz > 0).then_some(Self { cycles, hz })
    }

    /// The bit of a node that runs at `bitrate` bits per second; `None` for 0.
    #[must_use]
    pub fn of_bitrate(bitrate: u32) -> Option<Self> {
        Self::of_cycles(1, u64::from(bitrate))
    }

    /// The instant `bits` bits after `start`, rounded down to a nanosecond: once, so frames do not
    /// drift.
    #[must_use]
    pub fn after(self, start: VirtualNanos, bits: u64) -> VirtualNanos {
        let nanos = u128::from(bits) * u128::from(self.cycles) * u128::from(NANOS_PER_SECOND)
            / u128::from(self.hz);
        VirtualNanos(start.0.saturating_add(u64::try_from(nanos).unwrap_or(u64::MAX)))
    }

    /// How many whole bits fit between two instants; 0 if `end` is not after `start`.
    #[must_use]
    pub fn bits_between(self, start: VirtualNanos, end: VirtualNanos) -> u64 {
        let nanos = u128::from(end.0.saturating_sub(start.0));
        let bits =
            nanos * u128::from(self.hz) / (u128::from(self.cycles) * u128::from(NANOS_PER_SECOND));
        u64::try_from(bits).unwrap_or(u64::MAX)
    }

    /// Whether two nodes with these bit times understand each other.
    #[must_use]
    pub fn matches(self, other: Self) -> bool {
        let mine = u128::from(self.cycles) * u128::from(other.hz);
        let theirs = u128::from(other.cycles) * u128::from(self.hz);
        mine.abs_diff(theirs) * 1000 <= TOLERANCE_PER_MILLE * mine.max(theirs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_a_thousand_bits_do_not_drift() {
        // 19 × 20 cycles of 80 MHz: 210526 bit/s, 4750 ns a bit.
        let bit = BitTime::of_cycles(380, 80_000_000).unwrap();
        assert_eq!(bit.after(VirtualNanos(7), 1000), VirtualNanos(4_750_007));
        let third = BitTime::of_bitrate(300_000).unwrap();
        assert_eq!(third.after(VirtualNanos(0), 1), VirtualNanos(3_333));
        assert_eq!(third.after(VirtualNanos(0), 3), VirtualNanos(10_000));
        assert_eq!(third.bits_between(VirtualNanos(0), VirtualNanos(10_000)), 3);
        assert_eq!(third.bits_between(VirtualNanos(0), VirtualNanos(9_999)), 2);
    }

    #[test]
    fn rates_within_a_percent_match() {
        let controller = BitTime::of_cycles(380, 80_000_000).unwrap();
        assert!(controller.matches(BitTime::of_bitrate(210_526).unwrap()));
        assert!(controller.matches(BitTime::of_bitrate(212_000).unwrap()));
        assert!(!controller.matches(BitTime::of_bitrate(250_000).unwrap()));
        assert!(
            !BitTime::of_bitrate(500_000).unwrap().matches(BitTime::of_bitrate(1_000_000).unwrap())
        );
    }

    #[test]
    fn a_clock_that_stands_has_no_bits() {
        assert_eq!(BitTime::of_cycles(80, 0), None);
        assert_eq!(BitTime::of_bitrate(0), None);
    }
}
