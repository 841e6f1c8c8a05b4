//! Ids, byte positions and limits, each written once, and the checks that no range expresses.

use codec::check_range;

use crate::error::EncodeError;
use crate::returned::{ReturnFlags, ReturnFrames};
use crate::units::{Milliseconds, Rpm};

/// Standard id of a request is this plus the node (Thruster manual §1.1: RPDO, function code 0110).
pub const REQUEST_ID_BASE: u16 = 0x300;
/// Standard id of a reply is this plus the node (Thruster manual §1.1: TPDO, function code 0101).
pub const REPLY_ID_BASE: u16 = 0x280;

/// Lowest signal in percent (Thruster manual §2.1).
pub const SIGNAL_MIN: i16 = -100;
/// Highest signal in percent (Thruster manual §2.1).
pub const SIGNAL_MAX: i16 = 100;
/// Lowest speed in rpm, in either direction, of a set speed that is not 0 (Thruster manual §2.1).
pub const SPEED_MIN_MAGNITUDE: u16 = 30;
/// The timeout value that switches the timeout off (Thruster manual §2.3).
pub const TIMEOUT_OFF: u16 = 0;
/// Shortest timeout in ms (Thruster manual §2.3).
pub const TIMEOUT_MIN: u16 = 100;
/// Longest timeout in ms (Thruster manual §2.3).
pub const TIMEOUT_MAX: u16 = 60_000;
/// Lowest absolute position in 0.1° (Thruster manual §4.1).
pub const POSITION_MIN: i32 = -1799;
/// Highest absolute position in 0.1° (Thruster manual §4.1).
pub const POSITION_MAX: i32 = 1799;

/// Offset of the sub-command or, in a position command, of the speed.
pub(crate) const PARAMETER: usize = 2;
/// Offset of the carried data.
pub(crate) const DATA: usize = 4;
/// Offset of a word of 16 bits that is carried alone.
pub(crate) const LOWER_HALF: usize = 6;
/// Length of a data field that carries no data (Thruster manual §1.2).
pub(crate) const SHORT_LEN: usize = 4;
/// Length of a data field that carries data (Thruster manual §1.2).
pub(crate) const FULL_LEN: usize = 8;
/// The data of a reply that refuses a set command (Thruster manual §1.3).
pub(crate) const REFUSAL: [u8; 4] = [0x00, 0x00, 0xEE, 0xEE];

/// Sub-command of SP and RP: the limits of the absolute position (Thruster manual §4.1, SPLA and
/// RPLA). The only one the manual explains.
pub const POSITION_LIMITS: u16 = 0x4C41;

/// Refuses a speed of VC that the manual does not allow.
pub(crate) fn set_speed(speed: Rpm) -> Result<(), EncodeError> {
    if speed.0 != 0 && speed.0.unsigned_abs() < SPEED_MIN_MAGNITUDE {
        let reason = "must be 0, or at least 30 rpm in either direction";
        return Err(EncodeError::Forbidden { field: "speed", value: i64::from(speed.0), reason });
    }
    Ok(())
}

/// Refuses a timeout of ST that is neither off nor within the manual's range.
pub(crate) fn set_timeout(timeout: Milliseconds) -> Result<(), EncodeError> {
    if timeout.0 == TIMEOUT_OFF {
        return Ok(());
    }
    check_range("timeout", i64::from(timeout.0), i64::from(TIMEOUT_MIN), i64::from(TIMEOUT_MAX))
}

/// Refuses a sub-command of SP or RP that has a variant of its own.
pub(crate) fn raw_parameter(parameter: u16) -> Result<(), EncodeError> {
    if parameter == POSITION_LIMITS {
        let reason = "this sub-command has a variant of its own";
        return Err(EncodeError::Forbidden {
            field: "parameter",
            value: i64::from(parameter),
            reason,
        });
    }
    Ok(())
}

/// Refuses to set what the manual reserves.
pub(crate) fn named_flags(flags: ReturnFlags) -> Result<(), EncodeError> {
    no_reserved_bits("flags", flags.bits(), ReturnFlags::all().bits())
}

/// Refuses to set what the manual reserves.
pub(crate) fn named_frames(frames: ReturnFrames) -> Result<(), EncodeError> {
    no_reserved_bits("frames", frames.bits(), ReturnFrames::all().bits())
}

fn no_reserved_bits(field: &'static str, bits: u8, named: u8) -> Result<(), EncodeError> {
    if bits & !named == 0 {
        return Ok(());
    }
    Err(EncodeError::Forbidden { field, value: i64::from(bits), reason: "sets a reserved bit" })
}
