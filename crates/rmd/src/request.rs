//! What the master sends: the eight data bytes of each command.

use crate::error::EncodeError;
use crate::field::{DATA_LEN, command, request as field};
use crate::units::{Centiamps, Centidegrees, CentidegreesPerSecond, Milliseconds, SpeedLimit};

/// One command to one motor.
///
/// Bytes the manual calls NULL are sent as zero; when received with another value they are passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// 0x92: read the multi-turn angle of the output shaft (RMD V3.6 §2.11).
    ReadMultiTurnAngle,
    /// 0x9A: read temperature, brake, voltage and the error word (RMD V3.6 §2.12).
    ReadStatus1,
    /// 0x9C: read temperature, current, speed and angle (RMD V3.6 §2.13).
    ReadStatus2,
    /// 0x80: switch the output off and leave every closed loop; the shaft turns freely (RMD V3.6 §2.15).
    Shutdown,
    /// 0x81: stop and hold the position (RMD V3.6 §2.16).
    Stop,
    /// 0xA1: hold a torque current; runs only without a fault (RMD V3.6 §2.17).
    TorqueCurrent {
        /// Torque current, the whole i16 range.
        current: Centiamps,
    },
    /// 0xA2: hold a speed of the output shaft; runs only without a fault (RMD V3.6 §2.18).
    Velocity {
        /// Speed, the whole i32 range.
        speed: CentidegreesPerSecond,
    },
    /// 0xA4: move to a multi-turn angle; runs only without a fault (RMD V3.6 §2.20).
    AbsolutePosition {
        /// Highest speed of the move. 0 is encoded, though the manual does not say what it does.
        max_speed: SpeedLimit,
        /// Target angle from the zero point, the whole i32 range.
        angle: Centidegrees,
    },
    /// 0x77: release the brake (RMD V3.6 §2.26).
    ReleaseBrake,
    /// 0x78: lock the brake, as it also is without power (RMD V3.6 §2.27).
    LockBrake,
    /// 0xB3: cut the output and lock the brake when nothing is received for this long; stored in the motor's ROM
    /// (RMD V3.6 §2.30).
    SetCommunicationTimeout {
        /// Timeout, the whole u32 range; 0 switches the protection off.
        timeout: Milliseconds,
    },
    /// Any other command. It may well move the motor ([`command::CLOSED_LOOP`]) or write its flash.
    Unknown {
        /// The data bytes as received, the command byte first.
        data: [u8; DATA_LEN],
    },
}

impl Request {
    /// The command code: data byte 0.
    pub const fn command(&self) -> u8 {
        match self {
            Request::ReadMultiTurnAngle => command::READ_MULTI_TURN_ANGLE,
            Request::ReadStatus1 => command::READ_STATUS_1,
            Request::ReadStatus2 => command::READ_STATUS_2,
            Request::Shutdown => command::SHUTDOWN,
            Request::Stop => command::STOP,
            Request::TorqueCurrent { .. } => command::TORQUE_CURRENT,
            Request::Velocity { .. } => command::VELOCITY,
            Request::AbsolutePosition { .. } => command::ABSOLUTE_POSITION,
            Request::ReleaseBrake => command::RELEASE_BRAKE,
            Request::LockBrake => command::LOCK_BRAKE,
            Request::SetCommunicationTimeout { .. } => command::SET_COMMUNICATION_TIMEOUT,
            Request::Unknown { data: [command, ..] } => *command,
        }
    }

    /// The eight data bytes.
    ///
    /// Refused is an [`Request::Unknown`] whose command has a variant of its own: it would pass checks made on that
    /// variant unseen.
    pub fn encode(&self) -> Result<[u8; DATA_LEN], EncodeError> {
        if let Request::Unknown { data } = self
            && !matches!(Request::decode(data), Request::Unknown { .. })
        {
            return Err(EncodeError::Forbidden {
                field: "command",
                value: i64::from(self.command()),
                reason: "this command has a request of its own",
            });
        }
        Ok(self.to_bytes())
    }

    /// The request that eight data bytes hold. Every byte string is one: what is not listed is `Unknown`.
    pub fn decode(data: &[u8; DATA_LEN]) -> Request {
        let [command, ..] = *data;
        match command {
            command::READ_MULTI_TURN_ANGLE => Request::ReadMultiTurnAngle,
            command::READ_STATUS_1 => Request::ReadStatus1,
            command::READ_STATUS_2 => Request::ReadStatus2,
            command::SHUTDOWN => Request::Shutdown,
            command::STOP => Request::Stop,
            command::TORQUE_CURRENT => {
                Request::TorqueCurrent { current: Centiamps(i16::from_le_bytes(field::CURRENT.get(data))) }
            }
            command::VELOCITY => {
                Request::Velocity { speed: CentidegreesPerSecond(i32::from_le_bytes(field::SPEED.get(data))) }
            }
            command::ABSOLUTE_POSITION => Request::AbsolutePosition {
                max_speed: SpeedLimit(u16::from_le_bytes(field::MAX_SPEED.get(data))),
                angle: Centidegrees(i32::from_le_bytes(field::ANGLE.get(data))),
            },
            command::RELEASE_BRAKE => Request::ReleaseBrake,
            command::LOCK_BRAKE => Request::LockBrake,
            command::SET_COMMUNICATION_TIMEOUT => Request::SetCommunicationTimeout {
                timeout: Milliseconds(u32::from_le_bytes(field::TIMEOUT.get(data))),
            },
            _ => Request::Unknown { data: *data },
        }
    }

    /// The data bytes, whether or not they may be sent.
    pub(crate) fn to_bytes(self) -> [u8; DATA_LEN] {
        let mut data = [self.command(), 0, 0, 0, 0, 0, 0, 0];
        match self {
            Request::ReadMultiTurnAngle
            | Request::ReadStatus1
            | Request::ReadStatus2
            | Request::Shutdown
            | Request::Stop
            | Request::ReleaseBrake
            | Request::LockBrake => {}
            Request::TorqueCurrent { current } => field::CURRENT.put(&mut data, current.0.to_le_bytes()),
            Request::Velocity { speed } => field::SPEED.put(&mut data, speed.0.to_le_bytes()),
            Request::AbsolutePosition { max_speed, angle } => {
                field::MAX_SPEED.put(&mut data, max_speed.0.to_le_bytes());
                field::ANGLE.put(&mut data, angle.0.to_le_bytes());
            }
            Request::SetCommunicationTimeout { timeout } => {
                field::TIMEOUT.put(&mut data, timeout.0.to_le_bytes());
            }
            Request::Unknown { data: received } => data = received,
        }
        data
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn both_ways(request: Request, data: [u8; 8]) {
        assert_eq!(request.encode(), Ok(data));
        assert_eq!(Request::decode(&data), request);
    }

    /// RMD V3.6 §2.11.4, §2.12.4, §2.13.4.
    #[test]
    fn reads() {
        both_ways(Request::ReadMultiTurnAngle, [0x92, 0, 0, 0, 0, 0, 0, 0]);
        both_ways(Request::ReadStatus1, [0x9A, 0, 0, 0, 0, 0, 0, 0]);
        both_ways(Request::ReadStatus2, [0x9C, 0, 0, 0, 0, 0, 0, 0]);
    }

    /// RMD V3.6 §2.15.2, §2.16.2, §2.26.2, §2.27.2.
    #[test]
    fn stops_and_brake() {
        both_ways(Request::Shutdown, [0x80, 0, 0, 0, 0, 0, 0, 0]);
        both_ways(Request::Stop, [0x81, 0, 0, 0, 0, 0, 0, 0]);
        both_ways(Request::ReleaseBrake, [0x77, 0, 0, 0, 0, 0, 0, 0]);
        both_ways(Request::LockBrake, [0x78, 0, 0, 0, 0, 0, 0, 0]);
    }

    /// RMD V3.6 §2.17.4: 1 A and −1 A; then the ends of the word.
    #[test]
    fn torque_current() {
        both_ways(Request::TorqueCurrent { current: Centiamps(100) }, [0xA1, 0, 0, 0, 0x64, 0x00, 0, 0]);
        both_ways(Request::TorqueCurrent { current: Centiamps(-100) }, [0xA1, 0, 0, 0, 0x9C, 0xFF, 0, 0]);
        both_ways(Request::TorqueCurrent { current: Centiamps(i16::MAX) }, [0xA1, 0, 0, 0, 0xFF, 0x7F, 0, 0]);
        both_ways(Request::TorqueCurrent { current: Centiamps(i16::MIN) }, [0xA1, 0, 0, 0, 0x00, 0x80, 0, 0]);
    }

    /// RMD V3.6 §2.18.4: 100 and −100 degrees per second; then the ends of the word.
    #[test]
    fn velocity() {
        let velocity = |raw| Request::Velocity { speed: CentidegreesPerSecond(raw) };
        both_ways(velocity(10_000), [0xA2, 0, 0, 0, 0x10, 0x27, 0x00, 0x00]);
        both_ways(velocity(-10_000), [0xA2, 0, 0, 0, 0xF0, 0xD8, 0xFF, 0xFF]);
        both_ways(velocity(i32::MAX), [0xA2, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0x7F]);
        both_ways(velocity(i32::MIN), [0xA2, 0, 0, 0, 0x00, 0x00, 0x00, 0x80]);
    }

    /// RMD V3.6 §2.20.4: 360° and −360° at 500 degrees per second; a limit above i16 and a limit of 0.
    #[test]
    fn absolute_position() {
        let position = |max_speed, angle| Request::AbsolutePosition {
            max_speed: SpeedLimit(max_speed),
            angle: Centidegrees(angle),
        };
        both_ways(position(500, 36_000), [0xA4, 0x00, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00]);
        both_ways(position(500, -36_000), [0xA4, 0x00, 0xF4, 0x01, 0x60, 0x73, 0xFF, 0xFF]);
        both_ways(position(0xFFFE, i32::MIN), [0xA4, 0x00, 0xFE, 0xFF, 0x00, 0x00, 0x00, 0x80]);
        both_ways(position(0, 1), [0xA4, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00]);
    }

    /// RMD V3.6 §2.30.4: off and 1000 ms; then the end of the word.
    #[test]
    fn communication_timeout() {
        let timeout = |raw| Request::SetCommunicationTimeout { timeout: Milliseconds(raw) };
        both_ways(timeout(0), [0xB3, 0, 0, 0, 0x00, 0x00, 0x00, 0x00]);
        both_ways(timeout(1000), [0xB3, 0, 0, 0, 0xE8, 0x03, 0x00, 0x00]);
        both_ways(timeout(u32::MAX), [0xB3, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
    }

    /// Incremental position, RMD V3.6 §2.22.4: a command without a variant keeps every byte.
    #[test]
    fn other_commands_keep_their_bytes() {
        let data = [0xA8, 0x00, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00];
        both_ways(Request::Unknown { data }, data);
        assert_eq!(Request::decode(&data).command(), 0xA8);
    }

    /// NULL bytes of RMD V3.6 §2.17.2 and §2.15.2 carry nothing.
    #[test]
    fn reserved_bytes_are_passed_over() {
        assert_eq!(
            Request::decode(&[0xA1, 0x11, 0x22, 0x33, 0x64, 0x00, 0x66, 0x77]),
            Request::TorqueCurrent { current: Centiamps(100) }
        );
        assert_eq!(Request::decode(&[0x80, 1, 2, 3, 4, 5, 6, 7]), Request::Shutdown);
    }

    #[test]
    fn unknown_cannot_carry_a_known_command() {
        for command in [0x77, 0x78, 0x80, 0x81, 0x92, 0x9A, 0x9C, 0xA1, 0xA2, 0xA4, 0xB3] {
            let request = Request::Unknown { data: [command, 0, 0, 0, 0, 0, 0, 0] };
            assert_eq!(
                request.encode(),
                Err(EncodeError::Forbidden {
                    field: "command",
                    value: i64::from(command),
                    reason: "this command has a request of its own"
                })
            );
        }
    }
}
