//! JSON of what has no other: events, frames, and sets of protocols by name.

use embedded_can::{Frame, Id};
use host_protocol::{Event, EventMessage, Protocol, ProtocolSet, RawFrame};
use serde_json::{Value, json};

use crate::output::to_json;
use crate::words;

/// The names of a set.
pub fn protocols(set: ProtocolSet) -> Value {
    set.iter().map(Protocol::name).collect()
}

/// An event: its name, its time and its fields, named as in PROTOCOL.md.
pub fn event(message: &EventMessage) -> Value {
    let mut fields = match &message.event {
        Event::Tripped { axis, trip } => json!({ "axis": axis, "trip": to_json(trip) }),
        Event::StopConfirmed { axis, reaction_us, elapsed_us, standstill } => {
            json!({
                "axis": axis, "reaction_us": reaction_us,
                "elapsed_us": elapsed_us, "standstill": standstill
            })
        }
        Event::StateChanged { axis, state } => json!({ "axis": axis, "state": to_json(state) }),
        Event::AuthorityLost { reason } => json!({ "reason": to_json(reason) }),
        Event::EStopLatched {} | Event::EStopCleared {} => json!({}),
        Event::EStopInputChanged { open } => json!({ "open": open }),
        Event::EnableOutputChanged { active } => json!({ "active": active }),
        Event::StopDelayed { bus, axis, waiting_us } => {
            json!({ "bus": bus, "axis": axis, "waiting_us": waiting_us })
        }
        Event::BrakeUnverified { axis, locked } => json!({ "axis": axis, "locked": locked }),
        Event::FrameRejected { reason, count } => json!({ "reason": reason, "count": count }),
        Event::BusStateChanged { bus, state } => json!({ "bus": bus, "state": to_json(state) }),
        Event::MotorNotice { axis, data, length, unreported } => {
            let data = data.get(..usize::from(*length)).unwrap_or(data);
            json!({ "axis": axis, "data": words::hex(data), "unreported": unreported })
        }
        Event::AxisUnreachable { axis, stop_transmitted } => {
            json!({ "axis": axis, "stop_transmitted": stop_transmitted })
        }
        Event::RequestDropped { count } => json!({ "count": count }),
        Event::Sample {
            axis,
            state,
            position_rad,
            velocity_rad_s,
            current_a,
            voltage_v,
            motor_temperature_c,
            driver_temperature_c,
            faults,
        } => json!({
            "axis": axis,
            "state": to_json(state),
            "position_rad": to_json(position_rad),
            "velocity_rad_s": to_json(velocity_rad_s),
            "current_a": to_json(current_a),
            "voltage_v": to_json(voltage_v),
            "motor_temperature_c": to_json(motor_temperature_c),
            "driver_temperature_c": to_json(driver_temperature_c),
            "faults": to_json(faults),
        }),
        Event::Unknown { number } => json!({ "number": number }),
    };
    if let Some(fields) = fields.as_object_mut() {
        fields.insert("event".to_owned(), json!(message.event.name()));
        fields.insert("time_us".to_owned(), json!(message.time_us));
        fields.insert("dropped".to_owned(), json!(message.dropped));
    }
    fields
}

/// A raw frame.
pub fn frame(frame: &RawFrame) -> Value {
    match frame {
        RawFrame::Can(frame) => {
            let (id, extended) = match frame.id() {
                Id::Standard(id) => (u32::from(id.as_raw()), false),
                Id::Extended(id) => (id.as_raw(), true),
            };
            json!({
                "id": id, "extended": extended,
                "remote": frame.is_remote_frame(), "data": words::hex(frame.data())
            })
        }
        RawFrame::Serial(bytes) => json!({ "data": words::hex(bytes) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::CanFrame;

    #[test]
    fn an_event_carries_its_name_and_fields() {
        let message = EventMessage {
            dropped: 0,
            time_us: 7,
            event: Event::AxisUnreachable { axis: 3, stop_transmitted: true },
        };
        assert_eq!(
            event(&message).to_string(),
            concat!(
                r#"{"axis":3,"dropped":0,"event":"AxisUnreachable","#,
                r#""stop_transmitted":true,"time_us":7}"#
            )
        );
    }

    #[test]
    fn a_can_frame_has_its_id_as_a_number_and_its_data_in_hexadecimal() {
        let can = RawFrame::Can(CanFrame::standard(0x141, &[0x9A, 0]).unwrap());
        assert_eq!(
            frame(&can).to_string(),
            r#"{"data":"9A00","extended":false,"id":321,"remote":false}"#
        );
    }
}
