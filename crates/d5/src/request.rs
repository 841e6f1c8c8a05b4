//! What the gateway sends.

use crate::error::{DecodeError, EncodeError};
use crate::field::{SELF_TEST_BYTES, command};
use crate::payload::{Payload, Value, Width};
use crate::register::Register;

mod build;
mod fields;
mod span;
#[cfg(test)]
mod tests;

pub(crate) use fields::{visit_register, visit_written};

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
    /// D4: read the magnetic angle (D5 manual, table row 14).
    ReadMagneticAngle,
    /// CF: self test (D5 manual, table rows 3 to 5). What a healthy motor answers is not printed.
    SelfTest,
    /// CE: the self test spoilt, which a motor must answer with a command error (D5 manual, table row 4).
    FaultySelfTest,
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
            Request::ReadMagneticAngle => command::READ_MAGNETIC_ANGLE,
            Request::SelfTest => command::SELF_TEST,
            Request::FaultySelfTest => command::FAULTY_SELF_TEST,
            Request::Unknown { raw } => raw.command(),
        }
    }

    /// The bytes between id and checksum; what the register table does not allow is refused.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        Ok(match *self {
            Request::QueryId | Request::Execute | Request::Reset | Request::ReadMagneticAngle => {
                Payload::fixed(self.command(), [0; 3])
            }
            Request::SelfTest | Request::FaultySelfTest => Payload::fixed(self.command(), SELF_TEST_BYTES),
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
            command::READ_MAGNETIC_ANGLE => bare(payload, Request::ReadMagneticAngle)?,
            command::SELF_TEST => {
                payload.expect_fixed(SELF_TEST_BYTES)?;
                Request::SelfTest
            }
            // No motor knows this command, so other bytes behind it are not wrong, only unknown.
            command::FAULTY_SELF_TEST if payload.expect_fixed(SELF_TEST_BYTES).is_ok() => {
                Request::FaultySelfTest
            }
            _ => Request::Unknown { raw: *payload },
        })
    }
}

fn bare(payload: &Payload, request: Request) -> Result<Request, DecodeError> {
    payload.expect_fixed([0; 3])?;
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
