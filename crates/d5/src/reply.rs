//! What a motor answers.

use crate::error::{DecodeError, EncodeError};
use crate::field::{
    ERROR_CHECKSUM, ERROR_COMMAND, ERROR_ID, ERROR_MARK, ID_MARK, RESET_MARK, TWO_DATA_BYTES, command,
};
use crate::payload::{Payload, Value};
use crate::register::Register;
use crate::units::TurnDegrees;

mod fields;
#[cfg(test)]
mod tests;

/// What a motor finds wrong with a request (D5 manual, table rows 3 to 5).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MotorError {
    /// The request was for another id.
    Id,
    /// The motor does not know the command.
    Command,
    /// The checksum of the request was wrong.
    Checksum,
}

/// A reply of one motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply {
    /// 01: the frame's id byte is the motor's id (D5 manual, table rows 1 and 2).
    Id,
    /// 02: a register, or two (D5 manual, table rows 7 and 8).
    Read {
        /// The register, or the lower of two.
        register: Register,
        /// Its value.
        value: Value,
    },
    /// 03: the write repeated (D5 manual, table rows 9 and 10).
    Written {
        /// The register.
        register: Register,
        /// Its new value.
        value: Value,
    },
    /// 04: the asynchronous write repeated; it waits (D5 manual, table rows 11 and 12).
    AsyncWritten {
        /// The register.
        register: Register,
        /// The value that waits.
        value: Value,
    },
    /// 05: the write that waited has been carried out (D5 manual, table row 13).
    Executed {
        /// The register.
        register: Register,
        /// Its new value.
        value: Value,
    },
    /// 00: the reset is done; it comes from the factory id (D5 manual, table row 6).
    ResetDone,
    /// D4: the magnetic angle (D5 manual, table row 14).
    MagneticAngle {
        /// 0..=360 degrees.
        angle: TurnDegrees,
    },
    /// CF: whatever a motor answers to a self test that is not an error; not printed.
    SelfTest {
        /// Length, command, address, low and high byte as they are.
        raw: Payload,
    },
    /// The motor finds a request faulty (D5 manual, table rows 3 to 5).
    Error {
        /// What is wrong.
        error: MotorError,
        /// Command code of that request; for a checksum error of the one before.
        command: u8,
    },
    /// A command that has no variant here.
    Unknown {
        /// Length, command, address, low and high byte as they are.
        raw: Payload,
    },
}

impl Reply {
    /// The command code.
    pub fn command(&self) -> u8 {
        match self {
            Reply::Id => command::QUERY_ID,
            Reply::Read { .. } => command::READ,
            Reply::Written { .. } => command::WRITE,
            Reply::AsyncWritten { .. } => command::ASYNC_WRITE,
            Reply::Executed { .. } => command::EXECUTE,
            Reply::ResetDone => command::RESET_DONE,
            Reply::MagneticAngle { .. } => command::READ_MAGNETIC_ANGLE,
            Reply::SelfTest { raw } | Reply::Unknown { raw } => raw.command(),
            Reply::Error { command, .. } => *command,
        }
    }

    /// The bytes between id and checksum.
    ///
    /// Registers and values are not judged, a motor may answer anything; refused are only bytes that mean an error
    /// or another reply.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        let payload = match *self {
            Reply::Id => Payload::fixed(command::QUERY_ID, [ID_MARK; 3]),
            Reply::Read { register, value }
            | Reply::Written { register, value }
            | Reply::AsyncWritten { register, value }
            | Reply::Executed { register, value } => Payload::carrying(self.command(), register.0, value),
            Reply::ResetDone => Payload::fixed(command::RESET_DONE, [RESET_MARK; 3]),
            Reply::Error { error, command } => {
                Payload::fixed(command, [error_address(error), ERROR_MARK, ERROR_MARK])
            }
            Reply::MagneticAngle { angle } => {
                let Register(address) = Register::MAGNETIC_ANGLE;
                Payload::carrying(command::READ_MAGNETIC_ANGLE, address, Value::Word(angle.0))
            }
            Reply::SelfTest { raw } | Reply::Unknown { raw } => raw,
        };
        if Reply::decode(&payload) == Ok(*self) {
            return Ok(payload);
        }
        let reason = "its bytes mean an error or another reply";
        Err(EncodeError::Forbidden { field: "command", value: i64::from(self.command()), reason })
    }

    /// The reply in the bytes between id and checksum. An error reply can carry any command.
    pub fn decode(payload: &Payload) -> Result<Reply, DecodeError> {
        payload.width()?;
        let Payload([_, code, address, ..]) = *payload;
        if let Some(error) = motor_error(payload) {
            return Ok(Reply::Error { error, command: code });
        }
        let register = Register(address);
        Ok(match code {
            command::QUERY_ID => marked(payload, ID_MARK, Reply::Id)?,
            command::READ => Reply::Read { register, value: payload.value()? },
            command::WRITE => Reply::Written { register, value: payload.value()? },
            command::ASYNC_WRITE => Reply::AsyncWritten { register, value: payload.value()? },
            command::EXECUTE => Reply::Executed { register, value: payload.value()? },
            command::RESET_DONE => marked(payload, RESET_MARK, Reply::ResetDone)?,
            command::READ_MAGNETIC_ANGLE => {
                let Register(register) = Register::MAGNETIC_ANGLE;
                Reply::MagneticAngle { angle: TurnDegrees(payload.word_at(register)?) }
            }
            command::SELF_TEST => Reply::SelfTest { raw: *payload },
            _ => Reply::Unknown { raw: *payload },
        })
    }
}

fn marked(payload: &Payload, mark: u8, reply: Reply) -> Result<Reply, DecodeError> {
    payload.expect_fixed([mark; 3])?;
    Ok(reply)
}

fn error_address(error: MotorError) -> u8 {
    match error {
        MotorError::Id => ERROR_ID,
        MotorError::Command => ERROR_COMMAND,
        MotorError::Checksum => ERROR_CHECKSUM,
    }
}

fn motor_error(payload: &Payload) -> Option<MotorError> {
    let Payload([TWO_DATA_BYTES, _, address, ERROR_MARK, ERROR_MARK]) = *payload else { return None };
    [MotorError::Id, MotorError::Command, MotorError::Checksum]
        .into_iter()
        .find(|error| error_address(*error) == address)
}
