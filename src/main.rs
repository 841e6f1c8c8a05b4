//! Firmware of the motor gateway: it carries bytes and frames between the board's ports and the
//! core, `gateway`.
//!
//! Built for a board with `cargo fw`; on the host this is an empty program.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod can_bus;
#[cfg(target_os = "none")]
mod crash_report;
#[cfg(target_os = "none")]
mod dma_memory;
#[cfg(target_os = "none")]
mod fault;
#[cfg(target_os = "none")]
mod fdcan;
#[cfg(target_os = "none")]
mod flight;
#[cfg(target_os = "none")]
mod image;
#[cfg(target_os = "none")]
mod line;
#[cfg(target_os = "none")]
mod log;
#[cfg(target_os = "none")]
mod memory;
#[cfg(target_os = "none")]
mod random;
#[cfg(target_os = "none")]
mod retained;
#[cfg(target_os = "none")]
mod shared_gateway;
#[cfg(target_os = "none")]
mod starts;
#[cfg(target_os = "none")]
mod storage;
#[cfg(target_os = "none")]
mod task_budget;
#[cfg(target_os = "none")]
mod tasks;
#[cfg(target_os = "none")]
mod usb;
#[cfg(target_os = "none")]
mod watchdog;

#[cfg(target_os = "none")]
#[embassy_executor::main]
async fn main(spawner: embassy_executor::Spawner) {
    use defmt_rtt as _;
    use shared_gateway::SharedGateway;
    use starts::{Begins, Start};

    let boot = board::boot_reason();
    usb::bootloader::start_if_asked_for(boot);
    board::cache_instructions();
    fault::guard_stack();
    watchdog::start();
    let words = retained::start(boot);
    let Start { failed, begins } = starts::count(boot);
    let is_bare = begins == Begins::Bare;
    let words = if begins == Begins::AsItWas { words } else { words.without_the_run_before() };
    let has_kept_flight = flight::start(boot, failed);
    // Not before the retained RAM can be read: a reset in between must find the same reason.
    board::forget_boot_reason();
    let crash_report = crash_report::take(boot, is_bare);
    let (description, ports) = board::start(boot, crash_report);
    defmt::info!(
        "motor gateway {=str}, build {=str}, on {=str}, started by {}",
        description.firmware,
        description.build_id,
        description.name,
        boot
    );
    if !crash_report.is_empty() {
        defmt::error!("the run before this one ended: {=str}", crash_report);
    }
    if is_bare {
        defmt::error!(
            "start after start has failed: this run is without configuration, the enable output off"
        );
    }
    // Where there is none, nothing is armed, and the core says so.
    let gateway =
        SharedGateway::place(description, random::number(), words, is_bare, has_kept_flight);
    spawner.spawn(defmt::unwrap!(tasks::storage::storage(gateway)));
    gateway.has_started().await;
    task_budget::others_have_run();
    spawner.spawn(defmt::unwrap!(tasks::supervisor::supervisor(gateway)));
    spawner.spawn(defmt::unwrap!(tasks::history::history(gateway)));
    spawner.spawn(defmt::unwrap!(tasks::deadline::tick(gateway)));
    spawner.spawn(defmt::unwrap!(tasks::log::log(gateway)));
    spawner.spawn(defmt::unwrap!(tasks::flight::flight(gateway)));
    let hosts = ports.spawn(spawner, gateway);
    gateway.first_stops_have_left().await;
    gateway.has_loaded().await;
    hosts.spawn(spawner, gateway);
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "This is the firmware of a board: build it with `cargo fw`. `cargo run` starts the demonstration."
    );
}
