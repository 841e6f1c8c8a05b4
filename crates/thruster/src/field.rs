//! Ids, command words, byte positions and limits, each written once.

use codec::check_range;

use crate::error::EncodeError;
use crate::node::Node;
use crate::units::{Decidegrees, LimitDecidegrees, Milliseconds, Percent, Rpm};

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
    /// Stop the automatic return of ML and MM (Thruster manual §2.1).
    pub const MQ: u16 = 0x4D51;
    /// Return current and speed every second (Thruster manual §2.1).
    pub const ML: u16 = 0x4D4C;
    /// Return current and speed every 100 ms (Thruster manual §2.1).
    pub const MM: u16 = 0x4D4D;
    /// Change the id (Thruster manual §2.2).
    pub const CI: u16 = 0x4349;
    /// Change the bitrate (Thruster manual §2.2).
    pub const CB: u16 = 0x4342;
    /// Set the communication timeout (Thruster manual §2.3).
    pub const ST: u16 = 0x5354;
    /// Choose what TC and VC return (Thruster manual §2.4).
    pub const VM: u16 = 0x564D;
    /// Choose the stream that starts with power-on (Thruster manual §2.5).
    pub const SR: u16 = 0x5352;
    /// Read all faults since the start (Thruster manual §2.6).
    pub const FR: u16 = 0x4652;
    /// Write a system parameter (Thruster manual §2.7).
    pub const SP: u16 = 0x5350;
    /// Read a system parameter (Thruster manual §2.7).
    pub const RP: u16 = 0x5250;
    /// Move to an absolute position (Thruster manual §4.1).
    pub const LA: u16 = 0x4C41;
    /// Read the absolute position (Thruster manual §4.1).
    pub const QA: u16 = 0x5141;
    /// Make the present position the absolute zero (Thruster manual §4.1).
    pub const AZ: u16 = 0x415A;
    /// Move by a relative position (Thruster manual §4.2).
    pub const LR: u16 = 0x4C52;
    /// Read the relative position (Thruster manual §4.2).
    pub const QR: u16 = 0x5152;
    /// Make the present position the relative zero (Thruster manual §4.2).
    pub const RZ: u16 = 0x525A;
    /// Set the relative position to zero (Thruster manual §4.2).
    pub const RC: u16 = 0x5243;
    /// Emergency stop (Thruster manual §4.3).
    pub const LS: u16 = 0x4C53;

    /// The commands that set something: those a device can refuse (Thruster manual §1.3).
    pub(crate) const SET: [u16; 18] =
        [TC, VC, CF, MQ, ML, MM, CI, CB, ST, VM, SR, SP, LA, AZ, LR, RZ, RC, LS];
    /// The commands among them that carry something in bytes 2–3, a speed or a sub-command.
    pub(crate) const WITH_PARAMETER: [u16; 3] = [LA, LR, SP];
}

/// Sub-command of SP and RP: the limits of the absolute position (Thruster manual §4.1, SPLA and RPLA). The only one
/// the manual explains.
pub const POSITION_LIMITS: u16 = 0x4C41;

/// The signal word of TC, if the manual allows it.
pub(crate) fn signal_word(signal: Percent) -> Result<i16, EncodeError> {
    check_range("signal", i64::from(signal.0), i64::from(SIGNAL_MIN), i64::from(SIGNAL_MAX))?;
    Ok(signal.0)
}

/// The speed word of VC, if the manual allows it and its bytes cannot be taken for a refusal.
pub(crate) fn speed_word(speed: Rpm) -> Result<i16, EncodeError> {
    let [.., high, low] = REFUSAL;
    if speed.0.to_be_bytes() == [high, low] {
        return Err(refusal_bytes("speed", i64::from(speed.0)));
    }
    if speed.0 != 0 && speed.0.unsigned_abs() < SPEED_MIN_MAGNITUDE {
        let reason = "must be 0, or at least 30 rpm in either direction";
        return Err(EncodeError::Forbidden { field: "speed", value: i64::from(speed.0), reason });
    }
    Ok(speed.0)
}

/// The id of CI, if the manual allows it.
pub(crate) fn id_word(id: u16) -> Result<u16, EncodeError> {
    check_range("id", i64::from(id), i64::from(Node::MIN), i64::from(Node::MAX))?;
    Ok(id)
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

/// The sub-command of SP or RP, if it has no variant of its own.
pub(crate) fn raw_parameter(parameter: u16) -> Result<u16, EncodeError> {
    if parameter == POSITION_LIMITS {
        let reason = "this sub-command has a variant of its own";
        return Err(EncodeError::Forbidden { field: "parameter", value: i64::from(parameter), reason });
    }
    Ok(parameter)
}

/// The position of LR, if its bytes cannot be taken for a refusal.
pub(crate) fn relative_position(position: Decidegrees) -> Result<i32, EncodeError> {
    if position.0.to_be_bytes() == REFUSAL {
        return Err(refusal_bytes("position", i64::from(position.0)));
    }
    Ok(position.0)
}

/// The data of SPLA: reverse at most 0, forward at least 0. The manual gives no signs; these are assumed.
pub(crate) fn position_limits(
    reverse: LimitDecidegrees,
    forward: LimitDecidegrees,
) -> Result<[u8; 4], EncodeError> {
    check_range("reverse", i64::from(reverse.0), i64::from(i16::MIN), 0)?;
    check_range("forward", i64::from(forward.0), 0, i64::from(i16::MAX))?;
    Ok(limit_bytes(reverse, forward))
}

/// Two limits as they stand on the wire.
pub(crate) fn limit_bytes(reverse: LimitDecidegrees, forward: LimitDecidegrees) -> [u8; 4] {
    let ([r0, r1], [f0, f1]) = (reverse.0.to_be_bytes(), forward.0.to_be_bytes());
    [r0, r1, f0, f1]
}

/// The two limits in four bytes of the wire.
pub(crate) fn limits_of([r0, r1, f0, f1]: [u8; 4]) -> (LimitDecidegrees, LimitDecidegrees) {
    (LimitDecidegrees(i16::from_be_bytes([r0, r1])), LimitDecidegrees(i16::from_be_bytes([f0, f1])))
}

/// The error for a value whose four data bytes a device uses to refuse.
pub(crate) const fn refusal_bytes(field: &'static str, value: i64) -> EncodeError {
    EncodeError::Forbidden { field, value, reason: "its bytes 00 00 EE EE mean a refusal" }
}
