//! What the gateway sends.

use crate::error::{DecodeError, EncodeError};
use crate::field::command;
use crate::payload::{Payload, Value, Width};
use crate::register::Register;

/// A request, to one motor or, where [`crate::Address::Broadcast`] allows it, to all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// 01: report the id (D5 manual, table rows 1 and 2).
    QueryId,
    /// 02: read a register, or two (D5 manual, table rows 7 and 8).
    Read {
        /// The register, or the lower of two.
        register: Register,
        /// How many bytes.
        width: Width,
    },
    /// 03: write a register (D5 manual, table rows 9 and 10).
    Write {
        /// The register.
        register: Register,
        /// Its new value.
        value: Value,
    },
    /// 04: prepare a write that the next execute carries out (D5 manual, table rows 11 and 12).
    AsyncWrite {
        /// The register.
        register: Register,
        /// Its new value.
        value: Value,
    },
    /// 05: carry out the write that waits (D5 manual, table row 13).
    Execute,
    /// 06: factory reset; the id becomes 0x0B as well (D5 manual, table row 6).
    Reset,
    /// A command that has no variant here.
    Unknown {
        /// Length, command, address, low and high byte as they are.
        raw: Payload,
    },
}

impl Request {
    /// The command code.
    pub fn command(&self) -> u8 {
        match self {
            Request::QueryId => command::QUERY_ID,
            Request::Read { .. } => command::READ,
            Request::Write { .. } => command::WRITE,
            Request::AsyncWrite { .. } => command::ASYNC_WRITE,
            Request::Execute => command::EXECUTE,
            Request::Reset => command::RESET,
            Request::Unknown { raw } => raw.command(),
        }
    }

    /// The bytes between id and checksum; what the register table does not allow is refused.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        Ok(match *self {
            Request::QueryId | Request::Execute | Request::Reset => Payload::fixed(self.command(), [0; 3]),
            Request::Read { register, width } => {
                register.check_read(width)?;
                Payload::asking(command::READ, register.0, width)
            }
            Request::Write { register, value } | Request::AsyncWrite { register, value } => {
                register.check_write(value)?;
                Payload::carrying(self.command(), register.0, value)
            }
            Request::Unknown { raw } => unknown(raw)?,
        })
    }

    /// The request in the bytes between id and checksum.
    ///
    /// Neither register nor value are judged: what is not allowed is decoded, and refused only by
    /// [`Request::encode`].
    pub fn decode(payload: &Payload) -> Result<Request, DecodeError> {
        let width = payload.width()?;
        let Payload([_, code, address, ..]) = *payload;
        let register = Register(address);
        Ok(match code {
            command::QUERY_ID => bare(payload, Request::QueryId)?,
            command::READ => {
                payload.expect_no_data()?;
                Request::Read { register, width }
            }
            command::WRITE => Request::Write { register, value: payload.value()? },
            command::ASYNC_WRITE => Request::AsyncWrite { register, value: payload.value()? },
            command::EXECUTE => bare(payload, Request::Execute)?,
            command::RESET => bare(payload, Request::Reset)?,
            _ => Request::Unknown { raw: *payload },
        })
    }
}

fn bare(payload: &Payload, request: Request) -> Result<Request, DecodeError> {
    payload.expect_fixed(0)?;
    Ok(request)
}

/// Lets raw bytes pass unless they mean something else, and so would go around the register table.
fn unknown(raw: Payload) -> Result<Payload, EncodeError> {
    if let Ok(Request::Unknown { raw }) = Request::decode(&raw) {
        return Ok(raw);
    }
    let reason = "a wrong length, or a command that has a variant of its own";
    Err(EncodeError::Forbidden { field: "command", value: i64::from(raw.command()), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both_ways(bytes: [u8; 5], request: Request) {
        assert_eq!(Request::decode(&Payload(bytes)), Ok(request));
        assert_eq!(request.encode(), Ok(Payload(bytes)));
    }

    /// D5 manual, table rows 2, 6 and 13.
    #[test]
    fn commands_without_a_register() {
        both_ways([0x05, 0x01, 0x00, 0x00, 0x00], Request::QueryId);
        both_ways([0x05, 0x05, 0x00, 0x00, 0x00], Request::Execute);
        both_ways([0x05, 0x06, 0x00, 0x00, 0x00], Request::Reset);
    }

    /// D5 manual, table rows 7 and 8.
    #[test]
    fn reads_of_two_bytes_and_of_one() {
        let register = Register::ACCELERATION;
        both_ways([0x05, 0x02, 0x15, 0x00, 0x00], Request::Read { register, width: Width::Word });
        both_ways([0x04, 0x02, 0x15, 0x00, 0x00], Request::Read { register, width: Width::Byte });
    }

    /// D5 manual, table rows 9, 10 and 11.
    #[test]
    fn writes_of_two_bytes_and_of_one() {
        let speed = Request::Write { register: Register::SPEED, value: Value::Word(0x1111) };
        both_ways([0x05, 0x03, 0x20, 0x11, 0x11], speed);
        let delay = Request::Write { register: Register::REPLY_DELAY, value: Value::Byte(0x22) };
        both_ways([0x04, 0x03, 0x05, 0x22, 0x00], delay);
        let later = Request::AsyncWrite { register: Register::SPEED, value: Value::Word(0x040B) };
        both_ways([0x05, 0x04, 0x20, 0x0B, 0x04], later);
    }

    /// D5 manual, table row 12 writes half of the speed: understood, not sent.
    #[test]
    fn half_a_word_is_decoded_and_not_encoded() {
        let half = Request::AsyncWrite { register: Register(0x21), value: Value::Byte(0x84) };
        assert_eq!(Request::decode(&Payload([0x04, 0x04, 0x21, 0x84, 0x00])), Ok(half));
        assert!(matches!(half.encode(), Err(EncodeError::Forbidden { field: "register", value: 0x21, .. })));
    }

    /// D5 manual, frame format: the length byte is 4 or 5, and with 4 the upper data byte is empty.
    #[test]
    fn odd_bytes_are_named() {
        for (bytes, error) in [
            ([0x03, 0x03, 0x10, 0x01, 0x00], DecodeError::Length { got: 3, expected: 5 }),
            ([0x06, 0xD4, 0x00, 0x00, 0x00], DecodeError::Length { got: 6, expected: 5 }),
            ([0x04, 0x03, 0x10, 0x01, 0x07], DecodeError::FixedByte { offset: 6, got: 7, expected: 0 }),
            ([0x05, 0x02, 0x20, 0x07, 0x00], DecodeError::FixedByte { offset: 5, got: 7, expected: 0 }),
            ([0x05, 0x05, 0x20, 0x00, 0x00], DecodeError::FixedByte { offset: 4, got: 0x20, expected: 0 }),
            ([0x04, 0x06, 0x00, 0x00, 0x00], DecodeError::FixedByte { offset: 2, got: 4, expected: 5 }),
        ] {
            assert_eq!(Request::decode(&Payload(bytes)), Err(error));
        }
    }

    /// D5 manual, table rows 4 and 14: commands not named here keep their bytes.
    #[test]
    fn other_commands_keep_their_bytes() {
        for bytes in [[0x05, 0xD4, 0x00, 0x00, 0x00], [0x05, 0xCE, 0x12, 0x34, 0x56]] {
            both_ways(bytes, Request::Unknown { raw: Payload(bytes) });
        }
    }

    /// D5 manual, register table: raw bytes do not write a read-only register either.
    #[test]
    fn raw_bytes_do_not_go_around_the_table() {
        for bytes in [[0x05, 0x03, 0x26, 0x00, 0x00], [0x05, 0x05, 0x01, 0x00, 0x00], [0x07, 0xD4, 0, 0, 0]] {
            let result = Request::Unknown { raw: Payload(bytes) }.encode();
            assert!(matches!(result, Err(EncodeError::Forbidden { field: "command", .. })));
        }
    }
}
