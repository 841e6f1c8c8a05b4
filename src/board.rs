//! The boards: one file each, chosen by a feature. Only they name pins, clocks and interrupts.

#[cfg(feature = "nucleo-h743zi")]
mod nucleo_h743zi;
#[cfg(feature = "nucleo-h743zi")]
pub use nucleo_h743zi::{CAN_BUSES, CAN_TIMINGS, HOST_UARTS, RS485_BUSES, start};

/// Version of the firmware.
const FIRMWARE: &str = env!("CARGO_PKG_VERSION");
/// The commit, as build.rs found it.
const BUILD_ID: &str = env!("GATEWAY_BUILD_ID");
