//! Motion mode: position, velocity, two gains and a torque in one frame, on CAN only (RMD V3.6 §5).
//!
//! The words stay raw here; [`MotionRanges`] turns them into physical values and back. Both ways
//! differ as the manual prints them, so a decoded physical value must not be encoded again.

mod ranges;

use core::convert::Infallible;

use codec::{BuildError, Decode, Encode, FieldInfo, Fields, Visit, check_range};

use self::ranges::{ID, KD, KP, POSITION, RAW_12_MAX, TORQUE, VELOCITY};
pub use self::ranges::{MotionRanges, MotionState, MotionTarget, Span};
use crate::error::EncodeError;
use crate::field::DATA_LEN;
use crate::payload::Payload;

const NIBBLE: u32 = 4;
const LOW_NIBBLE: u8 = 0x0F;

/// The words of a motion-mode request, big-endian and packed without gaps (RMD V3.6 §5.2).
///
/// What the table calls bits 0 to 3 is the high half of a byte: the printed example proves it
/// (§5.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MotionCommand {
    /// Position, all 16 bits.
    pub position: u16,
    /// Velocity, 0..=4095.
    pub velocity: u16,
    /// Gain of the position error, 0..=4095.
    pub kp: u16,
    /// Gain of the velocity error, 0..=4095.
    pub kd: u16,
    /// Torque in addition, 0..=4095.
    pub torque: u16,
}

/// The words of a motion-mode reply (RMD V3.6 §5.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionFeedback {
    /// The motor's id as it stands in the data; the CAN id names it as well.
    pub id: u8,
    /// Position, all 16 bits.
    pub position: u16,
    /// Velocity, 0..=4095.
    pub velocity: u16,
    /// Torque, 0..=4095.
    pub torque: u16,
}

impl MotionCommand {
    /// No torque, no gain, and the middle of every range: asks the motor for nothing.
    ///
    /// Eight zero bytes are the lower end of every range instead, at full negative torque.
    pub const NEUTRAL: MotionCommand =
        MotionCommand { position: 0x8000, velocity: 0x800, kp: 0, kd: 0, torque: 0x800 };

    pub(crate) const FIELDS: &[FieldInfo] = &[POSITION, VELOCITY, KP, KD, TORQUE];

    /// In the manual's ranges.
    pub(crate) fn build(fields: &Fields<'_>) -> Result<MotionCommand, BuildError> {
        MotionRanges::DEFAULT.command(&MotionTarget::build(fields)?)
    }

    /// In the manual's ranges.
    pub(crate) fn visit(&self, visit: &mut Visit<'_>) {
        MotionRanges::DEFAULT.target(self).visit(visit);
    }
}

impl Decode<Payload> for MotionCommand {
    fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<MotionCommand, Infallible> {
        let [p1, p0, v1, v0_kp1, kp0, kd1, kd0_t1, t0] = *data;
        Ok(MotionCommand {
            position: u16::from_be_bytes([p1, p0]),
            velocity: high_12(v1, v0_kp1),
            kp: low_12(v0_kp1, kp0),
            kd: high_12(kd1, kd0_t1),
            torque: low_12(kd0_t1, t0),
        })
    }
}

impl Encode<Payload> for MotionCommand {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        let [p1, p0] = self.position.to_be_bytes();
        let [v1, v0_kp1, kp0] = pair_12(self.velocity, self.kp);
        let [kd1, kd0_t1, t0] = pair_12(self.kd, self.torque);
        *data = [p1, p0, v1, v0_kp1, kp0, kd1, kd0_t1, t0];
    }

    fn check(&self) -> Result<(), EncodeError> {
        check_12("velocity", self.velocity)?;
        check_12("kp", self.kp)?;
        check_12("kd", self.kd)?;
        check_12("torque", self.torque)
    }
}

impl MotionFeedback {
    pub(crate) const SHOWN: &[FieldInfo] = &[ID, POSITION, VELOCITY, TORQUE];

    /// In the manual's ranges.
    pub(crate) fn visit(&self, visit: &mut Visit<'_>) {
        MotionRanges::DEFAULT.state(self).visit(self.id, visit);
    }
}

impl Decode<Payload> for MotionFeedback {
    fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<MotionFeedback, Infallible> {
        let [id, p1, p0, v1, v0_t1, t0, _, _] = *data;
        Ok(MotionFeedback {
            id,
            position: u16::from_be_bytes([p1, p0]),
            velocity: high_12(v1, v0_t1),
            torque: low_12(v0_t1, t0),
        })
    }
}

impl Encode<Payload> for MotionFeedback {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        let [p1, p0] = self.position.to_be_bytes();
        let [v1, v0_t1, t0] = pair_12(self.velocity, self.torque);
        *data = [self.id, p1, p0, v1, v0_t1, t0, 0, 0];
    }

    fn check(&self) -> Result<(), EncodeError> {
        check_12("velocity", self.velocity)?;
        check_12("torque", self.torque)
    }
}

fn check_12(field: &'static str, word: u16) -> Result<(), EncodeError> {
    check_range(field, i64::from(word), 0, i64::from(RAW_12_MAX))
}

/// The first 12 bits of three half bytes and one more.
fn high_12(high: u8, low: u8) -> u16 {
    u16::from_be_bytes([high, low]) >> NIBBLE
}

/// The last 12 bits of one half byte more and three.
fn low_12(high: u8, low: u8) -> u16 {
    u16::from_be_bytes([high & LOW_NIBBLE, low])
}

/// Two words of 12 bits in three bytes.
fn pair_12(first: u16, second: u16) -> [u8; 3] {
    let [first_1, first_0] = (first << NIBBLE).to_be_bytes();
    let [second_1, second_0] = second.to_be_bytes();
    [first_1, first_0 | (second_1 & LOW_NIBBLE), second_0]
}
