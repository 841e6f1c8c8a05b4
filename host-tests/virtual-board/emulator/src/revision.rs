//! The revisions of the STM32H743, and what differs between them as far as the firmware must know.
//!
//! Sources: REV_ID in ST's stm32h7xx_hal.h; the errata sheet ES0392 as ST's forum, mbed-os (issue
//! 11303) and Zephyr (issue 38933) quote it; the write to the interconnect in ST's
//! system_stm32h7xx.c.

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::snapshot::store;
use rigless::soc::stm32h743::generated::axi::Register;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

/// A revision of the chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Revision {
    /// Most of the NUCLEO-H743ZI.
    Y,
    /// The first one with two sound CAN controllers.
    X,
    /// The NUCLEO-H743ZI2, and the emulator's own.
    V,
}

/// DEV_ID of the part, in the lower half of DBGMCU_IDC; bits 12 to 15 are reserved and read so.
const DEVICE: u64 = 0x6450;

impl Revision {
    /// What DBGMCU_IDC reads: REV_ID in its upper half.
    #[must_use]
    pub const fn identity(self) -> u64 {
        let revision = match self {
            Self::Y => 0x1003,
            Self::X => 0x2001,
            Self::V => 0x2003,
        };
        revision << 16 | DEVICE
    }

    /// Whether the processor can read wrong words from the message RAM while two FDCANs run.
    #[must_use]
    pub const fn disturbs_message_ram(self) -> bool {
        matches!(self, Self::Y)
    }
}

/// The AXI interconnect: a register file that knows when the setting for the AXI SRAM of revision Y
/// was written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Interconnect {
    sram_set: Option<VirtualNanos>,
}

store!(Interconnect);

/// AXI_TARG7_FN_MOD.READ_ISS_OVERRIDE.
const READ_ISS_OVERRIDE: u64 = 1;

impl Interconnect {
    /// When the AXI SRAM was first told to be read one word at a time, since the last reset.
    #[must_use]
    pub fn sram_set(&self) -> Option<VirtualNanos> {
        self.sram_set
    }
}

impl Device for Interconnect {
    type Register = Register;

    fn write(
        &mut self,
        register: Register,
        value: u64,
        _: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if register == Register::AxiTarg7FnMod && value & READ_ISS_OVERRIDE != 0 {
            self.sram_set.get_or_insert(context.now());
        }
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}
