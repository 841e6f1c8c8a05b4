//! The gateway: what it is, its buses, what it remembers.

use host_protocol::replies::{BusReport, GatewayReport, HelloReply, ImageReport, StoredReport};
use host_protocol::{BusConfig, ImageState, Incident, StoredState};
use serde_json::{Value, json};

use super::{axis, extend, name, protocols};
use crate::faults::Protocols;
use crate::output::to_json;

/// What it is, and how.
pub fn info(
    hello: &HelloReply,
    status: &GatewayReport,
    stored: &StoredReport,
    image: &ImageReport,
) -> Value {
    let buses = hello.buses.iter().map(|bus| {
        json!({
            "kind": name(&bus.kind),
            "bitrates_bit_s": to_json(&bus.bitrates),
            "protocols": protocols(bus.protocols),
        })
    });
    let mut value = to_json(hello);
    value["boot"] = json!(name(&hello.boot));
    value["buses"] = buses.collect();
    value["status"] = to_json(status);
    value["status"]["bus_limit"] = json!(status.bus_limit.as_ref().map(name));
    value["stored"] = stored_state(stored);
    let left_ms = match image.state {
        ImageState::OnTrial { left_ms } => Some(left_ms),
        ImageState::Kept | ImageState::RolledBack => None,
    };
    value["image"] = json!({
        "version": image.version.to_string(), "room_bytes": image.room,
        "needs_signature": image.needs_signature, "state": name(&image.state), "left_ms": left_ms,
    });
    if let Some(fields) = value.as_object_mut()
        && let Some(longest) = fields.remove("max_message")
    {
        fields.insert("max_message_bytes".to_owned(), longest);
    }
    value
}

/// What is stored of the configuration.
fn stored_state(stored: &StoredReport) -> Value {
    let (differs, layout, error) = match stored.state {
        StoredState::Kept { differs } => (Some(differs), None, None),
        StoredState::OtherLayout { layout } => (None, Some(layout), None),
        StoredState::Refused { error } => (None, None, Some(error)),
        _ => (None, None, None),
    };
    json!({
        "state": name(&stored.state), "differs": differs, "layout": layout, "error_number": error,
        "saving": stored.saving,
    })
}

/// How a bus is configured.
pub fn bus_config(config: &BusConfig) -> Value {
    json!({
        "bitrate_bit_s": config.bitrate, "protocols": protocols(config.protocols),
        "exclusive": config.exclusive, "reply_window_us": config.reply_window_us,
    })
}

/// How a bus is.
pub fn bus(bus: u8, report: &BusReport) -> Value {
    let config = report.config.as_ref().map(bus_config);
    let mut value = to_json(report);
    let own = json!({ "bus": bus, "state": name(&report.state), "config": config });
    extend(&mut value, own);
    value
}

/// Something worth remembering.
pub fn incident(incident: &Incident, motors: &Protocols) -> Value {
    match incident {
        Incident::Started { start, boot, has_crash_report } => json!({
            "incident": "started", "start": start, "boot": name(boot),
            "has_crash_report": has_crash_report,
        }),
        Incident::Tripped { start, axis: of, trip } => json!({
            "incident": "tripped", "start": start, "axis": of,
            "trip": axis::trip(trip, motors.of(*of)),
        }),
    }
}
