//! Blinks a light while the executor runs.

use embassy_stm32::gpio::Output;
use embassy_time::{Duration, Ticker};

/// On and off for this long each.
const HALF_PERIOD: Duration = Duration::from_millis(500);

/// For ever.
#[embassy_executor::task]
pub async fn life(mut light: Output<'static>) -> ! {
    let mut ticker = Ticker::every(HALF_PERIOD);
    loop {
        light.toggle();
        ticker.next().await;
    }
}
