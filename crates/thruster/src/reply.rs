//! What a device answers: the data field of each reply. The replies themselves are in the
//! [table](crate::table).

use codec::Decode;

use crate::command;
use crate::error::{DecodeError, EncodeError};
use crate::field::POSITION_LIMITS;
use crate::payload::Payload;
use crate::refused;
use crate::returned::{Headerless, ReturnSource, Returned};
pub use crate::table::Reply;

impl Reply {
    /// Whether nobody has asked for it. A speed or current may be an event too (ML and MM, Thruster
    /// manual §2.1), as may what follows the first returned frame; only the pending request
    /// tells, as [`answer`](crate::answer) does.
    pub const fn is_event(&self) -> bool {
        matches!(self, Reply::Returned(Returned { source: ReturnSource::Stream, .. }))
    }

    /// What it tells if it is the form without a header (Thruster manual §2.4); nothing if it
    /// begins as any other reply does.
    ///
    /// Only for a device that is set so, while its reply to TC or VC is due: see [`Headerless`].
    /// The command words and headers of the manual read as speeds beyond ±16 000 rpm, so that
    /// no speed of a device is lost.
    pub fn headerless(&self) -> Option<Headerless> {
        match self {
            Reply::Unknown { payload } => Headerless::decode(payload.as_slice()).ok(),
            _ => None,
        }
    }

    /// The data field; an echo outside the manual's range is refused, and so are bytes that mean a
    /// refusal, and an [`Unknown`](Reply::Unknown) whose command has a variant of its own.
    /// Reserved bits stay.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        self.check()?;
        let payload = self.to_payload();
        let (field, value) = match *self {
            Reply::Refused { command, parameter } => {
                return refused::check(command, parameter).map(|()| payload);
            }
            Reply::Unknown { .. } => {
                if matches!(Reply::decode(payload.as_slice()), Ok(Reply::Unknown { .. })) {
                    return Ok(payload);
                }
                let (value, reason) =
                    (i64::from(self.command()), "this command has a variant of its own");
                return Err(EncodeError::Forbidden { field: "command", value, reason });
            }
            Reply::Speed { speed } => ("speed", i64::from(speed.0)),
            Reply::ReturnConfigured { flags, .. } => ("flags", i64::from(flags.bits())),
            Reply::StreamConfigured { interval, .. } => ("interval", i64::from(interval.0)),
            Reply::ParameterSet { data, .. } => ("data", i64::from(u32::from_be_bytes(data))),
            Reply::RelativePosition { position, .. } => ("position", i64::from(position.0)),
            _ => return Ok(payload),
        };
        if payload.has_refusal_data() { Err(refused::meant(field, value)) } else { Ok(payload) }
    }

    /// The reply in a data field of 4 or 8 bytes.
    ///
    /// The bytes `00 00 EE EE` are a refusal in the reply to a set command only, never in a
    /// query's. What a device returns without a header is not found here; see [`Headerless`].
    pub fn decode(bytes: &[u8]) -> Result<Reply, DecodeError> {
        let payload = Payload::try_from(bytes)?;
        if payload.has_refusal_data()
            && let Some((command, parameter)) = refused::decode(&payload)?
        {
            return Ok(Reply::Refused { command, parameter });
        }
        // No command word ends with a number from 1 to 3, so none is taken for a header.
        if let Some(returned) = Returned::of(payload) {
            return Ok(Reply::Returned(returned));
        }
        match (payload.command(), payload.parameter()) {
            (command::SET_PARAMETER, POSITION_LIMITS) => {
                let (reverse, forward) = (Decode::get::<4>(&payload)?, Decode::get::<6>(&payload)?);
                Ok(Reply::PositionLimitsSet { reverse, forward })
            }
            (command::READ_PARAMETER, POSITION_LIMITS) => {
                let (reverse, forward) = (Decode::get::<4>(&payload)?, Decode::get::<6>(&payload)?);
                Ok(Reply::PositionLimits { reverse, forward })
            }
            (code, _) => Reply::decode_row(code, &payload, || Ok(Reply::Unknown { payload })),
        }
    }
}
