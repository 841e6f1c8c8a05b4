//! The words of a step.

use host_protocol::{
    AxisParameter, CanId, Protocol, ProtocolSet, Setpoint, StateField, StateFields, StopAction,
    Value, ValueKind,
};
use mgw_sim::Wiring;
use std::str::FromStr;
use std::time::Duration;

/// A line without its comment: `#` at the start, or between blanks (`#` also stands in CAN frames).
pub fn without_comment(line: &str) -> &str {
    if line.trim_start().starts_with('#') {
        return "";
    }
    line.split(" # ").next().unwrap_or_default()
}

/// The word at a place, as a number or whatever else is wanted there.
pub fn parse<T: FromStr>(words: &[&str], at: usize, what: &str) -> Result<T, String> {
    let word = words.get(at).ok_or_else(|| format!("{what} is missing"))?;
    word.parse().map_err(|_| format!("{word} is no {what}"))
}

/// `NUMBER ms|us|s` at a place.
pub fn duration(words: &[&str], at: usize) -> Result<Duration, String> {
    let number: f64 = parse(words, at, "time")?;
    match words.get(at + 1) {
        Some(&"us") => Ok(Duration::from_secs_f64(number / 1e6)),
        Some(&"ms") => Ok(Duration::from_secs_f64(number / 1e3)),
        Some(&"s") => Ok(Duration::from_secs_f64(number)),
        other => Err(format!("a time needs us, ms or s, not {other:?}")),
    }
}

/// Bytes in hexadecimal.
pub fn hex(text: &str) -> Result<Vec<u8>, String> {
    (0..text.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(text.get(at..at + 2).unwrap_or("?"), 16))
        .collect::<Result<_, _>>()
        .map_err(|e| format!("{text}: {e}"))
}

/// `position,velocity`
pub fn fields(text: &str) -> Result<StateFields, String> {
    text.split(',').try_fold(StateFields::NONE, |set, name| {
        let field =
            StateField::from_name(name).ok_or_else(|| format!("{name} is no field of a state"))?;
        Ok(set.with(field))
    })
}

/// The number after a word, 0 where the word is not there.
fn named(words: &[&str], name: &str) -> Result<f32, String> {
    match words.iter().position(|word| *word == name) {
        Some(at) => parse(words, at + 1, name),
        None => Ok(0.0),
    }
}

/// `signal|current|velocity V`, `position P speed V` or `impedance P [stiffness K] [damping D]
/// [velocity V] [torque T]` at a place.
pub fn setpoint(words: &[&str], at: usize) -> Result<Setpoint, String> {
    let value: f32 = parse(words, at + 1, "value")?;
    match words.get(at) {
        Some(&"signal") => Ok(Setpoint::Signal { fraction: value }),
        Some(&"current") => Ok(Setpoint::Current { current_a: value }),
        Some(&"velocity") => Ok(Setpoint::Velocity { velocity_rad_s: value }),
        Some(&"position") => Ok(Setpoint::Position {
            position_rad: value,
            speed_limit_rad_s: parse(words, at + 3, "speed limit")?,
        }),
        Some(&"impedance") => Ok(Setpoint::Impedance {
            position_rad: value,
            velocity_rad_s: named(words, "velocity")?,
            stiffness_nm_per_rad: named(words, "stiffness")?,
            damping_nm_s_per_rad: named(words, "damping")?,
            torque_nm: named(words, "torque")?,
        }),
        other => Err(format!("{other:?} is no kind of setpoint")),
    }
}

/// `rmd,thruster`
pub fn protocols(text: &str) -> Result<ProtocolSet, String> {
    text.split(',').try_fold(ProtocolSet::NONE, |set, name| {
        let protocol = Protocol::from_name(name).ok_or_else(|| format!("{name} is no protocol"))?;
        Ok(set.with(protocol))
    })
}

/// `motor BUS PROTOCOL NODE [CAN_ID|BITRATE]`: one more motor on the buses, a D5 on a CAN id of its
/// own, any other one at a bitrate of its own.
pub fn motor(wiring: Wiring, words: &[&str]) -> Result<Wiring, String> {
    let name: String = parse(words, 2, "protocol")?;
    let protocol = Protocol::from_name(&name).ok_or_else(|| format!("{name} is no protocol"))?;
    let mut wiring = wiring.with(parse(words, 1, "bus")?, protocol, parse(words, 3, "node")?);
    if let Some(motor) = wiring.motors.last_mut().filter(|_| words.len() > 4) {
        match protocol {
            Protocol::D5 => motor.can_id = Some(parse(words, 4, "CAN id")?),
            _ => motor.bitrate = parse(words, 4, "bitrate")?,
        }
    }
    Ok(wiring)
}

/// `name=value`
pub fn parameter(text: &str) -> Result<(AxisParameter, Value), String> {
    let (name, value) = text.split_once('=').ok_or_else(|| format!("{text} is not name=value"))?;
    let parameter =
        AxisParameter::from_name(name).ok_or_else(|| format!("{name} is no parameter"))?;
    let named = match parameter {
        AxisParameter::Protocol => Protocol::from_name(value).map(u32::from),
        AxisParameter::StopAction => StopAction::from_name(value).map(u32::from),
        _ if parameter.info().is_can_id() => value.parse().ok().map(CanId::to_wire),
        _ => None,
    };
    if let Some(number) = named {
        return Ok((parameter, Value::Unsigned(number)));
    }
    let bad = |_| format!("{value} is no value of {name}");
    let value = match parameter.info().kind {
        ValueKind::Bool => {
            Value::Bool(value.parse().map_err(|e: std::str::ParseBoolError| bad(e.to_string()))?)
        }
        ValueKind::Unsigned => {
            Value::Unsigned(value.parse().map_err(|e: std::num::ParseIntError| bad(e.to_string()))?)
        }
        ValueKind::Signed => {
            Value::Signed(value.parse().map_err(|e: std::num::ParseIntError| bad(e.to_string()))?)
        }
        ValueKind::Float => {
            Value::Float(value.parse().map_err(|e: std::num::ParseFloatError| bad(e.to_string()))?)
        }
    };
    Ok((parameter, value))
}
