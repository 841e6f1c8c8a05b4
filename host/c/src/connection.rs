//! Connecting, and staying connected.

use std::ffi::c_char;

use mgw_client::{Client, Transport, open, server_port};

use crate::arguments::{put, text};
use crate::error::{Failure, ended, mgw_result};

/// A connection to a gateway. It belongs to one thread at a time.
pub struct mgw_gateway {
    pub(crate) client: Client<Box<dyn Transport + Send>>,
}

/// Connects to a gateway and writes a handle to `gateway`, which `mgw_close` takes back. `port` is
/// a serial device, `DEVICE@RATE`, `tcp:HOST:PORT` or `unix:PATH`; null: the running `mgw serve` of
/// this user.
///
/// # Safety
/// `port` is null or a text with a zero behind it; `gateway` is a place for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mgw_connect(
    port: *const c_char,
    gateway: *mut *mut mgw_gateway,
) -> mgw_result {
    let connect = || {
        if gateway.is_null() {
            return Err(Failure::argument("gateway: the pointer is null"));
        }
        // Safety: as the caller promises.
        let port = match unsafe { text(port) }? {
            Some(port) => port.to_owned(),
            None => server_port().ok_or_else(|| {
                Failure::argument("no `mgw serve` of this user runs; name the port of the gateway")
            })?,
        };
        let transport = open(&port).map_err(mgw_client::ClientError::Connect)?;
        let client = Client::connect(transport)?;
        // Safety: as the caller promises.
        unsafe { put(gateway, Box::into_raw(Box::new(mgw_gateway { client }))) };
        Ok(())
    };
    ended(connect())
}

/// Stops what was armed over this handle and disconnects. The handle is gone whatever comes back;
/// null does nothing.
///
/// # Safety
/// `gateway` is null or a handle of `mgw_connect` that was not closed and that no other thread
/// uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mgw_close(gateway: *mut mgw_gateway) -> mgw_result {
    if gateway.is_null() {
        return mgw_result::Ok;
    }
    // Safety: as the caller promises.
    let mut gateway = unsafe { Box::from_raw(gateway) };
    let stopped = gateway.client.stop_armed().map_err(Failure::from);
    // Another host may be in command, and that is well.
    let _ = gateway.client.release_authority();
    ended(stopped)
}

/// Keeps the right to command while nothing else is asked: the gateway takes it away, and trips
/// what is armed, when it has not heard this host for 250 ms unless configured otherwise.
///
/// # Safety
/// `gateway` is an open handle that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mgw_keep_alive(gateway: *mut mgw_gateway) -> mgw_result {
    // Safety: as the caller promises.
    unsafe { with(gateway, |client| Ok(client.keep_alive()?)) }
}

/// The gateway's time now, µs, as this host knows it from what it has heard; 0 without a handle.
///
/// # Safety
/// `gateway` is null or an open handle that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mgw_time_us(gateway: *const mgw_gateway) -> u64 {
    // Safety: as the caller promises.
    unsafe { gateway.as_ref() }.map_or(0, |gateway| gateway.client.gateway_now_us())
}

/// Does something with a connection.
///
/// # Safety
/// `gateway` is null or an open handle that no other thread uses.
pub(crate) unsafe fn with(
    gateway: *mut mgw_gateway,
    act: impl FnOnce(&mut Client<Box<dyn Transport + Send>>) -> Result<(), Failure>,
) -> mgw_result {
    // Safety: as the caller promises.
    let gateway = unsafe { gateway.as_mut() };
    ended(match gateway {
        Some(gateway) => act(&mut gateway.client),
        None => Err(Failure::argument("gateway: the handle is null")),
    })
}
