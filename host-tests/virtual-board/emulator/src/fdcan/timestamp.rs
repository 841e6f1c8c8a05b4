//! The timestamp counter: TSCC and TSCV.

use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use super::BitTime;
use super::registers::field;

/// TSCC.TSS: counts bit times.
const INTERNAL: u32 = 0b01;
/// TSCC.TSS: counts what a timer of the chip counts.
const EXTERNAL: u32 = 0b10;
/// Values of the counter.
const RANGE: u64 = 1 << 16;

/// The counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timestamp {
    config: u32,
    bit: Option<BitTime>,
    /// When it stood at `from`, at this rate.
    since: VirtualNanos,
    from: u64,
    /// How often it has gone from its end to 0, as far as that has been told.
    wraps_told: u64,
}

impl Timestamp {
    /// After a reset.
    pub const RESET: Self =
        Self { config: 0, bit: None, since: VirtualNanos(0), from: 0, wraps_told: 0 };

    /// TSCC.
    #[must_use]
    pub fn config(&self) -> u32 {
        self.config
    }

    /// TSCC is written. False for the external counter, which this model does not have.
    #[must_use]
    pub fn configure(&mut self, now: VirtualNanos, written: u32) -> bool {
        self.hold(now);
        self.config = written & 0x000F_0003;
        field(self.config, 0, 2) != EXTERNAL
    }

    /// The bit time changed.
    pub fn follow(&mut self, now: VirtualNanos, bit: Option<BitTime>) {
        if self.bit != bit {
            self.hold(now);
            self.bit = bit;
        }
    }

    /// TSCV is written: the counter starts at 0.
    pub fn clear(&mut self, now: VirtualNanos) {
        self.since = now;
        self.from = 0;
        self.wraps_told = 0;
    }

    /// The counter at an instant.
    #[must_use]
    pub fn at(&self, instant: VirtualNanos) -> u16 {
        u16::try_from(self.total(instant) % RANGE).expect("16 bits")
    }

    /// When it goes from its end to 0 next.
    #[must_use]
    pub fn next_wrap(&self, now: VirtualNanos) -> Option<VirtualNanos> {
        let bit = self.counting()?;
        let wraps = self.total(now) / RANGE + 1;
        Some(bit.after(self.since, (wraps * RANGE - self.from) * self.bits_per_count()).max(now))
    }

    /// Whether it has gone from its end to 0 since the last call.
    pub fn take_wrap(&mut self, now: VirtualNanos) -> bool {
        let wraps = self.total(now) / RANGE;
        let wrapped = wraps > self.wraps_told;
        self.wraps_told = wraps;
        wrapped
    }

    fn counting(&self) -> Option<BitTime> {
        self.bit.filter(|_| field(self.config, 0, 2) == INTERNAL)
    }

    /// TCP + 1.
    fn bits_per_count(&self) -> u64 {
        u64::from(field(self.config, 16, 4)) + 1
    }

    fn total(&self, instant: VirtualNanos) -> u64 {
        match self.counting() {
            Some(bit) => self.from + bit.bits_between(self.since, instant) / self.bits_per_count(),
            None if field(self.config, 0, 2) == INTERNAL => self.from,
            None => 0,
        }
    }

    fn hold(&mut self, now: VirtualNanos) {
        self.from = self.total(now);
        self.since = now;
    }
}
