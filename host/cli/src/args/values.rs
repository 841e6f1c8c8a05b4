//! Values on the command line.

use std::time::Duration;

use host_protocol::{Protocol, StateField, StopAction};
use rmd::Dialect;

use super::finding::{Bitrates, FactoryMotor, ScanTarget};
use super::typed::{Typed, TypedClear, TypedStop};

/// Seconds from 0 on.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let duration = text.parse().ok().and_then(|value| Duration::try_from_secs_f64(value).ok());
    duration.ok_or_else(|| "takes seconds from 0 on, for example 2.5".to_owned())
}

/// Seconds above 0.
pub fn some_seconds(text: &str) -> Result<Duration, String> {
    let duration = seconds(text).ok().filter(|duration| !duration.is_zero());
    duration.ok_or_else(|| "takes seconds above 0, for example 2.5".to_owned())
}

/// The name of a field of the state.
pub fn state_field(text: &str) -> Result<StateField, String> {
    StateField::from_name(text).ok_or_else(|| {
        let names: Vec<&str> = StateField::ALL.iter().map(|field| field.name()).collect();
        format!("must be one of {}", names.join(", "))
    })
}

fn axis_or(text: &str, word: &str) -> Result<Option<Typed>, String> {
    if text == word {
        return Ok(None);
    }
    text.parse()
        .map(Some)
        .map_err(|_| format!("must be the number or the name of an axis, or `{word}`"))
}

/// An axis, or `all`.
pub fn stop_target(text: &str) -> Result<TypedStop, String> {
    Ok(axis_or(text, "all")?.map_or(TypedStop::All, TypedStop::Axis))
}

/// An axis, or `gateway`.
pub fn clear_target(text: &str) -> Result<TypedClear, String> {
    Ok(axis_or(text, "gateway")?.map_or(TypedClear::Gateway, TypedClear::Axis))
}

/// `0`, `0@1000000,500000`, `0@all`
pub fn scan_target(text: &str) -> Result<ScanTarget<Typed>, String> {
    let wrong = || {
        "takes a bus, or a bus with bitrates: 0, arm_bus, 0@1000000, 2@115200,500000 or 2@all"
            .to_owned()
    };
    let (bus, bitrates) = match text.split_once('@') {
        None => (text, Bitrates::Configured),
        Some((bus, "all")) => (bus, Bitrates::All),
        Some((bus, bitrates)) => {
            let bitrates = bitrates.split(',').map(str::parse).collect::<Result<_, _>>();
            (bus, Bitrates::Named(bitrates.map_err(|_| wrong())?))
        }
    };
    Ok(ScanTarget { bus: bus.parse().map_err(|_| wrong())?, bitrates })
}

/// The name of a stop action.
pub fn stop_action(text: &str) -> Result<StopAction, String> {
    StopAction::from_name(text).ok_or_else(|| "must be coast, hold or brake".to_owned())
}

/// `0:rmd:1`, `0:rmd:1:v4_4`, `2:rmd:1@500000`
pub fn factory_motor(text: &str) -> Result<FactoryMotor, String> {
    let wrong = || "takes BUS:PROTOCOL:NODE[:DIALECT][@RATE], for example 0:rmd:1:v4_4".to_owned();
    let (motor, rate) = match text.split_once('@') {
        Some((motor, rate)) => (motor, Some(rate.parse().map_err(|_| wrong())?)),
        None => (text, None),
    };
    let mut words = motor.split(':');
    let mut word = || words.next().ok_or_else(wrong);
    let bus = word()?.parse().map_err(|_| wrong())?;
    let protocol = Protocol::from_name(word()?).ok_or_else(wrong)?;
    let node = word()?.parse().map_err(|_| wrong())?;
    let dialect = match words.next() {
        Some(_) if protocol != Protocol::Rmd => return Err(wrong()),
        Some(name) => {
            let known = Dialect::ALL.into_iter().filter(|dialect| *dialect != Dialect::Unknown);
            Some(known.into_iter().find(|dialect| dialect.name() == name).ok_or_else(wrong)?)
        }
        None => None,
    };
    if words.next().is_some() {
        return Err(wrong());
    }
    Ok(FactoryMotor { bus, protocol, node, dialect, bitrate: rate })
}
