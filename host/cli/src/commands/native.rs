//! `mgw native`

use std::time::Duration;

use gateway::NativeEffect;
use host_protocol::{AxisParameter, AxisState, Bytes, Error, MAX_CAN_DATA};
use mgw_client::{Client, ClientError, NativeHold, Transport};
use serde_json::json;

use super::drive::{ArmedAxis, Rounds, drive, nothing_to_tell};
use super::limits::Limits;
use super::raw;
use crate::args::NativeArgs;
use crate::config;
use crate::decode;
use crate::encode;
use crate::failure::Failure;
use crate::native_request::{self, Motor};
use crate::output::Output;
use crate::parameters;
use crate::session::Session;

/// A command that cannot be kept up is ended by a stop before it expires, which would trip the
/// axis: by this part of the axis's TTL, and by the time that the stop may need to get there.
const ONCE_MARGIN_PARTS: u32 = 10;
const ONCE_MARGIN_MIN: Duration = Duration::from_millis(30);

/// A native command, and whose it is.
struct Command {
    motor: Motor,
    /// Whether its axis was idle when this was typed.
    is_idle: bool,
    data: Bytes<MAX_CAN_DATA>,
    effect: NativeEffect,
    limits: Limits,
}

/// Sends the command and prints the reply; what moves is armed before, kept up, and stopped.
pub fn run(session: &mut Session, arguments: &NativeArgs) -> Result<(), Failure> {
    let command = command(session, arguments)?;
    match (command.effect, arguments.seconds) {
        (NativeEffect::Prepares, _) => Err(Failure::Usage(encode::PREPARED.to_owned())),
        (NativeEffect::Moves | NativeEffect::MovesOnce, None) => Err(Failure::Usage(
            "this command moves the motor: add --for SECONDS, and the axis is armed, moved for so \
                long and stopped"
                .to_owned(),
        )),
        (NativeEffect::Moves, Some(duration)) => {
            move_by(session, &command, |session, armed| keep_up(session, &command, armed, duration))
        }
        (NativeEffect::MovesOnce, Some(duration)) => {
            move_by(session, &command, |session, armed| once(session, &command, armed, duration))
        }
        (NativeEffect::Stops | NativeEffect::Asks | NativeEffect::Changes, Some(_)) => {
            Err(Failure::Usage(
                "--for is for commands that move the motor; this one does \
                not"
                .to_owned(),
            ))
        }
        (NativeEffect::Stops | NativeEffect::Asks | NativeEffect::Changes, None) => {
            let axis = command.motor.axis;
            let is_stop = command.effect == NativeEffect::Stops && !command.is_idle;
            let data = command.data.clone();
            let reply = session.client.native_when_free(axis, 0, data, Duration::ZERO)?;
            if is_stop && reply.is_empty() {
                let text = format!("axis {axis}: carried out as a stop of the axis");
                return session.out.event("stop_taken", text, json!({ "axis": axis }));
            }
            print(session.out, &command, &reply)?;
            if let Some(until) = native_request::acts_after(command.motor, &command.data) {
                let text = format!("axis {axis}: acts after {until}");
                session.out.event("acts_after", text, json!({ "axis": axis, "message": until }))?;
            }
            Ok(())
        }
    }
}

/// Arms the axis, if its limits allow the command, and has `act` move it.
fn move_by(
    session: &mut Session,
    command: &Command,
    act: impl FnOnce(&mut Session, ArmedAxis) -> Result<(), Failure>,
) -> Result<(), Failure> {
    command.limits.native(&command.data)?;
    drive(session, command.motor.axis, |session, armed| {
        act(session, armed)?;
        Ok(nothing_to_tell)
    })
}

fn command(session: &mut Session, arguments: &NativeArgs) -> Result<Command, Failure> {
    let axis = session.axis(&arguments.axis)?;
    let (motor, state) = motor(&mut session.client, axis)?;
    let data = match &arguments.command {
        Some(name) => {
            let fields = arguments.fields.iter().map(|field| {
                parameters::split(field).map(|(name, value)| (name.to_owned(), value.to_owned()))
            });
            encode::data_field(motor.protocol, motor.node, name, fields.collect::<Result<_, _>>()?)?
        }
        None => data_field(&arguments.data)?,
    };
    let too_long = |_| {
        Failure::Usage(format!(
            "a data field has at most {MAX_CAN_DATA} bytes; leave CAN id and framing away"
        ))
    };
    let bytes = Bytes::from_slice(&data).map_err(too_long)?;
    let limits = Limits::of(session, axis)?;
    let limits = limits.ok_or_else(|| Failure::lacks(axis, AxisParameter::Protocol))?;
    let effect = limits
        .native_effect(&data)
        .map_err(|error| native_request::explain(motor, &data, error))?;
    let is_idle = state == AxisState::Idle;
    Ok(Command { motor, is_idle, data: bytes, effect, limits })
}

/// The motor of an axis, as it is configured, and the state of the axis; without asking the motor.
pub fn motor<T: Transport>(
    client: &mut Client<T>,
    axis: u8,
) -> Result<(Motor, AxisState), Failure> {
    let max_axes = client.hello().max_axes;
    if axis >= max_axes {
        return Err(ClientError::Gateway(Error::UnknownAxis { axis, max_axes }).into());
    }
    let missing = |parameter| Failure::lacks(axis, parameter);
    let axes = client.list_axes()?;
    let summary = axes.iter().find(|summary| summary.axis == axis);
    let summary = summary.ok_or_else(|| missing(AxisParameter::Protocol))?;
    let protocol = summary.protocol.ok_or_else(|| missing(AxisParameter::Protocol))?;
    let node = summary.node.ok_or_else(|| missing(AxisParameter::Node))?;
    let bus = summary.bus.ok_or_else(|| missing(AxisParameter::Bus))?;
    let bus = config::kind_of(client.hello(), bus);
    Ok((Motor { axis, protocol, node, bus }, summary.state))
}

/// Bytes in hexadecimal, with spaces wherever they please between them.
fn data_field(words: &[String]) -> Result<Vec<u8>, Failure> {
    let mut data = Vec::new();
    for word in words {
        let bytes = raw::bytes(word).ok_or_else(|| {
            Failure::Usage(format!(
                "`{word}` is no sequence of bytes. Write the data field in hexadecimal, for \
                    example A100000064000000"
            ))
        })?;
        data.extend(bytes);
    }
    Ok(data)
}

/// Sends the command again and again before it expires.
fn keep_up(
    session: &mut Session,
    command: &Command,
    armed: ArmedAxis,
    duration: Duration,
) -> Result<(), Failure> {
    let ArmedAxis { axis, epoch, ttl } = armed;
    let hold = NativeHold { axis, epoch, data: command.data.clone(), ttl };
    let mut rounds = Rounds::new(session, &[armed]);
    let (out, mut printed) = (session.out, false);
    let held = session.client.hold_native(&hold, duration, |client| {
        if !printed && let Some(reply) = client.native_reply() {
            printed = true;
            if let Err(failure) = print(out, command, reply) {
                return Ok(rounds.fail(failure));
            }
        }
        rounds.turn(client)
    });
    rounds.end(held)
}

/// Sends the command once, and waits nearly as long as it is valid.
fn once(
    session: &mut Session,
    command: &Command,
    armed: ArmedAxis,
    duration: Duration,
) -> Result<(), Failure> {
    let ArmedAxis { axis, epoch, ttl } = armed;
    let longest = ttl.saturating_sub(ONCE_MARGIN_MIN.max(ttl / ONCE_MARGIN_PARTS));
    if longest < duration {
        let seconds = longest.as_secs_f32();
        session.out.text(format!(
            "it goes out once and is stopped after {seconds:.3} s; a greater ttl_us of the axis \
                allows more"
        ))?;
    }
    let end = session.client.now() + duration.min(longest);
    let reply = session.client.native(axis, epoch, command.data.clone(), ttl);
    let mut rounds = Rounds::new(session, &[armed]);
    let held = match reply {
        Ok(reply) => {
            print(session.out, command, &reply)?;
            let left = end.saturating_sub(session.client.now());
            session.client.hold(left, |client| rounds.turn(client))
        }
        Err(error) => Err(error),
    };
    rounds.end(held)
}

fn print(out: Output, command: &Command, reply: &[u8]) -> Result<(), Failure> {
    let Motor { axis, protocol, node, .. } = command.motor;
    if reply.is_empty() {
        let text = format!("axis {axis}: the motor does not answer this command");
        return out.event("no_reply", text, json!({ "axis": axis }));
    }
    let json = out.is_json();
    out.line(&decode::reply(axis, protocol, node, &command.data, reply, json))
}
