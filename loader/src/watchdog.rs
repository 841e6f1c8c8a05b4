//! The independent watchdog, for as long as an exchange lasts. The image sets it up anew.

use stm32_metapac::IWDG1;
use stm32_metapac::iwdg::vals::{Key, Pr};

/// Its counts at most: with 256 clocks of 32 kHz each 32 s.
const RELOAD: u16 = 0xFFF;

/// How often its status is read at most: another count reaches it within six of the one before, 48
/// ms.
const SETTLING_POLLS: usize = 1_000_000;

/// Starts it: 32 s from a feed to the reset, and an operation of the flash takes 4 s at most.
pub fn start() {
    IWDG1.kr().write(|w| w.set_key(Key::START));
    IWDG1.kr().write(|w| w.set_key(Key::ENABLE));
    IWDG1.pr().write(|w| w.set_pr(Pr::DIVIDE_BY256));
    IWDG1.rlr().write(|w| w.set_rl(RELOAD));
}

/// Behind an exchange: has it count as an image expects, which waits for its own time only so long.
/// An image that hangs before it sets that is ended within 512 ms.
pub fn hand_over() {
    settle();
    IWDG1.kr().write(|w| w.set_key(Key::ENABLE));
    IWDG1.pr().write(|w| w.set_pr(Pr::DIVIDE_BY4));
    settle();
    feed();
}

/// Waits until what was set has reached it: before, it takes nothing else.
fn settle() {
    for _ in 0..SETTLING_POLLS {
        if IWDG1.sr().read().0 == 0 {
            break;
        }
    }
}

/// Feeds it.
pub fn feed() {
    IWDG1.kr().write(|w| w.set_key(Key::RESET));
}
