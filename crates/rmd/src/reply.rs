//! What the motor sends: the data bytes of each reply and of the timeout notice.

use crate::error::{DecodeError, EncodeError};
use crate::faults::Faults;
use crate::field::{self, DATA_LEN, check_range, command, reply};
use crate::notice::RawNotice;
use crate::units::{Celsius, Centiamps, Centidegrees, Decivolts, Degrees, DegreesPerSecond, Milliseconds};

/// State in the replies to 0x9C and to the closed-loop commands (RMD V3.6 §2.13.3, §2.17.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Motion {
    /// Motor temperature.
    pub temperature: Celsius,
    /// Measured torque current.
    pub current: Centiamps,
    /// Measured speed of the output shaft.
    pub speed: DegreesPerSecond,
    /// Angle of the output shaft from the zero point, −32767..=32767.
    pub angle: Degrees,
}

/// One frame from one motor.
///
/// Bytes the manual calls NULL are sent as zero; when received with another value they are passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply {
    /// 0x92: the multi-turn angle (RMD V3.6 §2.11.3).
    MultiTurnAngle {
        /// Angle of the output shaft from the zero point.
        angle: Centidegrees,
    },
    /// 0x9A, also sent unasked while a fault stands if so configured (RMD V3.6 §2.12.3, §2.33.4).
    Status1 {
        /// Motor temperature.
        temperature: Celsius,
        /// Whether the brake is commanded open. Only a wire value of 0 counts as locked.
        brake_released: bool,
        /// Supply voltage.
        voltage: Decivolts,
        /// Error word with all its bits.
        faults: Faults,
    },
    /// 0x9C: motion state (RMD V3.6 §2.13.3).
    Status2 {
        /// The state read.
        motion: Motion,
    },
    /// 0x80 received; an echo (RMD V3.6 §2.15.3).
    Shutdown,
    /// 0x81 received; an echo that proves receipt, not standstill (RMD V3.6 §2.16.3).
    Stop,
    /// 0xA1 received (RMD V3.6 §2.17.3).
    TorqueCurrent {
        /// The state at that moment.
        motion: Motion,
    },
    /// 0xA2 received (RMD V3.6 §2.18.3).
    Velocity {
        /// The state at that moment.
        motion: Motion,
    },
    /// 0xA4 received (RMD V3.6 §2.20.3).
    AbsolutePosition {
        /// The state at that moment.
        motion: Motion,
    },
    /// 0x77 received; an echo, 50 to 150 ms after the request on observed motors (RMD V3.6 §2.26.3).
    BrakeReleased,
    /// 0x78 received; an echo (RMD V3.6 §2.27.3).
    BrakeLocked,
    /// 0xB3 received. §2.30.3 says echo, example 2 of §2.30.4 prints all zero: both occur.
    CommunicationTimeout {
        /// The timeout echoed, or 0.
        timeout: Milliseconds,
    },
    /// 0xF1: an event some motors send every second after their communication timeout has struck. Answers nothing.
    TimeoutNotice {
        /// What followed the command byte, if anything.
        raw: RawNotice,
    },
    /// The reply to any other command.
    Unknown {
        /// The data bytes as received, the command byte first.
        data: [u8; DATA_LEN],
    },
}

impl Motion {
    fn decode(data: &[u8; DATA_LEN]) -> Motion {
        Motion {
            temperature: Celsius(i8::from_le_bytes(reply::TEMPERATURE.get(data))),
            current: Centiamps(i16::from_le_bytes(reply::CURRENT.get(data))),
            speed: DegreesPerSecond(i16::from_le_bytes(reply::SPEED.get(data))),
            angle: Degrees(i16::from_le_bytes(reply::ANGLE.get(data))),
        }
    }

    fn put(self, data: &mut [u8; DATA_LEN]) {
        reply::TEMPERATURE.put(data, self.temperature.0.to_le_bytes());
        reply::CURRENT.put(data, self.current.0.to_le_bytes());
        reply::SPEED.put(data, self.speed.0.to_le_bytes());
        reply::ANGLE.put(data, self.angle.0.to_le_bytes());
    }

    fn check(&self) -> Result<(), EncodeError> {
        let angle = i64::from(self.angle.0);
        check_range("angle", angle, i64::from(reply::ANGLE_MIN), i64::from(reply::ANGLE_MAX))
    }
}

impl Reply {
    /// The command code: data byte 0.
    pub const fn command(&self) -> u8 {
        match self {
            Reply::MultiTurnAngle { .. } => command::READ_MULTI_TURN_ANGLE,
            Reply::Status1 { .. } => command::READ_STATUS_1,
            Reply::Status2 { .. } => command::READ_STATUS_2,
            Reply::Shutdown => command::SHUTDOWN,
            Reply::Stop => command::STOP,
            Reply::TorqueCurrent { .. } => command::TORQUE_CURRENT,
            Reply::Velocity { .. } => command::VELOCITY,
            Reply::AbsolutePosition { .. } => command::ABSOLUTE_POSITION,
            Reply::BrakeReleased => command::RELEASE_BRAKE,
            Reply::BrakeLocked => command::LOCK_BRAKE,
            Reply::CommunicationTimeout { .. } => command::SET_COMMUNICATION_TIMEOUT,
            Reply::TimeoutNotice { .. } => command::TIMEOUT_NOTICE,
            Reply::Unknown { data: [command, ..] } => *command,
        }
    }

    /// The eight data bytes; a short timeout notice is filled up with zeros.
    ///
    /// Refused are a motion angle of −32768 and a [`Reply::Unknown`] whose command has a variant of its own.
    pub fn encode(&self) -> Result<[u8; DATA_LEN], EncodeError> {
        match self {
            Reply::Status2 { motion }
            | Reply::TorqueCurrent { motion }
            | Reply::Velocity { motion }
            | Reply::AbsolutePosition { motion } => motion.check()?,
            Reply::Unknown { data } if !matches!(Reply::decode_full(data), Reply::Unknown { .. }) => {
                return Err(EncodeError::Forbidden {
                    field: "command",
                    value: i64::from(self.command()),
                    reason: "this command has a reply of its own",
                });
            }
            _ => {}
        }
        Ok(self.to_bytes())
    }

    /// The reply that a frame's data bytes hold: eight of them, except that a timeout notice may be shorter.
    pub fn decode(data: &[u8]) -> Result<Reply, DecodeError> {
        if let Ok(data) = <&[u8; DATA_LEN]>::try_from(data) {
            return Ok(Reply::decode_full(data));
        }
        if let [command::TIMEOUT_NOTICE, payload @ ..] = data
            && let Ok(raw) = RawNotice::new(payload)
        {
            return Ok(Reply::TimeoutNotice { raw });
        }
        Err(DecodeError::Length { got: data.len(), expected: DATA_LEN })
    }

    /// The reply that eight data bytes hold.
    pub(crate) fn decode_full(data: &[u8; DATA_LEN]) -> Reply {
        let [command, payload @ ..] = data;
        match *command {
            command::READ_MULTI_TURN_ANGLE => Reply::MultiTurnAngle {
                angle: Centidegrees(i32::from_le_bytes(reply::MULTI_TURN_ANGLE.get(data))),
            },
            command::READ_STATUS_1 => Reply::Status1 {
                temperature: Celsius(i8::from_le_bytes(reply::TEMPERATURE.get(data))),
                brake_released: reply::BRAKE.get(data) != [reply::BRAKE_LOCKED],
                voltage: Decivolts(u16::from_le_bytes(reply::VOLTAGE.get(data))),
                faults: Faults::from_bits_retain(u16::from_le_bytes(reply::FAULTS.get(data))),
            },
            command::READ_STATUS_2 => Reply::Status2 { motion: Motion::decode(data) },
            command::SHUTDOWN => Reply::Shutdown,
            command::STOP => Reply::Stop,
            command::TORQUE_CURRENT => Reply::TorqueCurrent { motion: Motion::decode(data) },
            command::VELOCITY => Reply::Velocity { motion: Motion::decode(data) },
            command::ABSOLUTE_POSITION => Reply::AbsolutePosition { motion: Motion::decode(data) },
            command::RELEASE_BRAKE => Reply::BrakeReleased,
            command::LOCK_BRAKE => Reply::BrakeLocked,
            command::SET_COMMUNICATION_TIMEOUT => Reply::CommunicationTimeout {
                timeout: Milliseconds(u32::from_le_bytes(field::request::TIMEOUT.get(data))),
            },
            command::TIMEOUT_NOTICE => match RawNotice::new(payload) {
                Ok(raw) => Reply::TimeoutNotice { raw },
                Err(_) => Reply::Unknown { data: *data },
            },
            _ => Reply::Unknown { data: *data },
        }
    }

    /// The data bytes, whether or not they may be sent.
    pub(crate) fn to_bytes(self) -> [u8; DATA_LEN] {
        let mut data = [self.command(), 0, 0, 0, 0, 0, 0, 0];
        match self {
            Reply::Shutdown | Reply::Stop | Reply::BrakeReleased | Reply::BrakeLocked => {}
            Reply::MultiTurnAngle { angle } => reply::MULTI_TURN_ANGLE.put(&mut data, angle.0.to_le_bytes()),
            Reply::Status1 { temperature, brake_released, voltage, faults } => {
                let brake = if brake_released { reply::BRAKE_RELEASED } else { reply::BRAKE_LOCKED };
                reply::TEMPERATURE.put(&mut data, temperature.0.to_le_bytes());
                reply::BRAKE.put(&mut data, [brake]);
                reply::VOLTAGE.put(&mut data, voltage.0.to_le_bytes());
                reply::FAULTS.put(&mut data, faults.bits().to_le_bytes());
            }
            Reply::Status2 { motion }
            | Reply::TorqueCurrent { motion }
            | Reply::Velocity { motion }
            | Reply::AbsolutePosition { motion } => motion.put(&mut data),
            Reply::CommunicationTimeout { timeout } => {
                field::request::TIMEOUT.put(&mut data, timeout.0.to_le_bytes());
            }
            Reply::TimeoutNotice { raw } => data = raw.to_bytes(),
            Reply::Unknown { data: received } => data = received,
        }
        data
    }

    /// Data bytes of this frame on CAN.
    pub(crate) fn frame_len(&self) -> usize {
        match self {
            Reply::TimeoutNotice { raw } => raw.frame_len(),
            _ => DATA_LEN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn both_ways(reply: Reply, data: [u8; 8]) {
        assert_eq!(reply.encode(), Ok(data));
        assert_eq!(Reply::decode(&data), Ok(reply));
    }

    const FORWARD: Motion = Motion {
        temperature: Celsius(50),
        current: Centiamps(100),
        speed: DegreesPerSecond(500),
        angle: Degrees(45),
    };
    const BACKWARD: Motion = Motion {
        temperature: Celsius(50),
        current: Centiamps(-100),
        speed: DegreesPerSecond(-500),
        angle: Degrees(-45),
    };

    /// RMD V3.6 §2.11.4: 360°; then a negative angle.
    #[test]
    fn multi_turn_angle() {
        both_ways(
            Reply::MultiTurnAngle { angle: Centidegrees(36_000) },
            [0x92, 0, 0, 0, 0xA0, 0x8C, 0x00, 0x00],
        );
        both_ways(Reply::MultiTurnAngle { angle: Centidegrees(-1) }, [0x92, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
    }

    /// RMD V3.6 §2.12.4: 50 °C, released, 48.5 V, low voltage.
    #[test]
    fn status_1() {
        both_ways(
            Reply::Status1 {
                temperature: Celsius(50),
                brake_released: true,
                voltage: Decivolts(485),
                faults: Faults::UNDER_VOLTAGE,
            },
            [0x9A, 0x32, 0x00, 0x01, 0xE5, 0x01, 0x04, 0x00],
        );
    }

    /// Bits of the error word that RMD V3.6 §2.12.3 does not list survive, beside several that it does.
    #[test]
    fn unlisted_fault_bits_are_kept() {
        both_ways(
            Reply::Status1 {
                temperature: Celsius(-5),
                brake_released: false,
                voltage: Decivolts(0xFFFF),
                faults: Faults::from_bits_retain(0xFFFF),
            },
            [0x9A, 0xFB, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFF],
        );
    }

    /// RMD V3.6 §2.12.3 lists 0 and 1; anything but 0 must not pass for a locked brake. Byte 2 is NULL there and a
    /// temperature in newer manuals.
    #[test]
    fn only_zero_is_a_locked_brake() {
        let reply = Reply::decode(&[0x9A, 0x32, 0x28, 0x02, 0xE5, 0x01, 0x00, 0x00]);
        assert!(matches!(reply, Ok(Reply::Status1 { brake_released: true, .. })));
    }

    /// RMD V3.6 §2.13.4, §2.17.4, §2.18.4, §2.20.4.
    #[test]
    fn motion_replies() {
        both_ways(Reply::Status2 { motion: FORWARD }, [0x9C, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00]);
        both_ways(Reply::TorqueCurrent { motion: FORWARD }, [0xA1, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00]);
        both_ways(
            Reply::TorqueCurrent { motion: BACKWARD },
            [0xA1, 0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF],
        );
        both_ways(Reply::Velocity { motion: FORWARD }, [0xA2, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00]);
        both_ways(Reply::Velocity { motion: BACKWARD }, [0xA2, 0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF]);
        both_ways(
            Reply::AbsolutePosition { motion: FORWARD },
            [0xA4, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00],
        );
        both_ways(
            Reply::AbsolutePosition { motion: BACKWARD },
            [0xA4, 0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF],
        );
    }

    /// RMD V3.6 §2.13.3: the angle ends at ±32767. Received, −32768 is reported as it is.
    #[test]
    fn the_angle_is_symmetric() {
        let data = [0x9C, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x00, 0x80];
        let reply = Reply::Status2 { motion: Motion { angle: Degrees(i16::MIN), ..FORWARD } };
        assert_eq!(Reply::decode(&data), Ok(reply));
        assert_eq!(
            reply.encode(),
            Err(EncodeError::OutOfRange { field: "angle", value: -32768, min: -32767, max: 32767 })
        );
        both_ways(
            Reply::Status2 { motion: Motion { angle: Degrees(-32767), ..FORWARD } },
            [0x9C, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x01, 0x80],
        );
    }

    /// RMD V3.6 §3.2 (0x80), §2.16.3, §2.26.3, §2.27.3.
    #[test]
    fn echoes() {
        both_ways(Reply::Shutdown, [0x80, 0, 0, 0, 0, 0, 0, 0]);
        both_ways(Reply::Stop, [0x81, 0, 0, 0, 0, 0, 0, 0]);
        both_ways(Reply::BrakeReleased, [0x77, 0, 0, 0, 0, 0, 0, 0]);
        both_ways(Reply::BrakeLocked, [0x78, 0, 0, 0, 0, 0, 0, 0]);
    }

    /// RMD V3.6 §2.30.3 (echo) and §2.30.4 example 2 (all zero).
    #[test]
    fn communication_timeout_echoed_or_zero() {
        both_ways(
            Reply::CommunicationTimeout { timeout: Milliseconds(1000) },
            [0xB3, 0, 0, 0, 0xE8, 0x03, 0x00, 0x00],
        );
        both_ways(Reply::CommunicationTimeout { timeout: Milliseconds(0) }, [0xB3, 0, 0, 0, 0, 0, 0, 0]);
    }

    /// Observed on motors: the notice comes without data. No other reply may be short.
    #[test]
    fn only_the_timeout_notice_may_be_short() {
        let bare = Reply::TimeoutNotice { raw: RawNotice::default() };
        assert_eq!(Reply::decode(&[0xF1]), Ok(bare));
        assert_eq!(bare.encode(), Ok([0xF1, 0, 0, 0, 0, 0, 0, 0]));

        let full = [0xF1, 1, 2, 3, 4, 5, 6, 7];
        let reply =
            Reply::TimeoutNotice { raw: RawNotice::new(&[1, 2, 3, 4, 5, 6, 7]).expect("seven bytes") };
        both_ways(reply, full);

        assert_eq!(Reply::decode(&[]), Err(DecodeError::Length { got: 0, expected: 8 }));
        assert_eq!(Reply::decode(&[0x80]), Err(DecodeError::Length { got: 1, expected: 8 }));
        assert_eq!(Reply::decode(&[0xF1; 9]), Err(DecodeError::Length { got: 9, expected: 8 }));
        assert_eq!(
            RawNotice::new(&[0; 8]),
            Err(EncodeError::OutOfRange { field: "notice length", value: 8, min: 0, max: 7 })
        );
    }

    /// RMD V3.6 §2.14.4 (0x9D): a reply without a variant keeps every byte.
    #[test]
    fn other_replies_keep_their_bytes() {
        let data = [0x9D, 0x32, 0xC2, 0x0B, 0x10, 0xFA, 0xC0, 0xF9];
        both_ways(Reply::Unknown { data }, data);
    }

    #[test]
    fn unknown_cannot_carry_a_known_command() {
        for command in [0x77, 0x78, 0x80, 0x81, 0x92, 0x9A, 0x9C, 0xA1, 0xA2, 0xA4, 0xB3, 0xF1] {
            let reply = Reply::Unknown { data: [command, 0, 0, 0, 0, 0, 0, 0] };
            assert_eq!(
                reply.encode(),
                Err(EncodeError::Forbidden {
                    field: "command",
                    value: i64::from(command),
                    reason: "this command has a reply of its own"
                })
            );
        }
    }
}
