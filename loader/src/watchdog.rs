//! The independent watchdog, for as long as an exchange lasts. The image sets it up anew.

use stm32_metapac::IWDG1;
use stm32_metapac::iwdg::vals::{Key, Pr};

/// Its counts at most: with 256 clocks of 32 kHz each 32 s.
const RELOAD: u16 = 0xFFF;

/// Starts it: 32 s from a feed to the reset, and an operation of the flash takes 4 s at most.
pub fn start() {
    IWDG1.kr().write(|w| w.set_key(Key::START));
    IWDG1.kr().write(|w| w.set_key(Key::ENABLE));
    IWDG1.pr().write(|w| w.set_pr(Pr::DIVIDE_BY256));
    IWDG1.rlr().write(|w| w.set_rl(RELOAD));
}

/// Feeds it.
pub fn feed() {
    IWDG1.kr().write(|w| w.set_key(Key::RESET));
}
