//! `mgw set`

use std::time::Duration;

use host_protocol::Setpoint;

use super::drive::{Rounds, drive, nothing_to_tell};
use super::limits;
use crate::args::{Mode, SetArgs};
use crate::failure::Failure;
use crate::session::Session;

/// Arms an axis, holds a setpoint, stops it and disarms it.
pub fn run(session: &mut Session, arguments: &SetArgs) -> Result<(), Failure> {
    let setpoint = setpoint(arguments)?;
    let axis = session.axis(&arguments.axis)?;
    limits::check_setpoint(session, axis, setpoint)?;
    if let Some(pull) = pull(session, axis, arguments, setpoint)? {
        session.out.aside(pull);
    }
    drive(session, axis, |session, armed| {
        // Arming may have freed a brake.
        pull(session, axis, arguments, setpoint)?;
        let mut rounds = Rounds::new(session, &[armed]);
        let duration = arguments.seconds.unwrap_or(Duration::MAX);
        let held = session
            .client
            .hold_setpoints(&[armed.hold(setpoint)], duration, |client| rounds.turn(client));
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
        ("--torque-limit", arguments.torque_limit, Mode::Impedance),
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

/// What an impedance would do from where the axis stands; nothing of any other setpoint. One that
/// would begin with more torque than `--torque-limit` allows is refused.
fn pull(
    session: &mut Session,
    axis: u8,
    arguments: &SetArgs,
    setpoint: Setpoint,
) -> Result<Option<String>, Failure> {
    let Setpoint::Impedance {
        position_rad: target_rad,
        velocity_rad_s: target_rad_s,
        stiffness_nm_per_rad,
        damping_nm_s_per_rad,
        torque_nm,
    } = setpoint
    else {
        return Ok(None);
    };
    let limit_nm = arguments.torque_limit.filter(|limit| *limit >= 0.0).ok_or_else(|| {
        let needed = "an impedance pulls the harder the farther its target is: add --torque-limit \
            NM, 0 or more, beyond which nothing is armed";
        Failure::Usage(needed.to_owned())
    })?;
    let report = session.client.read_state_when_free(axis)?;
    let (Some(position), Some(velocity)) = (report.position_rad, report.velocity_rad_s) else {
        let text = format!("axis {axis} does not tell where it stands, so its pull is not known");
        return Err(Failure::Usage(text));
    };
    let spring = stiffness_nm_per_rad * (target_rad - position.value);
    let damper = damping_nm_s_per_rad * (target_rad_s - velocity.value);
    let torque_nm = spring + damper + torque_nm;
    let text = format!(
        "axis {axis} stands at {:.3} rad, {:.3} rad from its target: it is pulled with {:.2} N·m",
        position.value,
        (target_rad - position.value).abs(),
        torque_nm.abs()
    );
    if torque_nm.abs() <= limit_nm {
        return Ok(Some(text));
    }
    Err(Failure::Refused {
        name: "OutOfRange",
        field: "torque_nm",
        value: torque_nm.into(),
        range: Some((-f64::from(limit_nm), limit_nm.into())),
        message: format!("{text}, and --torque-limit allows {limit_nm} N·m"),
    })
}
