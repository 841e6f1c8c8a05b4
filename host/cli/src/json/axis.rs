//! Axes: their states, trips and readings.

use host_protocol::replies::AxisReport;
use host_protocol::{
    AxisState, AxisSummary, Event, FaultReading, MotorTimeout, Protocol, Setpoint, SlowState,
    StateField, Trip, TripReason,
};
use serde_json::{Value, json};

use super::{extend, name, variant};
use crate::explain::Page;
use crate::faults;
use crate::output::{number, to_json};

/// An axis and its state.
pub fn in_state(axis: u8, state: AxisState) -> Value {
    let confirmed = match state {
        AxisState::Tripped { confirmed } => Some(confirmed),
        _ => None,
    };
    json!({ "axis": axis, "state": name(&state), "stop_confirmed": confirmed })
}

/// A fault word: the names of its bits under `key`, and itself as `key`_raw.
fn put_faults(object: &mut Value, key: &str, protocol: Option<Protocol>, word: Option<u16>) {
    object[key] = json!(word.map(|word| faults::names(protocol, word)));
    object[format!("{key}_raw")] = json!(word);
}

/// Why an axis tripped, and what belongs to the reason.
pub fn reason(reason: &TripReason, protocol: Option<Protocol>) -> Value {
    let (name, fields) = variant(reason);
    let mut value = json!({ "reason": name, "explain": Page::of_trip(reason).code() });
    match reason {
        TripReason::MotorFault { faults } => {
            put_faults(&mut value, "faults", protocol, Some(*faults))
        }
        TripReason::CommandRefused { faults } => {
            put_faults(&mut value, "faults", protocol, *faults)
        }
        TripReason::LimitExceeded { quantity, value: measured, limit } => {
            value["quantity"] = json!(quantity.to_string().replace(' ', "_"));
            value["unit"] = json!(quantity.unit());
            value["value"] = number(*measured);
            value["limit"] = number(*limit);
        }
        TripReason::Group { axis } => value["tripped_axis"] = json!(axis),
        _ => extend(&mut value, Value::Object(fields)),
    }
    value
}

/// A trip.
pub fn trip(trip: &Trip, protocol: Option<Protocol>) -> Value {
    let mut value = reason(&trip.reason, protocol);
    let more = json!({
        "time_us": trip.time_us,
        "velocity_rad_s": trip.velocity_rad_s.map(number),
        "position_rad": trip.position_rad.map(number),
        "current_a": trip.current_a.map(number),
        "unreachable": trip.unreachable,
    });
    extend(&mut value, more);
    value
}

/// What an axis shall do: the name of the setpoint, and its values.
pub fn setpoint(axis: u8, setpoint: &Setpoint) -> Value {
    let (name, fields) = variant(setpoint);
    let mut value = json!({ "axis": axis, "setpoint": name });
    extend(&mut value, Value::Object(fields));
    value
}

/// The motor's own timeout, and its time where it is known.
pub fn motor_timeout(timeout: MotorTimeout) -> Value {
    let time = match timeout {
        MotorTimeout::Written { timeout_ms } => Some(timeout_ms),
        MotorTimeout::Unknown | MotorTimeout::Off | MotorTimeout::Verified => None,
    };
    json!({ "motor_timeout": name(&timeout), "motor_timeout_ms": time })
}

/// The fields of a sample that are numbers, and what they are called, as in PROTOCOL.md.
pub const NUMBERS: &[(StateField, &str)] = &[
    (StateField::Position, "position_rad"),
    (StateField::Velocity, "velocity_rad_s"),
    (StateField::Current, "current_a"),
    (StateField::Voltage, "voltage_v"),
    (StateField::MotorTemperature, "motor_temperature_c"),
    (StateField::DriverTemperature, "driver_temperature_c"),
];
/// The fields that [`StateField::Faults`] stands for.
pub const FAULTS: [&str; 5] =
    ["faults", "faults_raw", "fault_warnings", "fault_warnings_raw", "faults_age_us"];

fn put_reading(object: &mut Value, protocol: Option<Protocol>, faults: Option<FaultReading>) {
    put_faults(object, "faults", protocol, faults.map(|faults| faults.word));
    put_faults(object, "fault_warnings", protocol, faults.map(|faults| faults.warnings));
    object["faults_age_us"] = json!(faults.map(|faults| faults.age_us));
}

/// How an axis is.
pub fn report(report: &AxisReport, protocol: Option<Protocol>) -> Value {
    let mut value = to_json(report);
    extend(&mut value, in_state(report.axis, report.state));
    extend(&mut value, motor_timeout(report.motor_timeout));
    value["trip"] = json!(report.trip.as_ref().map(|of| trip(of, protocol)));
    put_reading(&mut value, protocol, report.faults);
    put_faults(&mut value, "fault_record", protocol, report.fault_record);
    value
}

/// The fields of a sample; nothing of another event.
pub fn sample(event: &Event, protocol: Option<Protocol>) -> Value {
    let Event::Sample { axis, state, faults, .. } = event else { return Value::Null };
    let mut value = in_state(*axis, *state);
    put_reading(&mut value, protocol, *faults);
    for (field, key) in NUMBERS {
        value[*key] = to_json(&event.reading(*field));
    }
    value
}

/// What a free-running cycle tells of one axis in turns.
pub fn slow(slow: &SlowState, protocol: Option<Protocol>) -> Value {
    let mut value = to_json(slow);
    put_reading(&mut value, protocol, slow.faults);
    value
}

/// One axis of a list.
pub fn summary(axis: &AxisSummary, missing: Option<&str>) -> Value {
    let mut value = in_state(axis.axis, axis.state);
    let more = json!({
        "bus": axis.bus, "protocol": axis.protocol.map(Protocol::name), "node": axis.node,
        "missing": missing,
    });
    extend(&mut value, more);
    value
}
