//! The boards: one file each, chosen by a feature. Only they name pins, clocks and interrupts.

mod clock;
#[cfg(feature = "nucleo-g474re")]
#[path = "board/g474_flash.rs"]
pub mod flash;
#[cfg(feature = "nucleo-h743zi")]
#[path = "board/h743_flash.rs"]
pub mod flash;
mod host_links;
#[cfg(has_loader)]
mod loader;
mod ports;
mod serial;
#[cfg(feature = "nucleo-g474re")]
#[path = "board/nucleo_g474re.rs"]
mod this;
#[cfg(feature = "nucleo-h743zi")]
#[path = "board/nucleo_h743zi.rs"]
mod this;

// As the flash interfaces have it, which a loader has, too.
use embassy_stm32::pac;
use gateway::{Board, BusPort};
use host_links::HostLinks;
use host_protocol::{BootReason, BusLimit};
use this::ENABLE_OUTPUT;
pub use this::{
    CAN_BUSES, CAN_TIMINGS, FLIGHT_BYTES, HOST_UARTS, NAME, RS485_BUSES, UsbDriver, UsbPort,
    WATCHDOG, begin_with_data0, boot_reason, cache_instructions, end_halt, forget_boot_reason,
    has_lost_clock, start, start_rom_bootloader,
};

/// Version of the firmware.
pub const FIRMWARE: &str = env!("CARGO_PKG_VERSION");
/// The commit, as build.rs found it.
pub const BUILD_ID: &str = env!("GATEWAY_BUILD_ID");

/// Sets the enable output, at once and from any context. Before [`start`] it stays inactive,
/// whatever is set.
pub fn set_enable_output(active: bool) {
    let (port, pin) = ENABLE_OUTPUT;
    port.bsrr().write(|w| {
        if active {
            w.set_bs(pin, true);
        } else {
            w.set_br(pin, true);
        }
    });
}

/// What the core must know of this board.
fn description(
    boot: BootReason,
    crash_report: &'static str,
    (buses, bus_limit): (&'static [BusPort], Option<BusLimit>),
) -> Board {
    Board {
        name: NAME,
        firmware: FIRMWARE,
        build_id: BUILD_ID,
        boot,
        crash_report,
        e_stop_input: true,
        enable_output: true,
        buses,
        bus_limit,
        links: &HostLinks::PORTS,
    }
}
