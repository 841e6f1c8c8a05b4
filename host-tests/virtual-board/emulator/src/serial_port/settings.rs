//! How the firmware has set a serial port up.

use rigless::device::RegisterFile;
use rigless::soc::FieldSpec;
use rigless::soc::stm32h743::generated::usart1::{Register, brr, cr1, cr3, presc};
use serde::{Deserialize, Serialize};

/// `PRESC`: what codes 0 to 11 divide the kernel clock by; the others divide by the last.
const PRESCALERS: [u64; 12] = [1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256];
const PICOS_PER_SECOND: u128 = 1_000_000_000_000;

/// What the line sees of the port's registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Settings {
    /// Picoseconds of a bit; 0 while the port is off, has no clock or no divider.
    pub bit_ps: u64,
    /// How the port drives its driver-enable output; `None` while that is off.
    pub driver_enable: Option<DriverEnable>,
}

/// The driver-enable output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct DriverEnable {
    /// From its rise to the start bit, in sample times: sixteenths of a bit, or eighths with
    /// OVER8.
    pub assertion: u8,
    /// From the stop bit's end to its fall, likewise.
    pub deassertion: u8,
    /// It is low while the port sends.
    pub active_low: bool,
}

impl Settings {
    /// Bits per second, rounded; 0 while the port is off.
    #[must_use]
    pub fn bits_per_second(&self) -> u64 {
        let bit = u128::from(self.bit_ps);
        match bit {
            0 => 0,
            _ => u64::try_from((PICOS_PER_SECOND + bit / 2) / bit).unwrap_or(u64::MAX),
        }
    }

    pub(super) fn of(registers: &RegisterFile, kernel_hz: u64) -> Self {
        let control = registers.get(Register::Cr1);
        if !cr1::UE.is_set(control) || kernel_hz == 0 {
            return Self::default();
        }
        let divider = registers.get(Register::Brr);
        let (high, low) = (brr::BRR_4_15.get(divider) << 4, brr::BRR_0_3.get(divider));
        // With OVER8, BRR[2:0] is the divider's low nibble shifted right once, and a bit is half
        // the divider.
        let cycles =
            if cr1::OVER8.is_set(control) { (high | (low & 0b111) << 1) / 2 } else { high | low };
        let code = usize::try_from(presc::PRESCALER.get(registers.get(Register::Presc)))
            .unwrap_or_default();
        let [.., last] = PRESCALERS;
        let cycles = cycles * PRESCALERS.get(code).unwrap_or(&last);
        let bit_ps = u128::from(cycles) * PICOS_PER_SECOND / u128::from(kernel_hz);
        let control_3 = registers.get(Register::Cr3);
        let driver_enable = cr3::DEM.is_set(control_3).then(|| DriverEnable {
            assertion: number(
                &[cr1::DEAT0, cr1::DEAT1, cr1::DEAT2, cr1::DEAT3, cr1::DEAT4],
                control,
            ),
            deassertion: number(
                &[cr1::DEDT0, cr1::DEDT1, cr1::DEDT2, cr1::DEDT3, cr1::DEDT4],
                control,
            ),
            active_low: cr3::DEP.is_set(control_3),
        });
        Self { bit_ps: u64::try_from(bit_ps).unwrap_or(u64::MAX), driver_enable }
    }
}

/// The number whose bits these fields are, lowest first.
fn number(bits: &[&FieldSpec], value: u64) -> u8 {
    bits.iter().rev().fold(0, |number, bit| number << 1 | u8::from(bit.is_set(value)))
}
