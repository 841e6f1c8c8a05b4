//! `mgw set`

use std::time::Duration;

use host_protocol::Setpoint;
use mgw_client::Hold;

use super::drive::{Rounds, drive, nothing_to_tell};
use super::limits;
use crate::args::{Mode, SetArgs};
use crate::failure::Failure;
use crate::session::Session;

/// Arms an axis, holds a setpoint, stops it and disarms it.
pub fn run(session: &mut Session, arguments: &SetArgs) -> Result<(), Failure> {
    let setpoint = setpoint(arguments)?;
    limits::check_setpoint(session, arguments.axis, setpoint)?;
    drive(session, arguments.axis, |session, armed| {
        let hold = Hold { axis: armed.axis, epoch: armed.epoch, setpoint, ttl: armed.ttl };
        let mut rounds = Rounds::new(session, &[armed]);
        let duration = arguments.seconds.unwrap_or(Duration::MAX);
        let held = session.client.hold_setpoints(&[hold], duration, |client| rounds.turn(client));
        rounds.end(held)?;
        Ok(nothing_to_tell)
    })
}

fn setpoint(arguments: &SetArgs) -> Result<Setpoint, Failure> {
    let value = arguments.value;
    let options = [
        ("--speed-limit", arguments.speed_limit, Mode::Position),
        ("--stiffness", arguments.stiffness, Mode::Impedance),
        ("--damping", arguments.damping, Mode::Impedance),
        ("--velocity", arguments.velocity, Mode::Impedance),
        ("--torque", arguments.torque, Mode::Impedance),
    ];
    for (option, given, mode) in options {
        if given.is_some() && mode != arguments.mode {
            let mode = if mode == Mode::Position { "position" } else { "impedance" };
            return Err(Failure::Usage(format!("{option} belongs to `{mode}`")));
        }
    }
    Ok(match arguments.mode {
        Mode::Signal => Setpoint::Signal { fraction: value },
        Mode::Current => Setpoint::Current { current_a: value },
        Mode::Velocity => Setpoint::Velocity { velocity_rad_s: value },
        Mode::Position => {
            let needed = "a position needs the speed on the way: add --speed-limit RAD_S";
            let speed_limit_rad_s =
                arguments.speed_limit.ok_or_else(|| Failure::Usage(needed.to_owned()))?;
            Setpoint::Position { position_rad: value, speed_limit_rad_s }
        }
        Mode::Impedance => {
            let (Some(stiffness_nm_per_rad), Some(damping_nm_s_per_rad)) =
                (arguments.stiffness, arguments.damping)
            else {
                let needed = "an impedance needs its spring and its damper: add --stiffness \
                    NM_PER_RAD and --damping NM_S_PER_RAD";
                return Err(Failure::Usage(needed.to_owned()));
            };
            Setpoint::Impedance {
                position_rad: value,
                velocity_rad_s: arguments.velocity.unwrap_or(0.0),
                stiffness_nm_per_rad,
                damping_nm_s_per_rad,
                torque_nm: arguments.torque.unwrap_or(0.0),
            }
        }
    })
}
