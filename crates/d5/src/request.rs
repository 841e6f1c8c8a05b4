//! What the gateway sends: the bytes between id and checksum of each command. The commands
//! themselves are in the [table](crate::table).

mod span;

use codec::{BuildError, Fields};

use crate::command;
use crate::error::{DecodeError, EncodeError};
use crate::field::SELF_TEST_BYTES;
use crate::payload::Payload;
pub use crate::table::Request;

impl Request {
    /// The bytes between id and checksum; what the register table does not allow is refused, and so
    /// is an [`Unknown`](Request::Unknown) that means something else and would go around that
    /// table.
    pub fn encode(&self) -> Result<Payload, EncodeError> {
        self.check()?;
        match *self {
            Request::Read { register, width } => register.check_read(width)?,
            Request::Write { register, value } | Request::AsyncWrite { register, value } => {
                register.check_write(value)?;
            }
            Request::Unknown { raw }
                if !matches!(Request::decode(&raw), Ok(Request::Unknown { .. })) =>
            {
                let reason = "a wrong length, or a command that has a variant of its own";
                return Err(EncodeError::Forbidden {
                    field: "command",
                    value: i64::from(raw.command()),
                    reason,
                });
            }
            _ => {}
        }
        Ok(self.to_payload())
    }

    /// The request in the bytes between id and checksum.
    ///
    /// Neither register nor value are judged: what is not allowed is decoded, and refused only by
    /// [`Request::encode`].
    pub fn decode(payload: &Payload) -> Result<Request, DecodeError> {
        payload.width()?;
        let no_row = || match payload.expect_fixed(SELF_TEST_BYTES) {
            Ok(()) if payload.command() == command::FAULTY_SELF_TEST => Ok(Request::FaultySelfTest),
            // No motor knows this command, so other bytes behind it are not wrong, only unknown.
            _ => Ok(Request::Unknown { raw: *payload }),
        };
        Request::decode_row(payload.command(), payload, no_row)
    }

    /// The command of this name in [`COMMANDS`](crate::COMMANDS) with the values that `fields`
    /// gives for the names in its [`request`](crate::CommandInfo::request), in the units of
    /// those names.
    ///
    /// What is written is given in the unit of the register, as `value` or under the name of the
    /// register's own field, [`RegisterInfo::field`](crate::RegisterInfo::field); what goes to
    /// the next register with it ([`Register::written_with`](crate::Register::written_with))
    /// under that one's. A read without `bytes` takes as many as the register has. A
    /// value outside its range is refused; inside it is rounded to the nearest count of the wire.
    ///
    /// ```
    /// use d5::{Register, Request, Value};
    ///
    /// let speed = |field: &str| match field {
    ///     "register" => Some(32.0),
    ///     "speed_dps" => Some(-600.0),
    ///     _ => None,
    /// };
    /// let request = Request::build("write", &speed)?;
    /// assert_eq!(request, Request::Write { register: Register::SPEED, value: Value::Word(0x8258) });
    /// # Ok::<(), d5::BuildError>(())
    /// ```
    pub fn build(name: &str, fields: &dyn Fn(&str) -> Option<f64>) -> Result<Request, BuildError> {
        let request =
            Request::build_row(name, &Fields(fields))?.ok_or(BuildError::UnknownCommand)?;
        request.encode()?;
        Ok(request)
    }
}
