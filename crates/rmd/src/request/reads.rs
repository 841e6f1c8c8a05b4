//! What changes nothing, and what does so later.

use super::Request;
use crate::function::Function;

impl Request {
    /// Whether the command only asks: it moves nothing, stops nothing and changes nothing in the motor. A command that the manual does not
    /// list may do any of these.
    pub const fn only_reads(&self) -> bool {
        match self {
            Request::ReadPid
            | Request::ReadAcceleration
            | Request::ReadEncoderPosition
            | Request::ReadEncoderRawPosition
            | Request::ReadEncoderOffset
            | Request::ReadMultiTurnAngle
            | Request::ReadStatus1
            | Request::ReadStatus2
            | Request::ReadStatus3
            | Request::ReadRunMode
            | Request::ReadPower
            | Request::ReadRunTime
            | Request::ReadVersionDate
            | Request::ReadModel
            | Request::ReadCanId
            | Request::ReadRs485Id => true,
            Request::WritePidRam { .. }
            | Request::WritePidRom { .. }
            | Request::WriteAcceleration { .. }
            | Request::WriteEncoderOffset { .. }
            | Request::WritePositionAsZero
            | Request::Shutdown
            | Request::Stop
            | Request::TorqueCurrent { .. }
            | Request::Velocity { .. }
            | Request::PositionTracking { .. }
            | Request::AbsolutePosition { .. }
            | Request::LimitedPositionTracking { .. }
            | Request::IncrementalPosition { .. }
            | Request::Reset
            | Request::ReleaseBrake
            | Request::LockBrake
            | Request::SetCommunicationTimeout { .. }
            | Request::SetBaudRate { .. }
            | Request::Function { .. }
            | Request::SetCanId { .. }
            | Request::MotionMode { .. }
            | Request::SetRs485Id { .. }
            | Request::Unknown { .. } => false,
        }
    }

    /// Whether it acts only after a restart of the motor (RMD V3.6 §2.9, §2.10, §2.33.4).
    pub const fn acts_after_restart(&self) -> bool {
        matches!(
            self,
            Request::WriteEncoderOffset { .. }
                | Request::WritePositionAsZero
                | Request::Function { function: Function::ClearMultiTurn }
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RMD V3.6 §2.13, §2.16, §2.25, §2.33; and a command that the manual does not list.
    #[test]
    fn reading_is_told_from_the_rest_by_the_first_byte() {
        let only_reads = |first: u8| Request::decode(&[first, 0, 0, 0, 0, 0, 0, 0]).only_reads();
        for first in
            [0x30, 0x42, 0x60, 0x61, 0x62, 0x70, 0x71, 0x90, 0x92, 0x9A, 0x9C, 0x9D, 0xB1, 0xB2, 0xB5]
        {
            assert_eq!(only_reads(first), first != 0x90, "{first:#04X}");
        }
        for first in
            [0x20, 0x31, 0x43, 0x63, 0x64, 0x76, 0x77, 0x78, 0x80, 0x81, 0xA1, 0xA8, 0xB3, 0xB4, 0xF1]
        {
            assert!(!only_reads(first), "{first:#04X}");
        }
    }
}
