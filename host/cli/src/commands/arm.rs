//! `mgw arm`

use std::time::Duration;

use host_protocol::Error;
use mgw_client::{Client, ClientError, Transport};
use serde_json::json;

use super::drive::no_longer_armed;
use crate::failure::Failure;
use crate::output::{Output, to_json};
use crate::session::{Session, go_on, print_events};
use crate::words;

/// Arms axes, keeps them armed for a while, and disarms them.
pub fn run(session: &mut Session, axes: &[u8], duration: Option<Duration>) -> Result<(), Failure> {
    session.note_interrupts();
    let mut armed = Vec::new();
    let result = arm_and_hold(session, axes, duration, &mut armed);
    // Whatever happened above: nothing that was armed here stays armed.
    let disarmed = disarm(session, &armed);
    result.and(disarmed)
}

fn arm_and_hold(
    session: &mut Session,
    axes: &[u8],
    duration: Option<Duration>,
    armed_axes: &mut Vec<u8>,
) -> Result<(), Failure> {
    let mut held = Vec::new();
    for axis in axes {
        // Noted before it is asked for: an answer that is lost may have armed it all the same.
        armed_axes.push(*axis);
        let armed = session.client.arm(*axis).inspect_err(|error| {
            if matches!(error, ClientError::Gateway(_)) {
                armed_axes.pop();
            }
        })?;
        held.push((*axis, armed.epoch));
        let timeout = words::motor_timeout(armed.motor_timeout);
        session.out.either(
            format!("axis {axis} is armed, epoch {}; the motor's own timeout: {timeout}", armed.epoch),
            &json!({ "axis": axis, "epoch": armed.epoch, "motor_timeout": to_json(&armed.motor_timeout) }),
        )?;
    }
    if duration.is_none() {
        session.out.text("Ctrl-C disarms")?;
    }
    hold_link(session, &held, duration.unwrap_or(Duration::MAX))
}

/// Keeps the link alive and prints events until the time is over, the user interrupts, or an axis trips.
fn hold_link(session: &mut Session, held: &[(u8, u32)], duration: Duration) -> Result<(), Failure> {
    let out = session.out;
    let axes: Vec<u8> = held.iter().map(|(axis, _)| *axis).collect();
    let mut failure = None;
    session.client.hold(duration, |client| {
        failure = look(client, &axes, held, out).unwrap_or_else(Some);
        go_on(client, failure.as_ref())
    })?;
    match failure.or(look(&mut session.client, &axes, held, out)?) {
        Some(failure) => Err(failure),
        None => Ok(()),
    }
}

/// Prints events, and returns why an axis is no longer armed.
fn look<T: Transport>(
    client: &mut Client<T>,
    axes: &[u8],
    held: &[(u8, u32)],
    out: Output,
) -> Result<Option<Failure>, Failure> {
    if let Some(tripped) = print_events(client, axes, out)? {
        return Ok(Some(tripped));
    }
    for (axis, epoch) in held {
        let report = match client.read_state(*axis) {
            // Another host has asked something; the next round tells.
            Err(ClientError::Gateway(Error::Busy { .. })) => continue,
            report => report?,
        };
        if let Some(failure) = no_longer_armed(&report, *epoch) {
            return Ok(Some(failure));
        }
    }
    Ok(None)
}

fn disarm(session: &mut Session, axes: &[u8]) -> Result<(), Failure> {
    let mut result = Ok(());
    for axis in axes {
        let disarmed = session.client.disarm(*axis).map_err(Failure::from);
        let stopped = disarmed.and_then(|()| session.await_stop(*axis)).map(drop);
        // Every axis is tried; the first failure is told.
        result = result.and(stopped);
    }
    if result.is_ok() && !axes.is_empty() {
        session.out.text("disarmed")?;
    }
    result
}
