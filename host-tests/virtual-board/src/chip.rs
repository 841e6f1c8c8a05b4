//! The chip of the board: the same seams, whichever it is.

use rigless::cpu::armv7m::windows;
use rigless::device::{DeviceContext, ErasedDevice, Level, RegisterFile, ResetCause};
use rigless::emulator::{Access, Checked, Memory};
use rigless::machine::armv7m::{Config, Core, Fpu, MpuRegions, Variant};
use rigless::mcu::{Mcu, Operate};
use rigless::snapshot::{self, Reader, Store, Writer};
use rigless::soc::stm32h743::generated::gpioa::Register as PortRegister;
use rigless::soc::stm32h743::peripherals::gpio::{self, Gpio};
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};
use std::num::{NonZeroU32, NonZeroU64};

use crate::fdcan::Fdcan;
use crate::g474::{self, Stm32g474};
use crate::part::{self, Part};
use crate::pins::{self, Driven, Pin, Port};
use crate::serial_port::SerialPort;

/// A board that the firmware is built for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Board {
    /// With an STM32H743.
    #[default]
    NucleoH743zi,
    /// With an STM32G474.
    NucleoG474re,
}

/// RAM that start-up code leaves alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct RetainedRam {
    /// Its first address.
    pub base: u64,
    /// Its size in bytes.
    pub bytes: u64,
    /// A reset loses the last write to it, which waits for the next one.
    pub loses_last_write: bool,
}

impl Board {
    /// As the firmware calls it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NucleoH743zi => "nucleo-h743zi",
            Self::NucleoG474re => "nucleo-g474re",
        }
    }

    /// The e-stop input: closed to ground on a machine that may run, pulled up inside the part.
    #[must_use]
    pub const fn e_stop(self) -> Pin {
        match self {
            Self::NucleoH743zi => pins::E_STOP,
            Self::NucleoG474re => Pin::new(Port::A, 4),
        }
    }

    /// The enable output: the drives have power while it is high.
    #[must_use]
    pub const fn enable(self) -> Pin {
        match self {
            Self::NucleoH743zi => pins::ENABLE,
            Self::NucleoG474re => Pin::new(Port::B, 0),
        }
    }

    /// The light: on while it is high.
    #[must_use]
    pub const fn light(self) -> Pin {
        match self {
            Self::NucleoH743zi => pins::LIGHT,
            Self::NucleoG474re => Pin::new(Port::A, 5),
        }
    }

    /// Where the firmware keeps what must outlive a reset. SRAM2 of the STM32G474 checks no words, so no write waits.
    #[must_use]
    pub const fn retained_ram(self) -> RetainedRam {
        match self {
            Self::NucleoH743zi => RetainedRam { base: 0x3800_0000, bytes: 64 << 10, loses_last_write: true },
            Self::NucleoG474re => RetainedRam { base: 0x2001_4000, bytes: 16 << 10, loses_last_write: false },
        }
    }
}

/// The chip with every model.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "it lies in a box")]
pub enum Chip {
    /// An STM32H743.
    H743(Part),
    /// An STM32G474.
    G474(Stm32g474),
}

/// The crystal X3 of the NUCLEO-G474RE.
const G474_HSE_HZ: u64 = 24_000_000;
/// The core clock that the firmware sets there.
const G474_CORE_HZ: NonZeroU64 = NonZeroU64::new(168_000_000).expect("not zero");
/// A Cortex-M4 r0p1.
const G474_CPUID: u32 = 0x410F_C241;

/// The Cortex-M4F of the STM32G474 (PM0214): FPv4-SP, eight MPU regions, four bits of priority.
pub(crate) fn g474_core(chip: &Chip, instructions_per_second: NonZeroU64, vector_table: u32) -> Config {
    let lines = NonZeroU32::new(u32::from(chip.cpu().interrupt_lines)).expect("a part with interrupts");
    let core = Core {
        variant: Variant::M4,
        clock_hz: G474_CORE_HZ,
        interrupt_lines: lines,
        priority_bits: 4,
        refclk_divider: NonZeroU32::new(8).expect("not zero"),
        instructions_per_second,
        boot: "flash",
    };
    let mut config = Config::new(core, &windows(chip.bus()));
    config.fpu = Fpu::FpV4Sp;
    config.mpu_regions = MpuRegions::Eight;
    config.cpuid = G474_CPUID;
    config.vector_table = Some(vector_table);
    config
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
    /// The chip of a board, out of reset.
    ///
    /// # Errors
    ///
    /// If the description of the part contradicts itself.
    pub fn new(board: Board) -> Result<Self, Error> {
        Ok(match board {
            Board::NucleoH743zi => Self::H743(Part::new()?),
            Board::NucleoG474re => {
                let mut part = Stm32g474::new()?;
                part.clocks.attach_crystal(G474_HSE_HZ);
                Self::G474(part)
            }
        })
    }

    /// The board it is on.
    #[must_use]
    pub fn board(&self) -> Board {
        match self {
            Self::H743(_) => Board::NucleoH743zi,
            Self::G474(_) => Board::NucleoG474re,
        }
    }

    /// The STM32H743.
    ///
    /// # Panics
    ///
    /// If the chip is another.
    #[must_use]
    pub fn h743(&self) -> &Part {
        match self {
            Self::H743(part) => part,
            Self::G474(_) => panic!("this board has an STM32G474"),
        }
    }

    /// The STM32G474.
    ///
    /// # Panics
    ///
    /// On the other board.
    #[must_use]
    pub fn g474(&self) -> &Stm32g474 {
        match self {
            Self::G474(part) => part,
            Self::H743(_) => panic!("this board has an STM32H743"),
        }
    }

    /// The STM32H743.
    ///
    /// # Panics
    ///
    /// If the chip is another.
    pub fn h743_mut(&mut self) -> &mut Part {
        match self {
            Self::H743(part) => part,
            Self::G474(_) => panic!("this board has an STM32G474"),
        }
    }

    /// A controller for CAN with its bus.
    #[must_use]
    pub fn fdcan(&self, number: usize) -> &Fdcan {
        either!(self, part => &part.fdcan[number])
    }

    /// A controller for CAN with its bus.
    pub fn fdcan_mut(&mut self, number: usize) -> &mut Fdcan {
        either!(self, part => &mut part.fdcan[number])
    }

    /// Calls one of them with its registers and an instant to act at.
    pub(crate) fn drive_fdcan<T>(
        &mut self,
        number: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut Fdcan, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        let (name, fdcan, bus) = match self {
            Self::H743(part) => (part::FDCAN_NAMES[number], &mut part.fdcan[number], part.stm32.bus_mut()),
            Self::G474(part) => (g474::FDCAN_NAMES[number], &mut part.fdcan[number], &mut part.bus),
        };
        let slot = bus.slot(name).expect("the part has this controller");
        let (registers, mut context) = bus.drive(at, slot);
        call(fdcan, registers, &mut context)
    }

    /// A serial port: host link 0, host link 1, RS485.
    pub fn serial_mut(&mut self, number: usize) -> &mut SerialPort {
        either!(self, part => &mut part.serial[number])
    }

    /// Whether the watchdog has been started.
    #[must_use]
    pub fn watchdog_is_started(&self) -> bool {
        either!(self, part => part.iwdg.is_started())
    }

    /// Calls one serial port with its registers and an instant to act at.
    pub fn drive_serial<T>(
        &mut self,
        port: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut SerialPort, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        either!(self, part => part.drive_serial(port, at, call))
    }

    /// Cuts the supply at an instant, or gives it back.
    pub(crate) fn supply(&mut self, at: VirtualNanos, on: bool) {
        either!(self, part => part.supply(at, on));
    }

    /// Drives a pin from outside from `at` on; `None` lets go of it.
    pub fn drive_pin(&mut self, pin: Pin, level: Option<Level>, at: VirtualNanos) {
        let number = gpio::Pin::new(pin.number()).expect("a port has sixteen pins");
        let drive = |gpio: &mut Gpio, registers: &mut RegisterFile, context: &mut DeviceContext<'_>| {
            gpio.drive(number, level, registers, context);
        };
        match self {
            Self::H743(part) => part.stm32.drive_port(at, pin.port(), drive),
            Self::G474(part) => part.drive_port(at, pin.port(), drive),
        }
    }

    /// Whether the chip reads a pin as high.
    pub(crate) fn reads_high(&self, pin: Pin) -> bool {
        let number = gpio::Pin::new(pin.number()).expect("a port has sixteen pins");
        let (port, registers) = match self {
            Self::H743(part) => (&part.stm32.gpio[pin.port()], part.port_registers(pin.port())),
            Self::G474(part) => (&part.gpio[pin.port()], part.port_registers(pin.port())),
        };
        port.level(number, registers) == Level::High
    }

    /// Ports of pins.
    pub(crate) fn ports(&self) -> usize {
        match self {
            Self::H743(_) => gpio::PORTS.len(),
            Self::G474(_) => g474::PORTS.len(),
        }
    }

    /// The port whose register is at that address.
    pub(crate) fn port_at(&self, address: u64) -> Option<usize> {
        let first = match self {
            Self::H743(_) => pins::FIRST_PORT,
            Self::G474(_) => g474::FIRST_PORT,
        };
        let port = usize::try_from(address.checked_sub(first)? / pins::PORT_BYTES).ok()?;
        (port < self.ports()).then_some(port)
    }

    /// What the firmware drives on the general-purpose outputs of a port.
    pub(crate) fn driven(&self, port: usize) -> Driven {
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

    fn mcu(&self) -> &dyn Mcu {
        either!(self, part => part)
    }

    fn mcu_mut(&mut self) -> &mut dyn Mcu {
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

impl Mcu for Chip {
    fn bus(&self) -> &Bus {
        self.mcu().bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.mcu_mut().bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.mcu_mut().reset(at, cause);
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.mcu_mut().poll(now);
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        self.mcu_mut().split(slot)
    }

    // The defaults of the trait would answer for the chip.

    fn read_checked(
        &mut self,
        at: VirtualNanos,
        address: u64,
        report: bool,
        memory: &mut dyn Memory,
    ) -> Option<Checked> {
        self.mcu_mut().read_checked(at, address, report, memory)
    }

    fn checks_every_read(&mut self) -> bool {
        self.mcu_mut().checks_every_read()
    }

    fn mismatched_words(&mut self) -> Option<Vec<u64>> {
        self.mcu_mut().mismatched_words()
    }

    fn write_checked(&mut self, access: Access, memory: &mut dyn Memory) -> Option<bool> {
        self.mcu_mut().write_checked(access, memory)
    }

    fn flip_bits(
        &mut self,
        address: u64,
        data: u64,
        check: u8,
        memory: &mut dyn Memory,
    ) -> Result<(), String> {
        self.mcu_mut().flip_bits(address, data, check, memory)
    }

    fn keeps_check_bits(&self, address: u64) -> bool {
        self.mcu().keeps_check_bits(address)
    }

    fn compares_cores(&self) -> bool {
        self.mcu().compares_cores()
    }

    fn compare_error(&mut self, at: VirtualNanos) {
        self.mcu_mut().compare_error(at);
    }
}
