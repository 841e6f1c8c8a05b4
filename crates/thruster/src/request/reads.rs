//! What changes nothing, and what does so later.

use super::Request;

impl Request {
    /// Whether the command only asks: it moves nothing, stops nothing and changes nothing in the device. A command that the manual does not
    /// list may do any of these.
    pub const fn only_reads(&self) -> bool {
        match self {
            Request::ReadSpeed
            | Request::ReadCurrent
            | Request::ReadVoltage
            | Request::ReadMotorTemperature
            | Request::ReadDriverTemperature
            | Request::ReadFaults
            | Request::ReadFaultRecord
            | Request::ReadParameter { .. }
            | Request::ReadAbsolutePosition
            | Request::ReadPositionLimits
            | Request::ReadRelativePosition => true,
            Request::Signal { .. }
            | Request::Speed { .. }
            | Request::ClearFaults
            | Request::RequestMode
            | Request::LowSpeedMode
            | Request::MediumSpeedMode
            | Request::SetId { .. }
            | Request::SetBitrate { .. }
            | Request::SetTimeout { .. }
            | Request::ConfigureReturn { .. }
            | Request::ConfigureStream { .. }
            | Request::SetParameter { .. }
            | Request::AbsolutePosition { .. }
            | Request::SetAbsoluteZero
            | Request::SetPositionLimits { .. }
            | Request::RelativePosition { .. }
            | Request::SetRelativeZero
            | Request::ClearRelativePosition
            | Request::EmergencyStop
            | Request::Unknown { .. } => false,
        }
    }

    /// Whether it acts only after the device was switched off and on: there is no command to restart it (Thruster manual §2.2).
    pub const fn acts_after_power_cycle(&self) -> bool {
        matches!(self, Request::SetId { .. } | Request::SetBitrate { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thruster manual §2.1 to §2.6, §4; and a command that the manual does not list.
    #[test]
    fn reading_is_told_from_the_rest_by_its_letters() {
        let only_reads = |data: &[u8]| Request::decode(data).unwrap().only_reads();
        for data in [
            b"QV\0\0", b"QC\0\0", b"QP\0\0", b"QT\0\0", b"EQ\0\0", b"EF\0\0", b"FR\0\0", b"QA\0\0", b"QR\0\0",
        ] {
            assert!(only_reads(data), "{data:02X?}");
        }
        for data in
            [b"TC\0\0\0\0\0\0", b"VC\0\0\0\0\0\0", b"CI\0\0\0\0\0\x0B", b"ST\0\0\0\0\0\0", b"XX\0\0\0\0\0\0"]
        {
            assert!(!only_reads(data), "{data:02X?}");
        }
        for data in [b"CF\0\0", b"MQ\0\0", b"ML\0\0", b"AZ\0\0", b"LS\0\0"] {
            assert!(!only_reads(data), "{data:02X?}");
        }
    }
}
