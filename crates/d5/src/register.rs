//! The registers of a motor: one table, and what it allows.

use codec::check_range;

use crate::angle::{ANGLE_MAX, decode_angle, encode_angle};
use crate::error::EncodeError;
use crate::node::Node;
use crate::payload::{Value, Width};
use crate::speed::{SPEED_MAX, decode_speed, encode_speed};
use crate::temperature::{TEMPERATURE_MAX, decode_temperature, encode_temperature};
use crate::units::{Celsius, Degrees, DegreesPerSecond};

/// Address of a register. Any address can be received; those of the manual have names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Register(pub u8);

impl Register {
    /// Software version.
    pub const VERSION: Register = Register(0x02);
    /// Id of the motor; written with two data bytes, as printed (D5 manual, common commands, row
    /// 1).
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

    /// The row of the table; `None` for the upper byte of a word and for registers without a
    /// function.
    pub fn info(self) -> Option<&'static RegisterInfo> {
        REGISTERS.iter().find(|info| info.register == self)
    }

    /// Refuses a read that would take half a word.
    pub(crate) fn check_read(self, width: Width) -> Result<(), EncodeError> {
        let starts_word =
            |register: Register| register.info().is_some_and(|info| info.width == Width::Word);
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
        let info = self.writable()?;
        match (info.written_width(), value) {
            (Width::Byte, Value::Byte(byte)) => info.check_raw(byte.into()),
            (Width::Word, Value::Word(word)) => info.check_raw(word),
            (Width::Byte, Value::Word(word)) => {
                let Some(next) = self.written_with() else {
                    return Err(self.forbidden(
                        "written with one data byte; the second would go to the next register",
                    ));
                };
                let [low, high] = word.to_le_bytes();
                info.check_raw(low.into())?;
                next.check_raw(high.into())
            }
            (Width::Word, Value::Byte(_)) => Err(self.forbidden("written with two data bytes")),
        }
    }

    /// The row of a register that a host may write.
    fn writable(self) -> Result<&'static RegisterInfo, EncodeError> {
        let info =
            self.info().ok_or(self.forbidden("a register without a function is not written"))?;
        match info.access {
            Access::ReadWrite => Ok(info),
            Access::ReadOnly => Err(self.forbidden("read-only")),
            Access::None => Err(self.forbidden("the manual gives no access")),
            Access::Unsupported => Err(self.forbidden("not supported by the motor")),
        }
    }

    /// The next register, where one write of two data bytes may fill both: two writable bytes of
    /// which none is the timeout switch. What was meant for 0x10 alone would switch the motor's
    /// own timeout of 0x11 off.
    pub fn written_with(self) -> Option<&'static RegisterInfo> {
        let next = Register(self.0.checked_add(1)?);
        let pair = [self, next].into_iter().all(|register| {
            let byte = register.writable().is_ok_and(|info| info.written_width() == Width::Byte);
            byte && register != Register::TIMEOUT_SWITCH
        });
        if pair { next.info() } else { None }
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

/// How a register holds its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Coding {
    /// A number from 0 on.
    Unsigned,
    /// The top bit is the sign, the others the magnitude: speeds and temperatures.
    SignMagnitude,
    /// Two's complement: the travelled angle.
    TwosComplement,
    /// Each bit a fault; see [`crate::Faults`].
    Faults,
}

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RegisterInfo {
    /// Its address, of a word the lower one.
    pub register: Register,
    /// Its name in errors and listings, in snake_case.
    pub name: &'static str,
    /// Name of its value, with the unit as its last part where there is one.
    pub field: &'static str,
    /// What a host may do with it.
    pub access: Access,
    /// One byte, or a word in two.
    pub width: Width,
    /// How it holds its value.
    pub coding: Coding,
    /// Raw value after a reset; `None` where the manual gives none.
    pub default: Option<u16>,
    /// Unit of its value; empty for a plain number, a flag or a unit the manual leaves unclear.
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

/// A row for a plain number, named like the register; the rest follows.
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
    let (field, coding, unit) = (name, Coding::Unsigned, "");
    RegisterInfo { register, name, field, access, width, coding, default, unit, min: 0, max }
}

impl RegisterInfo {
    /// Refuses raw data outside the range of the register.
    fn check_raw(&self, raw: u16) -> Result<(), EncodeError> {
        check_range(self.name, i64::from(raw), i64::from(self.min), i64::from(self.max))
    }

    const fn range(self, min: u16, max: u16) -> RegisterInfo {
        RegisterInfo { min, max, ..self }
    }

    const fn value(self, field: &'static str, unit: &'static str, coding: Coding) -> RegisterInfo {
        RegisterInfo { field, unit, coding, ..self }
    }

    /// Sign and magnitude in degrees per second, counter-clockwise positive.
    const fn speed(self) -> RegisterInfo {
        self.value("speed_dps", "dps", Coding::SignMagnitude)
    }

    /// Sign and magnitude in °C.
    const fn temperature(self, field: &'static str) -> RegisterInfo {
        self.value(field, "degC", Coding::SignMagnitude)
    }

    /// The value, in the unit of the row, of raw data as wide as the register.
    pub fn decode(&self, value: Value) -> Option<i64> {
        match (self.width, self.coding, value) {
            (Width::Byte, Coding::SignMagnitude, Value::Byte(raw)) => {
                Some(i64::from(decode_temperature(raw).0))
            }
            (Width::Word, Coding::SignMagnitude, Value::Word(raw)) => {
                Some(i64::from(decode_speed(raw).0))
            }
            (Width::Word, Coding::TwosComplement, Value::Word(raw)) => {
                Some(i64::from(decode_angle(raw).0))
            }
            (Width::Byte, _, Value::Byte(raw)) => Some(i64::from(raw)),
            (Width::Word, _, Value::Word(raw)) => Some(i64::from(raw)),
            (Width::Byte, _, Value::Word(_)) | (Width::Word, _, Value::Byte(_)) => None,
        }
    }

    /// The raw data for a value in the unit of the row, as wide as a write of this register.
    pub fn encode(&self, value: i64) -> Result<Value, EncodeError> {
        let (min, max) = self.value_range();
        let refused = EncodeError::OutOfRange { field: self.name, value, min, max };
        let raw = match (self.width, self.coding) {
            (Width::Byte, Coding::SignMagnitude) => {
                let value = i8::try_from(value).map_err(|_| refused)?;
                u16::from(encode_temperature(Celsius(value))?)
            }
            (Width::Word, Coding::SignMagnitude) => {
                let value = i16::try_from(value).map_err(|_| refused)?;
                encode_speed(DegreesPerSecond(value))?
            }
            (Width::Word, Coding::TwosComplement) => {
                let value = i16::try_from(value).map_err(|_| refused)?;
                encode_angle(Degrees(value))?
            }
            _ => u16::try_from(value).map_err(|_| refused)?,
        };
        check_range(self.name, value, min, max)?;
        Ok(match (self.written_width(), raw.to_le_bytes()) {
            (Width::Byte, [low, _]) => Value::Byte(low),
            (Width::Word, _) => Value::Word(raw),
        })
    }

    /// The lowest and the highest value in the unit of the row.
    pub const fn value_range(&self) -> (i64, i64) {
        let magnitude = match (self.coding, self.width) {
            (Coding::Unsigned | Coding::Faults, _) => return (self.min as i64, self.max as i64),
            (Coding::SignMagnitude, Width::Byte) => TEMPERATURE_MAX as i64,
            (Coding::SignMagnitude, Width::Word) => SPEED_MAX as i64,
            (Coding::TwosComplement, _) => ANGLE_MAX as i64,
        };
        (-magnitude, magnitude)
    }

    /// The width of a write. The id is one byte, but its change is printed with two (D5 manual,
    /// common commands, row 1).
    pub(crate) fn written_width(&self) -> Width {
        if self.register == Register::ID { Width::Word } else { self.width }
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
        row(Register::REPLY_DELAY, "reply_delay", ReadWrite, Byte, Some(0x00)),
        row(Register::MAX_TEMPERATURE, "max_temperature", Access::None, Byte, Some(0x64)).temperature("temperature_c"),
        row(Register::ACK_LEVEL, "ack_level", ReadWrite, Byte, Some(0x02)),
        row(Register::TIMEOUT_SWITCH, "timeout_switch", ReadWrite, Byte, Some(0x01)).range(0, FLAG_MAX),
        row(Register::STATUS, "status", ReadWrite, Byte, Some(0x00)).value("faults", "", Coding::Faults),
        row(Register::ACCELERATION, "acceleration", ReadWrite, Byte, Some(0x48)).range(ACCELERATION_MIN, ACCELERATION_MAX),
        row(Register::DECELERATION, "deceleration", ReadWrite, Byte, Some(0x48)).range(ACCELERATION_MIN, ACCELERATION_MAX),
        row(Register::CLEAR_PROTECTION, "clear_protection", ReadWrite, Byte, Some(0x00)).range(0, FLAG_MAX),
        row(Register::SPEED, "speed", ReadWrite, Word, Some(0x0000)).speed(),
        row(Register::CURRENT_SPEED, "current_speed", ReadOnly, Word, Some(0x0000)).speed(),
        row(Register::TRAVELLED_ANGLE, "travelled_angle", ReadOnly, Word, Some(0x0000)).value("angle_deg", "deg", Coding::TwosComplement),
        row(Register::RUNNING, "running", ReadOnly, Byte, Some(0x00)).range(0, FLAG_MAX),
        row(Register::BRAKE, "brake", Access::None, Byte, Some(0x00)).range(0, FLAG_MAX),
        row(Register::ASYNC_FLAG, "async_flag", ReadOnly, Byte, Some(0x00)).range(0, FLAG_MAX),
        row(Register::BOARD_TEMPERATURE, "board_temperature", ReadOnly, Byte, Some(0x00)).temperature("board_temperature_c"),
        row(Register::MOTOR_TEMPERATURE, "motor_temperature", ReadOnly, Byte, Some(0x00)).temperature("motor_temperature_c"),
        row(Register::CURRENT_COMMAND, "current_command", ReadOnly, Byte, Some(0x00)),
        row(Register::MAGNETIC_ANGLE, "magnetic_angle", ReadOnly, Word, Some(0x0000)).range(0, FULL_TURN).value("angle_deg", "deg", Coding::Unsigned),
    ]
};
