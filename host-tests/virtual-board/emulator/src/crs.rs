//! The clock recovery system as far as a firmware sets it up: CFGR keeps what it holds while CEN is
//! set (RM0433, CRS chapter). It trims nothing: the emulator's HSI48 is exact.

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::snapshot::store;
use rigless::soc::stm32h743::generated::crs::{Register, cfgr, cr};
use serde::{Deserialize, Serialize};

/// Its name on the bus.
pub(crate) const NAME: &str = "CRS";
/// Reset value of CFGR.
const CFGR_RESET: u64 = 0x2022_BB7F;

/// Where the frames come from that trim the oscillator (SYNCSRC; stm32h7xx_hal_rcc_ex.h).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// A pin.
    Pin,
    /// The 32 kHz crystal.
    Lse,
    /// The USB controller on PB14 and PB15.
    Usb1,
    /// The USB controller on PA11 and PA12.
    Usb2,
}

/// The clock recovery system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Crs {
    enabled: bool,
    configuration: u64,
}

store!(Crs);

impl Default for Crs {
    fn default() -> Self {
        Self { enabled: false, configuration: CFGR_RESET }
    }
}

impl Crs {
    /// What it follows; nothing while it is off.
    #[must_use]
    pub fn source(&self) -> Option<Source> {
        self.enabled.then(|| match cfgr::SYNCSRC.get(self.configuration) {
            0 => Source::Pin,
            1 => Source::Lse,
            2 => Source::Usb1,
            _ => Source::Usb2,
        })
    }
}

impl Device for Crs {
    type Register = Register;

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        match register {
            Register::Cr => self.enabled = cr::CEN.is_set(value),
            Register::Cfgr if self.enabled => {
                context.tell("CFGR", "written while CEN is set");
                registers.set(Register::Cfgr, self.configuration);
            }
            Register::Cfgr => self.configuration = value,
            Register::Isr | Register::Icr => {}
        }
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}
