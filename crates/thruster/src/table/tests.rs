//! The table against the codec.

use codec::{BuildError, FieldKind, FieldValue};

use super::*;
use crate::{Reply, Request};

const RAW: &[(&str, f64)] = &[
    ("signal_percent", -5.0),
    ("speed_rpm", 300.0),
    ("id", 127.0),
    ("bitrate_kbps", 83.0),
    ("timeout_ms", 5000.0),
    ("flags", 2.0),
    ("frames", 7.0),
    ("interval_ms", 250.0),
    ("parameter", 19713.0),
    ("value", 4_294_967_295.0),
    ("angle_deg", -90.04),
    ("reverse_deg", -90.0),
    ("forward_deg", 45.5),
];

fn given(name: &str) -> Option<f64> {
    RAW.iter().find(|(field, _)| *field == name).map(|(_, value)| *value)
}

#[track_caller]
fn built(name: &str, bytes: &[u8]) {
    let request = Request::build(name, &given).unwrap();
    assert_eq!(request.encode().unwrap().as_slice(), bytes, "{name}");
}

/// Thruster manual §2 and §4: one command with each field.
#[test]
fn commands_are_built_from_fields() {
    built("signal", &[0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0xFF, 0xFB]);
    built("speed", &[0x56, 0x43, 0x00, 0x00, 0x00, 0x00, 0x01, 0x2C]);
    built("set_id", &[0x43, 0x49, 0x00, 0x00, 0x00, 0x00, 0x00, 0x7F]);
    built("set_bitrate", &[0x43, 0x42, 0x00, 0x00, 0x00, 0x00, 0x00, 0x53]);
    built("set_timeout", &[0x53, 0x54, 0x00, 0x00, 0x00, 0x00, 0x13, 0x88]);
    built("configure_return", &[0x56, 0x4D, 0x00, 0x00, 0x00, 0x00, 0x02, 0x07]);
    built("configure_stream", &[0x53, 0x52, 0x00, 0x00, 0x00, 0x07, 0x00, 0xFA]);
    built("set_parameter", &[0x53, 0x50, 0x4D, 0x01, 0xFF, 0xFF, 0xFF, 0xFF]);
    built("read_parameter", &[0x52, 0x50, 0x4D, 0x01]);
    // −90.04° lies between two counts; the nearer one is sent.
    built("absolute_position", &[0x4C, 0x41, 0x01, 0x2C, 0xFF, 0xFF, 0xFC, 0x7C]);
    built("set_position_limits", &[0x53, 0x50, 0x4C, 0x41, 0xFC, 0x7C, 0x01, 0xC7]);
    built("read_position_limits", &[0x52, 0x50, 0x4C, 0x41]);
    built("relative_position", &[0x4C, 0x52, 0x01, 0x2C, 0xFF, 0xFF, 0xFC, 0x7C]);
    built("read_speed", &[0x51, 0x56, 0x00, 0x00]);
    built("emergency_stop", &[0x4C, 0x53, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00]);
}

/// What a request hands on builds the same request again, and is what its row lists.
#[test]
fn every_row_is_built_and_visited_alike() {
    for info in COMMANDS {
        let request = match Request::build(info.name, &given) {
            Ok(request) => request,
            Err(BuildError::UnknownCommand) => {
                assert!(info.note.contains("never sent"), "{}", info.name);
                continue;
            }
            Err(error) => panic!("{}: {error}", info.name),
        };
        assert_eq!((request.name(), request.command()), (info.name, info.code));
        let mut fields = info.request.iter();
        request.visit_fields(&mut |name, value| {
            let field =
                fields.next().unwrap_or_else(|| panic!("{}: {name} is not listed", info.name));
            assert_eq!(field.name, name, "{}", info.name);
            let (number, kind) = match value {
                FieldValue::Integer(value) => (value as f64, FieldKind::Integer),
                FieldValue::Physical(value) => (value, FieldKind::Physical),
                FieldValue::Flags { raw, .. } => (f64::from(raw), FieldKind::Flags),
                _ => panic!("{}: {name} cannot be built", info.name),
            };
            assert_eq!(field.kind, kind, "{}: {name}", info.name);
            assert!(
                (number - given(name).unwrap()).abs() <= field.lsb() / 2.0,
                "{}: {name} {number}",
                info.name
            );
        });
        assert!(fields.next().is_none(), "{}: a listed field is missing", info.name);
    }
}

#[test]
fn names_are_unique() {
    for (count, info) in COMMANDS.iter().enumerate() {
        assert!(
            COMMANDS.iter().skip(count + 1).all(|other| other.name != info.name),
            "{}",
            info.name
        );
    }
}

/// Thruster manual §2.1, §2.2, §4.1: refused by name, with the range.
#[test]
fn bad_values_are_refused_by_name() {
    let with = |name: &str, value: f64| Request::build(name, &|_| Some(value));
    let refused =
        BuildError::OutOfRange { field: "signal_percent", value: 101.0, min: -100.0, max: 100.0 };
    assert_eq!(with("signal", 101.0), Err(refused));
    assert!(matches!(
        with("signal", f64::NAN),
        Err(BuildError::OutOfRange { field: "signal_percent", .. })
    ));
    assert_eq!(with("set_id", 1.5), Err(BuildError::NotAnInteger { field: "id", value: 1.5 }));
    assert!(matches!(with("speed", 29.0), Err(BuildError::Encode(_))));
    assert!(matches!(with("set_bitrate", 84.0), Err(BuildError::Encode(_))));
    assert_eq!(with("warp", 9.0), Err(BuildError::UnknownCommand));
    assert_eq!(with("stream_1", 0.0), Err(BuildError::UnknownCommand));
    assert_eq!(
        Request::build("signal", &|_| None),
        Err(BuildError::MissingField { field: "signal_percent" })
    );
}

#[track_caller]
fn shown(bytes: [u8; 8], name: &str, expected: &[(&str, &str)]) {
    let reply = Reply::decode(&bytes).unwrap();
    assert_eq!(reply.name(), name);
    let mut expected = expected.iter();
    reply.visit_fields(&mut |name, value| {
        let (field, text) = expected.next().unwrap_or_else(|| panic!("{name} is not expected"));
        let mut names = [""; 3];
        let shown = match value {
            FieldValue::Integer(number) => Ok(number as f64),
            FieldValue::Physical(number) => Ok(number),
            FieldValue::Bool(flag) => Ok(f64::from(u8::from(flag))),
            FieldValue::Flags { raw, names: of } => {
                let mut places = names.iter_mut();
                of(raw, &mut |name| *places.next().unwrap() = name);
                Err(names)
            }
            _ => panic!("{name}"),
        };
        assert_eq!(name, *field);
        match shown {
            Ok(number) => assert_eq!(text.parse(), Ok(number), "{name}"),
            Err(names) => {
                assert!(names.iter().copied().filter(|name| !name.is_empty()).eq(text.split(' ')))
            }
        }
    });
    assert!(expected.next().is_none());
}

/// Thruster manual §1.3, §2.1, §2.4, §2.6, §4.1: values in the units of their names.
#[test]
fn replies_are_shown_in_units() {
    shown([0x51, 0x56, 0, 0, 0, 0, 0xFA, 0x24], "read_speed", &[("speed_rpm", "-1500")]);
    shown([0x51, 0x43, 0, 0, 0, 0, 0x00, 0x7B], "read_current", &[("current_a", "12.3")]);
    shown([0x51, 0x50, 0, 0, 0, 0, 0x01, 0xE1], "read_voltage", &[("voltage_v", "48.1")]);
    shown(
        [0x51, 0x54, 0, 0, 0, 0, 0x00, 0x37],
        "read_motor_temperature",
        &[("temperature_c", "55")],
    );
    shown(
        [0x46, 0x52, 0, 0, 0, 0, 0x40, 0x12],
        "read_fault_record",
        &[("faults", "ee_data under_voltage")],
    );
    shown([0x54, 0x43, 0, 0, 0, 0, 0xEE, 0xEE], "signal", &[("refused", "1")]);
    shown(
        [0x4C, 0x41, 0x01, 0x2C, 0, 0, 0xEE, 0xEE],
        "absolute_position",
        &[("refused", "1"), ("speed_rpm", "300")],
    );
    shown([0x53, 0x50, 0x4C, 0x41, 0, 0, 0xEE, 0xEE], "set_position_limits", &[("refused", "1")]);
    shown(
        [0x56, 0x01, 0xFA, 0x24, 0x00, 0xF0, 0xFF, 0xF6],
        "speed_return_1",
        &[("speed_rpm", "-1500"), ("voltage_v", "24"), ("current_a", "-1")],
    );
    shown(
        [0x41, 0x02, 0x00, 0x40, 0xFF, 0xFB, 0x00, 0x28],
        "stream_2",
        &[("faults", "stall"), ("motor_temperature_c", "-5"), ("driver_temperature_c", "40")],
    );
}
