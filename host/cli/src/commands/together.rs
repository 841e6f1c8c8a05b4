//! `mgw together`

use std::time::Duration;

use host_protocol::requests::{MAX_MEMBERS, Member};
use host_protocol::{Error, Protocol, Setpoint, TogetherBar, Vec as Members};
use mgw_client::ClientError;

use super::arm::while_armed;
use super::drive::{ArmedAxis, Rounds, refuse_twice};
use super::limits;
use crate::args::{Target, TogetherArgs};
use crate::failure::Failure;
use crate::session::Session;

/// Arms D5 motors, sets them in motion by one frame, holds their velocities, stops and disarms
/// them.
pub fn run(session: &mut Session, arguments: &TogetherArgs) -> Result<(), Failure> {
    let targets = targets(session, arguments)?;
    check_start(session, &targets)?;
    for Target { axis, velocity } in &targets {
        limits::check_setpoint(session, *axis, Setpoint::Velocity { velocity_rad_s: *velocity })?;
    }
    let axes: Vec<u8> = targets.iter().map(|target| target.axis).collect();
    let duration = arguments.seconds.unwrap_or(Duration::MAX);
    while_armed(session, &axes, |session, armed| start_and_hold(session, &targets, armed, duration))
}

/// What stands on the command line: at least two axes, each once.
fn targets(session: &mut Session, arguments: &TogetherArgs) -> Result<Vec<Target>, Failure> {
    let targets = Target::all(&arguments.words, |axis| session.axis(axis))?;
    let many = || Failure::Usage(format!("at most {MAX_MEMBERS} motors start together"));
    if targets.len() > MAX_MEMBERS {
        return Err(many());
    }
    refuse_twice(&targets.iter().map(|target| target.axis).collect::<Vec<_>>())?;
    Ok(targets)
}

/// What the gateway would refuse to start by one frame, found before anything is armed.
fn check_start(session: &mut Session, targets: &[Target]) -> Result<(), Failure> {
    let known = session.client.list_axes()?;
    let of = |axis: u8| known.iter().find(|known| known.axis == axis);
    let first = targets.first().and_then(|first| of(first.axis)).and_then(|first| first.bus);
    for target in targets {
        let axis = target.axis;
        // Arming says what an axis lacks.
        let Some((protocol, bus)) = of(axis).and_then(|axis| axis.protocol.zip(axis.bus)) else {
            continue;
        };
        if protocol != Protocol::D5 {
            let error = Error::Unsupported { axis, protocol };
            let text = format!(
                "axis {axis} speaks {protocol}: only D5 motors are started by one frame; `mgw \
                    cycle` moves several of others"
            );
            return Err(Failure::Explained { error, text });
        }
        if first.is_some_and(|first| first != bus) {
            let reason = TogetherBar::OtherBus;
            return Err(ClientError::Gateway(Error::CannotStartTogether { axis, reason }).into());
        }
    }
    Ok(())
}

fn start_and_hold(
    session: &mut Session,
    targets: &[Target],
    armed: &[ArmedAxis],
    duration: Duration,
) -> Result<(), Failure> {
    let mut members: Members<Member, MAX_MEMBERS> = Members::new();
    let mut holds = Vec::new();
    for (target, armed) in targets.iter().zip(armed) {
        let (axis, epoch, velocity_rad_s) = (armed.axis, armed.epoch, target.velocity);
        // There are no more than there may be.
        let _ = members.push(Member { axis, epoch, velocity_rad_s });
        holds.push(armed.hold(Setpoint::Velocity { velocity_rad_s }));
    }
    let ttl = armed.iter().map(|armed| armed.ttl).min().unwrap_or_default();
    let mut rounds = Rounds::new(session, armed);
    let held = session.client.start_together(&members, ttl).and_then(|()| {
        session.client.hold_setpoints(&holds, duration, |client| rounds.turn(client))
    });
    rounds.end(held)
}
