//! What the gateway sends.

use crate::error::{DecodeError, EncodeError};
use crate::field::{self, command};
use crate::payload::Payload;
use crate::units::{Decidegrees, Milliseconds, Percent, Rpm, RpmLimit};

/// A request to one node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// TC: run at a share of the full signal (Thruster manual §2.1).
    Signal {
        /// −100..=100 %.
        signal: Percent,
    },
    /// VC: run at a speed (Thruster manual §2.1).
    Speed {
        /// 0, or at least 30 rpm in either direction; −4370 rpm cannot be sent, its bytes mean a refusal.
        speed: Rpm,
    },
    /// QV: read the speed (Thruster manual §2.1).
    ReadSpeed,
    /// QC: read the current (Thruster manual §2.1).
    ReadCurrent,
    /// QP: read the voltage (Thruster manual §2.1).
    ReadVoltage,
    /// QT: read the motor temperature (Thruster manual §2.1).
    ReadMotorTemperature,
    /// EQ: read the driver temperature (Thruster manual §2.1).
    ReadDriverTemperature,
    /// EF: read the present faults (Thruster manual §2.1, §3).
    ReadFaults,
    /// CF: clear the faults (Thruster manual §2.1). Only a following EF proves them cleared.
    ClearFaults,
    /// FR: read all faults since the start (Thruster manual §2.6).
    ReadFaultRecord,
    /// ST: stop when no command has come for this long (Thruster manual §2.3).
    SetTimeout {
        /// 0 = off, or 100..=60000 ms.
        timeout: Milliseconds,
    },
    /// LA: move to an absolute position (Thruster manual §4.1); devices with an encoder only.
    AbsolutePosition {
        /// Speed of the move in rpm; 0 does not start it.
        speed: RpmLimit,
        /// −1799..=1799, 0.1° each.
        position: Decidegrees,
    },
    /// QA: read the absolute position (Thruster manual §4.1); devices with an encoder only.
    ReadAbsolutePosition,
    /// LS: emergency stop (Thruster manual §4.3).
    EmergencyStop,
    /// A command that has no variant here.
    Unknown {
        /// The data field as it is.
        payload: Payload,
    },
}

impl Request {
    /// The command word, bytes 0–1.
    pub fn command(&self) -> u16 {
        match self {
            Request::Signal { .. } => command::TC,
            Request::Speed { .. } => command::VC,
            Request::ReadSpeed => command::QV,
            Request::ReadCurrent => command::QC,
            Request::ReadVoltage => command::QP,
            Request::ReadMotorTemperature => command::QT,
            Request::ReadDriverTemperature => command::EQ,
            Request::ReadFaults => command::EF,
            Request::ClearFaults => command::CF,
            Request::ReadFaultRecord => command::FR,
            Request::SetTimeout { .. } => command::ST,
            Request::AbsolutePosition { .. } => command::LA,
            Request::ReadAbsolutePosition => command::QA,
            Request::EmergencyStop => command::LS,
            Request::Unknown { payload } => payload.command(),
        }
    }

    /// The data field; a value outside the manual's range is refused.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        Ok(match *self {
            Request::Signal { signal } => Payload::signed(command::TC, field::signal_word(signal)?),
            Request::Speed { speed } => Payload::signed(command::VC, field::speed_word(speed)?),
            Request::SetTimeout { timeout } => Payload::unsigned(command::ST, field::timeout_word(timeout)?),
            Request::AbsolutePosition { speed, position } => {
                Payload::position(command::LA, speed.0, field::absolute_position(position)?)
            }
            Request::ReadSpeed
            | Request::ReadCurrent
            | Request::ReadVoltage
            | Request::ReadMotorTemperature
            | Request::ReadDriverTemperature
            | Request::ReadFaults
            | Request::ClearFaults
            | Request::ReadFaultRecord
            | Request::ReadAbsolutePosition => Payload::short(self.command()),
            // §4.3 draws eight bytes.
            Request::EmergencyStop => Payload::full(command::LS, 0, [0; 4]),
            Request::Unknown { payload } => unknown(payload)?,
        })
    }

    /// The request in a data field of 4 or 8 bytes.
    ///
    /// Queries are accepted in both lengths (public drivers pad them with zeros), the emergency stop too.
    /// Values are not judged: an out-of-range one is decoded, and refused only by [`Request::encode`].
    pub fn decode(bytes: &[u8]) -> Result<Request, DecodeError> {
        let payload = Payload::try_from(bytes)?;
        Ok(match payload.command() {
            command::TC => Request::Signal { signal: Percent(payload.signed_value()?) },
            command::VC => Request::Speed { speed: Rpm(payload.signed_value()?) },
            command::QV => bare(payload, Request::ReadSpeed)?,
            command::QC => bare(payload, Request::ReadCurrent)?,
            command::QP => bare(payload, Request::ReadVoltage)?,
            command::QT => bare(payload, Request::ReadMotorTemperature)?,
            command::EQ => bare(payload, Request::ReadDriverTemperature)?,
            command::EF => bare(payload, Request::ReadFaults)?,
            command::CF => bare(payload, Request::ClearFaults)?,
            command::FR => bare(payload, Request::ReadFaultRecord)?,
            command::ST => Request::SetTimeout { timeout: Milliseconds(payload.unsigned_value()?) },
            command::LA => Request::AbsolutePosition {
                speed: RpmLimit(payload.parameter()),
                position: Decidegrees(payload.position_value()?),
            },
            command::QA => bare(payload, Request::ReadAbsolutePosition)?,
            command::LS => bare(payload, Request::EmergencyStop)?,
            _ => Request::Unknown { payload },
        })
    }
}

fn bare(payload: Payload, request: Request) -> Result<Request, DecodeError> {
    payload.expect_bare()?;
    Ok(request)
}

/// Lets raw bytes pass unless they would go around the checks of a named command or look like a refusal.
fn unknown(payload: Payload) -> Result<Payload, EncodeError> {
    let reason = if command::NAMED.contains(&payload.command()) {
        "this command has a variant of its own"
    } else if payload.has_refusal_data() {
        "its data 00 00 EE EE mean a refusal"
    } else {
        return Ok(payload);
    };
    Err(EncodeError::Forbidden { field: "command", value: i64::from(payload.command()), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(request: Request) -> Payload {
        request.encode().unwrap()
    }

    /// Thruster manual §1.3: the printed TC frames of +5 % and −5 %.
    #[test]
    fn signal_has_a_zero_upper_half_even_when_negative() {
        let plus = Payload::Full([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0x00, 0x05]);
        let minus = Payload::Full([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0xFF, 0xFB]);
        assert_eq!(encoded(Request::Signal { signal: Percent(5) }), plus);
        assert_eq!(encoded(Request::Signal { signal: Percent(-5) }), minus);
        assert_eq!(Request::decode(minus.as_slice()), Ok(Request::Signal { signal: Percent(-5) }));
    }

    /// Thruster manual §1.3 leaves the upper half open: a sign extension is accepted, anything else is named.
    #[test]
    fn upper_half_is_zero_or_a_sign_extension() {
        let extended = [0x54, 0x43, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFB];
        assert_eq!(Request::decode(&extended), Ok(Request::Signal { signal: Percent(-5) }));
        let odd = [0x56, 0x43, 0x00, 0x00, 0x00, 0x01, 0x00, 0x64];
        assert_eq!(Request::decode(&odd), Err(DecodeError::UpperHalf { got: 1 }));
    }

    /// Thruster manual §2.3: 60000 needs all 16 bits, so the word is never sign-extended.
    #[test]
    fn timeout_is_unsigned() {
        let longest = Payload::Full([0x53, 0x54, 0x00, 0x00, 0x00, 0x00, 0xEA, 0x60]);
        let request = Request::SetTimeout { timeout: Milliseconds(60_000) };
        assert_eq!(encoded(request), longest);
        assert_eq!(Request::decode(longest.as_slice()), Ok(request));
        let extended = [0x53, 0x54, 0x00, 0x00, 0xFF, 0xFF, 0xEA, 0x60];
        assert_eq!(Request::decode(&extended), Err(DecodeError::UpperHalf { got: 0xFFFF }));
    }

    /// Thruster manual §2.3.
    #[test]
    fn timeout_is_off_or_within_its_range() {
        let off = Payload::Full([0x53, 0x54, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00]);
        assert_eq!(encoded(Request::SetTimeout { timeout: Milliseconds(0) }), off);
        assert!(Request::SetTimeout { timeout: Milliseconds(100) }.encode().is_ok());
        for ms in [1, 99, 60_001, 0xEEEE, u16::MAX] {
            let refused =
                EncodeError::OutOfRange { field: "timeout", value: i64::from(ms), min: 100, max: 60_000 };
            assert_eq!(Request::SetTimeout { timeout: Milliseconds(ms) }.encode(), Err(refused));
        }
    }

    /// Thruster manual §2.1.
    #[test]
    fn signal_beyond_full_is_refused() {
        for signal in [100, -100] {
            assert!(Request::Signal { signal: Percent(signal) }.encode().is_ok());
        }
        for signal in [101, -101, i16::MAX, i16::MIN] {
            let refused =
                EncodeError::OutOfRange { field: "signal", value: i64::from(signal), min: -100, max: 100 };
            assert_eq!(Request::Signal { signal: Percent(signal) }.encode(), Err(refused));
        }
    }

    /// Thruster manual §2.1; VC −4370 would be the bytes of a refusal.
    #[test]
    fn speed_below_30_rpm_and_the_refusal_pattern_are_refused() {
        for speed in [0, 30, -30, i16::MAX, i16::MIN] {
            assert!(Request::Speed { speed: Rpm(speed) }.encode().is_ok());
        }
        for speed in [1, -1, 29, -29, -4370] {
            let result = Request::Speed { speed: Rpm(speed) }.encode();
            assert!(
                matches!(result, Err(EncodeError::Forbidden { field: "speed", value, .. }) if value == i64::from(speed))
            );
        }
    }

    /// Thruster manual §4.1.
    #[test]
    fn absolute_position_has_speed_then_a_32_bit_position() {
        let request = Request::AbsolutePosition { speed: RpmLimit(300), position: Decidegrees(-1799) };
        let bytes = [0x4C, 0x41, 0x01, 0x2C, 0xFF, 0xFF, 0xF8, 0xF9];
        assert_eq!(encoded(request), Payload::Full(bytes));
        assert_eq!(Request::decode(&bytes), Ok(request));
        for position in [1800, -1800] {
            let request = Request::AbsolutePosition { speed: RpmLimit(1), position: Decidegrees(position) };
            let refused = EncodeError::OutOfRange {
                field: "position",
                value: i64::from(position),
                min: -1799,
                max: 1799,
            };
            assert_eq!(request.encode(), Err(refused));
        }
    }

    /// Thruster manual §1.2: four bytes are sent, eight zero-padded ones accepted.
    #[test]
    fn queries_come_short_or_zero_padded() {
        assert_eq!(encoded(Request::ReadSpeed), Payload::Short([0x51, 0x56, 0x00, 0x00]));
        let padded = [0x51, 0x56, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00];
        assert_eq!(Request::decode(&padded), Ok(Request::ReadSpeed));
        let stray = [0x51, 0x56, 0x00, 0x00, 0x00, 0x07, 0x00, 0x00];
        let error = DecodeError::FixedByte { offset: 5, got: 7, expected: 0 };
        assert_eq!(Request::decode(&stray), Err(error));
    }

    /// Thruster manual §4.3: eight bytes are sent, four accepted.
    #[test]
    fn emergency_stop_is_drawn_with_eight_bytes() {
        let full = Payload::Full([0x4C, 0x53, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00]);
        assert_eq!(encoded(Request::EmergencyStop), full);
        assert_eq!(Request::decode(full.as_slice()), Ok(Request::EmergencyStop));
        assert_eq!(Request::decode(&[0x4C, 0x53, 0x00, 0x00]), Ok(Request::EmergencyStop));
    }

    /// Thruster manual §1.2; the nine-byte rows are misprints.
    #[test]
    fn other_lengths_are_refused() {
        for len in [0, 1, 3, 5, 7] {
            let bytes = [0x54, 0x43, 0, 0, 0, 0, 0, 5];
            let result = Request::decode(bytes.get(..len).unwrap());
            assert_eq!(result, Err(DecodeError::Length { got: len, expected: 8 }));
        }
        let nine = [0x43, 0x49, 0, 0, 0, 0, 0, 0, 0x7F];
        assert_eq!(Request::decode(&nine), Err(DecodeError::Length { got: 9, expected: 8 }));
        let short_signal = [0x54, 0x43, 0x00, 0x00];
        assert_eq!(Request::decode(&short_signal), Err(DecodeError::Length { got: 4, expected: 8 }));
    }

    /// Thruster manual §1.3: bytes 2–3 are zero where a command has no sub-command.
    #[test]
    fn a_stray_sub_command_is_named() {
        let stray = [0x54, 0x43, 0x00, 0x02, 0x00, 0x00, 0x00, 0x05];
        let error = DecodeError::FixedByte { offset: 3, got: 2, expected: 0 };
        assert_eq!(Request::decode(&stray), Err(error));
    }

    /// Thruster manual §2.1: MQ (0x4D51), not named here, keeps its bytes.
    #[test]
    fn other_commands_keep_their_bytes() {
        let payload = Payload::Short([0x4D, 0x51, 0x00, 0x00]);
        assert_eq!(Request::decode(payload.as_slice()), Ok(Request::Unknown { payload }));
        assert_eq!(encoded(Request::Unknown { payload }), payload);
    }

    /// Thruster manual §1.3: raw bytes neither go around the range checks nor look like a refusal (LR 61166).
    #[test]
    fn raw_bytes_do_not_go_around_the_checks() {
        let signal_200 = Payload::Full([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0x00, 0xC8]);
        let relative_61166 = Payload::Full([0x4C, 0x52, 0x00, 0x01, 0x00, 0x00, 0xEE, 0xEE]);
        for (payload, command) in [(signal_200, 0x5443), (relative_61166, 0x4C52)] {
            let result = Request::Unknown { payload }.encode();
            assert!(
                matches!(result, Err(EncodeError::Forbidden { field: "command", value, .. }) if value == command)
            );
        }
    }
}
