//! The divider of an LPUART: a bit lasts BRR / 256 kernel clocks, where a USART's lasts BRR
//! (stm32-metapac 21, `usart_v4`, block LPUART; embassy-stm32 0.6.0, `usart`, which multiplies by
//! 256).
//!
//! The model behind is a USART's, with a BRR of 16 bits. It keeps a fixed divider, and gets the
//! clock with which that makes the same bit.

use serde::{Deserialize, Serialize};

/// What stands in the BRR of the model.
pub(super) const DIVIDER: u64 = 16;
/// What the kernel clock is multiplied by.
const FACTOR: u64 = 256;

/// The divider as the firmware sees it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct LowPower {
    kernel_hz: u64,
    divider: u64,
}

impl LowPower {
    /// BRR as it was written.
    pub(super) fn divider(self) -> u64 {
        self.divider
    }

    /// The kernel clock is `hz` from now on; what the model gets.
    pub(super) fn follow(&mut self, hz: u64) -> u64 {
        self.kernel_hz = hz;
        self.model_hz()
    }

    /// BRR is written; what the model gets as its clock.
    pub(super) fn divide_by(&mut self, divider: u64) -> u64 {
        self.divider = divider;
        self.model_hz()
    }

    fn model_hz(self) -> u64 {
        match self.divider {
            0 => self.kernel_hz,
            divider => self.kernel_hz * FACTOR * DIVIDER / divider,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bit_at_168_mhz_and_921600_baud_is_as_long_as_the_divider_says() {
        let mut low_power = LowPower::default();
        low_power.follow(168_000_000);
        // 256 × 168 MHz / 921600 = 46666.7.
        let hz = low_power.divide_by(46_667);
        assert_eq!(hz / DIVIDER, 921_593, "bits a second");
        assert_eq!(low_power.divider(), 46_667);
    }
}
