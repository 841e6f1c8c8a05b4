//! Values on the command line.

use std::time::Duration;

use host_protocol::{ClearTarget, StateField, StopTarget};

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

fn axis_or(text: &str, word: &str) -> Result<Option<u8>, String> {
    if text == word {
        return Ok(None);
    }
    text.parse().map(Some).map_err(|_| format!("must be the number of an axis, or `{word}`"))
}

/// An axis, or `all`.
pub fn stop_target(text: &str) -> Result<StopTarget, String> {
    Ok(axis_or(text, "all")?.map_or(StopTarget::All, StopTarget::Axis))
}

/// An axis, or `gateway`.
pub fn clear_target(text: &str) -> Result<ClearTarget, String> {
    Ok(axis_or(text, "gateway")?.map_or(ClearTarget::Gateway, ClearTarget::Axis))
}
