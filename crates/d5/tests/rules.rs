//! What no line of a vector file can say.

use codec_testing::{CanFrame, check_deframer, check_names, hex};
use d5::serial::Deframer;
use d5::{
    AckLevel, Address, COMMANDS, Celsius, Degrees, DegreesPerSecond, EncodeError, FAULTS, Faults,
    MotorError, Node, REGISTERS, Register, RegisterInfo, Reply, Request, Value, Width, can,
    decode_request_frame, encode_angle, encode_speed, encode_temperature,
};
use embedded_can::{ExtendedId, Id, StandardId};

#[test]
fn the_names_of_the_table() {
    check_names(COMMANDS);
}

/// D5 manual, table row 9.
#[test]
fn the_deframer_finds_frames_whole_and_in_time() {
    let request = [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x11, 0x11, 0x55];
    let reply = [0x5D, 0x0B, 0x05, 0x03, 0x20, 0x11, 0x11, 0x55];
    check_deframer(Deframer::new, request, reply);
}

/// The manual gives no CAN ids, so the caller chooses them.
#[test]
fn the_can_id_is_the_callers() {
    let extended = Id::from(ExtendedId::new(0x1234_5678).expect("29 bits"));
    for id in [extended, StandardId::new(0x123).expect("11 bits").into()] {
        let to = Address::Node(Node::FACTORY);
        let query = can::request::<CanFrame>(id, to, &Request::QueryId).expect("a frame");
        assert_eq!((query.id(), can::decode_request(&query)), (id, Ok((to, Request::QueryId))));
        let here = can::reply::<CanFrame>(id, Node::FACTORY, &Reply::Id).expect("a frame");
        assert_eq!((here.id(), can::decode_reply(&here)), (id, Ok((Node::FACTORY, Reply::Id))));
    }
    assert_eq!(can::default_request_id(Node::FACTORY).as_raw(), 0x00B);
}

/// D5 manual, table row 1: 0xFE addresses all motors, so it names none.
#[test]
fn ids_end_below_the_broadcast_id() {
    assert_eq!([0x01, 0xFD].map(|id| Node::new(id).map(Node::get)), [Ok(0x01), Ok(0xFD)]);
    assert_eq!((Address::new(0xFE), Address::Broadcast.id()), (Ok(Address::Broadcast), 0xFE));
    assert_eq!(Address::new(0x0B), Ok(Address::Node(Node::FACTORY)));
    assert!(Address::new(0xFF).is_err());
    for id in [0x00, 0xFE, 0xFF] {
        let refused =
            EncodeError::OutOfRange { field: "node", value: i64::from(id), min: 0x01, max: 0xFD };
        assert_eq!(Node::new(id), Err(refused));
    }
}

/// D5 manual, register 0x10; of broadcasts only the query is answered (table row 1, quick start).
#[test]
fn what_motors_answer_at_a_level() {
    let motor = Address::Node(Node::FACTORY);
    let read = Request::Read { register: Register::STATUS, width: Width::Byte };
    let write = Request::Write { register: Register::SPEED, value: Value::Word(0) };
    for (raw, answered) in
        [(2, [true, true]), (1, [true, false]), (0, [false, false]), (3, [false, false])]
    {
        let level = AckLevel::of(raw);
        assert_eq!([read, write].map(|request| level.answers(motor, &request)), answered, "{raw}");
        assert_eq!(level.raw(), raw);
    }
    let all = [Request::QueryId, Request::Execute, Request::Reset]
        .map(|request| AckLevel::ReadsAndWrites.answers(Address::Broadcast, &request));
    assert_eq!(all, [true, false, false]);
    assert!(AckLevel::ReadsAndWrites.answers(motor, &Request::Reset));
}

/// D5 manual, registers 0x10, 0x11, 0x19, 0x20 and 0x21, table rows 9, 11 to 13, quick start (4):
/// two data bytes go to two registers, and the set speed is the two bytes from 0x20 on.
#[test]
fn what_a_write_touches() {
    let request = |frame: &str| {
        let frame = hex(frame).try_into().expect("8 bytes");
        decode_request_frame(&frame).expect("a request").1
    };
    for (frame, moves) in [
        ("D50B05032058028D", true),
        ("D50B0504200B0443", true),
        ("D50B04032058008A", true), // the low byte alone
        ("D50B0404218400B8", true), // the high one, as printed
        ("D50B05031F00588A", true), // from the register below
        ("D50B050321020036", true), // into the register above
        ("D50B050500000015", true),
        ("D5FE050320580280", true), // to all
        ("D5FE050500000008", true),
        ("D50B050220000032", false),
        ("D50B04031F580089", false),
        ("D50B05031E005889", false),
        ("D50B04032258008C", false),
        ("D50B050100000011", false),
    ] {
        assert_eq!(request(frame).moves(), moves, "{frame}");
    }
    let (ack, timeout) = (Register::ACK_LEVEL, Register::TIMEOUT_SWITCH);
    let both = request("D50B050310010024");
    assert!(both.writes(ack) && both.writes(timeout));
    let one = request("D50B040310010023");
    assert!(one.writes(ack) && !one.writes(timeout));
    let id = request("D50B0503030D0023");
    assert!(id.writes(Register::ID) && !id.moves());
}

/// D5 manual, register 0x19 and error states at 0x12: every named bit has one row.
#[test]
fn which_faults_can_be_cleared() {
    assert!(Faults::all().iter().eq(FAULTS.iter().map(|info| info.fault)));
    assert_eq!((Faults::all().bits(), Faults::CLEARABLE.bits()), (0xCF, 0x42));
    let clearable = FAULTS.iter().filter(|info| info.is_clearable).map(|info| info.name);
    assert!(clearable.eq(["over_current", "stall"]));
}

/// D5 manual, table rows 3 to 5: bytes that mean an error are no other reply.
#[test]
fn replies_that_no_motor_sends_are_refused() {
    let value = Value::Word(0xEEEE);
    let read = Reply::Read { register: Register::ID, value }.encode();
    assert!(matches!(read, Err(EncodeError::Forbidden { field: "command", value: 0x02, .. })));
    for error in [MotorError::Id, MotorError::Command, MotorError::Checksum] {
        for command in 0..=u8::MAX {
            let reply = Reply::Error { error, command };
            let payload = reply.encode().expect("any command");
            assert_eq!(Reply::decode(&payload), Ok(reply));
        }
    }
}

/// D5 manual, register table: sorted, without overlaps, defaults within their limits; two byte
/// registers that can be read at once show fields of different names.
#[test]
fn the_table_of_registers() {
    for pair in REGISTERS.windows(2) {
        let [low, high] = pair else { unreachable!() };
        let end = low.register.0 + if low.width == Width::Word { 2 } else { 1 };
        assert!(end <= high.register.0, "{} {}", low.name, high.name);
        let read_at_once = low.width == Width::Byte && end == high.register.0;
        assert!(!read_at_once || low.field != high.field, "{} {}", low.name, high.name);
    }
    for RegisterInfo { name, default, min, max, .. } in &REGISTERS {
        assert!(default.is_none_or(|default| (min..=max).contains(&&default)), "{name}");
    }
}

/// D5 manual, register table, common commands, rows 2, 3 and 5: how each kind of register holds its
/// value, and where it ends.
#[test]
fn values_are_coded_as_the_table_says() {
    let info = |register: Register| register.info().expect("in the table");
    for (register, value, raw) in [
        (Register::SPEED, 600, Value::Word(0x0258)),
        (Register::SPEED, -600, Value::Word(0x8258)),
        (Register::SPEED, 32_767, Value::Word(0x7FFF)),
        (Register::TRAVELLED_ANGLE, -21_629, Value::Word(0xAB83)),
        (Register::MAGNETIC_ANGLE, 353, Value::Word(0x0161)),
        (Register::BOARD_TEMPERATURE, -5, Value::Byte(0x85)),
        (Register::MAX_TEMPERATURE, 100, Value::Byte(0x64)),
        (Register::ACCELERATION, 72, Value::Byte(0x48)),
        (Register::STATUS, 0x42, Value::Byte(0x42)),
    ] {
        assert_eq!(info(register).decode(raw), Some(value), "{}", info(register).name);
        assert_eq!(info(register).encode(value), Ok(raw), "{}", info(register).name);
    }
    // The id is read as a byte and written as a word.
    assert_eq!(info(Register::ID).decode(Value::Byte(0x0B)), Some(0x0B));
    assert_eq!(info(Register::ID).encode(0x0D), Ok(Value::Word(0x000D)));
    assert_eq!(info(Register::SPEED).decode(Value::Byte(0x58)), None);
    assert_eq!(info(Register::ACCELERATION).decode(Value::Word(0x4848)), None);
    let out_of_range = |field, value, min, max| EncodeError::OutOfRange { field, value, min, max };
    for (register, value, field, min, max) in [
        (Register::SPEED, 32_768, "speed", -32_767, 32_767),
        (Register::SPEED, -40_000, "speed", -32_767, 32_767),
        (Register::ACCELERATION, 71, "acceleration", 72, 250),
        (Register::ACCELERATION, -1, "acceleration", 72, 250),
        (Register::MAGNETIC_ANGLE, 361, "magnetic_angle", 0, 360),
        (Register::BOARD_TEMPERATURE, 128, "board_temperature", -127, 127),
    ] {
        let refused = out_of_range(field, value, min, max);
        assert_eq!(info(register).encode(value), Err(refused));
    }
    let words = [encode_speed(DegreesPerSecond(i16::MIN)), encode_angle(Degrees(i16::MIN))];
    let refused =
        ["speed", "angle"].map(|field| Err(out_of_range(field, -32_768, -32_767, 32_767)));
    assert_eq!(words, refused);
    let refused = out_of_range("temperature", -128, -127, 127);
    assert_eq!(encode_temperature(Celsius(i8::MIN)), Err(refused));
}
