//! Whether the board's own clock runs at the start, and the time driver behind it.
//!
//! The drivers would wait for it for ever. Without it the chip's oscillator takes its place: the
//! motors on RS485 are stopped, and CAN, for which it is not exact enough, stays off.

use embassy_stm32::pac::TIM2;
use embassy_stm32::{Config, Peripherals, peripherals, rcc};
use host_protocol::BootReason;

use crate::watchdog;

/// How long it is waited for: ten times what it needs. Meanwhile a motor may be turning, and the
/// watchdog runs.
const WAIT_US: u32 = 20_000;
/// How often so long after the power came, half a second: the clock may come from a chip that
/// starts, too.
const WAITS_AFTER_POWER_ON: usize = 25;
const POLLS_PER_SECOND: u32 = 20_000;
const HZ_PER_MHZ: u32 = 1_000_000;

/// Waits until the clock is ready, not for ever. `core_hz`: what the processor runs at; it clocks
/// TIM2, which counts the time here before the time driver takes it over.
pub fn starts(boot: BootReason, core_hz: u32, is_ready: impl Fn() -> bool) -> bool {
    rcc::enable_and_reset_without_stop::<peripherals::TIM2>();
    TIM2.psc().write_value(u16::try_from(core_hz / HZ_PER_MHZ - 1).unwrap_or(u16::MAX));
    let waits = match boot {
        BootReason::PowerOn | BootReason::Brownout => WAITS_AFTER_POWER_ON,
        _ => 1,
    };
    let starts = (0..waits).any(|_| {
        watchdog::feed();
        // The prescaler acts, and the count begins, with this update.
        TIM2.egr().write(|w| w.set_ug(true));
        TIM2.cr1().modify(|w| w.set_cen(true));
        while !is_ready() && TIM2.cnt().read() < WAIT_US {
            cortex_m::asm::delay(core_hz / POLLS_PER_SECOND);
        }
        is_ready()
    });
    TIM2.cr1().modify(|w| w.set_cen(false));
    starts
}

/// [`embassy_stm32::init`], whose time driver then counts from 0.
///
/// The update that sets its prescaler is a match as well: the count and the compare value are 0.
/// The driver would take that for the first half of the counter's range. Its time would be 65.5 ms
/// ahead, and would fall back by that at each half, until the interrupt there is served: a time
/// limit that is set meanwhile is over at once.
pub fn init(config: Config) -> Peripherals {
    cortex_m::interrupt::free(|_| {
        let peripherals = embassy_stm32::init(config);
        // Written as zeros they are cleared.
        TIM2.sr().write_value(Default::default());
        peripherals
    })
}
