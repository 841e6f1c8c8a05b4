//! The light of the board.
//!
//! | The light | means |
//! |---|---|
//! | is on and off for 0.8 s each | idle: nothing moves and nothing may, and no motor holds |
//! | flashes three times every 1.6 s | nothing may move; a motor holds, its output on |
//! | is on | an axis is armed: it may move |
//! | flashes twice every 1.6 s | the host in command fell silent |
//! | blinks five times a second | an axis is tripped |
//! | is on, with two short gaps every 1.6 s | the e-stop is latched |
//! | stays dark | the firmware does not run |

use embassy_stm32::gpio::{Level, Output};
use embassy_time::{Duration, Ticker};
use gateway::Light;

use crate::shared_gateway::SharedGateway;
use crate::watchdog::{TaskId, Watch};

/// A bit of a pattern lasts so long.
const STEP: Duration = Duration::from_millis(100);

/// When the light is on: a bit for each step, the lowest first.
const fn pattern(light: Light) -> u16 {
    match light {
        Light::Idle => 0b0000_0000_1111_1111,
        Light::Holding => 0b0000_0000_0001_0101,
        Light::Armed => 0b1111_1111_1111_1111,
        Light::LinkLost => 0b0000_0000_0000_0101,
        Light::Tripped => 0b0101_0101_0101_0101,
        Light::EStopped => 0b1111_1111_1111_1010,
    }
}

/// For ever.
#[embassy_executor::task]
pub async fn light(gateway: &'static SharedGateway, mut light: Output<'static>) -> ! {
    let watch = Watch::new(TaskId::LIGHT);
    let mut ticker = Ticker::every(STEP);
    let mut steps = (0..u16::BITS).cycle();
    loop {
        let is_on = steps.next().is_some_and(|step| pattern(gateway.light()) & (1 << step) != 0);
        light.set_level(if is_on { Level::High } else { Level::Low });
        while watch.wait(ticker.next()).await.is_none() {}
    }
}
