//! Byte positions and limits of the eight data bytes.

/// Every request and reply has eight data bytes, on CAN and on RS485 (RMD V3.6 §1.1.2, §1.2.2).
pub const DATA_LEN: usize = 8;

/// Lowest acceleration of 0x42 and 0x43, dps/s (RMD V3.6 §2.4.3, §2.5.1).
pub(crate) const ACCELERATION_MIN: u32 = 100;
/// Highest acceleration of 0x42 and 0x43, dps/s (RMD V3.6 §2.4.3, §2.5.1).
pub(crate) const ACCELERATION_MAX: u32 = 60_000;

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

/// Fields of requests. Words are little-endian. A reply that echoes its request has them in the same places.
pub(crate) mod request {
    use super::Field;

    /// 0x31 and 0x32 gains (RMD V3.6 §2.2.2); the reply to 0x30 too.
    pub(crate) const GAINS: Field<2, 6> = Field;
    /// Index of 0x20 and 0x43 (RMD V3.6 §2.5.2, §2.33.2).
    pub(crate) const INDEX: Field<1, 1> = Field;
    /// 0x43 acceleration, u32 (RMD V3.6 §2.5.2); the reply to 0x42 too.
    pub(crate) const ACCELERATION: Field<4, 4> = Field;
    /// 0x63 encoder offset, i32 (RMD V3.6 §2.9.2). The table shifts its last two bytes by 8, a misprint.
    pub(crate) const ENCODER_OFFSET: Field<4, 4> = Field;
    /// 0xA1 torque current, i16 (RMD V3.6 §2.17.2).
    pub(crate) const CURRENT: Field<4, 2> = Field;
    /// 0xA2 speed, i32 (RMD V3.6 §2.18.2).
    pub(crate) const SPEED: Field<4, 4> = Field;
    /// 0xA4, 0xA5 and 0xA8 speed limit, u16 (RMD V3.6 §2.20.2).
    pub(crate) const MAX_SPEED: Field<2, 2> = Field;
    /// 0xA3, 0xA4, 0xA5 and 0xA8 angle, i32 (RMD V3.6 §2.20.2).
    pub(crate) const ANGLE: Field<4, 4> = Field;
    /// 0xB3 timeout, u32 (RMD V3.6 §2.30.2).
    pub(crate) const TIMEOUT: Field<4, 4> = Field;
    /// 0xB4 baud code (RMD V3.6 §2.31.2).
    pub(crate) const BAUD_CODE: Field<7, 1> = Field;
    /// 0x20 value, u32 (RMD V3.6 §2.33.2).
    pub(crate) const FUNCTION_VALUE: Field<4, 4> = Field;
}

/// Fields of replies. Words are little-endian.
pub(crate) mod reply {
    use super::Field;

    /// 0x60, 0x61, 0x62 and 0x64 encoder pulses, i32 (RMD V3.6 §2.6.3).
    pub(crate) const PULSES: Field<4, 4> = Field;
    /// 0x92 angle, i32 (RMD V3.6 §2.11.3).
    pub(crate) const MULTI_TURN_ANGLE: Field<4, 4> = Field;
    /// Temperature, i8, in 0x9A, 0x9C, 0x9D and motion replies (RMD V3.6 §2.12.3, §2.13.3).
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
    /// 0x9D current of phase A, i16 (RMD V3.6 §2.14.3).
    pub(crate) const PHASE_A: Field<2, 2> = Field;
    /// 0x9D current of phase B, i16 (RMD V3.6 §2.14.3).
    pub(crate) const PHASE_B: Field<4, 2> = Field;
    /// 0x9D current of phase C, i16 (RMD V3.6 §2.14.3).
    pub(crate) const PHASE_C: Field<6, 2> = Field;
    /// 0x70 run mode (RMD V3.6 §2.23.3).
    pub(crate) const RUN_MODE: Field<7, 1> = Field;
    /// 0x71 power, u16 (RMD V3.6 §2.24.3).
    pub(crate) const POWER: Field<6, 2> = Field;
    /// 0xB1 run time, u32 (RMD V3.6 §2.28.3).
    pub(crate) const RUN_TIME: Field<4, 4> = Field;
    /// 0xB2 version date, u32 (RMD V3.6 §2.29.3).
    pub(crate) const VERSION_DATE: Field<4, 4> = Field;
    /// 0xB5 model, seven characters (RMD V3.6 §2.32.3); 0xB4 answers with seven bytes of no meaning (§2.31.3).
    pub(crate) const AFTER_COMMAND: Field<1, 7> = Field;

    /// Value of [`BRAKE`] while the brake is locked.
    pub(crate) const BRAKE_LOCKED: u8 = 0;
    /// Value of [`BRAKE`] while the brake is released.
    pub(crate) const BRAKE_RELEASED: u8 = 1;
    /// [`ANGLE`] is symmetric: −32768 is not in the manual's range (RMD V3.6 §2.13.3).
    pub(crate) const ANGLE_MIN: i16 = -32767;
    /// Upper end of [`ANGLE`] (RMD V3.6 §2.13.3).
    pub(crate) const ANGLE_MAX: i16 = 32767;
}
