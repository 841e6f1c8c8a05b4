//! What the motor sends: the data bytes of each reply and of the timeout notice. The replies
//! themselves are in the [table](crate::table).

use core::convert::Infallible;

use codec::{Decode, Visit};

use crate::command;
use crate::dialect::Dialect;
use crate::error::{DecodeError, EncodeError};
use crate::field::DATA_LEN;
use crate::motion_mode::MotionRanges;
use crate::notice::RawNotice;
use crate::payload::Payload;
use crate::request::Request;
pub use crate::table::Reply;

impl Reply {
    /// The eight data bytes; a short timeout notice is filled up with zeros.
    ///
    /// Refused are values outside the manual's ranges, a
    /// [`Function::Other`](crate::Function::Other), and a [`Reply::Unknown`] whose command has
    /// a variant of its own.
    pub fn encode(&self) -> Result<[u8; DATA_LEN], EncodeError> {
        self.check()?;
        if let Reply::Unknown { data } = self
            && !matches!(Reply::decode_full_in(Dialect::V3_6, data), Reply::Unknown { .. })
        {
            let reason = "this command has a reply of its own";
            return Err(EncodeError::Forbidden {
                field: "command",
                value: i64::from(self.command()),
                reason,
            });
        }
        Ok(self.to_bytes())
    }

    /// The reply that the data bytes of a single motor's frame hold: eight of them, except that a
    /// timeout notice may be shorter.
    ///
    /// The bytes do not tell motion mode and the id commands: their ids do, and [`can`](crate::can)
    /// and [`rs485`](crate::rs485) look at those.
    pub fn decode(data: &[u8]) -> Result<Reply, DecodeError> {
        Reply::decode_in(Dialect::V3_6, data)
    }

    /// The reply that the data bytes of a motor of this dialect hold; where the dialect is unknown,
    /// the form of the bytes tells.
    pub fn decode_in(dialect: Dialect, data: &[u8]) -> Result<Reply, DecodeError> {
        if let Ok(data) = <&[u8; DATA_LEN]>::try_from(data) {
            return Ok(Reply::decode_full_in(dialect, data));
        }
        if let [command::TIMEOUT_NOTICE, payload @ ..] = data
            && let Ok(raw) = RawNotice::new(payload)
        {
            return Ok(Reply::TimeoutNotice { raw });
        }
        Err(DecodeError::Length { got: data.len(), expected: DATA_LEN })
    }

    /// The reply by its code alone, in its oldest form.
    pub(crate) fn decode_row_of(data: &[u8; DATA_LEN]) -> Reply {
        let [code, ..] = *data;
        let Ok(reply) = Reply::decode_any(code, data);
        reply
    }

    // Not inlined: it then writes the reply where the caller wants it, which takes a third fewer
    // instructions.
    #[inline(never)]
    fn decode_any(code: u8, data: &[u8; DATA_LEN]) -> Result<Reply, Infallible> {
        Reply::decode_row(code, data, || match code {
            command::FUNCTION => {
                Decode::<Payload>::get::<1>(data).map(|function| Reply::Function { function })
            }
            command::TIMEOUT_NOTICE => {
                Decode::<Payload>::get::<1>(data).map(|raw| Reply::TimeoutNotice { raw })
            }
            _ => Ok(Reply::Unknown { data: *data }),
        })
    }

    /// The data bytes, whether or not they may be sent.
    pub(crate) fn to_bytes(self) -> [u8; DATA_LEN] {
        self.to_payload()
    }

    /// Whether these are the bytes of `request`.
    pub fn repeats(&self, request: &Request) -> bool {
        self.to_bytes() == request.to_bytes()
    }

    /// Data bytes of this frame on CAN.
    pub(crate) fn frame_len(&self) -> usize {
        match self {
            Reply::TimeoutNotice { raw } => raw.frame_len(),
            _ => DATA_LEN,
        }
    }

    /// [`visit_fields`](Reply::visit_fields) with motion mode in these ranges.
    pub fn visit_fields_in(&self, ranges: &MotionRanges, visit: &mut Visit<'_>) {
        match self {
            Reply::MotionMode { feedback } => ranges.state(feedback).visit(feedback.id, visit),
            _ => self.visit_fields(visit),
        }
    }

    /// Whether nobody has asked for it. A [`Reply::Status1`] may be an event too (RMD V3.6
    /// §2.33.4); only the pending request tells, as [`answer`](crate::answer) does.
    pub const fn is_event(&self) -> bool {
        matches!(self, Reply::TimeoutNotice { .. })
    }
}
