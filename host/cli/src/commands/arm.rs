//! `mgw arm`

use std::time::Duration;

use host_protocol::{AxisState, Error};
use mgw_client::{Client, ClientError, Transport};

use super::drive::{ArmedAxis, no_longer_armed, round, tell_armed, tell_stopped};
use crate::failure::Failure;
use crate::output::Output;
use crate::session::{Session, print_events};

/// Arms axes, keeps them armed for a while, and disarms them.
pub fn run(session: &mut Session, axes: &[u8], duration: Option<Duration>) -> Result<(), Failure> {
    while_armed(session, axes, |session, armed| {
        if duration.is_none() {
            session.out.text("Ctrl-C disarms")?;
        }
        hold_link(session, armed, duration.unwrap_or(Duration::MAX))
    })?;
    session.out.text("disarmed")
}

/// Arms axes, has `act` do what it does with them, stops them, and says of each how it ended.
pub fn while_armed(
    session: &mut Session,
    axes: &[u8],
    act: impl FnOnce(&mut Session, &[ArmedAxis]) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut armed = Vec::new();
    let held = arm_all(session, axes, &mut armed).and_then(|()| act(session, &armed));
    let held = held.map_err(Failure::cut_short);
    // Whatever happened above: the next frames are the stops of what was armed here, which also
    // disarm.
    let axes: Vec<u8> = armed.iter().map(|armed| armed.axis).collect();
    session.client.stop_armed().map_err(|error| Failure::lost(&axes, error))?;
    match held {
        Err(Failure::Client(error @ ClientError::StopUnanswered { .. })) => {
            Err(Failure::lost(&axes, error))
        }
        // Ctrl-C is how it ends.
        Ok(()) | Err(Failure::Client(ClientError::Interrupted { armed: true })) => {
            await_stops(session, &armed)
        }
        Err(failure) => Failure::first([await_stops(session, &armed), Err(failure)]),
    }
}

fn arm_all(session: &mut Session, axes: &[u8], held: &mut Vec<ArmedAxis>) -> Result<(), Failure> {
    for axis in axes.iter().copied() {
        let ttl = session.client.axis_ttl(axis)?;
        let armed = session.client.arm(axis).inspect_err(|error| {
            // Unless it was refused it may be armed, and has been stopped for that.
            if !matches!(error, ClientError::Gateway(_)) {
                held.push(ArmedAxis { axis, epoch: 0, ttl });
            }
        })?;
        held.push(ArmedAxis { axis, epoch: armed.epoch, ttl });
        tell_armed(session.out, axis, &armed)?;
    }
    Ok(())
}

/// Keeps the link alive and prints events until the time is over, the user interrupts, or an axis
/// trips.
fn hold_link(session: &mut Session, held: &[ArmedAxis], duration: Duration) -> Result<(), Failure> {
    let out = session.out;
    let axes: Vec<u8> = held.iter().map(|armed| armed.axis).collect();
    let mut failure = None;
    session.client.hold(duration, |client| round(look(client, &axes, held, out), &mut failure))?;
    failure.map_or(Ok(()), Err)
}

/// Prints events, and returns why an axis is no longer armed.
fn look<T: Transport>(
    client: &mut Client<T>,
    axes: &[u8],
    held: &[ArmedAxis],
    out: Output,
) -> Result<Option<Failure>, Failure> {
    if let Some(tripped) = print_events(client, axes, out)? {
        return Ok(Some(tripped));
    }
    for armed in held {
        let report = match client.read_state(armed.axis) {
            // Another host has asked something; the next round tells.
            Err(ClientError::Gateway(Error::Busy { .. })) => continue,
            report => report?,
        };
        if let Some(failure) = no_longer_armed(&report, armed.epoch, out.motors) {
            return Ok(Some(failure));
        }
    }
    Ok(None)
}

/// Waits for the stop of every axis and says how it ended; the first failure is told at the end, a
/// trip too.
fn await_stops(session: &mut Session, held: &[ArmedAxis]) -> Result<(), Failure> {
    let mut result = Ok(());
    let end = session.stops_until();
    for ArmedAxis { axis, .. } in held.iter().copied() {
        let ended = session.await_stop(axis, end).and_then(|report| {
            let told = tell_stopped(session, &report);
            let trip = report.trip.filter(|_| matches!(report.state, AxisState::Tripped { .. }));
            trip.map_or(told, |trip| Err(Failure::tripped(axis, &trip, session.out.motors)))
        });
        if let (Err(_), Err(further)) = (&result, &ended)
            && !further.is_silent()
        {
            session.out.aside(further.to_string());
        }
        result = Failure::first([result, ended]);
    }
    result
}
