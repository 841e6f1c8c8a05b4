//! Arming, setpoints, stops.

use std::time::Duration;

use host_protocol::{ClearTarget, MAX_CYCLE_AXES, StateField, StateFields, StopTarget};

use crate::arguments::{elements, put};
use crate::connection::{mgw_gateway, with};
use crate::error::{Failure, mgw_result};
use crate::values::{mgw_axis, mgw_setpoint};

/// As many as a request has bits for.
const AXES: usize = 32;

/// Without any time nothing would be sent.
fn ttl(ttl_us: u32) -> Result<Duration, Failure> {
    match ttl_us {
        0 => Err(Failure::argument("ttl_us: 1 at least, the axis's ttl_us at most")),
        _ => Ok(Duration::from_micros(ttl_us.into())),
    }
}

/// Arms so many axes, 32 at most, in one epoch, all of them or none, and writes the epoch to
/// `epoch`. It takes the right to command. Steps that the motors need take up to some hundreds of
/// milliseconds.
///
/// # Safety
/// `axes` is null or the first of `count` numbers; `epoch` is null or a place for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mgw_arm(
    gateway: *mut mgw_gateway,
    axes: *const u8,
    count: usize,
    epoch: *mut u32,
) -> mgw_result {
    // Safety: as the caller promises.
    unsafe {
        with(gateway, |client| {
            let armed = client.arm_together(elements(axes, count, AXES, "axes")?)?;
            put(epoch, armed);
            Ok(())
        })
    }
}

/// Ends the permission to move, through the stop action of the axis.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_disarm(gateway: *mut mgw_gateway, axis: u8) -> mgw_result {
    with(gateway, |client| Ok(client.disarm(axis)?))
}

/// Gives one armed axis a setpoint that lives `ttl_us` µs: without another the gateway stops it
/// then.
///
/// # Safety
/// `setpoint` is null or one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mgw_set(
    gateway: *mut mgw_gateway,
    epoch: u32,
    setpoint: *const mgw_setpoint,
    ttl_us: u32,
) -> mgw_result {
    // Safety: as the caller promises.
    unsafe {
        with(gateway, |client| {
            let setpoint = setpoint
                .as_ref()
                .ok_or_else(|| Failure::argument("setpoint: the pointer is null"))?;
            let of = setpoint.read()?;
            Ok(client.set(of.axis, epoch, of.setpoint, ttl(ttl_us)?)?)
        })
    }
}

/// Gives so many axes that were armed together each its setpoint, which lives `ttl_us` µs, and
/// waits until every motor has answered or its own time is over. Where `states` is not null, the
/// state of each is written there, in the order of the setpoints; `count` of them must fit, which
/// is 16 at most. Call it again before the setpoints expire.
///
/// # Safety
/// `setpoints` is null or the first of `count`; `states` is null or the first of `count` places.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mgw_cycle(
    gateway: *mut mgw_gateway,
    epoch: u32,
    setpoints: *const mgw_setpoint,
    count: usize,
    ttl_us: u32,
    states: *mut mgw_axis,
) -> mgw_result {
    // Safety: as the caller promises.
    unsafe {
        with(gateway, |client| {
            let given = elements(setpoints, count, MAX_CYCLE_AXES, "setpoints")?;
            let read = given.iter().map(mgw_setpoint::read).collect::<Result<Vec<_>, _>>()?;
            let told =
                client.cycle(epoch, &read, StateFields::of(StateField::ALL), ttl(ttl_us)?)?;
            for (at, setpoint) in given.iter().enumerate().filter(|_| !states.is_null()) {
                let state = told.iter().find(|state| state.axis == setpoint.axis);
                let missing = || Failure::argument("the gateway's answer lacks an axis");
                states.add(at).write(mgw_axis::from(state.ok_or_else(missing)?));
            }
            Ok(())
        })
    }
}

/// Reads how an axis is: its state, why it tripped, and what was measured last.
///
/// # Safety
/// `axis_state` is null or a place for it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mgw_read(
    gateway: *mut mgw_gateway,
    axis: u8,
    axis_state: *mut mgw_axis,
) -> mgw_result {
    // Safety: as the caller promises.
    unsafe {
        with(gateway, |client| {
            let report = client.read_state_when_free(axis)?;
            put(axis_state, mgw_axis::from(&report));
            Ok(())
        })
    }
}

/// Stops an axis; needs no right to command. It is repeated until it is answered, for 3 s at most.
/// OK says that the gateway has taken it: that the motor has stopped is told by
/// `MGW_EVENT_KIND_STOP_CONFIRMED`, that it has not by a trip.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_stop(gateway: *mut mgw_gateway, axis: u8) -> mgw_result {
    with(gateway, |client| Ok(client.stop(StopTarget::Axis(axis))?))
}

/// Stops every axis; needs no right to command. As `mgw_stop`.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_stop_all(gateway: *mut mgw_gateway) -> mgw_result {
    with(gateway, |client| Ok(client.stop(StopTarget::All)?))
}

/// Emergency stop: everything stops, and nothing arms until `mgw_clear_gateway`. As `mgw_stop`.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_estop(gateway: *mut mgw_gateway) -> mgw_result {
    with(gateway, |client| Ok(client.estop()?))
}

/// Clears the trip of an axis whose stop is confirmed and whose cause is gone. Never arms.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_clear(gateway: *mut mgw_gateway, axis: u8) -> mgw_result {
    with(gateway, |client| Ok(client.clear(ClearTarget::Axis(axis))?))
}

/// Clears the latched e-stop. Never arms.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_clear_gateway(gateway: *mut mgw_gateway) -> mgw_result {
    with(gateway, |client| Ok(client.clear(ClearTarget::Gateway)?))
}

/// Switches the output of a holding motor off: it lets go.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_output_off(gateway: *mut mgw_gateway, axis: u8) -> mgw_result {
    with(gateway, |client| Ok(client.output_off(axis)?))
}
