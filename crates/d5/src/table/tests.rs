//! The table against the codec.

use codec::{BuildError, FieldValue, Visit};

use super::*;
use crate::{
    Address, Node, REGISTERS, Register, Reply, Request, Value, Width, decode_reply_frame,
    request_frame,
};

#[track_caller]
fn built(name: &str, fields: &[(&str, f64)], frame: [u8; 8]) {
    let request = Request::build(name, &|field| given(fields, field)).unwrap();
    assert_eq!(request_frame(Address::Node(Node::FACTORY), &request), Ok(frame));
}

fn given(fields: &[(&str, f64)], field: &str) -> Option<f64> {
    fields.iter().find(|(name, _)| *name == field).map(|(_, value)| *value)
}

/// D5 manual, table rows 2 and 6 to 14, common commands, rows 1 to 3.
#[test]
fn commands_are_built_from_fields() {
    built("query_id", &[], [0xD5, 0x0B, 0x05, 0x01, 0x00, 0x00, 0x00, 0x11]);
    built(
        "read",
        &[("register", 21.0), ("bytes", 2.0)],
        [0xD5, 0x0B, 0x05, 0x02, 0x15, 0x00, 0x00, 0x27],
    );
    built("read", &[("register", 21.0)], [0xD5, 0x0B, 0x04, 0x02, 0x15, 0x00, 0x00, 0x26]);
    built("read", &[("register", 40.0)], [0xD5, 0x0B, 0x05, 0x02, 0x28, 0x00, 0x00, 0x3A]);
    let speed = [("register", 32.0), ("speed_dps", 600.0)];
    built("write", &speed, [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D]);
    let clockwise = [("register", 32.0), ("value", -600.4)];
    built("write", &clockwise, [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x82, 0x0D]);
    let level = [("register", 16.0), ("ack_level", 1.0)];
    built("write", &level, [0xD5, 0x0B, 0x04, 0x03, 0x10, 0x01, 0x00, 0x23]);
    let id = [("register", 3.0), ("id", 13.0)];
    built("write", &id, [0xD5, 0x0B, 0x05, 0x03, 0x03, 0x0D, 0x00, 0x23]);
    let waiting = [("register", 32.0), ("speed_dps", 1035.0)];
    built("async_write", &waiting, [0xD5, 0x0B, 0x05, 0x04, 0x20, 0x0B, 0x04, 0x43]);
    built("execute", &[], [0xD5, 0x0B, 0x05, 0x05, 0x00, 0x00, 0x00, 0x15]);
    built("reset", &[], [0xD5, 0x0B, 0x05, 0x06, 0x00, 0x00, 0x00, 0x16]);
    built("read_magnetic_angle", &[], [0xD5, 0x0B, 0x05, 0xD4, 0x00, 0x00, 0x00, 0xE4]);
    built("self_test", &[], [0xD5, 0x0B, 0x05, 0xCF, 0x12, 0x34, 0x56, 0x7B]);
    built("faulty_self_test", &[], [0xD5, 0x0B, 0x05, 0xCE, 0x12, 0x34, 0x56, 0x7A]);
}

/// What a request hands on builds the same request again.
#[test]
fn every_command_is_visited_and_built_alike() {
    for info in COMMANDS {
        for register in REGISTERS.iter().map(|row| row.register) {
            let fields = |field: &str| match field {
                "register" => Some(f64::from(register.0)),
                "value" => Some(1.0_f64.max(f64::from(register.info().unwrap().min))),
                _ => None,
            };
            let request = match Request::build(info.name, &fields) {
                Ok(request) => request,
                Err(BuildError::Encode(_)) => continue,
                Err(error) => panic!("{}: {error}", info.name),
            };
            assert_eq!((request.name(), u16::from(request.command())), (info.name, info.code));
            let again = Request::build(info.name, &|field| {
                let mut found = None;
                request.visit_fields(&mut |name, value| {
                    if name == field {
                        found = match value {
                            FieldValue::Integer(number) => Some(number as f64),
                            FieldValue::Physical(number) => Some(number),
                            FieldValue::Flags { raw, .. } => Some(f64::from(raw)),
                            _ => None,
                        };
                    }
                });
                found
            });
            assert_eq!(again, Ok(request));
        }
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

/// D5 manual, register table: refused by name, with the range.
#[test]
fn bad_values_are_refused_by_name() {
    let write = |register: f64, value: f64| {
        Request::build("write", &|field| match field {
            "register" => Some(register),
            "value" => Some(value),
            _ => None,
        })
    };
    let refused = |field, value, min, max| Err(BuildError::OutOfRange { field, value, min, max });
    assert_eq!(write(32.0, 32_768.0), refused("value", 32_768.0, -32_767.0, 32_767.0));
    assert_eq!(write(21.0, 71.0), refused("value", 71.0, 72.0, 250.0));
    assert_eq!(write(256.0, 0.0), refused("register", 256.0, 0.0, 255.0));
    assert_eq!(write(16.0, 1.5), Err(BuildError::NotAnInteger { field: "value", value: 1.5 }));
    assert!(matches!(write(38.0, 1.0), Err(BuildError::Encode(_))), "read-only");
    assert!(matches!(write(6.0, 1.0), Err(BuildError::Encode(_))), "no function");
    assert_eq!(
        Request::build("write", &|_| None),
        Err(BuildError::MissingField { field: "register" })
    );
    let no_value = Request::build("write", &|field| (field == "register").then_some(32.0));
    assert_eq!(no_value, Err(BuildError::MissingField { field: "value" }));
    let no_width = Request::build("read", &|field| (field == "register").then_some(6.0));
    assert_eq!(no_width, Err(BuildError::MissingField { field: "bytes" }));
    assert_eq!(Request::build("warp", &|_| None), Err(BuildError::UnknownCommand));
}

#[track_caller]
fn shown(frame: [u8; 8], name: &str, expected: &[(&str, &str)]) {
    let (_, reply) = decode_reply_frame(&frame).unwrap();
    assert_eq!(reply.name(), name);
    fields(&|visit| reply.visit_fields(visit), expected);
}

#[track_caller]
fn fields(visit_fields: &dyn Fn(&mut Visit<'_>), expected: &[(&str, &str)]) {
    let mut expected = expected.iter();
    visit_fields(&mut |name, value| {
        let (field, text) = expected.next().unwrap_or_else(|| panic!("{name} is not expected"));
        assert_eq!(name, *field);
        match value {
            FieldValue::Integer(number) => assert_eq!(text.parse(), Ok(number), "{name}"),
            FieldValue::Physical(number) => assert_eq!(text.parse(), Ok(number), "{name}"),
            FieldValue::Text(shown) => assert_eq!(shown, *text),
            FieldValue::Flags { raw, names } => {
                let mut words = text.split(' ');
                names(raw, &mut |name| assert_eq!(Some(name), words.next()));
                assert_eq!(words.next(), None);
            }
            FieldValue::Bool(_) | FieldValue::Bytes(_) => panic!("{name}"),
        }
    });
    assert!(expected.next().is_none());
}

/// D5 manual, table rows 3, 7, 12 and 14, common commands, rows 1, 3 and 5, error states at 0x12.
#[test]
fn replies_are_shown_in_units() {
    let named = |register, name, value| [("register", register), ("register_name", name), value];
    shown(
        [0x5D, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x82, 0x0D],
        "write",
        &named("32", "speed", ("speed_dps", "-600")),
    );
    shown(
        [0x5D, 0x0B, 0x05, 0x02, 0x28, 0x83, 0xAB, 0x68],
        "read",
        &named("40", "travelled_angle", ("angle_deg", "-21629")),
    );
    shown(
        [0x5D, 0x0B, 0x04, 0x02, 0x12, 0x42, 0x00, 0x65],
        "read",
        &named("18", "status", ("faults", "over_current stall")),
    );
    shown(
        [0x5D, 0x0B, 0x04, 0x02, 0x2E, 0x85, 0x00, 0xC4],
        "read",
        &named("46", "board_temperature", ("board_temperature_c", "-5")),
    );
    shown(
        [0x5D, 0x0D, 0x05, 0x03, 0x03, 0x0D, 0x00, 0x25],
        "write",
        &named("3", "id", ("id", "13")),
    );
    let two = [
        ("register", "21"),
        ("register_name", "acceleration"),
        ("acceleration", "72"),
        ("deceleration", "72"),
    ];
    shown([0x5D, 0x0B, 0x05, 0x02, 0x15, 0x48, 0x48, 0xB7], "read", &two);
    let temperatures = [
        ("register", "46"),
        ("register_name", "board_temperature"),
        ("board_temperature_c", "-5"),
        ("motor_temperature_c", "30"),
    ];
    shown([0x5D, 0x0B, 0x05, 0x02, 0x2E, 0x85, 0x1E, 0xE3], "read", &temperatures);
    let half = [("register", "33"), ("value", "132")];
    shown([0x5D, 0x0B, 0x04, 0x05, 0x21, 0x84, 0x00, 0xB9], "execute", &half);
    shown(
        [0x5D, 0x0B, 0x05, 0xD4, 0x57, 0x61, 0x01, 0x9D],
        "read_magnetic_angle",
        &[("angle_deg", "353")],
    );
    let error = [("motor_error", "command"), ("command_code", "206")];
    shown([0x5D, 0x0B, 0x05, 0xCE, 0x03, 0xEE, 0xEE, 0xBD], "faulty_self_test", &error);
    let error = [("motor_error", "checksum"), ("command_code", "3")];
    shown([0x5D, 0x0B, 0x05, 0x03, 0x07, 0xEE, 0xEE, 0xF6], "write", &error);
}

/// A register without a name is shown by its address.
#[test]
fn unnamed_registers_are_shown_raw() {
    let read = Request::Read { register: Register(0x0C), width: Width::Byte };
    fields(&|visit| read.visit_fields(visit), &[("register", "12"), ("bytes", "1")]);
    let reply = Reply::Read { register: Register(0x0C), value: Value::Byte(0x14) };
    fields(&|visit| reply.visit_fields(visit), &[("register", "12"), ("value", "20")]);
}
