//! The table of registers, and what it allows.

use super::*;

fn refusal(register: u8, value: Value) -> &'static str {
    match Register(register).check_write(value) {
        Err(EncodeError::Forbidden { field: "register", value, reason }) => {
            assert_eq!(value, i64::from(register));
            reason
        }
        other => panic!("{register:#04x}: {other:?}"),
    }
}

#[test]
fn the_table_is_sorted_and_no_registers_overlap() {
    for pair in REGISTERS.windows(2) {
        let [low, high] = pair else { unreachable!() };
        let size = if low.width == Width::Word { 2 } else { 1 };
        assert!(low.register.0 + size <= high.register.0, "{} {}", low.name, high.name);
    }
}

/// Two byte registers read at once show their fields side by side.
#[test]
fn neighbours_read_at_once_have_fields_of_different_names() {
    for pair in REGISTERS.windows(2) {
        let [low, high] = pair else { unreachable!() };
        let read_at_once = low.width == Width::Byte && low.register.0 + 1 == high.register.0;
        assert!(!read_at_once || low.field != high.field, "{} {}", low.name, high.name);
    }
}

/// D5 manual, register table: every default lies within its limits.
#[test]
fn defaults_lie_within_their_limits() {
    for info in &REGISTERS {
        assert!(
            info.default.is_none_or(|default| (info.min..=info.max).contains(&default)),
            "{}",
            info.name
        );
    }
}

/// D5 manual, register table: access column.
#[test]
fn only_writable_registers_are_written() {
    assert_eq!(refusal(0x02, Value::Byte(1)), "read-only");
    assert_eq!(refusal(0x04, Value::Byte(1)), "not supported by the motor");
    assert_eq!(refusal(0x0B, Value::Byte(100)), "the manual gives no access");
    assert_eq!(refusal(0x2B, Value::Byte(1)), "the manual gives no access");
    assert_eq!(refusal(0x26, Value::Word(0)), "read-only");
    assert_eq!(refusal(0x2F, Value::Byte(0)), "read-only");
    for register in [0x00, 0x01, 0x06, 0x0C, 0x1F, 0x22, 0x38, 0x40, 0xFF] {
        let reason = "a register without a function is not written";
        assert_eq!(refusal(register, Value::Byte(0)), reason);
    }
}

/// D5 manual, frame format: two data bytes also write the next register; to 0x10 they would switch
/// the timeout of 0x11 off.
#[test]
fn the_width_is_that_of_the_register() {
    let one = "written with one data byte; the second would go to the next register";
    assert_eq!(refusal(0x10, Value::Word(0x0001)), one);
    assert_eq!(refusal(0x11, Value::Word(0x0001)), one);
    assert_eq!(refusal(0x20, Value::Byte(0)), "written with two data bytes");
    assert_eq!(refusal(0x21, Value::Byte(0x84)), "a word is written whole, with two data bytes");
    assert_eq!(Register::ACK_LEVEL.check_write(Value::Byte(1)), Ok(()));
    assert_eq!(Register::SPEED.check_write(Value::Word(0x8258)), Ok(()));
}

/// D5 manual, table row 7 reads 0x15 and 0x16 at once, frame format: two data bytes go to both.
#[test]
fn acceleration_and_deceleration_are_written_at_once() {
    assert_eq!(Register::ACCELERATION.check_write(Value::Word(0x4848)), Ok(()));
    let refused = |field, value| Err(EncodeError::OutOfRange { field, value, min: 72, max: 250 });
    assert_eq!(
        Register::ACCELERATION.check_write(Value::Word(0xFB48)),
        refused("deceleration", 251)
    );
    assert_eq!(
        Register::ACCELERATION.check_write(Value::Word(0x4847)),
        refused("acceleration", 71)
    );
    let alone = "written with one data byte; the second would go to the next register";
    assert_eq!(refusal(0x16, Value::Word(0x4848)), alone); // 0x17 has no function
}

/// D5 manual, common commands, row 1: the id change has two data bytes.
#[test]
fn the_id_is_written_with_two_data_bytes() {
    assert_eq!(Register::ID.check_write(Value::Word(0x000D)), Ok(()));
    assert_eq!(refusal(0x03, Value::Byte(0x0D)), "written with two data bytes");
    for id in [0x0000, 0x00FE, 0x00FF, 0x010D] {
        let refused =
            EncodeError::OutOfRange { field: "id", value: i64::from(id), min: 1, max: 0xFD };
        assert_eq!(Register::ID.check_write(Value::Word(id)), Err(refused));
    }
}

/// D5 manual, register table: limits in the text of 0x11, 0x15, 0x16, 0x19.
#[test]
fn values_lie_within_their_limits() {
    for (register, value, field, min, max) in [
        (0x11, 2, "timeout_switch", 0, 1),
        (0x15, 71, "acceleration", 72, 250),
        (0x16, 251, "deceleration", 72, 250),
        (0x19, 2, "clear_protection", 0, 1),
    ] {
        let refused = EncodeError::OutOfRange { field, value: i64::from(value), min, max };
        assert_eq!(Register(register).check_write(Value::Byte(value)), Err(refused));
    }
    assert_eq!(Register::ACCELERATION.check_write(Value::Byte(72)), Ok(()));
    assert_eq!(Register::DECELERATION.check_write(Value::Byte(250)), Ok(()));
}

/// D5 manual, table row 7: two bytes are read at once; a word never by halves.
#[test]
fn words_are_read_whole() {
    let readable = |register: u8, width| Register(register).check_read(width).is_ok();
    assert!(
        readable(0x20, Width::Word) && readable(0x26, Width::Word) && readable(0x57, Width::Word)
    );
    assert!(
        readable(0x15, Width::Word) && readable(0x15, Width::Byte) && readable(0x40, Width::Byte)
    );
    assert!(
        !readable(0x20, Width::Byte)
            && !readable(0x21, Width::Byte)
            && !readable(0x27, Width::Word)
    );
    assert!(
        !readable(0x1F, Width::Word)
            && !readable(0x25, Width::Word)
            && !readable(0xFF, Width::Word)
    );
    assert!(
        readable(0x26, Width::Word) && readable(0x28, Width::Word) && readable(0xFF, Width::Byte)
    );
}

/// D5 manual, register table, common commands, rows 2, 3 and 5: how each kind of register holds its
/// value.
#[test]
fn values_are_coded_as_the_table_says() {
    let info = |register: Register| register.info().unwrap();
    for (register, value, raw) in [
        (Register::SPEED, 600, Value::Word(0x0258)),
        (Register::SPEED, -600, Value::Word(0x8258)),
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
    assert_eq!(info(Register::SPEED).decode(Value::Byte(0x58)), None);
    assert_eq!(info(Register::ACCELERATION).decode(Value::Word(0x4848)), None);
    assert_eq!(info(Register::ID).decode(Value::Byte(0x0B)), Some(0x0B));
    assert_eq!(info(Register::ID).encode(0x0D), Ok(Value::Word(0x000D)));
    for (register, value, name, min, max) in [
        (Register::SPEED, 32_768, "speed", -32_767, 32_767),
        (Register::SPEED, -40_000, "speed", -32_767, 32_767),
        (Register::ACCELERATION, 71, "acceleration", 72, 250),
        (Register::ACCELERATION, -1, "acceleration", 72, 250),
        (Register::MAGNETIC_ANGLE, 361, "magnetic_angle", 0, 360),
        (Register::BOARD_TEMPERATURE, 128, "board_temperature", -127, 127),
    ] {
        let refused = EncodeError::OutOfRange { field: name, value, min, max };
        assert_eq!(info(register).encode(value), Err(refused));
    }
}
