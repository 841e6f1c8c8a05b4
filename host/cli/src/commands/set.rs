//! `mgw set`

use std::time::Duration;

use host_protocol::{AxisState, Event, Setpoint, StopTarget};
use mgw_client::{Client, Hold, Transport};
use serde_json::json;

use crate::args::{Mode, SetArgs};
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

/// Arms an axis, holds a setpoint, stops it and disarms it.
pub fn run(session: &mut Session, arguments: &SetArgs) -> Result<(), Failure> {
    let setpoint = setpoint(arguments)?;
    let axis = arguments.axis;
    interrupt::note();
    let ttl = session.client.axis_ttl(axis)?;
    let armed = session.client.arm(axis)?;
    let timeout = words::motor_timeout(armed.motor_timeout);
    session.out.either(
        format!("axis {axis} is armed, epoch {}; the motor's own timeout: {timeout}", armed.epoch),
        &json!({ "axis": axis, "epoch": armed.epoch, "motor_timeout": to_json(&armed.motor_timeout) }),
    )?;
    let hold = Hold { axis, epoch: armed.epoch, setpoint, ttl };
    let held = hold_and_print(session, hold, arguments.duration.unwrap_or(Duration::MAX));
    // Whatever happened above: it is stopped here, and not by its deadline.
    let stopped = stop(session, axis);
    held.and(stopped)
}

fn setpoint(arguments: &SetArgs) -> Result<Setpoint, Failure> {
    let value = arguments.value;
    if arguments.mode != Mode::Position && arguments.speed_limit.is_some() {
        return Err(Failure::Usage("--speed-limit belongs to `position`".to_owned()));
    }
    Ok(match arguments.mode {
        Mode::Signal => Setpoint::Signal { fraction: value },
        Mode::Current => Setpoint::Current { current_a: value },
        Mode::Velocity => Setpoint::Velocity { velocity_rad_s: value },
        Mode::Position => match arguments.speed_limit {
            Some(speed_limit_rad_s) => Setpoint::Position { position_rad: value, speed_limit_rad_s },
            None => {
                return Err(Failure::Usage(
                    "a position needs the speed on the way: add --speed-limit RAD_S".to_owned(),
                ));
            }
        },
    })
}

fn hold_and_print(session: &mut Session, hold: Hold, duration: Duration) -> Result<(), Failure> {
    let out = session.out;
    let mut states = StateLines { out, headings_printed: false, next: session.client.now() };
    let mut failure = None;
    let held = session.client.hold_setpoints(&[hold], duration, |client| {
        let printed = print_events(client, &[hold.axis], out);
        failure = printed
            .and_then(|tripped| states.print_if_due(client, hold.axis).map(|()| tripped))
            .unwrap_or_else(Some);
        go_on(failure.as_ref())
    });
    // A setpoint refused because the axis tripped says less than the trip.
    match failure.or(session.print_events(&[hold.axis])?) {
        Some(failure) => Err(failure),
        None => Ok(held?),
    }
}

/// The rows of a table of states that grows with time.
struct StateLines {
    out: Output,
    headings_printed: bool,
    next: Duration,
}

impl StateLines {
    fn print_if_due<T: Transport>(&mut self, client: &mut Client<T>, axis: u8) -> Result<(), Failure> {
        if client.now() < self.next {
            return Ok(());
        }
        self.next = client.now() + PRINT_EVERY;
        let report = client.read_state(axis)?;
        for line in states::table(&[report]).lines().iter().skip(usize::from(self.headings_printed)) {
            self.out.text(line)?;
        }
        self.headings_printed = true;
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
