//! What `--json` prints, of one convention that docs/mgw.schema.json states: names and values in
//! snake_case, units in names, faults by name and as the motor's own word, `event` on each line of
//! a stream.

pub mod axis;
pub mod cycle;
pub mod gateway;

use embedded_can::{Frame, Id};
use host_protocol::{Event, EventMessage, Protocol, ProtocolSet, RawFrame};
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::faults::Protocols;
use crate::output::to_json;
use crate::words;

/// `SetpointExpired` as `setpoint_expired`.
pub fn snake(name: &str) -> String {
    let mut snake = String::with_capacity(name.len() + 4);
    for (place, character) in name.chars().enumerate() {
        if character.is_ascii_uppercase() && place > 0 {
            snake.push('_');
        }
        snake.push(character.to_ascii_lowercase());
    }
    snake
}

/// Which variant of an enum of the wire this is, and its fields.
pub fn variant(value: &impl Serialize) -> (String, Map<String, Value>) {
    match to_json(value) {
        Value::String(name) => (name, Map::new()),
        Value::Object(variant) => match variant.into_iter().next() {
            Some((name, Value::Object(fields))) => (name, fields),
            Some((name, _)) => (name, Map::new()),
            None => Default::default(),
        },
        _ => Default::default(),
    }
}

/// The name of a variant of the wire.
pub fn name(value: &impl Serialize) -> String {
    variant(value).0
}

/// The names of a set.
pub fn protocols(set: ProtocolSet) -> Value {
    set.iter().map(Protocol::name).collect()
}

/// Adds the fields of one object to another.
pub fn extend(object: &mut Value, more: Value) {
    if let (Some(object), Value::Object(more)) = (object.as_object_mut(), more) {
        object.extend(more);
    }
}

/// The same object with the name of what it is about.
pub fn with_name(mut object: Value, name: Option<&str>) -> Value {
    extend(&mut object, json!({ "name": name }));
    object
}

/// The line of a stream.
pub fn line(event: &str, fields: Value) -> Value {
    let mut line = json!({ "event": event });
    extend(&mut line, fields);
    line
}

/// An event of the gateway: its name, its time and its fields, named as in PROTOCOL.md.
pub fn event(message: &EventMessage, motors: &Protocols) -> Value {
    let mut fields = match &message.event {
        Event::Tripped { axis, trip } => {
            json!({ "axis": axis, "trip": axis::trip(trip, motors.of(*axis)) })
        }
        Event::StateChanged { axis, state } => axis::in_state(*axis, *state),
        Event::AngleMismatch { axis, angle_rad, position_rad } => {
            json!({ "axis": axis, "angle_rad": angle_rad, "position_rad": position_rad })
        }
        Event::FrameRejected { reason, count } => {
            json!({ "reason": words::frame_error(*reason).map(snake), "count": count })
        }
        Event::MotorNotice { axis, data, length, unreported } => {
            let data = data.get(..usize::from(*length)).unwrap_or(data);
            json!({ "axis": axis, "data": words::hex(data), "unreported": unreported })
        }
        Event::Sample { axis, .. } => axis::sample(&message.event, motors.of(*axis)),
        // The others are as the wire has them.
        event => Value::Object(variant(event).1),
    };
    let common = json!({
        "event": snake(message.event.name()),
        "time_us": message.time_us, "dropped": message.dropped
    });
    extend(&mut fields, common);
    fields
}

/// A raw frame of a bus, and of which kind that is.
pub fn raw_frame(bus: u8, raw: &RawFrame) -> Value {
    json!({ "bus": bus, "kind": kind(raw), "frame": frame(raw) })
}

/// What carries a raw frame.
pub fn kind(raw: &RawFrame) -> &'static str {
    match raw {
        RawFrame::Can(_) => "can",
        RawFrame::Serial(_) => "serial",
    }
}

/// A raw frame as `mgw decode` reads it: `141#9A00000000000000`, or the bytes of a serial line.
pub fn frame(frame: &RawFrame) -> String {
    let RawFrame::Can(frame) = frame else {
        let RawFrame::Serial(bytes) = frame else { return String::new() };
        return words::hex(bytes);
    };
    let id = match frame.id() {
        Id::Standard(id) => format!("{:03X}", id.as_raw()),
        Id::Extended(id) => format!("{:08X}", id.as_raw()),
    };
    if frame.is_remote_frame() {
        return format!("{id}#R{}", frame.dlc());
    }
    format!("{id}#{}", words::hex(frame.data()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::requests as ask;
    use host_protocol::{CanFrame, Request, Setpoint, StopTarget};

    #[test]
    fn variants_are_in_snake_case_and_fields_as_they_are() {
        let stop = Request::Stop(ask::Stop { target: StopTarget::All });
        assert_eq!(to_json(&stop).to_string(), r#"{"stop":{"target":"all"}}"#);
        let setpoint = Setpoint::Velocity { velocity_rad_s: 0.1 };
        assert_eq!(to_json(&setpoint).to_string(), r#"{"velocity":{"velocity_rad_s":0.1}}"#);
    }

    #[test]
    fn an_event_carries_its_name_and_fields() {
        let message = EventMessage {
            dropped: 0,
            time_us: 7,
            event: Event::AxisUnreachable { axis: 3, stop_transmitted: true },
        };
        assert_eq!(
            event(&message, &Protocols::default()).to_string(),
            concat!(
                r#"{"axis":3,"dropped":0,"event":"axis_unreachable","#,
                r#""stop_transmitted":true,"time_us":7}"#
            )
        );
    }

    #[test]
    fn a_name_is_cut_at_its_capitals() {
        for (pascal, cut) in
            [("EStop", "e_stop"), ("Rs485", "rs485"), ("NotACommand", "not_a_command"), ("", "")]
        {
            assert_eq!(snake(pascal), cut);
        }
    }

    #[test]
    fn a_frame_is_written_as_it_is_read() {
        let can = |frame| super::frame(&RawFrame::Can(frame));
        assert_eq!(can(CanFrame::standard(0x141, &[0x9A, 0]).unwrap()), "141#9A00");
        assert_eq!(can(CanFrame::extended(0x141, &[]).unwrap()), "00000141#");
    }
}
