//! What `set`, `native`, `move` and `together` have in common: arming an axis, looking after it
//! while it moves, stopping and disarming it.

use std::ops::ControlFlow;
use std::time::Duration;

use host_protocol::replies::{Armed, AxisReport};
use host_protocol::{AxisState, Error, Event, Setpoint};
use mgw_client::{Client, ClientError, Hold, Round, Transport};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::faults::Protocols;
use crate::json;
use crate::names::Names;
use crate::output::Output;
use crate::session::{Session, print_event, print_events, trip_of};
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

impl ArmedAxis {
    /// What it shall keep doing.
    pub fn hold(self, setpoint: Setpoint) -> Hold {
        let Self { axis, epoch, ttl } = self;
        Hold { axis, epoch, setpoint, ttl }
    }
}

/// Arms an axis, has `act` move it, and stops it. Then what `act` returned tells how it went, from
/// the state at rest.
pub fn drive<F>(
    session: &mut Session,
    axis: u8,
    act: impl FnOnce(&mut Session, ArmedAxis) -> Result<F, Failure>,
) -> Result<(), Failure>
where
    F: FnOnce(&mut Session, &AxisReport) -> Result<(), Failure>,
{
    let ttl = session.client.axis_ttl(axis)?;
    let acted = match session.client.arm(axis) {
        // Refused: there is nothing to stop, and another host may be moving it.
        Err(error @ ClientError::Gateway(_)) => return Err(error.into()),
        Err(error) => Err(error.into()),
        Ok(armed) => {
            let armed_axis = ArmedAxis { axis, epoch: armed.epoch, ttl };
            tell_armed(session.out, axis, &armed)
                .and_then(|()| act(session, armed_axis))
                .map_err(Failure::cut_short)
        }
    };
    // Whatever happened above: the next frame is its stop. An interrupt has been followed by it
    // already.
    session.client.stop_armed().map_err(|error| Failure::lost(&[axis], error))?;
    if let Err(Failure::Client(error @ ClientError::StopUnanswered { .. })) = acted {
        return Err(Failure::lost(&[axis], error));
    }
    let end = session.stops_until();
    let report = session.await_stop(axis, end)?;
    let mut tripped = None;
    let confirmed = print_confirmation(session, axis, &mut tripped);
    let told = acted.and_then(|tell| tell(session, &report));
    let stopped = tell_stopped(session, &report);
    match (report.state, report.trip) {
        (AxisState::Tripped { .. }, Some(trip)) => {
            Err(Failure::tripped(axis, &trip, session.out.motors))
        }
        _ => Failure::first([tripped.map_or(Ok(()), Err), told, confirmed, stopped]),
    }
}

/// What a look at the axes makes of a round of their hold: a failure ends it and is kept. An
/// interrupt, or a stop that nothing answers, ends it as itself.
pub fn round(looked: Result<Option<Failure>, Failure>, failure: &mut Option<Failure>) -> Round {
    match looked {
        Err(Failure::Client(error)) if !matches!(error, ClientError::Gateway(_)) => Err(error),
        looked => {
            *failure = looked.unwrap_or_else(Some);
            Ok(if failure.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        }
    }
}

/// How a hold of axes ended. An interrupt ends it as its time does, and a command refused because
/// an axis was stopped says less than that.
pub fn end_of_hold(held: Result<(), ClientError>) -> Result<(), Failure> {
    match held {
        Ok(()) | Err(ClientError::Interrupted { .. }) => Ok(()),
        Err(ClientError::Gateway(Error::NotArmed { axis, state })) => {
            Err(Failure::StoppedElsewhere { axis, state })
        }
        Err(ClientError::Gateway(Error::StaleEpoch { axis, .. })) => {
            Err(Failure::StoppedElsewhere { axis, state: AxisState::Armed })
        }
        Err(error) => Err(error.into()),
    }
}

/// Refuses axes of which one is named twice.
pub fn refuse_twice(axes: &[u8]) -> Result<(), Failure> {
    let mut places = axes.iter().enumerate();
    match places.find(|(place, axis)| axes[..*place].contains(axis)) {
        Some((_, axis)) => Err(Failure::Usage(format!("axis {axis} is named twice"))),
        None => Ok(()),
    }
}

/// Of a motion that ends with its stop.
pub fn nothing_to_tell(_: &mut Session, _: &AxisReport) -> Result<(), Failure> {
    Ok(())
}

/// Says that an axis is armed.
pub fn tell_armed(out: Output, axis: u8, armed: &Armed) -> Result<(), Failure> {
    let timeout = words::motor_timeout(armed.motor_timeout);
    let mut fields = json!({ "axis": axis, "epoch": armed.epoch });
    json::extend(&mut fields, json::axis::motor_timeout(armed.motor_timeout));
    out.event(
        "armed",
        format!("axis {axis} is armed, epoch {}; the motor's own timeout: {timeout}", armed.epoch),
        fields,
    )
}

/// Says how an axis is after its stop.
pub fn tell_stopped(session: &Session, report: &AxisReport) -> Result<(), Failure> {
    let AxisReport { axis, state, .. } = *report;
    let text = format!("axis {axis} is {}", words::axis_state(state));
    session.out.event("stopped", text, json::axis::in_state(axis, state))
}

/// The rounds of a hold: events and a table of states that grows with time, until something ends
/// them.
pub struct Rounds {
    axes: Vec<ArmedAxis>,
    out: Output,
    names: Names,
    headings_printed: bool,
    next: Duration,
    failure: Option<Failure>,
    /// The state that was printed last, of the last axis.
    pub latest: Option<AxisReport>,
}

impl Rounds {
    /// Of the axes that are held.
    pub fn new(session: &Session, armed: &[ArmedAxis]) -> Self {
        let (axes, next) = (armed.to_vec(), session.client.now());
        let (out, names) = (session.out, session.known_names());
        Self { axes, out, names, headings_printed: false, next, failure: None, latest: None }
    }

    /// One round of a hold.
    pub fn turn<T: Transport>(&mut self, client: &mut Client<T>) -> Round {
        let axes: Vec<u8> = self.axes.iter().map(|armed| armed.axis).collect();
        let printed = print_events(client, &axes, self.out)
            .and_then(|tripped| self.print_if_due(client).map(|no_longer| tripped.or(no_longer)));
        round(printed, &mut self.failure)
    }

    /// Ends the hold with a failure.
    pub fn fail(&mut self, failure: Failure) -> ControlFlow<()> {
        self.failure = Some(failure);
        ControlFlow::Break(())
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

    /// The end of the hold.
    pub fn end(self, held: Result<(), ClientError>) -> Result<(), Failure> {
        self.failure.map_or_else(|| end_of_hold(held), Err)
    }

    /// Prints the states from time to time; returns why an axis is no longer armed, if one is not.
    fn print_if_due<T: Transport>(
        &mut self,
        client: &mut Client<T>,
    ) -> Result<Option<Failure>, Failure> {
        if client.now() < self.next {
            return Ok(None);
        }
        self.next = client.now() + PRINT_EVERY;
        let mut no_longer = None;
        for armed in self.axes.clone() {
            let report = match client.read_state(armed.axis) {
                // Another host has asked something; the next round tells.
                Err(ClientError::Gateway(Error::Busy { .. })) => continue,
                report => report?,
            };
            for line in states::table(&[report], &self.out.motors, &self.names)
                .lines()
                .iter()
                .skip(usize::from(self.headings_printed))
            {
                self.out.text(line)?;
            }
            self.headings_printed = true;
            self.latest = Some(report);
            self.out.object(&state_line(&report, self.out.motors))?;
            no_longer = no_longer.or(no_longer_armed(&report, armed.epoch, self.out.motors));
        }
        Ok(no_longer)
    }
}

/// The state of an axis as a line of a stream.
pub fn state_line(report: &AxisReport, motors: Protocols) -> Value {
    json::line("state", json::axis::report(report, motors.of(report.axis)))
}

/// Why an axis that was armed here, and that nobody here has stopped, is no longer armed.
pub fn no_longer_armed(report: &AxisReport, epoch: u32, motors: Protocols) -> Option<Failure> {
    let AxisReport { axis, state, .. } = *report;
    match (state, report.trip) {
        (AxisState::Armed | AxisState::Active, _) if report.epoch == Some(epoch) => None,
        (AxisState::Tripped { .. }, Some(trip)) => Some(Failure::tripped(axis, &trip, motors)),
        _ => Some(Failure::StoppedElsewhere { axis, state }),
    }
}

/// The event with the times of the stop may come a little after the reply with the state. Keeps
/// the trip of the axis, if there was one.
fn print_confirmation(
    session: &mut Session,
    axis: u8,
    tripped: &mut Option<Failure>,
) -> Result<(), Failure> {
    let end = session.client.now() + EVENT_PATIENCE;
    let mut printed = Ok(());
    while session.client.now() < end
        && let Some(message) =
            session.client.poll_event(end.saturating_sub(session.client.now()))?
    {
        printed = printed.and(print_event(&message, session.out));
        *tripped = tripped.take().or(trip_of(&message.event, &[axis], session.out.motors));
        if matches!(message.event, Event::StopConfirmed { axis: of, .. } if of == axis) {
            break;
        }
    }
    printed
}
