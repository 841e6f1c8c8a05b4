extern crate std;

use std::collections::BTreeSet;
use std::string::String;
use std::vec::Vec;

use codec::{BuildError, FieldValue};

use super::*;
use crate::{MotionRanges, Span};

fn none(_: &str) -> Option<f64> {
    None
}

/// Every value at the lower, then at the upper end of its range.
fn ends(info: &CommandInfo) -> [Request; 2] {
    let build = |end: fn(&FieldInfo) -> f64| {
        let value = |name: &str| info.request.iter().find(|field| field.name == name).map(end);
        Request::build(info.name, &value).expect(info.name)
    };
    [build(|field| field.min), build(|field| field.max)]
}

#[test]
fn names_are_unique_and_in_snake_case() {
    let names: BTreeSet<_> = COMMANDS.iter().map(|info| info.name).collect();
    assert_eq!(names.len(), COMMANDS.len());
    let fields = COMMANDS.iter().flat_map(|info| info.request.iter().chain(info.reply));
    for name in names.into_iter().chain(fields.map(|field| field.name)) {
        let is_snake =
            |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
        assert!(name.bytes().all(is_snake), "{name}");
    }
}

/// The 33 commands of RMD V3.6 §2, where 0x20 has four functions; two id commands for each bus;
/// motion mode; and the notice.
#[test]
fn every_command_of_the_manual_is_listed() {
    let codes: BTreeSet<_> = COMMANDS.iter().map(|info| info.code).collect();
    let expected = [
        0x00, 0x20, 0x30, 0x31, 0x32, 0x42, 0x43, 0x60, 0x61, 0x62, 0x63, 0x64, 0x70, 0x71, 0x76,
        0x77, 0x78, 0x79, 0x80, 0x81, 0x92, 0x9A, 0x9C, 0x9D, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA8,
        0xB1, 0xB2, 0xB3, 0xB4, 0xB5, 0xF1,
    ];
    assert_eq!(codes, BTreeSet::from(expected));
    assert_eq!(COMMANDS.len(), 33 + 3 + 4 + 1 + 1);
}

#[test]
fn every_command_but_the_notice_can_be_built_and_shows_its_fields() {
    for info in COMMANDS.iter().filter(|info| info.name != TIMEOUT_NOTICE.name) {
        for request in ends(info) {
            assert_eq!(request.info(), Some(info));
            assert_eq!(u16::from(request.command()), info.code);
            let mut shown = Vec::new();
            request.visit_fields(&mut |name, _| shown.push(name));
            shown.retain(|name| !name.ends_with("_name"));
            assert!(
                shown.iter().copied().eq(info.request.iter().map(|field| field.name)),
                "{shown:?}"
            );
        }
    }
    assert_eq!(Request::build(TIMEOUT_NOTICE.name, &none), Err(BuildError::UnknownCommand));
    assert_eq!(Request::build("no_such_command", &none), Err(BuildError::UnknownCommand));
}

/// The ends of RMD V3.6 §2.17, §2.20 and §2.21 in their units.
#[test]
fn ranges_are_in_the_units_of_the_names() {
    let range = |name: &str, field: &str| {
        let info = COMMANDS.iter().find(|info| info.name == name).expect(name);
        let mut fields = info.request.iter().chain(info.reply);
        let field = fields.find(|info| info.name == field).expect(field);
        (field.min, field.max, field.lsb())
    };
    assert_eq!(range("torque_current", "current_a"), (-327.68, 327.67, 0.01));
    assert_eq!(range("absolute_position", "max_speed_dps"), (0.0, 65535.0, 1.0));
    assert_eq!(range("limited_position_tracking", "max_speed_dps"), (0.0, 655.35, 0.01));
    assert_eq!(range("absolute_position", "angle_deg"), (-21_474_836.48, 21_474_836.47, 0.01));
    assert_eq!(range("read_status_1", "voltage_v"), (0.0, 6553.5, 0.1));
    assert_eq!(range("write_acceleration", "acceleration_dps2"), (100.0, 60_000.0, 1.0));
    assert_eq!(range("motion_mode", "position_rad"), (-12.5, 12.5, 25.0 / 65536.0));
    assert_eq!(range("motion_mode", "torque_nm"), (-24.0, 24.0, 48.0 / 4096.0));
}

#[test]
fn values_are_rounded_to_the_wire_and_refused_by_name() {
    let current = |value: f64| Request::build("torque_current", &|_| Some(value));
    assert_eq!(current(0.014), Ok(Request::TorqueCurrent { current: Centiamps(1) }));
    assert_eq!(current(-0.016), Ok(Request::TorqueCurrent { current: Centiamps(-2) }));
    assert_eq!(current(327.67), Ok(Request::TorqueCurrent { current: Centiamps(i16::MAX) }));
    for value in [327.68, -327.69, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            current(value),
            Err(BuildError::OutOfRange { field: "current_a", min: -327.68, max: 327.67, .. })
        ));
    }
    assert_eq!(
        Request::build("set_baud_rate", &|_| Some(1.5)),
        Err(BuildError::NotAnInteger { field: "baud_code", value: 1.5 })
    );
    assert_eq!(
        Request::build("set_can_id", &|_| Some(33.0)),
        Err(BuildError::OutOfRange { field: "id", value: 33.0, min: 1.0, max: 32.0 })
    );
    assert_eq!(
        Request::build("absolute_position", &|name| (name == "max_speed_dps").then_some(500.0)),
        Err(BuildError::MissingField { field: "angle_deg" })
    );
}

/// RMD V3.6 §2.20.4 example 1.
#[test]
fn a_request_by_its_name() {
    let fields = |name: &str| match name {
        "max_speed_dps" => Some(500.0),
        "angle_deg" => Some(360.0),
        _ => None,
    };
    let request = Request::build("absolute_position", &fields);
    assert_eq!(
        request.map(|request| request.encode()),
        Ok(Ok([0xA4, 0x00, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00]))
    );
    assert!(matches!(request, Ok(Request::AbsolutePosition { max_speed: SpeedLimit(500), .. })));
}

/// RMD V3.6 §5.4, and a motor with a wider torque range.
#[test]
fn motion_mode_in_other_ranges() {
    let fields = |name: &str| match name {
        "position_rad" | "kp" => Some(10.0),
        "velocity_rad_s" | "kd" => Some(1.0),
        "torque_nm" => Some(100.0),
        _ => None,
    };
    assert_eq!(
        Request::build("motion_mode", &fields),
        Err(BuildError::OutOfRange { field: "torque_nm", value: 100.0, min: -24.0, max: 24.0 })
    );
    let ranges = MotionRanges { torque_nm: Span::new(-240.0, 240.0), ..MotionRanges::DEFAULT };
    let request = Request::build_in(&ranges, "motion_mode", &fields).expect("in range");
    assert_eq!(request.encode(), Ok([0xE6, 0x66, 0x82, 0xE0, 0x52, 0x33, 0x3B, 0x55]));
    request.visit_fields_in(&ranges, &mut |name, value| {
        if let ("torque_nm", FieldValue::Physical(value)) = (name, value) {
            assert!((value - 100.04).abs() < 0.01);
        }
    });
}

/// A field's value as text.
fn text(value: FieldValue<'_>) -> String {
    match value {
        FieldValue::Integer(value) => std::format!("{value}"),
        FieldValue::Physical(value) => std::format!("{value}"),
        FieldValue::Bool(value) => std::format!("{value}"),
        FieldValue::Flags { raw, names } => {
            let mut text = std::format!("{raw:#06x}");
            names(raw, &mut |name| {
                text.push(' ');
                text.push_str(name);
            });
            text
        }
        FieldValue::Text(text) => text.into(),
        FieldValue::Bytes(bytes) => std::format!("{bytes:02X?}"),
    }
}

#[track_caller]
fn shows<const N: usize>(data: [u8; 8], name: &str, expected: [(&str, &str); N]) {
    let reply = Reply::decode_full(&data);
    assert_eq!(reply.name(), name);
    let mut shown = Vec::new();
    reply.visit_fields(&mut |name, value| shown.push((name, text(value))));
    assert!(
        shown.iter().map(|(name, value)| (*name, value.as_str())).eq(expected),
        "{shown:?} instead of {expected:?}"
    );
    if let Some(info) = reply.info() {
        assert!(shown.iter().map(|(name, _)| *name).eq(info.reply.iter().map(|field| field.name)));
    }
}

/// Values as RMD V3.6 §2.12.4, §2.14.4, §2.17.4, §2.23.4, §2.24.4 and §2.32.4 explain them.
#[test]
fn replies_show_their_fields() {
    shows(
        [0x9A, 0x32, 0x00, 0x01, 0xE5, 0x01, 0x04, 0x80],
        "read_status_1",
        [
            ("temperature_c", "50"),
            ("brake_released", "true"),
            ("voltage_v", "48.5"),
            ("faults", "0x8004 under_voltage"),
        ],
    );
    shows(
        [0x9D, 0x32, 0xC2, 0x0B, 0x10, 0xFA, 0xC0, 0xF9],
        "read_status_3",
        [
            ("temperature_c", "50"),
            ("phase_a_current_a", "30.1"),
            ("phase_b_current_a", "-15.2"),
            ("phase_c_current_a", "-16"),
        ],
    );
    shows(
        [0xA1, 0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF],
        "torque_current",
        [("temperature_c", "50"), ("current_a", "-1"), ("speed_dps", "-500"), ("angle_deg", "-45")],
    );
    shows(
        [0x70, 0, 0, 0, 0, 0, 0, 0x03],
        "read_run_mode",
        [("run_mode", "3"), ("run_mode_name", "position")],
    );
    shows([0x71, 0, 0, 0, 0, 0, 0xD0, 0x07], "read_power", [("power_w", "200")]);
    shows([0xB5, 0x58, 0x38, 0x53, 0x32, 0x56, 0x31, 0x30], "read_model", [("model", "X8S2V10")]);
    shows([0x77, 1, 2, 3, 4, 5, 6, 7], "release_brake", []);
    shows([0x90, 1, 2, 3, 4, 5, 6, 7], "unknown", [("data", "[90, 01, 02, 03, 04, 05, 06, 07]")]);
}
