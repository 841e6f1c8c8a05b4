//! What a motor answers: the bytes between id and checksum of each reply. The replies themselves
//! are in the [table](crate::table).

use crate::command;
use crate::error::{DecodeError, EncodeError};
use crate::field::RESET_MARK;
use crate::motor_error::MotorError;
use crate::payload::Payload;
pub use crate::table::Reply;

impl Reply {
    /// The bytes between id and checksum.
    ///
    /// Registers and values are not judged, a motor may answer anything; refused are only bytes
    /// that mean an error or another reply.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        self.check()?;
        let payload = self.to_payload();
        if Reply::decode(&payload) == Ok(*self) {
            return Ok(payload);
        }
        let reason = "its bytes mean an error or another reply";
        Err(EncodeError::Forbidden { field: "command", value: i64::from(self.command()), reason })
    }

    /// The reply in the bytes between id and checksum. An error reply can carry any command.
    pub fn decode(payload: &Payload) -> Result<Reply, DecodeError> {
        payload.width()?;
        let code = payload.command();
        if let Some(error) = MotorError::of(payload) {
            return Ok(Reply::Error { error, command: code });
        }
        Reply::decode_row(code, payload, || match code {
            command::RESET_DONE => payload.expect_fixed([RESET_MARK; 3]).map(|()| Reply::ResetDone),
            _ => Ok(Reply::Unknown { raw: *payload }),
        })
    }
}
