//! What `set`, `native` and `move` have in common: arming an axis, looking after it while it moves, stopping and disarming it.

use std::ops::ControlFlow;
use std::time::Duration;

use host_protocol::replies::AxisReport;
use host_protocol::{AxisState, Event, StopTarget};
use mgw_client::{Client, ClientError, Round, Transport};
use serde_json::json;

use crate::failure::Failure;
use crate::interrupt;
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
    interrupt::note();
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
    out: Output,
    headings_printed: bool,
    next: Duration,
    failure: Option<Failure>,
    /// The state that was printed last.
    pub latest: Option<AxisReport>,
}

impl Rounds {
    pub fn new(session: &Session, axis: u8) -> Self {
        let next = session.client.now();
        Self { axis, out: session.out, headings_printed: false, next, failure: None, latest: None }
    }

    /// One round of a hold.
    pub fn turn<T: Transport>(&mut self, client: &mut Client<T>) -> Round {
        let printed = print_events(client, &[self.axis], self.out)
            .and_then(|tripped| self.print_if_due(client).map(|()| tripped));
        self.failure = printed.unwrap_or_else(Some);
        go_on(self.failure.as_ref())
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

    /// The end of the hold. A command refused because the axis tripped says less than the trip.
    pub fn end(self, session: &mut Session, held: Result<(), ClientError>) -> Result<(), Failure> {
        match self.failure.or(session.print_events(&[self.axis])?) {
            Some(failure) => Err(failure),
            None => Ok(held?),
        }
    }

    fn print_if_due<T: Transport>(&mut self, client: &mut Client<T>) -> Result<(), Failure> {
        if client.now() < self.next {
            return Ok(());
        }
        self.next = client.now() + PRINT_EVERY;
        let report = client.read_state(self.axis)?;
        for line in states::table(&[report]).lines().iter().skip(usize::from(self.headings_printed)) {
            self.out.text(line)?;
        }
        self.headings_printed = true;
        self.latest = Some(report);
        self.out.object(&to_json(&report))
    }
}

fn stop(session: &mut Session, axis: u8) -> Result<(), Failure> {
    let before = session.client.read_state(axis)?.state;
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
