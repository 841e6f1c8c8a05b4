//! The second part: setpoints, states in SI units, and what travels on the buses.

use std::cell::RefCell;
use std::collections::HashSet;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::Setpoint;
use mgw_client::{Client, Hold};
use mgw_sim::{SimTransport, Station, World};

use super::setup::heading;
use super::trace::{self, Decoded, Trace};
use crate::commands::{ArmedAxis, state_line};
use crate::failure::Failure;
use crate::json;
use crate::names::Names;
use crate::output::Output;
use crate::states;

/// How long the motors move before the host falls silent.
const MOVING_FOR: Duration = Duration::from_secs(2);
/// States are shown after these times.
const SHOWN_AFTER: [Duration; 2] = [Duration::from_millis(300), Duration::from_millis(1_900)];
/// What each axis shall do: 2 rad/s; a fifth of the full signal; 600 °/s; a long way at 3 rad/s;
/// 5 rad/s.
const SETPOINTS: [Setpoint; 5] = [
    Setpoint::Velocity { velocity_rad_s: 2.0 },
    Setpoint::Signal { fraction: 0.2 },
    Setpoint::Velocity { velocity_rad_s: 10.471_976 },
    Setpoint::Position { position_rad: 30.0, speed_limit_rad_s: 3.0 },
    Setpoint::Velocity { velocity_rad_s: 5.0 },
];

/// What an axis shall do.
pub type Motion = Hold;

/// A motion for each armed axis.
pub fn motions(armed: &[ArmedAxis]) -> Vec<Motion> {
    armed.iter().zip(SETPOINTS).map(|(armed, setpoint)| armed.hold(setpoint)).collect()
}

/// Holds the setpoints for a while and shows states and frames.
pub fn run(
    client: &mut Client<SimTransport>,
    motions: &[Motion],
    world: &Rc<RefCell<World>>,
    trace: &mut Trace,
    out: Output,
) -> Result<(), Failure> {
    heading(out, "4. Moving: setpoints are renewed before they expire")?;
    for motion in motions {
        let Hold { axis, setpoint, .. } = motion;
        let text = format!("axis {axis}: {}", words(*setpoint));
        out.event("setpoint", text, json::axis::setpoint(*axis, setpoint))?;
    }
    let start = client.now();
    let mut shown = SHOWN_AFTER.iter().peekable();
    let mut snapshots = Vec::new();
    client.hold_setpoints(motions, MOVING_FOR, |client| {
        if shown.next_if(|after| client.now() >= start + **after).is_some() {
            let reports: Result<Vec<_>, _> =
                motions.iter().map(|motion| client.read_state(motion.axis)).collect();
            snapshots.push((client.now() - start, reports?));
        }
        Ok(ControlFlow::Continue(()))
    })?;
    for (after, reports) in &snapshots {
        out.text("")?;
        out.text(format!("states {:.1} s later", after.as_secs_f32()))?;
        out.table(&states::table(reports, &out.motors, &Names::default()))?;
        reports.iter().try_for_each(|report| out.object(&state_line(report, out.motors)))?;
    }
    out.text("")?;
    out.text("on the buses, the first frame of each kind (-> to the motor, <- from it)")?;
    trace::print(first_of_each_kind(trace.collect(world)).into_iter(), out)
}

fn words(setpoint: Setpoint) -> String {
    match setpoint {
        Setpoint::Signal { fraction } => format!("signal {fraction} of full"),
        Setpoint::Current { current_a } => format!("current {current_a} A"),
        Setpoint::Velocity { velocity_rad_s } => format!("velocity {velocity_rad_s:.2} rad/s"),
        Setpoint::Position { position_rad, speed_limit_rad_s } => {
            format!("position {position_rad} rad at up to {speed_limit_rad_s} rad/s")
        }
        Setpoint::Impedance { position_rad, stiffness_nm_per_rad, .. } => {
            format!("a spring of {stiffness_nm_per_rad} N·m/rad about {position_rad} rad")
        }
    }
}

/// One frame for each bus, sender, motor and command, sorted by bus.
fn first_of_each_kind(frames: &[Decoded]) -> Vec<&Decoded> {
    let mut seen = HashSet::new();
    let mut first: Vec<&Decoded> = frames
        .iter()
        .filter(|decoded| {
            let Some(meaning) = &decoded.meaning else { return false };
            let kind = meaning.text.split([' ', '(']).next().map(str::to_owned);
            let from_gateway = decoded.entry.from == Station::Gateway;
            seen.insert((decoded.entry.bus, from_gateway, meaning.motor.clone(), kind))
        })
        .collect();
    first.sort_by_key(|decoded| (decoded.entry.bus, decoded.entry.time_us));
    first
}
