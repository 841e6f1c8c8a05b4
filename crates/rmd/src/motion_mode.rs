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

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn both_ways<T: Decode<Payload> + Encode<Payload> + PartialEq + core::fmt::Debug>(
        words: T,
        bytes: [u8; 8],
    ) {
        let mut data = [0; 8];
        words.put::<0>(&mut data);
        assert_eq!(data, bytes);
        assert!(T::get::<0>(&data).is_ok_and(|got| got == words));
    }

    const COMMAND: MotionCommand =
        MotionCommand { position: 0xE666, velocity: 0x82E, kp: 0x052, kd: 0x333, torque: 0xB55 };

    /// RMD V3.6 §5.4, request.
    #[test]
    fn printed_request() {
        let data = [0xE6, 0x66, 0x82, 0xE0, 0x52, 0x33, 0x3B, 0x55];
        both_ways(COMMAND, data);
        assert_eq!(COMMAND.check(), Ok(()));
    }

    /// RMD V3.6 §5.4, reply: the bytes say E6 65 where the text says E666, and the row of byte 3 is
    /// missing.
    #[test]
    fn printed_reply() {
        let data = [0x01, 0xE6, 0x65, 0x82, 0xEB, 0x55, 0x00, 0x00];
        let feedback = MotionFeedback { id: 1, position: 0xE665, velocity: 0x82E, torque: 0xB55 };
        both_ways(feedback, data);
        assert_eq!(feedback.check(), Ok(()));
    }

    /// Each word alone at its end, so that no word reaches into its neighbour (layout RMD V3.6
    /// §5.2, §5.3).
    #[test]
    fn every_word_has_its_own_bits() {
        let zero = MotionCommand { position: 0, velocity: 0, kp: 0, kd: 0, torque: 0 };
        let rows = [
            (zero, [0, 0, 0, 0, 0, 0, 0, 0]),
            (MotionCommand { position: 0xFFFF, ..zero }, [0xFF, 0xFF, 0, 0, 0, 0, 0, 0]),
            (MotionCommand { velocity: 0xFFF, ..zero }, [0, 0, 0xFF, 0xF0, 0, 0, 0, 0]),
            (MotionCommand { kp: 0xFFF, ..zero }, [0, 0, 0, 0x0F, 0xFF, 0, 0, 0]),
            (MotionCommand { kd: 0xFFF, ..zero }, [0, 0, 0, 0, 0, 0xFF, 0xF0, 0]),
            (MotionCommand { torque: 0xFFF, ..zero }, [0, 0, 0, 0, 0, 0, 0x0F, 0xFF]),
            (MotionCommand::NEUTRAL, [0x80, 0x00, 0x80, 0x00, 0x00, 0x00, 0x08, 0x00]),
        ];
        for (command, data) in rows {
            both_ways(command, data);
        }
        let zero = MotionFeedback { id: 0, position: 0, velocity: 0, torque: 0 };
        let rows = [
            (MotionFeedback { id: 0xFF, ..zero }, [0xFF, 0, 0, 0, 0, 0, 0, 0]),
            (MotionFeedback { position: 0xFFFF, ..zero }, [0, 0xFF, 0xFF, 0, 0, 0, 0, 0]),
            (MotionFeedback { velocity: 0xFFF, ..zero }, [0, 0, 0, 0xFF, 0xF0, 0, 0, 0]),
            (MotionFeedback { torque: 0xFFF, ..zero }, [0, 0, 0, 0, 0x0F, 0xFF, 0, 0]),
        ];
        for (feedback, data) in rows {
            both_ways(feedback, data);
        }
    }

    #[test]
    fn words_wider_than_their_bits_are_refused() {
        let refused =
            |field| Err(EncodeError::OutOfRange { field, value: 0x1000, min: 0, max: 0xFFF });
        assert_eq!(MotionCommand { velocity: 0x1000, ..COMMAND }.check(), refused("velocity"));
        assert_eq!(MotionCommand { kp: 0x1000, ..COMMAND }.check(), refused("kp"));
        assert_eq!(MotionCommand { kd: 0x1000, ..COMMAND }.check(), refused("kd"));
        assert_eq!(MotionCommand { torque: 0x1000, ..COMMAND }.check(), refused("torque"));
        let feedback = MotionFeedback { id: 1, position: 0, velocity: 0x1000, torque: 0 };
        assert_eq!(feedback.check(), refused("velocity"));
    }
}
