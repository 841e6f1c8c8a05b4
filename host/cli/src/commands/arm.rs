//! `mgw arm`

use std::ops::ControlFlow;
use std::time::Duration;

use host_protocol::{AxisState, Error};
use mgw_client::{Client, ClientError, Transport};

use super::drive::{no_longer_armed, tell_armed};
use crate::failure::Failure;
use crate::output::Output;
use crate::session::{Session, print_events};
use crate::words;

/// Arms axes, keeps them armed for a while, and disarms them.
pub fn run(session: &mut Session, axes: &[u8], duration: Option<Duration>) -> Result<(), Failure> {
    let mut armed = Vec::new();
    let held = arm_and_hold(session, axes, duration, &mut armed);
    // Whatever happened above: the next frames are the stops of what was armed here, which also disarm.
    session.client.stop_armed()?;
    match held {
        Err(Failure::Client(error @ ClientError::StopUnanswered { .. })) => return Err(error.into()),
        // Ctrl-C is how it ends.
        Ok(()) | Err(Failure::Client(ClientError::Interrupted { armed: true })) => {
            await_stops(session, &armed)
        }
        Err(failure) => await_stops(session, &armed).and(Err(failure)),
    }?;
    if !armed.is_empty() {
        session.out.text("disarmed")?;
    }
    Ok(())
}

fn arm_and_hold(
    session: &mut Session,
    axes: &[u8],
    duration: Option<Duration>,
    held: &mut Vec<(u8, u32)>,
) -> Result<(), Failure> {
    for axis in axes {
        let armed = session.client.arm(*axis)?;
        held.push((*axis, armed.epoch));
        tell_armed(session, *axis, &armed)?;
    }
    if duration.is_none() {
        session.out.text("Ctrl-C disarms")?;
    }
    hold_link(session, held, duration.unwrap_or(Duration::MAX))
}

/// Keeps the link alive and prints events until the time is over, the user interrupts, or an axis trips.
fn hold_link(session: &mut Session, held: &[(u8, u32)], duration: Duration) -> Result<(), Failure> {
    let out = session.out;
    let axes: Vec<u8> = held.iter().map(|(axis, _)| *axis).collect();
    let mut failure = None;
    session.client.hold(duration, |client| match look(client, &axes, held, out) {
        Err(Failure::Client(error)) if !matches!(error, ClientError::Gateway(_)) => Err(error),
        seen => {
            failure = seen.unwrap_or_else(Some);
            Ok(if failure.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        }
    })?;
    failure.map_or(Ok(()), Err)
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

/// Waits for the stop of every axis; the first failure is told, a trip too.
fn await_stops(session: &mut Session, held: &[(u8, u32)]) -> Result<(), Failure> {
    let mut result = Ok(());
    for (axis, _) in held {
        let stopped = session.await_stop(*axis).and_then(|report| match (report.state, report.trip) {
            (AxisState::Tripped { .. }, Some(trip)) => {
                Err(Failure::Tripped { axis: *axis, reason: words::trip_reason(&trip.reason) })
            }
            _ => Ok(()),
        });
        result = result.and(stopped);
    }
    result
}
