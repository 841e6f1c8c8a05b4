//! A number of the chip's random generator, for what must not come again after a start.

use embassy_stm32::pac::RNG;
use embassy_stm32::{peripherals, rcc};
use embassy_time::{Duration, Instant};

/// In which the generator must have given it.
const DEADLINE: Duration = Duration::from_millis(1);

/// A random number; nothing if the generator gives none in time. Once, when the clocks run. Errors
/// of its noise source and its clock are answered by another try (RM0433, RM0440, "Error
/// management"), and both numbers of a stuck source by none: the first is only there to be
/// told from the second (FIPS 140-2, 4.9.2).
pub fn number() -> Option<u32> {
    rcc::enable_and_reset::<peripherals::RNG>();
    let end = Instant::now() + DEADLINE;
    RNG.cr().modify(|w| w.set_rngen(true));
    let mut first = None;
    let number = loop {
        let status = RNG.sr().read();
        if status.seis() || status.ceis() {
            RNG.cr().modify(|w| w.set_rngen(false));
            RNG.sr().write(|w| {
                w.set_seis(false);
                w.set_ceis(false);
            });
            RNG.cr().modify(|w| w.set_rngen(true));
            first = None;
        } else if status.drdy() {
            // Zero is what stands there while there is none.
            match (first, RNG.dr().read()) {
                (_, 0) => {}
                (None, number) => first = Some(number),
                (Some(before), number) if before == number => break None,
                (Some(_), number) => break Some(number),
            }
        }
        if Instant::now() >= end {
            break None;
        }
    };
    rcc::disable::<peripherals::RNG>();
    number
}
