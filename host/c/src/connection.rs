//! Connecting, and staying connected.

use std::collections::BTreeMap;
use std::ffi::c_char;
use std::ptr::{null_mut, without_provenance_mut};
use std::sync::{Arc, Mutex, PoisonError, RwLock, TryLockError};

use mgw_client::{Transport, open, server_port};

use crate::arguments::{put, text};
use crate::error::{Failure, ended, mgw_result};

/// A connection to a gateway. It belongs to one thread at a time, and to the process that made it:
/// another one is refused.
pub struct mgw_gateway {
    // A handle is a number and points to nothing.
    _nothing: (),
}

type Client = mgw_client::Client<Box<dyn Transport + Send>>;

/// A session with a gateway.
pub(crate) struct Session {
    pub(crate) client: Client,
    /// Of the events that were lost on the way here, how many have been told.
    pub(crate) told_lost: u64,
}

/// What a handle stands for.
struct Connection {
    /// `None` once it is closed.
    session: Option<Session>,
    /// The process that made it: a child of it has the same memory, and the same cable.
    process: u32,
}

/// The connections by the numbers that are their handles.
struct Handles {
    /// The last number. None is given twice, so that a handle that was closed is not mistaken for a
    /// later one.
    last: usize,
    open: BTreeMap<usize, Arc<Mutex<Connection>>>,
}

static HANDLES: RwLock<Handles> = RwLock::new(Handles { last: 0, open: BTreeMap::new() });

/// Takes a connection in and returns its handle.
fn keep(client: Client) -> *mut mgw_gateway {
    let session = Some(Session { client, told_lost: 0 });
    let connection = Connection { session, process: std::process::id() };
    let mut handles = HANDLES.write().unwrap_or_else(PoisonError::into_inner);
    handles.last += 1;
    let handle = handles.last;
    handles.open.insert(handle, Arc::new(Mutex::new(connection)));
    without_provenance_mut(handle)
}

/// Does something with what a handle stands for, unless that is refused.
fn hold<R>(
    gateway: *const mgw_gateway,
    act: impl FnOnce(&mut Option<Session>) -> Result<R, Failure>,
) -> Result<R, Failure> {
    let refused = |why: &str| Failure::argument(format!("gateway: {why}"));
    if gateway.is_null() {
        return Err(refused("the handle is null"));
    }
    let handles = HANDLES.read().unwrap_or_else(PoisonError::into_inner);
    let found = handles.open.get(&gateway.addr()).cloned();
    drop(handles);
    let closed = "the handle is not open: it was closed, or mgw_connect did not give it";
    let found = found.ok_or_else(|| refused(closed))?;
    let mut taken = match found.try_lock() {
        Ok(taken) => taken,
        Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
        Err(TryLockError::WouldBlock) => {
            let used = "another thread is in a call with this handle; give each its own";
            return Err(refused(used));
        }
    };
    if taken.process != std::process::id() {
        let forked = "the handle belongs to the process that made it; connect anew after a fork";
        return Err(refused(forked));
    }
    if taken.session.is_none() { Err(refused(closed)) } else { act(&mut taken.session) }
}

/// Connects to a gateway and writes a handle to `gateway`, which `mgw_close` takes back, or null
/// where it fails. `port` is a serial device, `DEVICE@RATE`, `tcp:HOST:PORT` or `unix:PATH`; null:
/// the running `mgw serve` of this user.
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
        unsafe { put(gateway, null_mut()) };
        // Safety: likewise.
        let port = match unsafe { text(port) }? {
            Some(port) => port.to_owned(),
            None => server_port().ok_or_else(|| {
                Failure::lost("no `mgw serve` of this user runs; name the port of the gateway")
            })?,
        };
        let transport = open(&port).map_err(mgw_client::ClientError::Connect)?;
        let client = Client::connect(transport)?;
        // Safety: as the caller promises.
        unsafe { put(gateway, keep(client)) };
        Ok(())
    };
    ended(connect())
}

/// Stops what was armed over this handle, as `mgw_stop` does, and disconnects without waiting for
/// the motors. The handle is gone whatever comes back, unless it was refused as an argument; null
/// does nothing.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_close(gateway: *mut mgw_gateway) -> mgw_result {
    if gateway.is_null() {
        return mgw_result::Ok;
    }
    ended(hold(gateway, |session| {
        let mut handles = HANDLES.write().unwrap_or_else(PoisonError::into_inner);
        handles.open.remove(&gateway.addr());
        drop(handles);
        let Some(Session { mut client, .. }) = session.take() else { return Ok(()) };
        let stopped = client.stop_armed();
        // Another host may be in command, and that is well.
        let _ = client.release_authority();
        Ok(stopped?)
    }))
}

/// Keeps the right to command while nothing else is asked: the gateway takes it away, and trips
/// what is armed, when it has not heard this host for 250 ms unless configured otherwise.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_keep_alive(gateway: *mut mgw_gateway) -> mgw_result {
    with(gateway, |client| Ok(client.keep_alive()?))
}

/// The gateway's time now, µs, as this host knows it from what it has heard; 0 without a handle
/// that this thread can use.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_time_us(gateway: *const mgw_gateway) -> u64 {
    let time = |session: &Session| session.client.gateway_now_us();
    hold(gateway, |session| Ok(session.as_ref().map_or(0, time))).unwrap_or(0)
}

/// Does something with a connection.
pub(crate) fn with(
    gateway: *mut mgw_gateway,
    act: impl FnOnce(&mut Client) -> Result<(), Failure>,
) -> mgw_result {
    with_session(gateway, |session| act(&mut session.client))
}

/// Does something with a session.
pub(crate) fn with_session(
    gateway: *mut mgw_gateway,
    act: impl FnOnce(&mut Session) -> Result<(), Failure>,
) -> mgw_result {
    ended(hold(gateway, |session| session.as_mut().map_or(Ok(()), act)))
}
