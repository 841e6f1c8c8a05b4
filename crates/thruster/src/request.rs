//! What the gateway sends: the data field of each command. The commands themselves are in the
//! [table](crate::table).

use codec::{BuildError, Decode, Effect, Fields};

use crate::command;
use crate::error::{DecodeError, EncodeError};
use crate::field::POSITION_LIMITS;
use crate::payload::Payload;
use crate::refused;
pub use crate::table::Request;

impl Request {
    /// The data field; a value outside the manual's range is refused, and so are bytes that mean a
    /// refusal, and an [`Unknown`](Request::Unknown) whose command has a variant of its own.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        self.check()?;
        if let Request::Unknown { payload } = self
            && !matches!(Request::decode(payload.as_slice()), Ok(Request::Unknown { .. }))
        {
            let reason = "this command has a variant of its own";
            return Err(EncodeError::Forbidden {
                field: "command",
                value: i64::from(self.command()),
                reason,
            });
        }
        let payload = self.to_payload();
        if !payload.has_refusal_data() {
            return Ok(payload);
        }
        let (field, value) = match *self {
            Request::Speed { speed } => ("speed", i64::from(speed.0)),
            Request::ConfigureStream { interval, .. } => ("interval", i64::from(interval.0)),
            Request::SetParameter { data, .. } => ("data", i64::from(u32::from_be_bytes(data))),
            Request::RelativePosition { position, .. } => ("position", i64::from(position.0)),
            _ => ("command", i64::from(self.command())),
        };
        Err(refused::meant(field, value))
    }

    /// The request in a data field of 4 or 8 bytes.
    ///
    /// What carries no data is accepted in both lengths (public drivers pad with zeros). Values are
    /// not judged: an out-of-range one is decoded, and refused only by [`Request::encode`].
    pub fn decode(bytes: &[u8]) -> Result<Request, DecodeError> {
        let payload = Payload::try_from(bytes)?;
        match (payload.command(), payload.parameter()) {
            (command::SET_PARAMETER, POSITION_LIMITS) => {
                let (reverse, forward) = (Decode::get::<4>(&payload)?, Decode::get::<6>(&payload)?);
                Ok(Request::SetPositionLimits { reverse, forward })
            }
            (command::READ_PARAMETER, POSITION_LIMITS) => {
                payload.expect_no_data()?;
                Ok(Request::ReadPositionLimits)
            }
            (code, _) => Request::decode_row(code, &payload, || Ok(Request::Unknown { payload })),
        }
    }

    /// The command of this name in [`COMMANDS`](crate::COMMANDS) with the values that `fields`
    /// gives for the names in its [`request`](crate::CommandInfo::request), in the units of
    /// those names; a bit mask as a number.
    ///
    /// A value outside its range is refused; inside it is rounded to the nearest count of the wire.
    ///
    /// ```
    /// use thruster::{Percent, Request};
    ///
    /// let request = Request::build("signal", &|field| (field == "signal_percent").then_some(-5.0))?;
    /// assert_eq!(request, Request::Signal { signal: Percent(-5) });
    /// # Ok::<(), thruster::BuildError>(())
    /// ```
    pub fn build(name: &str, fields: &dyn Fn(&str) -> Option<f64>) -> Result<Request, BuildError> {
        let request =
            Request::build_row(name, &Fields(fields))?.ok_or(BuildError::UnknownCommand)?;
        request.encode()?;
        Ok(request)
    }

    /// Whether the command only asks: it moves nothing, stops nothing and changes nothing in the
    /// device. A command that the manual does not list may do any of these.
    pub const fn only_reads(&self) -> bool {
        matches!(self.effect(), Effect::Reads)
    }

    /// Whether it acts only after the device was switched off and on: there is no command to
    /// restart it (Thruster manual §2.2).
    pub const fn acts_after_power_cycle(&self) -> bool {
        matches!(self.effect(), Effect::Later)
    }
}
