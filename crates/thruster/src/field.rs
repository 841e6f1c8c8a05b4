//! Ids, command words, byte positions and limits, each written once.

use crate::error::EncodeError;
use crate::units::{Decidegrees, Milliseconds, Percent, Rpm};

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
/// Length of a data field that carries no data (Thruster manual §1.2).
pub(crate) const SHORT_LEN: usize = 4;
/// Length of a data field that carries data (Thruster manual §1.2).
pub(crate) const FULL_LEN: usize = 8;
/// The data of a reply that refuses a set command (Thruster manual §1.3).
pub(crate) const REFUSAL: [u8; 4] = [0x00, 0x00, 0xEE, 0xEE];

/// Command words: the first two bytes of every data field, two ASCII letters.
pub mod command {
    /// Set the signal in percent (Thruster manual §2.1).
    pub const TC: u16 = 0x5443;
    /// Set the speed in rpm (Thruster manual §2.1).
    pub const VC: u16 = 0x5643;
    /// Read the speed (Thruster manual §2.1).
    pub const QV: u16 = 0x5156;
    /// Read the current (Thruster manual §2.1).
    pub const QC: u16 = 0x5143;
    /// Read the voltage (Thruster manual §2.1).
    pub const QP: u16 = 0x5150;
    /// Read the motor temperature (Thruster manual §2.1).
    pub const QT: u16 = 0x5154;
    /// Read the driver temperature (Thruster manual §2.1).
    pub const EQ: u16 = 0x4551;
    /// Read the present faults (Thruster manual §2.1, §3).
    pub const EF: u16 = 0x4546;
    /// Clear the faults (Thruster manual §2.1).
    pub const CF: u16 = 0x4346;
    /// Read all faults since the start (Thruster manual §2.6).
    pub const FR: u16 = 0x4652;
    /// Set the communication timeout (Thruster manual §2.3).
    pub const ST: u16 = 0x5354;
    /// Move to an absolute position (Thruster manual §4.1).
    pub const LA: u16 = 0x4C41;
    /// Read the absolute position (Thruster manual §4.1).
    pub const QA: u16 = 0x5141;
    /// Emergency stop (Thruster manual §4.3).
    pub const LS: u16 = 0x4C53;

    /// Every command that has a variant of its own.
    pub(crate) const NAMED: [u16; 14] = [TC, VC, QV, QC, QP, QT, EQ, EF, CF, FR, ST, LA, QA, LS];
    /// The commands among them that a device can refuse.
    pub(crate) const SET: [u16; 6] = [TC, VC, CF, ST, LA, LS];
}

/// Refuses a value outside `min..=max`.
pub(crate) const fn check_range(
    field: &'static str,
    value: i64,
    min: i64,
    max: i64,
) -> Result<(), EncodeError> {
    if min <= value && value <= max {
        Ok(())
    } else {
        Err(EncodeError::OutOfRange { field, value, min, max })
    }
}

/// The signal word of TC, if the manual allows it.
pub(crate) fn signal_word(signal: Percent) -> Result<i16, EncodeError> {
    check_range("signal", i64::from(signal.0), i64::from(SIGNAL_MIN), i64::from(SIGNAL_MAX))?;
    Ok(signal.0)
}

/// The speed word of VC, if the manual allows it and its bytes cannot be taken for a refusal.
pub(crate) fn speed_word(speed: Rpm) -> Result<i16, EncodeError> {
    let [.., high, low] = REFUSAL;
    let reason = if speed.0.to_be_bytes() == [high, low] {
        "its bytes EE EE mean a refusal"
    } else if speed.0 != 0 && speed.0.unsigned_abs() < SPEED_MIN_MAGNITUDE {
        "must be 0, or at least 30 rpm in either direction"
    } else {
        return Ok(speed.0);
    };
    Err(EncodeError::Forbidden { field: "speed", value: i64::from(speed.0), reason })
}

/// The timeout word of ST: off, or within the manual's range.
pub(crate) fn timeout_word(timeout: Milliseconds) -> Result<u16, EncodeError> {
    if timeout.0 != TIMEOUT_OFF {
        check_range("timeout", i64::from(timeout.0), i64::from(TIMEOUT_MIN), i64::from(TIMEOUT_MAX))?;
    }
    Ok(timeout.0)
}

/// The position of LA, if the manual allows it.
pub(crate) fn absolute_position(position: Decidegrees) -> Result<i32, EncodeError> {
    check_range("position", i64::from(position.0), i64::from(POSITION_MIN), i64::from(POSITION_MAX))?;
    Ok(position.0)
}
