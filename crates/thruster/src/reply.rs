//! What a device answers.

use crate::error::{DecodeError, EncodeError};
use crate::faults::Faults;
use crate::field::{self, REFUSAL, command};
use crate::payload::Payload;
use crate::units::{Celsius, Deciamps, Decidegrees, Decivolts, Milliseconds, Percent, Rpm, RpmLimit};

/// A reply of one node. It repeats the command word of the request (Thruster manual §1.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply {
    /// TC: the signal was taken.
    Signal {
        /// The signal set, %.
        signal: Percent,
    },
    /// VC: the speed was taken.
    Speed {
        /// The speed set, rpm.
        speed: Rpm,
    },
    /// QV: the speed measured (Thruster manual §2.1).
    MeasuredSpeed {
        /// rpm; −4370 is a value like any other here.
        speed: Rpm,
    },
    /// QC: the current (Thruster manual §2.1).
    Current {
        /// 0.1 A each.
        current: Deciamps,
    },
    /// QP: the voltage (Thruster manual §2.1).
    Voltage {
        /// 0.1 V each.
        voltage: Decivolts,
    },
    /// QT: the motor temperature (Thruster manual §2.1).
    MotorTemperature {
        /// °C.
        temperature: Celsius,
    },
    /// EQ: the driver temperature (Thruster manual §2.1).
    DriverTemperature {
        /// °C.
        temperature: Celsius,
    },
    /// EF: the present faults (Thruster manual §3). A timeout is shown once only (§2.3).
    Faults {
        /// The fault word.
        faults: Faults,
    },
    /// CF was taken.
    FaultsCleared,
    /// FR: all faults since the start (Thruster manual §2.6).
    FaultRecord {
        /// The fault word.
        faults: Faults,
    },
    /// ST: the timeout was taken.
    Timeout {
        /// The timeout set, ms; 0 = off.
        timeout: Milliseconds,
    },
    /// LA: the position was taken.
    AbsolutePosition {
        /// The speed of the move, rpm.
        speed: RpmLimit,
        /// The target, 0.1° each.
        position: Decidegrees,
    },
    /// QA: the absolute position (Thruster manual §4.1).
    MeasuredPosition {
        /// 0.1° each.
        position: Decidegrees,
    },
    /// LS was taken.
    EmergencyStop,
    /// The device refuses a set command, for instance after a stall (Thruster manual §1.3); EF says why.
    Refused {
        /// The command word of the refused request.
        command: u16,
        /// Bytes 2–3 of the refused request: the speed of LA, else 0.
        parameter: u16,
    },
    /// A command that has no variant here.
    Unknown {
        /// The data field as it is.
        payload: Payload,
    },
}

impl Reply {
    /// The command word, bytes 0–1.
    pub fn command(&self) -> u16 {
        match self {
            Reply::Signal { .. } => command::TC,
            Reply::Speed { .. } => command::VC,
            Reply::MeasuredSpeed { .. } => command::QV,
            Reply::Current { .. } => command::QC,
            Reply::Voltage { .. } => command::QP,
            Reply::MotorTemperature { .. } => command::QT,
            Reply::DriverTemperature { .. } => command::EQ,
            Reply::Faults { .. } => command::EF,
            Reply::FaultsCleared => command::CF,
            Reply::FaultRecord { .. } => command::FR,
            Reply::Timeout { .. } => command::ST,
            Reply::AbsolutePosition { .. } => command::LA,
            Reply::MeasuredPosition { .. } => command::QA,
            Reply::EmergencyStop => command::LS,
            Reply::Refused { command, .. } => *command,
            Reply::Unknown { payload } => payload.command(),
        }
    }

    /// The data field; an echo outside the manual's range is refused.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        Ok(match *self {
            Reply::Signal { signal } => Payload::signed(command::TC, field::signal_word(signal)?),
            Reply::Speed { speed } => Payload::signed(command::VC, field::speed_word(speed)?),
            Reply::MeasuredSpeed { speed } => Payload::signed(command::QV, speed.0),
            Reply::Current { current } => Payload::signed(command::QC, current.0),
            Reply::Voltage { voltage } => Payload::unsigned(command::QP, voltage.0),
            Reply::MotorTemperature { temperature } => Payload::signed(command::QT, temperature.0),
            Reply::DriverTemperature { temperature } => Payload::signed(command::EQ, temperature.0),
            Reply::Faults { faults } => Payload::unsigned(command::EF, faults.bits()),
            Reply::FaultRecord { faults } => Payload::unsigned(command::FR, faults.bits()),
            Reply::Timeout { timeout } => Payload::unsigned(command::ST, field::timeout_word(timeout)?),
            Reply::AbsolutePosition { speed, position } => {
                Payload::position(command::LA, speed.0, field::absolute_position(position)?)
            }
            Reply::MeasuredPosition { position } => Payload::position(command::QA, 0, position.0),
            // The manual does not draw these two; eight bytes leave room for a refusal in the same place.
            Reply::FaultsCleared | Reply::EmergencyStop => Payload::full(self.command(), 0, [0; 4]),
            Reply::Refused { command, parameter } => refused(command, parameter)?,
            Reply::Unknown { payload } => unknown(payload)?,
        })
    }

    /// The reply in a data field of 4 or 8 bytes.
    ///
    /// The bytes `00 00 EE EE` are a refusal in the reply to a set command only, never in a query's.
    pub fn decode(bytes: &[u8]) -> Result<Reply, DecodeError> {
        let payload = Payload::try_from(bytes)?;
        let command = payload.command();
        if command::SET.contains(&command) && payload.has_refusal_data() {
            return decode_refused(payload);
        }
        Ok(match command {
            command::TC => Reply::Signal { signal: Percent(payload.signed_value()?) },
            command::VC => Reply::Speed { speed: Rpm(payload.signed_value()?) },
            command::QV => Reply::MeasuredSpeed { speed: Rpm(payload.signed_value()?) },
            command::QC => Reply::Current { current: Deciamps(payload.signed_value()?) },
            command::QP => Reply::Voltage { voltage: Decivolts(payload.unsigned_value()?) },
            command::QT => Reply::MotorTemperature { temperature: Celsius(payload.signed_value()?) },
            command::EQ => Reply::DriverTemperature { temperature: Celsius(payload.signed_value()?) },
            command::EF => Reply::Faults { faults: Faults::from_bits_retain(payload.unsigned_value()?) },
            command::CF => bare(payload, Reply::FaultsCleared)?,
            command::FR => Reply::FaultRecord { faults: Faults::from_bits_retain(payload.unsigned_value()?) },
            command::ST => Reply::Timeout { timeout: Milliseconds(payload.unsigned_value()?) },
            command::LA => Reply::AbsolutePosition {
                speed: RpmLimit(payload.parameter()),
                position: Decidegrees(payload.position_value()?),
            },
            command::QA => {
                payload.expect_no_parameter()?;
                Reply::MeasuredPosition { position: Decidegrees(payload.position_value()?) }
            }
            command::LS => bare(payload, Reply::EmergencyStop)?,
            _ => Reply::Unknown { payload },
        })
    }
}

fn bare(payload: Payload, reply: Reply) -> Result<Reply, DecodeError> {
    payload.expect_bare()?;
    Ok(reply)
}

fn decode_refused(payload: Payload) -> Result<Reply, DecodeError> {
    if payload.command() != command::LA {
        payload.expect_no_parameter()?;
    }
    Ok(Reply::Refused { command: payload.command(), parameter: payload.parameter() })
}

fn refused(command: u16, parameter: u16) -> Result<Payload, EncodeError> {
    if !command::SET.contains(&command) {
        let reason = "only a set command with a variant of its own can be refused";
        return Err(EncodeError::Forbidden { field: "command", value: i64::from(command), reason });
    }
    if command != command::LA {
        field::check_range("parameter", i64::from(parameter), 0, 0)?;
    }
    Ok(Payload::full(command, parameter, REFUSAL))
}

/// Lets raw bytes pass unless they would go around the checks of a named command.
fn unknown(payload: Payload) -> Result<Payload, EncodeError> {
    if command::NAMED.contains(&payload.command()) {
        let reason = "this command has a variant of its own";
        return Err(EncodeError::Forbidden { field: "command", value: i64::from(payload.command()), reason });
    }
    Ok(payload)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thruster manual §1.3: the printed refusal of TC; any set command can be refused so.
    #[test]
    fn set_commands_can_be_refused() {
        let frames: [([u8; 8], u16, u16); 6] = [
            ([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x5443, 0),
            ([0x56, 0x43, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x5643, 0),
            ([0x43, 0x46, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x4346, 0),
            ([0x53, 0x54, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x5354, 0),
            ([0x4C, 0x41, 0x01, 0x2C, 0x00, 0x00, 0xEE, 0xEE], 0x4C41, 300),
            ([0x4C, 0x53, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE], 0x4C53, 0),
        ];
        for (bytes, command, parameter) in frames {
            let reply = Reply::Refused { command, parameter };
            assert_eq!(Reply::decode(&bytes), Ok(reply));
            assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
        }
    }

    /// Thruster manual §1.3 prints refusals of set commands only: −4370 rpm is a measured speed like any other.
    #[test]
    fn queries_are_never_refused() {
        let bytes = [0x51, 0x56, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE];
        let reply = Reply::MeasuredSpeed { speed: Rpm(-4370) };
        assert_eq!(Reply::decode(&bytes), Ok(reply));
        assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
        let refused = Reply::Refused { command: 0x5156, parameter: 0 }.encode();
        assert!(matches!(refused, Err(EncodeError::Forbidden { field: "command", value: 0x5156, .. })));
    }

    /// Thruster manual §1.3: all four bytes count; a sign-extended −4370 is an echo.
    #[test]
    fn a_refusal_has_a_zero_upper_half() {
        let bytes = [0x56, 0x43, 0x00, 0x00, 0xFF, 0xFF, 0xEE, 0xEE];
        assert_eq!(Reply::decode(&bytes), Ok(Reply::Speed { speed: Rpm(-4370) }));
        assert!(Reply::Speed { speed: Rpm(-4370) }.encode().is_err());
    }

    /// Thruster manual §2.6: bit 14 is reserved and kept.
    #[test]
    fn fault_record_keeps_reserved_bits() {
        let bytes = [0x46, 0x52, 0x00, 0x00, 0x00, 0x00, 0x40, 0x12];
        let reply = Reply::decode(&bytes).unwrap();
        let Reply::FaultRecord { faults } = reply else { panic!("{reply:?}") };
        assert!(faults.contains(Faults::EE_DATA | Faults::UNDER_VOLTAGE));
        assert_eq!(faults.bits(), 0x4012);
        assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
    }

    /// Thruster manual §2.1: dA and dV; the current is signed, the voltage is not.
    #[test]
    fn current_is_signed_and_voltage_is_not() {
        let current = [0x51, 0x43, 0x00, 0x00, 0x00, 0x00, 0xFF, 0x9C];
        assert_eq!(Reply::decode(&current), Ok(Reply::Current { current: Deciamps(-100) }));
        let voltage = [0x51, 0x50, 0x00, 0x00, 0x00, 0x00, 0xFF, 0x9C];
        assert_eq!(Reply::decode(&voltage), Ok(Reply::Voltage { voltage: Decivolts(65_436) }));
        let extended = [0x51, 0x50, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0x9C];
        assert_eq!(Reply::decode(&extended), Err(DecodeError::UpperHalf { got: 0xFFFF }));
    }

    /// Thruster manual §4.1: a 32-bit position, negative ones included.
    #[test]
    fn measured_position_has_32_bits() {
        let bytes = [0x51, 0x41, 0x00, 0x00, 0xFF, 0xFF, 0xFC, 0x7C];
        let reply = Reply::MeasuredPosition { position: Decidegrees(-900) };
        assert_eq!(Reply::decode(&bytes), Ok(reply));
        assert_eq!(reply.encode(), Ok(Payload::Full(bytes)));
    }

    /// The reply to CF and LS is not drawn: with and without data.
    #[test]
    fn bare_replies_come_short_or_full() {
        let full = [0x43, 0x46, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00];
        assert_eq!(Reply::decode(&full), Ok(Reply::FaultsCleared));
        assert_eq!(Reply::decode(&[0x43, 0x46, 0x00, 0x00]), Ok(Reply::FaultsCleared));
        assert_eq!(Reply::FaultsCleared.encode(), Ok(Payload::Full(full)));
        assert_eq!(Reply::decode(&[0x4C, 0x53, 0x00, 0x00]), Ok(Reply::EmergencyStop));
    }

    /// Thruster manual §1.3: the reply to a query carries data.
    #[test]
    fn a_query_reply_without_data_is_refused() {
        let short = Reply::decode(&[0x51, 0x56, 0x00, 0x00]);
        assert_eq!(short, Err(DecodeError::Length { got: 4, expected: 8 }));
    }

    /// Thruster manual §2.4: returned frames (`54 01`) are not named here and keep their bytes.
    #[test]
    fn other_replies_keep_their_bytes() {
        let payload = Payload::Full([0x54, 0x01, 0x03, 0xE8, 0x00, 0xF0, 0x00, 0x0A]);
        assert_eq!(Reply::decode(payload.as_slice()), Ok(Reply::Unknown { payload }));
        assert_eq!(Reply::Unknown { payload }.encode(), Ok(payload));
    }
}
