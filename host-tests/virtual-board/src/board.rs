//! The boards that the firmware is built for: what is on them, and which pin and port means what.

use std::num::NonZeroU64;

use rigless::machine::armv7m::INSTRUCTIONS_PER_SECOND;
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

/// The variable that chooses a board.
const BOARD_VARIABLE: &str = "MOTOR_GATEWAY_BOARD";
/// VDD and VDDA.
const SUPPLY_MILLIVOLTS: u32 = 3300;

impl Board {
    /// Every board.
    pub const ALL: [Self; 2] = [Self::NucleoH743zi, Self::NucleoG474re];

    /// The one that the variable `MOTOR_GATEWAY_BOARD` names; the NUCLEO-H743ZI where it is not
    /// set.
    ///
    /// # Panics
    ///
    /// If it names another.
    #[must_use]
    pub fn chosen() -> Self {
        let Ok(name) = std::env::var(BOARD_VARIABLE) else { return Self::default() };
        let found = Self::ALL.into_iter().find(|board| board.name() == name);
        found.unwrap_or_else(|| panic!("{BOARD_VARIABLE} names {name}, which is no board"))
    }

    /// The variable that names the file of its image.
    #[must_use]
    pub const fn image_variable(self) -> &'static str {
        match self {
            Self::NucleoH743zi => "MOTOR_GATEWAY_ELF",
            Self::NucleoG474re => "MOTOR_GATEWAY_G474_ELF",
        }
    }

    /// The board around a chip.
    #[must_use]
    pub const fn of(chip: &Chip) -> Self {
        match chip {
            Chip::H743(_) => Self::NucleoH743zi,
            Chip::G474(_) => Self::NucleoG474re,
        }
    }

    /// The clock on the HSE pins: from the ST-LINK, or the crystal X3.
    pub(crate) const fn hse_hz(self) -> u64 {
        match self {
            Self::NucleoH743zi => 8_000_000,
            Self::NucleoG474re => 24_000_000,
        }
    }

    /// Its chip, with the clock on its HSE pins.
    ///
    /// # Panics
    ///
    /// If a chip is not described as our models expect it: a defect of the emulator.
    #[must_use]
    pub fn chip(self) -> Chip {
        let chip = match self {
            Self::NucleoH743zi => Chip::new_h743(),
            Self::NucleoG474re => Chip::new_g474(),
        };
        let mut chip = chip.unwrap_or_else(|error| panic!("{error}"));
        chip.attach_hse(self.hse_hz());
        if let Chip::H743(part) = &mut chip {
            part.stm32.set_supply(SUPPLY_MILLIVOLTS);
            part.stm32.set_analog_supply(SUPPLY_MILLIVOLTS);
        }
        chip
    }

    /// How its core runs, with the clock that the firmware sets.
    pub(crate) fn pace(self, instructions_per_second: NonZeroU64) -> Pace {
        let clock_hz = match self {
            Self::NucleoH743zi => const { NonZeroU64::new(400_000_000).expect("not zero") },
            Self::NucleoG474re => const { NonZeroU64::new(168_000_000).expect("not zero") },
        };
        Pace { clock_hz, instructions_per_second }
    }

    /// How many instructions a second its core executes unless told otherwise: what rigless assumes
    /// of the STM32H743, and one for each cycle of the STM32G474, the most that it can.
    pub(crate) fn usual_rate(self) -> NonZeroU64 {
        match self {
            Self::NucleoH743zi => INSTRUCTIONS_PER_SECOND,
            Self::NucleoG474re => const { NonZeroU64::new(168_000_000).expect("not zero") },
        }
    }

    /// The speeds that measurements and reaction times are taken at, in instructions per second:
    /// what the core reaches at best with its caches, or with one instruction in each cycle,
    /// and a bad case without.
    #[must_use]
    pub const fn speeds(self) -> [u64; 2] {
        match self {
            Self::NucleoH743zi => SPEEDS,
            Self::NucleoG474re => [168_000_000, 100_000_000],
        }
    }

    /// What a bit lasts on host link 1 at 921600 baud, in picoseconds: 109 cycles of 100 MHz, 182
    /// of 168 MHz.
    #[must_use]
    pub const fn host_1_bit_ps(self) -> u64 {
        match self {
            Self::NucleoH743zi => 1_090_000,
            Self::NucleoG474re => 1_083_333,
        }
    }

    /// As the firmware calls it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NucleoH743zi => "nucleo-h743zi",
            Self::NucleoG474re => "nucleo-g474re",
        }
    }

    /// Its CAN buses, which the gateway numbers first.
    #[must_use]
    pub const fn can_ports(self) -> &'static [CanPort] {
        match self {
            Self::NucleoH743zi => &[CanPort::Bus0, CanPort::Bus1],
            Self::NucleoG474re => &[CanPort::Bus0, CanPort::Bus1, CanPort::Bus2],
        }
    }

    /// The gateway's number of the RS485 bus: the last.
    #[must_use]
    pub const fn rs485_bus(self) -> u8 {
        match self {
            Self::NucleoH743zi => 2,
            Self::NucleoG474re => 3,
        }
    }

    /// Where the image has nothing: the end of the flash.
    #[must_use]
    pub const fn free_flash(self) -> u64 {
        match self {
            Self::NucleoH743zi => 0x081F_F000,
            Self::NucleoG474re => 0x0807_F000,
        }
    }

    /// The chip's name for a serial port.
    #[must_use]
    pub const fn serial_name(self, port: UartPort) -> &'static str {
        match (self, port) {
            (Self::NucleoH743zi, UartPort::Host0) => "USART3",
            (Self::NucleoH743zi, UartPort::Host1) => "USART6",
            (Self::NucleoH743zi, UartPort::Rs485) => "USART2",
            (Self::NucleoG474re, UartPort::Host0) => "LPUART1",
            (Self::NucleoG474re, UartPort::Host1) => "USART1",
            (Self::NucleoG474re, UartPort::Rs485) => "USART3",
        }
    }

    /// The e-stop input: closed to ground on a machine that may run, pulled up inside the part.
    #[must_use]
    pub const fn e_stop(self) -> Pin {
        match self {
            Self::NucleoH743zi => Pin::new(Port::E, 11),
            Self::NucleoG474re => Pin::new(Port::A, 4),
        }
    }

    /// The enable output: the drives have power while it is high; a resistor outside pulls it down.
    #[must_use]
    pub const fn enable(self) -> Pin {
        match self {
            Self::NucleoH743zi => Pin::new(Port::E, 9),
            Self::NucleoG474re => Pin::new(Port::B, 0),
        }
    }

    /// The light: on while it is high.
    #[must_use]
    pub const fn light(self) -> Pin {
        match self {
            Self::NucleoH743zi => Pin::new(Port::B, 0),
            Self::NucleoG474re => Pin::new(Port::A, 5),
        }
    }

    /// Where the firmware keeps what must outlive a reset. SRAM2 of the STM32G474 checks no words,
    /// so no write waits.
    #[must_use]
    pub const fn retained_ram(self) -> RetainedRam {
        match self {
            Self::NucleoH743zi => {
                RetainedRam { base: 0x3800_0000, bytes: 64 << 10, loses_last_write: true }
            }
            Self::NucleoG474re => {
                RetainedRam { base: 0x2001_4000, bytes: 16 << 10, loses_last_write: false }
            }
        }
    }
}

/// A serial port of the board around a chip.
pub(crate) fn serial_port(chip: &mut Chip, port: UartPort) -> &mut SerialPort {
    chip.serial_mut(Board::of(chip).serial_name(port))
}
