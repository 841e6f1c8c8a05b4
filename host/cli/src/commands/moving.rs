//! `mgw move`

use std::time::Duration;

use host_protocol::Setpoint;
use host_protocol::replies::{AxisReport, MoveTarget};
use serde_json::{Value, json};

use super::drive::{Rounds, drive};
use super::limits;
use crate::args::MoveArgs;
use crate::failure::Failure;
use crate::output::number;
use crate::session::Session;

/// An axis that has arrived is slower than this, rad/s.
const SLOW_RAD_S: f32 = 0.05;
/// What says that it has arrived is younger than this, µs.
const FRESH_US: u32 = 1_000_000;

/// Arms an axis, moves it by a distance and holds it there, stops it and disarms it.
pub fn run(session: &mut Session, arguments: &MoveArgs) -> Result<(), Failure> {
    let MoveArgs { distance, speed_limit, tolerance, seconds: duration, .. } = *arguments;
    if tolerance.is_nan() || tolerance <= 0.0 {
        return Err(Failure::Usage("--tolerance is an angle above 0".to_owned()));
    }
    let axis = session.axis(&arguments.axis)?;
    limits::check_move(session, axis, distance, speed_limit)?;
    drive(session, axis, |session, armed| {
        let target =
            session.client.move_relative(axis, armed.epoch, distance, speed_limit, armed.ttl)?;
        let MoveTarget { start_rad, target_rad } = target;
        session.out.event(
            "move_started",
            format!("axis {axis} moves from {start_rad:.3} rad to {target_rad:.3} rad"),
            json!({
                "axis": axis, "start_rad": number(start_rad), "target_rad": number(target_rad)
            }),
        )?;
        let setpoint =
            Setpoint::Position { position_rad: target_rad, speed_limit_rad_s: speed_limit };
        let hold = armed.hold(setpoint);
        let mut rounds = Rounds::new(session, &[armed]);
        let is_there = move |report: &AxisReport| has_arrived(report, target_rad, tolerance);
        let held =
            session.client.hold_setpoints(&[hold], duration.unwrap_or(Duration::MAX), |client| {
                rounds.turn_until(client, is_there)
            });
        let arrived = rounds.latest.as_ref().is_some_and(is_there);
        rounds.end(held)?;
        Ok(move |session: &mut Session, report: &AxisReport| {
            tell(session, report, target_rad, arrived || is_there(report))
        })
    })
}

/// At rest near its target, by readings that are not old.
fn has_arrived(report: &AxisReport, target_rad: f32, tolerance_rad: f32) -> bool {
    let (Some(position), Some(velocity)) = (report.position_rad, report.velocity_rad_s) else {
        return false;
    };
    position.age_us.max(velocity.age_us) < FRESH_US
        && (position.value - target_rad).abs() <= tolerance_rad
        && velocity.value.abs() < SLOW_RAD_S
}

fn tell(
    session: &Session,
    report: &AxisReport,
    target_rad: f32,
    arrived: bool,
) -> Result<(), Failure> {
    let AxisReport { axis, position_rad: position, .. } = *report;
    let place = position
        .map_or("an unknown place".to_owned(), |position| format!("{:.3} rad", position.value));
    let text = if arrived { "has arrived" } else { "has not arrived" };
    let position = position.map_or(Value::Null, |position| number(position.value));
    let printed = session.out.event(
        "move_ended",
        format!("axis {axis} {text}: it is at {place}"),
        json!({ "axis": axis, "arrived": arrived, "position_rad": position }),
    );
    if arrived { printed } else { Err(Failure::NotArrived { axis, place, target_rad }) }
}
