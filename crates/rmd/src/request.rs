//! What the master sends: the eight data bytes of each command. The commands themselves are in the
//! [table](crate::table).

use core::convert::Infallible;

use codec::{BuildError, Decode, Effect, Fields, Visit};

use crate::command;
use crate::dialect::{Dialect, Dialects};
use crate::error::EncodeError;
use crate::field::DATA_LEN;
use crate::function::Function;
use crate::motion_mode::{MotionRanges, MotionTarget};
use crate::payload::Payload;
use crate::table;
pub use crate::table::Request;

impl Request {
    /// The eight data bytes.
    ///
    /// Refused are values outside the manual's ranges, a [`Function::Other`], and a
    /// [`Request::Unknown`] whose command has a variant of its own in any dialect: it would pass
    /// checks made on that variant unseen. Whether a motor has the command its dialect says:
    /// [`encode_in`](Request::encode_in).
    ///
    /// The data of motion mode and of the id commands mean something only under their own ids:
    /// [`can`](crate::can) and [`rs485`](crate::rs485) put them there.
    pub fn encode(&self) -> Result<[u8; DATA_LEN], EncodeError> {
        self.check()?;
        if let Request::Unknown { data } = self
            && Request::dialects_of(data) != Dialects::NONE
        {
            let reason = "this command has a request of its own";
            return Err(EncodeError::Forbidden {
                field: "command",
                value: i64::from(self.command()),
                reason,
            });
        }
        Ok(self.to_bytes())
    }

    /// The request that eight data bytes to a single motor of V3.6 hold, as the motor takes it:
    /// bytes without a meaning are passed over. Every byte string is one: what is not listed is
    /// `Unknown`.
    ///
    /// The bytes do not tell motion mode and the id commands: their ids do, and [`can`](crate::can)
    /// and [`rs485`](crate::rs485) look at those.
    pub fn decode(data: &[u8; DATA_LEN]) -> Request {
        let request = Request::decode_row_of(data);
        let is_known = request.dialects().contains(Dialect::V3_6);
        if is_known { request } else { Request::Unknown { data: *data } }
    }

    /// The request by its code alone, in its oldest form.
    pub(crate) fn decode_row_of(data: &[u8; DATA_LEN]) -> Request {
        let [code, ..] = *data;
        let Ok(request) = Request::decode_any(code, data);
        request
    }

    // Not inlined: it then writes the request where the caller wants it, which takes a third fewer
    // instructions.
    #[inline(never)]
    fn decode_any(code: u8, data: &[u8; DATA_LEN]) -> Result<Request, Infallible> {
        Request::decode_row(code, data, || match code {
            command::FUNCTION => {
                Decode::<Payload>::get::<1>(data).map(|function| Request::Function { function })
            }
            _ => Ok(Request::Unknown { data: *data }),
        })
    }

    /// The data bytes, whether or not they may be sent.
    pub(crate) fn to_bytes(self) -> [u8; DATA_LEN] {
        self.to_payload()
    }

    /// The command of this name in [`COMMANDS`](crate::COMMANDS) with the values that `fields`
    /// gives for the names in its [`request`](crate::CommandInfo::request), in the units of
    /// those names; 0 or 1 for a bool. Motion mode in the manual's ranges.
    ///
    /// A value outside its range is refused; inside it is rounded to the nearest count of the wire.
    ///
    /// ```
    /// use rmd::{Centiamps, Request};
    ///
    /// let request = Request::build("torque_current", &|field| (field == "current_a").then_some(-1.0))?;
    /// assert_eq!(request, Request::TorqueCurrent { current: Centiamps(-100) });
    /// # Ok::<(), rmd::BuildError>(())
    /// ```
    pub fn build(name: &str, fields: &dyn Fn(&str) -> Option<f64>) -> Result<Request, BuildError> {
        Request::build_in(&MotionRanges::DEFAULT, name, fields)
    }

    /// [`build`](Request::build) with motion mode in these ranges.
    pub fn build_in(
        ranges: &MotionRanges,
        name: &str,
        fields: &dyn Fn(&str) -> Option<f64>,
    ) -> Result<Request, BuildError> {
        let fields = Fields(fields);
        let request = if name == table::MOTION_MODE.name {
            Request::MotionMode { command: ranges.command(&MotionTarget::build(&fields)?)? }
        } else if let Some(function) = Function::build_row(name, &fields)? {
            Request::Function { function }
        } else {
            Request::build_row(name, &fields)?.ok_or(BuildError::UnknownCommand)?
        };
        request.encode()?;
        Ok(request)
    }

    /// [`visit_fields`](Request::visit_fields) with motion mode in these ranges.
    pub fn visit_fields_in(&self, ranges: &MotionRanges, visit: &mut Visit<'_>) {
        match self {
            Request::MotionMode { command } => ranges.target(command).visit(visit),
            _ => self.visit_fields(visit),
        }
    }

    /// Whether the command only asks: it moves nothing, stops nothing and changes nothing in the
    /// motor. A command that the manual does not list may do any of these.
    pub const fn only_reads(&self) -> bool {
        matches!(self.effect(), Effect::Reads)
    }

    /// Whether it acts only after a restart of the motor (RMD V3.6 §2.9, §2.10, §2.33.4).
    pub const fn acts_after_restart(&self) -> bool {
        matches!(self.effect(), Effect::Later)
    }

    /// Whether a motor answers at all. What comes back after 0xB4 is random and answers nothing
    /// (RMD V3.6 §2.25.3, §2.31.3).
    pub const fn is_answered(&self) -> bool {
        !matches!(
            self,
            Request::Reset | Request::SetBaudRate { .. } | Request::SetActiveReply { .. }
        )
    }
}
