//! The boards that the firmware is built for: what is on them, and which pin and port means what.

use std::num::NonZeroU64;
use std::ops::{Deref, Range};
use std::time::Duration;

use rigless::machine::armv7m::INSTRUCTIONS_PER_SECOND;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};
use virtual_stm32::Chip;
use virtual_stm32::pins::{Pin, Port};
use virtual_stm32::processor::Pace;
use virtual_stm32::serial_port::SerialPort;

use crate::machine::{CanPort, UartPort};
use crate::measure::SPEEDS;

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

/// The flash, as far as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flash {
    /// Where it is written: from, to.
    pub written: (u64, u64),
    /// Bytes of a page, which is erased as a whole.
    pub page: usize,
    /// Bytes of a word, which is written as a whole.
    pub word: usize,
    /// The banks that are written: where each begins, from which its pages are counted, and its
    /// control register.
    pub banks: &'static [(u64, u64)],
    /// The bit of a control register that starts an erasure.
    pub erase: u64,
    /// From where in the control register the page is counted, and its bits.
    pub page_field: (u32, u64),
    /// What an erasure and a word take at least.
    pub times: [Duration; 2],
}

impl Flash {
    /// Whether an address is where it is written.
    pub fn holds(&self, address: u64) -> bool {
        (self.written.0..self.written.1).contains(&address)
    }
}

/// What is on a board.
#[derive(Debug)]
pub struct Facts {
    /// As the firmware calls it.
    name: &'static str,
    /// The variable that names the file of its image.
    pub image_variable: &'static str,
    /// The clock on the HSE pins.
    pub(crate) hse_hz: u64,
    /// The clock of the core that the firmware sets.
    clock_hz: NonZeroU64,
    /// How many instructions a second its core executes unless told otherwise.
    pub(crate) usual_rate: NonZeroU64,
    /// The speeds that measurements and reaction times are taken at, in instructions per second:
    /// what the core reaches at best, and a bad case.
    pub speeds: [u64; 2],
    /// What a bit lasts on host link 1 at 921600 baud, in picoseconds.
    pub host_1_bit_ps: u64,
    /// Its CAN buses, which the gateway numbers first.
    pub can_ports: &'static [CanPort],
    rs485_bus: u8,
    /// Where `board-resume` begins (host-tests/board-resume).
    pub(crate) resume: u32,
    /// Where the image has nothing: the end of what it may have.
    pub free_flash: u64,
    /// Some words of RAM that the image has nothing in: behind the few buffers of DMA.
    pub(crate) free_ram: u32,
    /// Its flash.
    pub flash: Flash,
    /// The chip's names for the serial ports: of host links 0 and 1, and of RS485.
    serial_names: [&'static str; 3],
    /// The e-stop input: closed to ground on a machine that may run, pulled up inside the part.
    pub e_stop: Pin,
    /// The enable output: the drives have power while it is high; a resistor outside pulls it down.
    pub enable: Pin,
    /// The light: on while it is high.
    pub light: Pin,
    /// The image's static memory. What a call returns lies elsewhere, on the stack.
    pub statics: Range<u32>,
    /// Where the firmware keeps what must outlive a reset.
    pub retained_ram: RetainedRam,
}

/// The ST-LINK clocks the chip; a core with its caches, and without.
static NUCLEO_H743ZI: Facts = Facts {
    name: "nucleo-h743zi",
    image_variable: "MOTOR_GATEWAY_ELF",
    hse_hz: 8_000_000,
    clock_hz: NonZeroU64::new(400_000_000).expect("not zero"),
    usual_rate: INSTRUCTIONS_PER_SECOND,
    speeds: SPEEDS,
    host_1_bit_ps: 1_090_000, // 109 cycles of 100 MHz
    can_ports: &[CanPort::Bus0, CanPort::Bus1],
    rs485_bus: 2,
    resume: 0x080C_0000,
    free_flash: 0x080F_F000,
    free_ram: 0x2403_FFE0,
    flash: Flash {
        written: (0x0802_0000, 0x0820_0000),
        page: 128 << 10,
        word: 32,
        banks: &[(0x0800_0000, 0x5200_200C), (0x0810_0000, 0x5200_210C)],
        erase: 1 << 7,
        page_field: (8, 0b111),
        times: [Duration::from_secs(1), Duration::from_micros(100)],
    },
    serial_names: ["USART3", "USART6", "USART2"],
    e_stop: Pin::new(Port::E, 11),
    enable: Pin::new(Port::E, 9),
    light: Pin::new(Port::B, 0),
    statics: 0x2000_C000..0x2002_0000,
    retained_ram: RetainedRam { base: 0x3800_0000, bytes: 64 << 10, loses_last_write: true },
};

/// The crystal X3 clocks the chip; one instruction in each cycle at most. SRAM2 checks no words,
/// so no write waits.
static NUCLEO_G474RE: Facts = Facts {
    name: "nucleo-g474re",
    image_variable: "MOTOR_GATEWAY_G474_ELF",
    hse_hz: 24_000_000,
    clock_hz: NonZeroU64::new(168_000_000).expect("not zero"),
    usual_rate: NonZeroU64::new(168_000_000).expect("not zero"),
    speeds: [168_000_000, 100_000_000],
    host_1_bit_ps: 1_083_333, // 182 cycles of 168 MHz
    can_ports: &[CanPort::Bus0, CanPort::Bus1, CanPort::Bus2],
    rs485_bus: 3,
    resume: 0x0A00_0000,
    free_flash: 0x0807_B000,
    free_ram: 0x2001_3FE0,
    flash: Flash {
        written: (0x0807_C000, 0x0808_0000),
        page: 2 << 10,
        word: 8,
        banks: &[(0x0804_0000, 0x4002_2014)],
        erase: 1 << 16,
        page_field: (3, 0x7F),
        times: [Duration::from_micros(24_470), Duration::from_micros(90)],
    },
    serial_names: ["LPUART1", "USART1", "USART3"],
    e_stop: Pin::new(Port::A, 4),
    enable: Pin::new(Port::B, 0),
    light: Pin::new(Port::A, 5),
    statics: 0x2000_0000..0x2001_3000,
    retained_ram: RetainedRam { base: 0x2001_4000, bytes: 16 << 10, loses_last_write: false },
};

/// The variable that chooses a board.
const BOARD_VARIABLE: &str = "MOTOR_GATEWAY_BOARD";
/// VDD and VDDA.
const SUPPLY_MILLIVOLTS: u32 = 3300;

impl Board {
    /// Every board.
    pub const ALL: [Self; 2] = [Self::NucleoH743zi, Self::NucleoG474re];

    /// The one that the variable `MOTOR_GATEWAY_BOARD` names; the NUCLEO-H743ZI where it is not
    /// set.
    /// Panics if it names another.
    pub fn chosen() -> Self {
        let Ok(name) = std::env::var(BOARD_VARIABLE) else { return Self::default() };
        let found = Self::ALL.into_iter().find(|board| board.name() == name);
        found.unwrap_or_else(|| panic!("{BOARD_VARIABLE} names {name}, which is no board"))
    }

    /// What is on it.
    pub const fn facts(self) -> &'static Facts {
        match self {
            Self::NucleoH743zi => &NUCLEO_H743ZI,
            Self::NucleoG474re => &NUCLEO_G474RE,
        }
    }

    /// The board around a chip.
    pub const fn of(chip: &Chip) -> Self {
        match chip {
            Chip::H743(_) => Self::NucleoH743zi,
            Chip::G474(_) => Self::NucleoG474re,
        }
    }

    /// Its chip, with the clock on its HSE pins. Panics if it is not described as our models
    /// expect it: a defect of the emulator.
    pub fn chip(self) -> Chip {
        let chip = match self {
            Self::NucleoH743zi => Chip::new_h743(),
            Self::NucleoG474re => Chip::new_g474(),
        };
        let mut chip = chip.unwrap_or_else(|error| panic!("{error}"));
        chip.attach_hse(VirtualNanos(0), self.hse_hz);
        if let Chip::H743(part) = &mut chip {
            part.stm32.set_supply(SUPPLY_MILLIVOLTS);
            part.stm32.set_analog_supply(SUPPLY_MILLIVOLTS);
        }
        chip
    }

    /// How its core runs, with the clock that the firmware sets.
    pub(crate) fn pace(self, instructions_per_second: NonZeroU64) -> Pace {
        Pace { clock_hz: self.clock_hz, instructions_per_second }
    }

    /// As the firmware calls it.
    pub const fn name(self) -> &'static str {
        self.facts().name
    }

    /// The chip's name for a serial port.
    pub const fn serial_name(self, port: UartPort) -> &'static str {
        self.facts().serial_names[port as usize]
    }

    /// The gateway's number of the RS485 bus: the last.
    pub const fn rs485_bus(self) -> u8 {
        self.facts().rs485_bus
    }
}

impl Deref for Board {
    type Target = Facts;

    fn deref(&self) -> &Facts {
        self.facts()
    }
}

/// A serial port of the board around a chip.
pub(crate) fn serial_port(chip: &mut Chip, port: UartPort) -> &mut SerialPort {
    chip.serial_mut(Board::of(chip).serial_name(port))
}
