//! Periods of a free-running cycle.

use host_protocol::{CycleEvent, CycleMessage, CycleResult, ERRORS};
use serde_json::{Value, json};

use super::{axis, extend, line, name, snake};
use crate::faults::Protocols;
use crate::output::{number, to_json};

/// What became of a setpoint; one that was refused: the name of the error.
pub fn result(result: CycleResult) -> String {
    match result {
        CycleResult::Refused { error } => {
            let known = ERRORS.iter().find(|info| info.number == error);
            known.map_or("refused".to_owned(), |info| snake(info.name))
        }
        other => name(&other),
    }
}

/// A period, and how each axis is in it.
pub fn period(event: &CycleEvent) -> Value {
    let axes = event.states().map(|state| {
        let mut axis = axis::in_state(state.axis, state.state);
        extend(
            &mut axis,
            json!({
                "result": result(state.result), "age_us": state.age_us,
                "position_rad": state.position_rad.map(number),
                "velocity_rad_s": state.velocity_rad_s.map(number),
                "current_a": state.current_a.map(number),
            }),
        );
        axis
    });
    json!({
        "period": event.period, "late_us": event.late_us, "jitter_us": event.jitter_us,
        "took_us": event.took_us,
        "overruns": to_json(&event.overruns),
        "axes": axes.collect::<Value>(),
    })
}

/// A period with its times, and what is told of one axis in turns.
pub fn told(message: &CycleMessage, motors: &Protocols) -> Value {
    let mut value = line("period", period(&message.event));
    let slow = message.event.slow.as_ref().map(|slow| axis::slow(slow, motors.of(slow.axis)));
    let more = json!({
        "time_us": message.time_us, "due_us": message.event.due_us.0,
        "dropped": message.dropped, "slow": slow,
    });
    extend(&mut value, more);
    value
}
