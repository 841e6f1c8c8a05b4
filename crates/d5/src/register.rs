//! The registers of a motor: one table, and what it allows.

use crate::error::EncodeError;
use crate::field::check_range;
use crate::node::Node;
use crate::payload::{Value, Width};

/// Address of a register. Any address can be received; those of the manual have names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Register(pub u8);

impl Register {
    /// Software version.
    pub const VERSION: Register = Register(0x02);
    /// Id of the motor; written with two data bytes, as printed (D5 manual, common commands, row 1).
    pub const ID: Register = Register(0x03);
    /// Bitrate; the motor does not support it.
    pub const BITRATE: Register = Register(0x04);
    /// Reply delay, raw: the text gives 500 µs as default, the table 0x00.
    pub const REPLY_DELAY: Register = Register(0x05);
    /// Highest temperature; see [`crate::temperature`].
    pub const MAX_TEMPERATURE: Register = Register(0x0B);
    /// Which requests are answered: 2 reads and writes, 1 reads only, anything else none.
    pub const ACK_LEVEL: Register = Register(0x10);
    /// Communication timeout: 1 on, 0 off. Its time is not given.
    pub const TIMEOUT_SWITCH: Register = Register(0x11);
    /// Faults; see [`crate::Faults`].
    pub const STATUS: Register = Register(0x12);
    /// Acceleration, raw, 72..=250.
    pub const ACCELERATION: Register = Register(0x15);
    /// Deceleration, raw, 72..=250.
    pub const DECELERATION: Register = Register(0x16);
    /// 1 clears stall and over-current; returns to 0 by itself.
    pub const CLEAR_PROTECTION: Register = Register(0x19);
    /// Set speed, a word; see [`crate::speed`].
    pub const SPEED: Register = Register(0x20);
    /// Measured speed, a word; see [`crate::speed`].
    pub const CURRENT_SPEED: Register = Register(0x26);
    /// Travelled angle, a word; see [`crate::angle`].
    pub const TRAVELLED_ANGLE: Register = Register(0x28);
    /// 1 while the motor works, 0 in standby.
    pub const RUNNING: Register = Register(0x2A);
    /// 1 while the brake holds and speeds are ignored.
    pub const BRAKE: Register = Register(0x2B);
    /// 1 while an asynchronous write waits.
    pub const ASYNC_FLAG: Register = Register(0x2C);
    /// Temperature of the board; see [`crate::temperature`].
    pub const BOARD_TEMPERATURE: Register = Register(0x2E);
    /// Temperature of the motor; see [`crate::temperature`].
    pub const MOTOR_TEMPERATURE: Register = Register(0x2F);
    /// The command the motor works on.
    pub const CURRENT_COMMAND: Register = Register(0x50);
    /// Magnetic angle, a word, 0..=360 degrees.
    pub const MAGNETIC_ANGLE: Register = Register(0x57);

    /// The row of the table; `None` for the upper byte of a word and for registers without a function.
    pub fn info(self) -> Option<&'static RegisterInfo> {
        REGISTERS.iter().find(|info| info.register == self)
    }

    /// Refuses a read that would take half a word.
    pub(crate) fn check_read(self, width: Width) -> Result<(), EncodeError> {
        let starts_word = |register: Register| register.info().is_some_and(|info| info.width == Width::Word);
        let next = self.0.checked_add(1).map(Register);
        let splits_a_word = match width {
            Width::Byte => starts_word(self),
            Width::Word => !starts_word(self) && next.is_some_and(starts_word),
        };
        if splits_a_word || self.is_upper_byte() {
            return Err(self.forbidden("a word is read whole, with two data bytes"));
        }
        if width == Width::Word && next.is_none() {
            return Err(self.forbidden("no register follows the last one"));
        }
        Ok(())
    }

    /// Refuses a write that the table does not allow.
    pub(crate) fn check_write(self, value: Value) -> Result<(), EncodeError> {
        if self.is_upper_byte() {
            return Err(self.forbidden("a word is written whole, with two data bytes"));
        }
        let Some(info) = self.info() else {
            return Err(self.forbidden("a register without a function is not written"));
        };
        match info.access {
            Access::ReadWrite => {}
            Access::ReadOnly => return Err(self.forbidden("read-only")),
            Access::None => return Err(self.forbidden("the manual gives no access")),
            Access::Unsupported => return Err(self.forbidden("not supported by the motor")),
        }
        // The id is one byte, but its change is printed with two (D5 manual, common commands, row 1).
        let width = if self == Register::ID { Width::Word } else { info.width };
        let raw = match (width, value) {
            (Width::Byte, Value::Byte(byte)) => i64::from(byte),
            (Width::Word, Value::Word(word)) => i64::from(word),
            (Width::Byte, Value::Word(_)) => {
                return Err(
                    self.forbidden("written with one data byte; the second would go to the next register")
                );
            }
            (Width::Word, Value::Byte(_)) => return Err(self.forbidden("written with two data bytes")),
        };
        check_range(info.name, raw, i64::from(info.min), i64::from(info.max))
    }

    fn is_upper_byte(self) -> bool {
        let below = self.0.checked_sub(1).and_then(|address| Register(address).info());
        below.is_some_and(|info| info.width == Width::Word)
    }

    fn forbidden(self, reason: &'static str) -> EncodeError {
        EncodeError::Forbidden { field: "register", value: i64::from(self.0), reason }
    }
}

/// What the manual lets a host do with a register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Access {
    /// Read and written.
    ReadWrite,
    /// Read only.
    ReadOnly,
    /// The register has a function, but its access column says none.
    None,
    /// The manual says that the motor does not support it.
    Unsupported,
}

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RegisterInfo {
    /// Its address, of a word the lower one.
    pub register: Register,
    /// Its name in errors and listings.
    pub name: &'static str,
    /// What a host may do with it.
    pub access: Access,
    /// One byte, or a word in two.
    pub width: Width,
    /// Raw value after a reset; `None` where the manual gives none.
    pub default: Option<u16>,
    /// Unit of the raw value; empty for a plain number, a flag or a unit the manual leaves unclear.
    pub unit: &'static str,
    /// Lowest raw value.
    pub min: u16,
    /// Highest raw value.
    pub max: u16,
}

const BYTE_MAX: u16 = 0xFF;
const WORD_MAX: u16 = 0xFFFF;
const FLAG_MAX: u16 = 1;
const ACCELERATION_MIN: u16 = 72;
const ACCELERATION_MAX: u16 = 250;
const FULL_TURN: u16 = 360;
const ID_MIN: u16 = Node::MIN as u16;
const ID_MAX: u16 = Node::MAX as u16;
const ID_DEFAULT: u16 = Node::FACTORY.get() as u16;

const CELSIUS: &str = "°C, bit 7 = below zero";
const SPEED_UNIT: &str = "°/s, bit 15 = clockwise";

/// A row; the limits follow.
const fn row(
    register: Register,
    name: &'static str,
    access: Access,
    width: Width,
    default: Option<u16>,
) -> RegisterInfo {
    let max = match width {
        Width::Byte => BYTE_MAX,
        Width::Word => WORD_MAX,
    };
    RegisterInfo { register, name, access, width, default, unit: "", min: 0, max }
}

impl RegisterInfo {
    const fn unit(self, unit: &'static str) -> RegisterInfo {
        RegisterInfo { unit, ..self }
    }

    const fn range(self, min: u16, max: u16) -> RegisterInfo {
        RegisterInfo { min, max, ..self }
    }
}

/// Every register of the manual that has a function, by address (D5 manual, register table).
#[rustfmt::skip]
pub static REGISTERS: [RegisterInfo; 21] = {
    use Access::{ReadOnly, ReadWrite, Unsupported};
    use Width::{Byte, Word};
    [
        row(Register::VERSION, "version", ReadOnly, Byte, Some(0x01)),
        row(Register::ID, "id", ReadWrite, Byte, Some(ID_DEFAULT)).range(ID_MIN, ID_MAX),
        row(Register::BITRATE, "bitrate", Unsupported, Byte, None),
        row(Register::REPLY_DELAY, "reply delay", ReadWrite, Byte, Some(0x00)),
        row(Register::MAX_TEMPERATURE, "max temperature", Access::None, Byte, Some(0x64)).unit(CELSIUS),
        row(Register::ACK_LEVEL, "ack level", ReadWrite, Byte, Some(0x02)),
        row(Register::TIMEOUT_SWITCH, "timeout switch", ReadWrite, Byte, Some(0x01)).range(0, FLAG_MAX),
        row(Register::STATUS, "status", ReadWrite, Byte, Some(0x00)),
        row(Register::ACCELERATION, "acceleration", ReadWrite, Byte, Some(0x48)).range(ACCELERATION_MIN, ACCELERATION_MAX),
        row(Register::DECELERATION, "deceleration", ReadWrite, Byte, Some(0x48)).range(ACCELERATION_MIN, ACCELERATION_MAX),
        row(Register::CLEAR_PROTECTION, "clear protection", ReadWrite, Byte, Some(0x00)).range(0, FLAG_MAX),
        row(Register::SPEED, "speed", ReadWrite, Word, Some(0x0000)).unit(SPEED_UNIT),
        row(Register::CURRENT_SPEED, "current speed", ReadOnly, Word, Some(0x0000)).unit(SPEED_UNIT),
        row(Register::TRAVELLED_ANGLE, "travelled angle", ReadOnly, Word, Some(0x0000)).unit("°, two's complement"),
        row(Register::RUNNING, "running", ReadOnly, Byte, Some(0x00)).range(0, FLAG_MAX),
        row(Register::BRAKE, "brake", Access::None, Byte, Some(0x00)).range(0, FLAG_MAX),
        row(Register::ASYNC_FLAG, "asynchronous write flag", ReadOnly, Byte, Some(0x00)).range(0, FLAG_MAX),
        row(Register::BOARD_TEMPERATURE, "board temperature", ReadOnly, Byte, Some(0x00)).unit(CELSIUS),
        row(Register::MOTOR_TEMPERATURE, "motor temperature", ReadOnly, Byte, Some(0x00)).unit(CELSIUS),
        row(Register::CURRENT_COMMAND, "current command", ReadOnly, Byte, Some(0x00)),
        row(Register::MAGNETIC_ANGLE, "magnetic angle", ReadOnly, Word, Some(0x0000)).unit("°").range(0, FULL_TURN),
    ]
};

#[cfg(test)]
mod tests {
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

    /// D5 manual, frame format: two data bytes also write the next register; to 0x10 they would switch the timeout
    /// of 0x11 off.
    #[test]
    fn the_width_is_that_of_the_register() {
        let one = "written with one data byte; the second would go to the next register";
        assert_eq!(refusal(0x10, Value::Word(0x0001)), one);
        assert_eq!(refusal(0x15, Value::Word(0x4848)), one);
        assert_eq!(refusal(0x20, Value::Byte(0)), "written with two data bytes");
        assert_eq!(refusal(0x21, Value::Byte(0x84)), "a word is written whole, with two data bytes");
        assert_eq!(Register::ACK_LEVEL.check_write(Value::Byte(1)), Ok(()));
        assert_eq!(Register::SPEED.check_write(Value::Word(0x8258)), Ok(()));
    }

    /// D5 manual, common commands, row 1: the id change has two data bytes.
    #[test]
    fn the_id_is_written_with_two_data_bytes() {
        assert_eq!(Register::ID.check_write(Value::Word(0x000D)), Ok(()));
        assert_eq!(refusal(0x03, Value::Byte(0x0D)), "written with two data bytes");
        for id in [0x0000, 0x00FE, 0x00FF, 0x010D] {
            let refused = EncodeError::OutOfRange { field: "id", value: i64::from(id), min: 1, max: 0xFD };
            assert_eq!(Register::ID.check_write(Value::Word(id)), Err(refused));
        }
    }

    /// D5 manual, register table: limits in the text of 0x11, 0x15, 0x16, 0x19.
    #[test]
    fn values_lie_within_their_limits() {
        for (register, value, field, min, max) in [
            (0x11, 2, "timeout switch", 0, 1),
            (0x15, 71, "acceleration", 72, 250),
            (0x16, 251, "deceleration", 72, 250),
            (0x19, 2, "clear protection", 0, 1),
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
        assert!(readable(0x20, Width::Word) && readable(0x26, Width::Word) && readable(0x57, Width::Word));
        assert!(readable(0x15, Width::Word) && readable(0x15, Width::Byte) && readable(0x40, Width::Byte));
        assert!(!readable(0x20, Width::Byte) && !readable(0x21, Width::Byte) && !readable(0x27, Width::Word));
        assert!(!readable(0x1F, Width::Word) && !readable(0x25, Width::Word) && !readable(0xFF, Width::Word));
        assert!(readable(0x26, Width::Word) && readable(0x28, Width::Word) && readable(0xFF, Width::Byte));
    }
}
