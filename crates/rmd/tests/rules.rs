//! What no line of a vector file can say.

use codec_testing::{CanFrame, check_deframer, check_names};
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use rmd::{
    BaudCode, COMMANDS, Dialect, EncodeError, FAULTS, FaultLevel, Faults, FieldValue,
    MotionCommand, MotionFeedback, MotionRanges, Node, RawNotice, Reply, Request, Span, can, rs485,
};

fn node(id: u8) -> Node {
    Node::new(id).expect("1..=32")
}

#[test]
fn the_names_of_the_table() {
    check_names(COMMANDS);
}

/// Proven frames, RMD V3.6 §2.13.4.
#[test]
fn the_deframer_finds_frames_whole_and_in_time() {
    let request = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    let reply = [0x3E, 0x01, 0x08, 0x9C, 0x19, 0x34, 0x12, 0x9C, 0xFF, 0x78, 0x56, 0x7A, 0xD8];
    check_deframer(rs485::Deframer::new, request, reply);
}

/// RMD V3.6 §1.1.2, §3, §5: 0x79 has ids of its own. Thrusters use 0x281 to 0x2FF and 0x301 to
/// 0x37F of the same bus.
#[test]
fn every_id_is_that_of_a_motor_or_refused() {
    for id in 0..0x800 {
        let id = StandardId::new(id).expect("11 bits");
        let frame = CanFrame::new(id, &[0x79, 0, 1, 0, 0, 0, 0x42, 0x02]).expect("8 bytes");
        let motor = |base: u16| {
            let node = u8::try_from(id.as_raw().checked_sub(base)?).ok()?;
            Some(Node::new(node).ok())?
        };
        let requested = motor(0x140).or(motor(0x400));
        assert_eq!(can::decode_request(&frame).ok().map(|(node, _)| node), requested);
        let for_all = [0x280, 0x300].contains(&id.as_raw());
        assert_eq!(can::decode_any_request(&frame).is_ok(), requested.is_some() || for_all);
        let replying = motor(0x240).or(motor(0x500));
        assert_eq!(can::node_of_reply_id(id.into()), replying);
        let named = if id.as_raw() == 0x300 { Some(node(2)) } else { replying };
        assert_eq!(can::decode_reply(&frame).ok().map(|(node, _)| node), named);
    }
    assert_eq!(can::node_of_reply_id(Id::Extended(ExtendedId::new(0x241).expect("29 bits"))), None);
    for id in [0, 33, 0xCD, 0xFF] {
        let refused =
            EncodeError::OutOfRange { field: "node", value: i64::from(id), min: 1, max: 32 };
        assert_eq!(Node::new(id), Err(refused));
    }
}

/// RMD V3.6 §4, §5 and §7: these have one bus, and motion mode one motor.
#[test]
fn what_is_for_the_other_bus_is_refused() {
    let feedback = MotionFeedback { id: 1, position: 0, velocity: 0, torque: 0 };
    let motion = Request::MotionMode { command: MotionCommand::NEUTRAL };
    for (refused, reason) in [
        (can::broadcast::<CanFrame>(&motion).err(), "motion mode addresses one motor"),
        (
            can::broadcast::<CanFrame>(&Request::SetRs485Id { id: 2 }).err(),
            "this command is for RS485",
        ),
        (
            can::reply::<CanFrame>(node(1), &Reply::Rs485Id { id: node(1) }).err(),
            "this command is for RS485",
        ),
        (rs485::broadcast(&motion).err(), "this command is for CAN"),
        (rs485::broadcast(&Request::ReadCanId).err(), "this command is for CAN"),
        (rs485::reply(node(1), &Reply::MotionMode { feedback }).err(), "this command is for CAN"),
        (rs485::reply(node(1), &Reply::CanIdSet { id: node(1) }).err(), "this command is for CAN"),
    ] {
        assert!(
            matches!(refused, Some(EncodeError::Forbidden { field: "command", reason: given, .. })
                if given == reason),
            "{refused:?}"
        );
    }
}

/// RMD V3.6 §4.3, §7.3: the new id is confirmed from the new id.
#[test]
fn who_answers_an_id_command() {
    for (request, from) in [
        (Request::SetCanId { id: 2 }, Some(node(2))),
        (Request::SetRs485Id { id: 2 }, Some(node(2))),
        (Request::SetCanId { id: 33 }, None),
        (Request::ReadCanId, None),
        (Request::ReadRs485Id, None),
    ] {
        assert_eq!(request.answering_node(node(1)), from, "{request:?}");
    }
}

/// The codes of requests that only read, that act after a restart (RMD V3.6 §2.9, §2.10, §2.33.4)
/// and that nothing answers (§2.25.3, §2.31.3).
#[test]
fn what_requests_do() {
    let codes = |of: fn(&Request) -> bool| -> Vec<u8> {
        let request = |code: &u8| Request::decode(&[*code, 1, 0, 0, 0, 0, 0, 0]);
        (0..=u8::MAX).filter(|code| of(&request(code))).collect()
    };
    let reads =
        [0x30, 0x42, 0x60, 0x61, 0x62, 0x70, 0x71, 0x92, 0x9A, 0x9C, 0x9D, 0xB1, 0xB2, 0xB5];
    assert_eq!(codes(Request::only_reads), reads);
    assert_eq!(codes(Request::acts_after_restart), [0x20, 0x63, 0x64]);
    assert_eq!(codes(|request| !request.is_answered()), [0x76, 0xB4]);
}

/// RMD V3.6 §8.2: the level 1 rows that have a bit, and the encoder's data (V4.4).
#[test]
fn what_stays_until_a_restart() {
    let level_1 = FAULTS.iter().filter(|info| info.level == FaultLevel::UntilRestart);
    assert!(level_1.map(|info| info.fault).eq(Faults::UNTIL_RESTART.iter()));
    assert_eq!(Faults::UNTIL_RESTART.bits(), 0x4092);
    assert_eq!(Faults::from_bits_retain(0x0104).level(), Some(FaultLevel::Recovers));
    assert_eq!(Faults::from_bits_retain(0x0106).level(), Some(FaultLevel::UntilRestart));
    assert_eq!(Faults::from_bits_retain(0x8000).level(), None);
}

/// RMD V3.6 §2.31.1; V3.8, V3.9 and V4.4 0xB4: the codes of CAN are swapped, so that a motor would
/// be gone after the next power-on.
#[test]
fn rates_of_both_buses() {
    let of = |dialect, rate: fn(BaudCode, Dialect) -> Option<u32>| {
        [0, 1, 2, 3, 4, 5].map(|code| rate(BaudCode(code), dialect).unwrap_or(0))
    };
    let thousands = |rates: [u32; 6]| rates.map(|rate| rate * 1_000);
    for (dialect, rs485, can) in [
        (Dialect::Unknown, [0; 6], [0; 6]),
        (Dialect::V3_6, [115, 500, 1_000, 1_500, 2_000, 0], [500, 1_000, 0, 0, 0, 0]),
        (Dialect::V3_7, [115, 500, 1_000, 1_500, 0, 0], [500, 1_000, 0, 0, 0, 0]),
        (Dialect::V3_9, [115, 500, 1_000, 1_500, 2_500, 0], [500, 1_000, 0, 0, 0, 0]),
        (Dialect::V4_3, [115, 500, 1_000, 1_500, 2_500, 0], [500, 1_000, 0, 0, 0, 0]),
        (Dialect::V4_4, [115, 0, 0, 0, 0, 0], [1_000, 500, 250, 0, 0, 0]),
    ] {
        let kilo = of(dialect, BaudCode::rs485).map(|rate| rate / 1_000 * 1_000);
        assert_eq!(kilo, thousands(rs485), "{dialect:?}");
        assert_eq!(of(dialect, BaudCode::can), thousands(can), "{dialect:?}");
    }
    assert_eq!(BaudCode(0).rs485(Dialect::V3_6), Some(115_200));
    assert_eq!(BaudCode::for_rs485(Dialect::V3_6, 2_000_000), Some(BaudCode(4)));
    assert_eq!(BaudCode::for_rs485(Dialect::V4_2, 2_000_000), None);
    for (dialect, code) in
        [(Dialect::V3_6, Some(1)), (Dialect::V4_4, Some(0)), (Dialect::Unknown, None)]
    {
        assert_eq!(BaudCode::for_can(dialect, 1_000_000), code.map(BaudCode));
    }
    assert_eq!(BaudCode::for_can(Dialect::V3_6, 115_200), None);
}

/// Words of 12 bits, and a notice of more bytes than a frame holds.
#[test]
fn values_wider_than_their_bytes_are_refused() {
    let wide = MotionCommand { velocity: 0x1000, ..MotionCommand::NEUTRAL };
    let refused = |field| Err(EncodeError::OutOfRange { field, value: 0x1000, min: 0, max: 0xFFF });
    for (command, field) in [
        (wide, "velocity"),
        (MotionCommand { kp: 0x1000, ..MotionCommand::NEUTRAL }, "kp"),
        (MotionCommand { kd: 0x1000, ..MotionCommand::NEUTRAL }, "kd"),
        (MotionCommand { torque: 0x1000, ..MotionCommand::NEUTRAL }, "torque"),
    ] {
        assert_eq!(Request::MotionMode { command }.encode(), refused(field));
    }
    for (velocity, torque, field) in [(0x1000, 0, "velocity"), (0, 0x1000, "torque")] {
        let feedback = MotionFeedback { id: 1, position: 0, velocity, torque };
        assert_eq!(Reply::MotionMode { feedback }.encode(), refused(field));
    }
    let refused = EncodeError::OutOfRange { field: "notice length", value: 8, min: 0, max: 7 };
    assert_eq!(RawNotice::new(&[0; 8]), Err(refused));
}

/// The words of RMD V3.6 §5.4 on a motor with a wider torque range.
#[test]
fn motion_mode_in_other_ranges() {
    let fields = |name: &str| match name {
        "position_rad" | "kp" => Some(10.0),
        "velocity_rad_s" | "kd" => Some(1.0),
        "torque_nm" => Some(100.0),
        _ => None,
    };
    assert!(Request::build("motion_mode", &fields).is_err());
    let ranges = MotionRanges { torque_nm: Span::new(-240.0, 240.0), ..MotionRanges::DEFAULT };
    let request = Request::build_in(&ranges, "motion_mode", &fields).expect("in range");
    assert_eq!(request.encode(), Ok([0xE6, 0x66, 0x82, 0xE0, 0x52, 0x33, 0x3B, 0x55]));
    let mut torque = None;
    request.visit_fields_in(&ranges, &mut |name, value| {
        if let ("torque_nm", FieldValue::Physical(value)) = (name, value) {
            torque = Some(value);
        }
    });
    assert!(torque.is_some_and(|torque| (torque - 100.04).abs() < 0.01));
}

/// V4.4 0x400: position ±12.566 rad, and torque and kd as the motor has them. The printed words of
/// RMD V3.6 §5.4 would have such a motor give 2.5 times the torque and 10 times the damping.
#[test]
fn motion_mode_of_v4_4() {
    let fields = |name: &str| match name {
        "position_rad" | "kp" => Some(10.0),
        "velocity_rad_s" | "kd" => Some(1.0),
        "torque_nm" => Some(10.0),
        _ => None,
    };
    let words = |ranges: &MotionRanges| {
        Request::build_in(ranges, "motion_mode", &fields).expect("in range").encode()
    };
    assert_eq!(words(&MotionRanges::DEFAULT), Ok([0xE6, 0x66, 0x82, 0xE0, 0x52, 0x33, 0x3B, 0x55]));
    assert_eq!(
        words(&MotionRanges::v4_4(60.0, 50.0)),
        Ok([0xE5, 0xDD, 0x82, 0xE0, 0x52, 0x05, 0x29, 0x55])
    );
}

/// V4.4 0x20, 0x32, 0x43, 0x63, 0x64, 0xB4: echoed and not stored unless the output is off.
#[test]
fn what_is_stored_only_while_the_output_is_off() {
    let codes = |dialect| -> Vec<u8> {
        let request = |code: u8| Request::decode_in(dialect, &[code, 1, 0, 0, 0, 0, 0, 0]);
        (0..=u8::MAX).filter(|code| request(*code).is_stored_only_off(dialect)).collect()
    };
    assert_eq!(codes(Dialect::V4_4), [0x20, 0x32, 0x43, 0x63, 0x64, 0xB4]);
    assert_eq!(codes(Dialect::V4_3), []);
}

/// Observed: a motor may answer an unknown command with a copy of its last reply.
#[test]
fn a_stale_reply_answers_nothing() {
    use rmd::{Answer, answer};
    for (dialect, asked, stale, own) in [
        // Another command's.
        (
            Dialect::V4_3,
            [0xA9, 30, 0xF4, 1, 0xA0, 0x8C, 0, 0],
            [0x9C, 50, 100, 0, 0, 0, 45, 0],
            [0xA9, 50, 0, 0, 0, 0, 45, 0],
        ),
        (
            Dialect::V3_7,
            [0x94, 0, 0, 0, 0, 0, 0, 0],
            [0x92, 0, 0, 0, 0x10, 0, 0, 0],
            [0x94, 0, 0, 0, 0, 0, 0, 0x10],
        ),
        // Another index of the same command.
        (
            Dialect::V4_2,
            [0x30, 1, 0, 0, 0, 0, 0, 0],
            [0x30, 2, 0, 0, 0, 0, 0, 0x3F],
            [0x30, 1, 0, 0, 0, 0, 0, 0x3F],
        ),
        (
            Dialect::V3_9,
            [0x42, 3, 0, 0, 0, 0, 0, 0],
            [0x42, 1, 0, 0, 0x88, 0x13, 0, 0],
            [0x42, 3, 0, 0, 0x88, 0x13, 0, 0],
        ),
        (
            Dialect::V4_4,
            [0xB5, 1, 2, 0, 0, 0, 0, 0],
            [0xB5, 1, 1, 0x52, 0x4D, 0x44, 0x2D, 0x58],
            [0xB5, 1, 2, 0x34, 0x2D, 0x50, 0x33, 0x36],
        ),
        // The other form of the same command.
        (
            Dialect::V4_2,
            [0x30, 1, 0, 0, 0, 0, 0, 0],
            [0x30, 0, 0x55, 0x19, 0x55, 0x19, 0x55, 0x19],
            [0x30, 1, 0, 0, 0, 0, 0, 0x3F],
        ),
        (
            Dialect::V3_6,
            [0x30, 0, 0, 0, 0, 0, 0, 0],
            [0x30, 1, 0, 0, 0, 0, 0, 0x3F],
            [0x30, 0, 0x55, 0x19, 0x55, 0x19, 0x55, 0x19],
        ),
    ] {
        let request = Request::decode_in(dialect, &asked);
        assert!(!matches!(request, Request::Unknown { .. }), "{asked:02X?}");
        let read = |data: &[u8; 8]| Reply::decode_in(Dialect::Unknown, data).expect("eight bytes");
        assert_eq!(answer(&request, &read(&stale)), Answer::Unrelated, "{stale:02X?}");
        assert_eq!(answer(&request, &read(&own)), Answer::Reply(read(&own)), "{own:02X?}");
    }
}
