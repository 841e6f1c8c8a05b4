//! The e-stop input: a contact to ground that is closed unless the button is pressed or its cable
//! is cut.

use core::pin::pin;

use embassy_stm32::exti::ExtiInput;
use embassy_stm32::mode::Async;
use embassy_time::{Duration, Timer, with_timeout};
use gateway::Event;

use crate::shared_gateway::SharedGateway;
use crate::task_budget::{TaskBudget, Urgency};
use crate::watchdog::{TaskId, Watch};

/// Open for this long counts as pressed. What a motor's cable couples into the cable of the button
/// is shorter: a machine that stops for nothing would have its button bridged. A contact bounces
/// for a few ms while it opens; each look that finds it closed starts anew, and the last bounce
/// leaves it open: a press is found late by as much as it bounces, and never lost.
const PRESSED: Duration = Duration::from_millis(1);
/// Closed for this long without a break counts as released. Nothing waits for it: the e-stop stays
/// latched.
const RELEASED: Duration = Duration::from_millis(10);

/// For ever: tell the core when the contact opens and when it closes. The interrupt of an edge only
/// makes it quick: the level is read at each pulse too.
#[embassy_executor::task]
pub async fn e_stop(gateway: &'static SharedGateway, mut contact: ExtiInput<'static, Async>) -> ! {
    let watch = Watch::new(TaskId::E_STOP);
    let _urgent = TaskBudget::new(Urgency::Demand).await;
    let mut open = contact.is_high();
    loop {
        gateway.handle(Event::EStopInput { open });
        if open {
            until_released(&mut contact, &watch).await;
        } else {
            until_pressed(&mut contact, &watch).await;
        }
        open = !open;
    }
}

/// Until it has been open at both ends of [`PRESSED`].
async fn until_pressed(contact: &mut ExtiInput<'static, Async>, watch: &Watch) {
    loop {
        if watch.wait(pin!(contact.wait_for_high())).await.is_some() {
            Timer::after(PRESSED).await;
            if contact.is_high() {
                return;
            }
        }
    }
}

/// Until it has stayed closed for [`RELEASED`].
async fn until_released(contact: &mut ExtiInput<'static, Async>, watch: &Watch) {
    loop {
        if watch.wait(pin!(contact.wait_for_low())).await.is_some() {
            if with_timeout(RELEASED, contact.wait_for_high()).await.is_err() {
                return;
            }
            // Edges without end do not take the processor.
            Timer::after(PRESSED).await;
        }
    }
}
