//! Periods of a free-running cycle.

use host_protocol::{CycleEvent, CycleMessage, CycleResult, ERRORS};
use serde_json::{Value, json};

use super::{axis, extend, line, snake};
use crate::faults::Protocols;
use crate::output::number;

/// What became of a setpoint; one that was refused: the name of the error.
pub fn result(result: CycleResult) -> String {
    let name = match result {
        CycleResult::Answered => "answered",
        CycleResult::Ambiguous => "ambiguous",
        CycleResult::NoReply => "no_reply",
        CycleResult::Stopped => "stopped",
        CycleResult::Superseded => "superseded",
        CycleResult::Refused { error } => {
            let known = ERRORS.iter().find(|info| info.number == error);
            return known.map_or("refused".to_owned(), |info| snake(info.name));
        }
    };
    name.to_owned()
}

/// A period, and how each axis is in it.
pub fn period(event: &CycleEvent) -> Value {
    let or_null = |value: Option<f32>| value.map_or(Value::Null, number);
    let axes = event.states().map(|state| {
        let mut axis = axis::in_state(state.axis, state.state);
        extend(
            &mut axis,
            json!({
                "result": result(state.result), "age_us": state.age_us,
                "position_rad": or_null(state.position_rad),
                "velocity_rad_s": or_null(state.velocity_rad_s),
                "current_a": or_null(state.current_a),
            }),
        );
        axis
    });
    let overruns = event.overruns;
    json!({
        "period": event.period, "late_us": event.late_us, "jitter_us": event.jitter_us,
        "took_us": event.took_us,
        "overruns": {
            "bus": overruns.bus, "motor": overruns.motor,
            "host": overruns.host, "gateway": overruns.gateway,
        },
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
