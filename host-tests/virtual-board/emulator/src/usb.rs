//! The USB controller of the part as a driver finds it with nothing plugged in: it can be set up, and nothing happens.
//!
//! Only the global registers that a driver waits for or decides by have a behaviour of their own; the others, and those
//! of the device block, keep what is written. It enumerates nothing, carries no byte and raises no interrupt.
//!
//! | Register | Behaviour | Source |
//! |---|---|---|
//! | GRSTCTL | the core's reset and the flushes of the FIFOs are over at once; the bus master is idle | the emulator's model, which cites RM0433 §57.14.5 |
//! | GINTSTS | FIFOs empty, no event, whatever is written; device mode 25 ms after GUSBCFG has had FDMOD and PHYSEL, host mode before | RM0433 §57.14.6, GUSBCFG.FDMOD; chibios-upstream #13 |
//! | CID | 0x2300 | found on an STM32H7: stm32-rs/synopsys-usb-otg, pull request 4 |

pub mod function;

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::snapshot::store;
use rigless::soc::stm32h743::generated::otg1_hs_global::Register;
use rigless::soc::stm32h743::peripherals::otg::Otg;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

/// The controller with the internal full-speed transceiver, on PA11 and PA12.
pub(crate) const NAME: &str = "OTG2_HS_GLOBAL";
/// GINTSTS: periodic and non-periodic transmit FIFO empty.
const NOTHING_HAPPENED: u64 = 1 << 26 | 1 << 5;
/// GINTSTS.CMOD: host mode.
const HOST_MODE: u64 = 1;
/// GUSBCFG: the internal transceiver, and the role of a device.
const PHYSEL: u64 = 1 << 6;
const FDMOD: u64 = 1 << 30;
/// How long the controller takes to take that role.
const ROLE_NANOS: u64 = 25_000_000;
/// What CID reads.
const CORE: u64 = 0x2300;

/// The controller's global registers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Usb {
    otg: Otg,
    /// Since when it has been told to be a device, by its own transceiver.
    device_since: Option<VirtualNanos>,
}

store!(Usb);

impl Device for Usb {
    type Register = Register;

    fn read(
        &mut self,
        register: Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        self.peek(register, registers, context.now())
    }

    fn peek(&self, register: Register, _: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        let is_device = self.device_since.is_some_and(|since| now.0 >= since.0 + ROLE_NANOS);
        match register {
            Register::OtgHsGintsts => Some(NOTHING_HAPPENED | if is_device { 0 } else { HOST_MODE }),
            Register::OtgHsCid => Some(CORE),
            _ => None,
        }
    }

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if register == Register::OtgHsGusbcfg {
            let told = value & (PHYSEL | FDMOD) == PHYSEL | FDMOD;
            self.device_since = if told { self.device_since.or(Some(context.now())) } else { None };
        }
        self.otg.write(register, value, registers, context);
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use rigless::mcu::Operate;
    use rigless::soc::Width;

    use super::*;
    use crate::h743::Stm32h743;

    /// RCC_AHB1ENR (RM0433 §8.7.40) and its bit of this controller.
    const AHB1ENR: u64 = 0x5802_44D8;
    const USB2OTGHSEN: u64 = 1 << 27;
    /// The controller's registers.
    const GRSTCTL: u64 = 0x4008_0010;
    const GINTSTS: u64 = 0x4008_0014;
    const GAHBCFG: u64 = 0x4008_0008;
    const GUSBCFG: u64 = 0x4008_000C;
    const CID: u64 = 0x4008_003C;

    #[test]
    fn a_driver_can_set_it_up_and_nothing_happens() {
        let mut part = Stm32h743::new().unwrap();
        let at = VirtualNanos(0);
        let mut write = |address, value| part.write(at, address, Width::W32, value).unwrap();
        write(AHB1ENR, USB2OTGHSEN);
        // Core soft reset; then both flushes; then every event cleared, and interrupts unmasked.
        write(GRSTCTL, 1);
        write(GRSTCTL, 0x10 << 6 | 3 << 4);
        write(GINTSTS, 0xFFFF_FFFF);
        write(GAHBCFG, 1);
        let mut read = |address| part.read(at, address, Width::W32).unwrap();
        assert_eq!(read(GRSTCTL) & 0x8000_0031, 0x8000_0000, "idle, nothing under way");
        assert_eq!(read(GINTSTS), 0x0400_0021, "host mode");
        assert_eq!(read(GAHBCFG), 1);
        assert_eq!(read(CID), 0x2300);
    }

    #[test]
    fn it_is_a_device_only_with_its_own_transceiver() {
        let mut part = Stm32h743::new().unwrap();
        part.write(VirtualNanos(0), AHB1ENR, Width::W32, USB2OTGHSEN).unwrap();
        for (value, mode) in [(FDMOD, HOST_MODE), (FDMOD | PHYSEL, 0)] {
            part.write(VirtualNanos(0), GUSBCFG, Width::W32, value).unwrap();
            assert_eq!(part.read(VirtualNanos(ROLE_NANOS - 1), GINTSTS, Width::W32).unwrap() & 1, HOST_MODE);
            assert_eq!(part.read(VirtualNanos(ROLE_NANOS), GINTSTS, Width::W32).unwrap() & 1, mode);
        }
    }
}
