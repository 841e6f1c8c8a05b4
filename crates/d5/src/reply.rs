//! What a motor answers.

use crate::error::{DecodeError, EncodeError};
use crate::field::{
    ERROR_CHECKSUM, ERROR_COMMAND, ERROR_ID, ERROR_MARK, ID_MARK, RESET_MARK, TWO_DATA_BYTES, command,
};
use crate::payload::{Payload, Value};
use crate::register::Register;

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
            Reply::Error { command, .. } => *command,
            Reply::Unknown { raw } => raw.command(),
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
            Reply::Unknown { raw } => raw,
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
            _ => Reply::Unknown { raw: *payload },
        })
    }
}

fn marked(payload: &Payload, mark: u8, reply: Reply) -> Result<Reply, DecodeError> {
    payload.expect_fixed(mark)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    fn both_ways(bytes: [u8; 5], reply: Reply) {
        assert_eq!(Reply::decode(&Payload(bytes)), Ok(reply));
        assert_eq!(reply.encode(), Ok(Payload(bytes)));
    }

    /// D5 manual, table rows 1 and 6.
    #[test]
    fn replies_with_fixed_bytes() {
        both_ways([0x05, 0x01, 0xCC, 0xCC, 0xCC], Reply::Id);
        both_ways([0x05, 0x00, 0xFF, 0xFF, 0xFF], Reply::ResetDone);
        let odd = Reply::decode(&Payload([0x05, 0x01, 0xCC, 0xCD, 0xCC]));
        assert_eq!(odd, Err(DecodeError::FixedByte { offset: 5, got: 0xCD, expected: 0xCC }));
    }

    /// D5 manual, table rows 7 to 13.
    #[test]
    fn replies_with_a_register() {
        let register = Register::ACCELERATION;
        both_ways([0x05, 0x02, 0x15, 0x48, 0x48], Reply::Read { register, value: Value::Word(0x4848) });
        both_ways([0x04, 0x02, 0x15, 0x48, 0x00], Reply::Read { register, value: Value::Byte(0x48) });
        let speed = Register::SPEED;
        both_ways(
            [0x05, 0x03, 0x20, 0x11, 0x11],
            Reply::Written { register: speed, value: Value::Word(0x1111) },
        );
        let waits = Reply::AsyncWritten { register: speed, value: Value::Word(0x040B) };
        both_ways([0x05, 0x04, 0x20, 0x0B, 0x04], waits);
        // Repeats the stored write, here the upper half of the speed, with command 05.
        let executed = Reply::Executed { register: Register(0x21), value: Value::Byte(0x84) };
        both_ways([0x04, 0x05, 0x21, 0x84, 0x00], executed);
    }

    /// D5 manual, table rows 3 to 5, with commands the codec names and others.
    #[test]
    fn errors_come_with_any_command() {
        for command in [0x00, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0xCE, 0xCF, 0xD4, 0xFF] {
            both_ways([0x05, command, 0x01, 0xEE, 0xEE], Reply::Error { error: MotorError::Id, command });
            both_ways(
                [0x05, command, 0x03, 0xEE, 0xEE],
                Reply::Error { error: MotorError::Command, command },
            );
            both_ways(
                [0x05, command, 0x07, 0xEE, 0xEE],
                Reply::Error { error: MotorError::Checksum, command },
            );
        }
    }

    /// D5 manual, table rows 3 to 5: only these addresses, only two data bytes; elsewhere EE EE is a value.
    #[test]
    fn ee_ee_elsewhere_is_a_value() {
        let speed = Reply::Read { register: Register::CURRENT_SPEED, value: Value::Word(0xEEEE) };
        both_ways([0x05, 0x02, 0x26, 0xEE, 0xEE], speed);
        both_ways(
            [0x04, 0x02, 0x03, 0xEE, 0x00],
            Reply::Read { register: Register::ID, value: Value::Byte(0xEE) },
        );
        let error = Reply::Read { register: Register::ID, value: Value::Word(0xEEEE) }.encode();
        assert!(matches!(error, Err(EncodeError::Forbidden { field: "command", value: 0x02, .. })));
    }

    /// D5 manual, table row 14: 0xD4 is not named here and keeps its bytes.
    #[test]
    fn other_commands_keep_their_bytes() {
        let bytes = [0x05, 0xD4, 0x57, 0x61, 0x01];
        both_ways(bytes, Reply::Unknown { raw: Payload(bytes) });
        let named = Reply::Unknown { raw: Payload([0x05, 0x02, 0x15, 0x48, 0x48]) }.encode();
        assert!(matches!(named, Err(EncodeError::Forbidden { field: "command", value: 0x02, .. })));
    }
}
