//! Command codes, byte positions and limits of the eight data bytes.

use crate::error::EncodeError;

/// Every request and reply has eight data bytes, on CAN and on RS485 (RMD V3.6 §1.1.2, §1.2.2).
pub const DATA_LEN: usize = 8;

/// Command codes: data byte 0 of a request and of its reply.
pub mod command {
    use core::ops::RangeInclusive;

    /// Release the brake (RMD V3.6 §2.26).
    pub const RELEASE_BRAKE: u8 = 0x77;
    /// Lock the brake (RMD V3.6 §2.27).
    pub const LOCK_BRAKE: u8 = 0x78;
    /// Switch the output off (RMD V3.6 §2.15).
    pub const SHUTDOWN: u8 = 0x80;
    /// Stop and hold (RMD V3.6 §2.16).
    pub const STOP: u8 = 0x81;
    /// Read the multi-turn angle (RMD V3.6 §2.11).
    pub const READ_MULTI_TURN_ANGLE: u8 = 0x92;
    /// Read temperature, brake, voltage and the error word (RMD V3.6 §2.12).
    pub const READ_STATUS_1: u8 = 0x9A;
    /// Read temperature, current, speed and angle (RMD V3.6 §2.13).
    pub const READ_STATUS_2: u8 = 0x9C;
    /// Torque current control (RMD V3.6 §2.17).
    pub const TORQUE_CURRENT: u8 = 0xA1;
    /// Velocity control (RMD V3.6 §2.18).
    pub const VELOCITY: u8 = 0xA2;
    /// Absolute position control with a speed limit (RMD V3.6 §2.20).
    pub const ABSOLUTE_POSITION: u8 = 0xA4;
    /// The closed-loop commands, 0xA1 to 0xA8 (RMD V3.6 §2.17 to §2.22): the ones that move the motor.
    pub const CLOSED_LOOP: RangeInclusive<u8> = 0xA1..=0xA8;
    /// Set the motor's communication timeout (RMD V3.6 §2.30).
    pub const SET_COMMUNICATION_TIMEOUT: u8 = 0xB3;
    /// Sent by some motors, unasked, once their communication timeout has struck. Not in the manual.
    pub const TIMEOUT_NOTICE: u8 = 0xF1;
}

/// The `N` data bytes from byte `AT` on.
///
/// A position outside the data does not compile, so reading and writing cannot fail.
#[derive(Clone, Copy)]
pub(crate) struct Field<const AT: usize, const N: usize>;

impl<const AT: usize, const N: usize> Field<AT, N> {
    const FITS: () = assert!(AT + N <= DATA_LEN);

    pub(crate) fn get(self, data: &[u8; DATA_LEN]) -> [u8; N] {
        let () = Self::FITS;
        let mut bytes = [0; N];
        for (byte, received) in bytes.iter_mut().zip(data.iter().skip(AT)) {
            *byte = *received;
        }
        bytes
    }

    pub(crate) fn put(self, data: &mut [u8; DATA_LEN], bytes: [u8; N]) {
        let () = Self::FITS;
        for (place, byte) in data.iter_mut().skip(AT).zip(bytes) {
            *place = byte;
        }
    }
}

/// Fields of requests. Words are little-endian.
pub(crate) mod request {
    use super::Field;

    /// 0xA1 torque current, i16 (RMD V3.6 §2.17.2).
    pub(crate) const CURRENT: Field<4, 2> = Field;
    /// 0xA2 speed, i32 (RMD V3.6 §2.18.2).
    pub(crate) const SPEED: Field<4, 4> = Field;
    /// 0xA4 speed limit, u16 (RMD V3.6 §2.20.2).
    pub(crate) const MAX_SPEED: Field<2, 2> = Field;
    /// 0xA4 angle, i32 (RMD V3.6 §2.20.2).
    pub(crate) const ANGLE: Field<4, 4> = Field;
    /// 0xB3 timeout, u32 (RMD V3.6 §2.30.2); its reply has the same place.
    pub(crate) const TIMEOUT: Field<4, 4> = Field;
}

/// Fields of replies. Words are little-endian.
pub(crate) mod reply {
    use super::Field;

    /// 0x92 angle, i32 (RMD V3.6 §2.11.3).
    pub(crate) const MULTI_TURN_ANGLE: Field<4, 4> = Field;
    /// Temperature, i8, in 0x9A, 0x9C and motion replies (RMD V3.6 §2.12.3, §2.13.3).
    pub(crate) const TEMPERATURE: Field<1, 1> = Field;
    /// 0x9A brake: 0 locked, 1 released (RMD V3.6 §2.12.3).
    pub(crate) const BRAKE: Field<3, 1> = Field;
    /// 0x9A voltage, u16 (RMD V3.6 §2.12.3).
    pub(crate) const VOLTAGE: Field<4, 2> = Field;
    /// 0x9A error word, u16 (RMD V3.6 §2.12.3).
    pub(crate) const FAULTS: Field<6, 2> = Field;
    /// Torque current, i16, in motion replies (RMD V3.6 §2.13.3).
    pub(crate) const CURRENT: Field<2, 2> = Field;
    /// Speed, i16, in motion replies (RMD V3.6 §2.13.3).
    pub(crate) const SPEED: Field<4, 2> = Field;
    /// Angle, i16, in motion replies (RMD V3.6 §2.13.3).
    pub(crate) const ANGLE: Field<6, 2> = Field;

    /// Value of [`BRAKE`] while the brake is locked.
    pub(crate) const BRAKE_LOCKED: u8 = 0;
    /// Value of [`BRAKE`] while the brake is released.
    pub(crate) const BRAKE_RELEASED: u8 = 1;
    /// [`ANGLE`] is symmetric: −32768 is not in the manual's range (RMD V3.6 §2.13.3).
    pub(crate) const ANGLE_MIN: i16 = -32767;
    /// Upper end of [`ANGLE`] (RMD V3.6 §2.13.3).
    pub(crate) const ANGLE_MAX: i16 = 32767;
}

/// Refuses a value outside `min..=max`.
pub(crate) const fn check_range(
    field: &'static str,
    value: i64,
    min: i64,
    max: i64,
) -> Result<(), EncodeError> {
    if value < min || value > max {
        return Err(EncodeError::OutOfRange { field, value, min, max });
    }
    Ok(())
}
