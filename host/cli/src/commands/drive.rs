//! What `set`, `native` and `move` have in common: arming an axis, looking after it while it moves, stopping and disarming it.

use std::ops::ControlFlow;
use std::time::Duration;

use host_protocol::replies::AxisReport;
use host_protocol::{AxisState, Error, Event, StopTarget};
use mgw_client::{Client, ClientError, Round, Transport};
use serde_json::json;

use crate::failure::Failure;
use crate::output::{Output, to_json};
use crate::session::{Session, go_on, print_event, print_events};
use crate::states;
use crate::words;

/// Between two printed states.
const PRINT_EVERY: Duration = Duration::from_millis(200);

/// How long the event that confirms a stop is awaited.
const EVENT_PATIENCE: Duration = Duration::from_millis(500);

/// An axis that is armed.
#[derive(Debug, Clone, Copy)]
pub struct ArmedAxis {
    pub axis: u8,
    pub epoch: u32,
    /// How long what moves it is valid.
    pub ttl: Duration,
}

/// Arms an axis, has `act` move it, then stops and disarms it.
pub fn drive(
    session: &mut Session,
    axis: u8,
    act: impl FnOnce(&mut Session, ArmedAxis) -> Result<(), Failure>,
) -> Result<(), Failure> {
    session.note_interrupts();
    let ttl = session.client.axis_ttl(axis)?;
    let armed = session.client.arm(axis)?;
    let timeout = words::motor_timeout(armed.motor_timeout);
    session.out.either(
        format!("axis {axis} is armed, epoch {}; the motor's own timeout: {timeout}", armed.epoch),
        &json!({ "axis": axis, "epoch": armed.epoch, "motor_timeout": to_json(&armed.motor_timeout) }),
    )?;
    let acted = act(session, ArmedAxis { axis, epoch: armed.epoch, ttl });
    // Whatever happened above: it is stopped here, and not by its deadline.
    let stopped = stop(session, axis);
    acted.and(stopped)
}

/// The rounds of a hold: events and a table of states that grows with time, until something ends them.
pub struct Rounds {
    axis: u8,
    epoch: u32,
    out: Output,
    headings_printed: bool,
    next: Duration,
    failure: Option<Failure>,
    /// The state that was printed last.
    pub latest: Option<AxisReport>,
}

impl Rounds {
    pub fn new(session: &Session, armed: ArmedAxis) -> Self {
        let ArmedAxis { axis, epoch, .. } = armed;
        let next = session.client.now();
        Self { axis, epoch, out: session.out, headings_printed: false, next, failure: None, latest: None }
    }

    /// One round of a hold.
    pub fn turn<T: Transport>(&mut self, client: &mut Client<T>) -> Round {
        let printed = print_events(client, &[self.axis], self.out)
            .and_then(|tripped| self.print_if_due(client).map(|no_longer| tripped.or(no_longer)));
        self.failure = printed.unwrap_or_else(Some);
        go_on(client, self.failure.as_ref())
    }

    /// As [`turn`](Self::turn), ending when a state that was just printed is the one wanted.
    pub fn turn_until<T: Transport>(
        &mut self,
        client: &mut Client<T>,
        is_there: impl Fn(&AxisReport) -> bool,
    ) -> Round {
        let round = self.turn(client)?;
        let there = self.latest.as_ref().is_some_and(is_there);
        Ok(if there { ControlFlow::Break(()) } else { round })
    }

    /// The end of the hold. A command refused because the axis tripped, or was stopped, says less than that.
    pub fn end(self, session: &mut Session, held: Result<(), ClientError>) -> Result<(), Failure> {
        if let Some(failure) = self.failure.or(session.print_events(&[self.axis])?) {
            return Err(failure);
        }
        match held {
            Ok(()) | Err(ClientError::Gateway(Error::NotArmed { .. } | Error::StaleEpoch { .. })) => {
                let report = session.client.read_state_when_free(self.axis)?;
                match no_longer_armed(&report, self.epoch) {
                    Some(failure) => Err(failure),
                    None => Ok(held?),
                }
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Prints the state from time to time; returns why the axis is no longer armed, if it is not.
    fn print_if_due<T: Transport>(&mut self, client: &mut Client<T>) -> Result<Option<Failure>, Failure> {
        if client.now() < self.next {
            return Ok(None);
        }
        self.next = client.now() + PRINT_EVERY;
        let report = match client.read_state(self.axis) {
            // Another host has asked something; the next round tells.
            Err(ClientError::Gateway(Error::Busy { .. })) => return Ok(None),
            report => report?,
        };
        for line in states::table(&[report]).lines().iter().skip(usize::from(self.headings_printed)) {
            self.out.text(line)?;
        }
        self.headings_printed = true;
        self.latest = Some(report);
        self.out.object(&to_json(&report))?;
        Ok(no_longer_armed(&report, self.epoch))
    }
}

/// Why an axis that was armed here, and that nobody here has stopped, is no longer armed.
pub fn no_longer_armed(report: &AxisReport, epoch: u32) -> Option<Failure> {
    let AxisReport { axis, state, .. } = *report;
    match (state, report.trip) {
        (AxisState::Armed | AxisState::Active, _) if report.epoch == Some(epoch) => None,
        (AxisState::Tripped { .. }, Some(trip)) => {
            Some(Failure::Tripped { axis, reason: words::trip_reason(&trip.reason) })
        }
        _ => Some(Failure::StoppedElsewhere { axis, state }),
    }
}

fn stop(session: &mut Session, axis: u8) -> Result<(), Failure> {
    let before = session.client.read_state_when_free(axis)?.state;
    if !matches!(before, AxisState::Tripped { .. }) {
        session.client.stop(StopTarget::Axis(axis))?;
    }
    let report = session.await_stop(axis)?;
    print_confirmation(session, axis)?;
    if matches!(report.state, AxisState::Armed | AxisState::Active) {
        session.client.disarm(axis)?;
        session.await_stop(axis)?;
    }
    session.out.either(
        format!("axis {axis} is {}", words::axis_state(report.state)),
        &json!({ "axis": axis, "state": to_json(&report.state) }),
    )
}

/// The event with the times of the stop may come a little after the reply with the state.
fn print_confirmation(session: &mut Session, axis: u8) -> Result<(), Failure> {
    let end = session.client.now() + EVENT_PATIENCE;
    while let Some(message) = session.client.poll_event(end.saturating_sub(session.client.now()))? {
        print_event(&message, session.out)?;
        if matches!(message.event, Event::StopConfirmed { axis: of, .. } if of == axis) {
            break;
        }
    }
    Ok(())
}
