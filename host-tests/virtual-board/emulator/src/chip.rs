//! One type for both chips: the same calls, whichever it is.

use std::ops::{Deref, DerefMut};

use rigless::device::{DeviceContext, Level, RegisterFile};
use rigless::mcu::Mcu;
use rigless::snapshot::{self, Reader, Store, Writer};
use rigless::soc::Error;
use rigless::soc::stm32h743::generated::gpioa::Register as PortRegister;
use rigless::soc::stm32h743::peripherals::gpio::{self, Gpio};
use rigless::time::VirtualNanos;

use crate::fdcan::Fdcan;
use crate::g474::{self, Stm32g474};
use crate::h743::{self, Stm32h743};
use crate::pins::{Driven, Pin};
use crate::serial_port::SerialPort;
use crate::usb::host::Host;

/// From one port's registers to the next, on both chips (RM0433 §2.3, stm32-metapac 21).
const PORT_BYTES: u64 = 0x400;

/// A chip with every model. It dereferences to what rigless runs, an [`Mcu`]: so `read`, `write`
/// and `bus` are its own too.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "it lies in a box")]
pub enum Chip {
    /// An STM32H743.
    H743(Stm32h743),
    /// An STM32G474.
    G474(Stm32g474),
}

/// Says the same of either chip.
macro_rules! either {
    ($chip:expr, $part:ident => $say:expr) => {
        match $chip {
            Chip::H743($part) => $say,
            Chip::G474($part) => $say,
        }
    };
}

impl Chip {
    /// An STM32H743 out of reset.
    ///
    /// # Errors
    ///
    /// If the description of the part contradicts itself.
    pub fn new_h743() -> Result<Self, Error> {
        Stm32h743::new().map(Self::H743)
    }

    /// An STM32G474 out of reset.
    ///
    /// # Errors
    ///
    /// If the description of the part contradicts itself.
    pub fn new_g474() -> Result<Self, Error> {
        Stm32g474::new().map(Self::G474)
    }

    /// The STM32H743.
    ///
    /// # Panics
    ///
    /// If the chip is another.
    #[must_use]
    pub fn h743(&self) -> &Stm32h743 {
        match self {
            Self::H743(part) => part,
            Self::G474(_) => panic!("this chip is an STM32G474"),
        }
    }

    /// The STM32H743.
    ///
    /// # Panics
    ///
    /// If the chip is another.
    pub fn h743_mut(&mut self) -> &mut Stm32h743 {
        match self {
            Self::H743(part) => part,
            Self::G474(_) => panic!("this chip is an STM32G474"),
        }
    }

    /// The STM32G474.
    ///
    /// # Panics
    ///
    /// If the chip is another.
    #[must_use]
    pub fn g474(&self) -> &Stm32g474 {
        match self {
            Self::G474(part) => part,
            Self::H743(_) => panic!("this chip is an STM32H743"),
        }
    }

    /// The STM32G474.
    ///
    /// # Panics
    ///
    /// If the chip is another.
    pub fn g474_mut(&mut self) -> &mut Stm32g474 {
        match self {
            Self::G474(part) => part,
            Self::H743(_) => panic!("this chip is an STM32H743"),
        }
    }

    /// Puts a crystal, or another clock of `hz`, on the HSE pins; nothing where it is 0.
    pub fn attach_hse(&mut self, at: VirtualNanos, hz: u64) {
        match self {
            Self::H743(part) => part.attach_hse(hz),
            Self::G474(part) => part.attach_hse(at, hz),
        }
    }

    /// The clock on the HSE pins stops. Whether the clock security system was on: it then moves the
    /// system to the HSI, and raises the NMI, which is up to the caller.
    pub fn lose_hse(&mut self, at: VirtualNanos) -> bool {
        either!(self, part => part.lose_hse(at))
    }

    /// A controller for CAN with its bus. FDCAN1 is 0.
    ///
    /// # Panics
    ///
    /// Here and below: if the chip has no such peripheral.
    #[must_use]
    pub fn fdcan(&self, number: usize) -> &Fdcan {
        either!(self, part => &part.fdcan[number])
    }

    /// A controller for CAN with its bus. FDCAN1 is 0.
    pub fn fdcan_mut(&mut self, number: usize) -> &mut Fdcan {
        either!(self, part => &mut part.fdcan[number])
    }

    /// Calls one of them with its registers and an instant to act at.
    pub fn drive_fdcan<T>(
        &mut self,
        number: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut Fdcan, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        either!(self, part => part.drive_fdcan(number, at, call))
    }

    /// A serial port by its name, such as `USART3`.
    pub fn serial_mut(&mut self, name: &str) -> &mut SerialPort {
        let port = self.serial_port(name);
        either!(self, part => &mut part.serial[port])
    }

    /// Calls one serial port with its registers and an instant to act at.
    pub fn drive_serial<T>(
        &mut self,
        name: &str,
        at: VirtualNanos,
        call: impl FnOnce(&mut SerialPort, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        let port = self.serial_port(name);
        either!(self, part => part.drive_serial(port, at, call))
    }

    fn serial_port(&self, name: &str) -> usize {
        let names: &[&str] = match self {
            Self::H743(_) => &h743::SERIAL_NAMES,
            Self::G474(_) => &g474::SERIAL_NAMES,
        };
        let port = names.iter().position(|known| *known == name);
        port.unwrap_or_else(|| panic!("the chip has no serial port {name}"))
    }

    /// The host at the other end of the USB cable.
    pub fn usb_host_mut(&mut self) -> &mut Host {
        either!(self, part => &mut part.usb.host)
    }

    /// Whether the independent watchdog has been started.
    #[must_use]
    pub fn watchdog_is_started(&self) -> bool {
        either!(self, part => part.iwdg.is_started())
    }

    /// Whether the processor stands still because its flash is busy: that of the STM32H743 runs from
    /// the first bank, and does not wait for the second.
    #[must_use]
    pub fn waits_for_flash(&self) -> bool {
        match self {
            Self::H743(part) => part.first_bank_is_busy(),
            Self::G474(part) => part.flash.is_busy(),
        }
    }

    /// Cuts the supply at an instant, or gives it back.
    pub fn supply(&mut self, at: VirtualNanos, on: bool) {
        either!(self, part => part.supply(at, on));
    }

    /// Drives a pin from outside from `at` on; `None` lets go of it.
    pub fn drive_pin(&mut self, pin: Pin, level: Option<Level>, at: VirtualNanos) {
        let number = number(pin);
        let drive =
            |gpio: &mut Gpio, registers: &mut RegisterFile, context: &mut DeviceContext<'_>| {
                gpio.drive(number, level, registers, context);
            };
        either!(self, part => part.drive_port(pin.port(), at, drive));
    }

    /// Whether the chip reads a pin as high.
    #[must_use]
    pub fn reads_high(&self, pin: Pin) -> bool {
        let (port, registers) = match self {
            Self::H743(part) => (&part.stm32.gpio[pin.port()], part.port_registers(pin.port())),
            Self::G474(part) => (&part.gpio[pin.port()], part.port_registers(pin.port())),
        };
        port.level(number(pin), registers) == Level::High
    }

    /// Ports of pins.
    #[must_use]
    pub fn ports(&self) -> usize {
        match self {
            Self::H743(_) => gpio::PORTS.len(),
            Self::G474(_) => g474::PORTS.len(),
        }
    }

    /// The port whose register is at that address.
    #[must_use]
    pub fn port_at(&self, address: u64) -> Option<usize> {
        let first = match self {
            Self::H743(_) => h743::FIRST_PORT,
            Self::G474(_) => g474::FIRST_PORT,
        };
        let port = usize::try_from(address.checked_sub(first)? / PORT_BYTES).ok()?;
        (port < self.ports()).then_some(port)
    }

    /// What the firmware drives on the general-purpose outputs of a port, of which A is 0.
    #[must_use]
    pub fn driven(&self, port: usize) -> Driven {
        let registers = either!(self, part => part.port_registers(port));
        let [modes, types, levels] = [PortRegister::Moder, PortRegister::Otyper, PortRegister::Odr]
            .map(|register| registers.get(register));
        let mut driven = Driven::default();
        for pin in 0..16 {
            let bit = |word: u64| word >> pin & 1 == 1;
            // An open drain that is high drives nothing.
            if modes >> (2 * pin) & 3 == 1 && !(bit(types) && bit(levels)) {
                driven.outputs |= 1 << pin;
                driven.high |= u16::from(bit(levels)) << pin;
            }
        }
        driven
    }
}

fn number(pin: Pin) -> gpio::Pin {
    gpio::Pin::new(pin.number()).expect("a port has sixteen pins")
}

impl Deref for Chip {
    type Target = dyn Mcu;

    fn deref(&self) -> &Self::Target {
        either!(self, part => part)
    }
}

impl DerefMut for Chip {
    fn deref_mut(&mut self) -> &mut Self::Target {
        either!(self, part => part)
    }
}

impl Store for Chip {
    fn store(&self, to: &mut Writer) -> Result<(), snapshot::Error> {
        either!(self, part => part.store(to))
    }

    fn load(&mut self, from: &mut Reader) -> Result<(), snapshot::Error> {
        either!(self, part => part.load(from))
    }
}
