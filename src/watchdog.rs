//! The independent watchdog, and the loops that must check in before it is fed.
//!
//! It runs from its own oscillator and resets the board 50 ms after it was last fed. It is fed only
//! when every watched loop has checked in since or waits for its next event: so a loop that hangs,
//! one that waits for ever for something else and one that never gets the processor all end the
//! same way. Those that wait are asked one after the other to prove that they can be woken. A
//! debugger does not stop it: where the core is halted for longer, the board starts again and stops
//! its motors.
//!
//! So that the next run can say which loop failed, retained RAM keeps which task has the processor,
//! and which were missing.

mod check_in;
mod verdict;

pub use check_in::{TASKS, TaskId, Watch, ask, missing};
pub use verdict::{CHECK_IN_WORDS, forget, note_missing, write_verdict};

use embassy_stm32::pac::iwdg::vals::{Key, Pr};

use crate::board::WATCHDOG;

/// Nominal frequency of its oscillator, the LSI. It is between 29.5 and 34 kHz over all boards and
/// temperatures (data sheets): 50 ms are 47 to 54 ms.
const LSI_HZ: u32 = 32_000;
/// Clocks of one count, as the prescaler divides: its reset value, but a loader that has exchanged
/// images leaves another.
const CLOCKS_PER_COUNT: u32 = 4;
const PRESCALER: Pr = Pr::DIVIDE_BY4;
/// From the last feed to the reset.
const TIMEOUT_MS: u32 = 50;
/// 32 kHz / 4 × 50 ms = 400 counts, and the count after 0 resets.
#[expect(clippy::cast_possible_truncation, reason = "399 of the 4095 that the register holds")]
const RELOAD: u16 = (LSI_HZ / CLOCKS_PER_COUNT * TIMEOUT_MS / 1000 - 1) as u16;
/// How often its status is read at most. The timeout reaches it within five clocks of 32 kHz, 156
/// µs: some 1000 reads at the 64 MHz before the clocks are set up.
const SETTLING_POLLS: usize = 20_000;

/// Starts it; it needs no clock of the processor's. A feed before the timeout has reached it would
/// give it the longest one, 512 ms.
pub fn start() {
    WATCHDOG.kr().write(|w| w.set_key(Key::START));
    WATCHDOG.kr().write(|w| w.set_key(Key::ENABLE));
    WATCHDOG.pr().write(|w| w.set_pr(PRESCALER));
    WATCHDOG.rlr().write(|w| w.set_rl(RELOAD));
    for _ in 0..SETTLING_POLLS {
        if WATCHDOG.sr().read().0 == 0 {
            break;
        }
    }
    feed();
}

/// Feeds it.
pub fn feed() {
    WATCHDOG.kr().write(|w| w.set_key(Key::RESET));
}
