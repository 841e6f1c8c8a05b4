//! A request from a name and numbers.

use codec::{BuildError, CommandInfo, FieldInfo, Fields};

use super::Request;
use crate::field::command;
use crate::payload::{Value, Width};
use crate::register::Register;
use crate::table::{COMMANDS, field as f};

impl Request {
    /// The command of this name in [`COMMANDS`](crate::COMMANDS) with the values that `fields` gives for the names in
    /// its [`request`](crate::CommandInfo::request), in the units of those names.
    ///
    /// What is written is given in the unit of the register, as `value` or under the name of the register's own field,
    /// [`RegisterInfo::field`](crate::RegisterInfo::field); what goes to the next register with it
    /// ([`Register::written_with`]) under that one's. A read without `bytes` takes as many as the register has. A
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
        let info = COMMANDS.iter().find(|info| info.name == name).ok_or(BuildError::UnknownCommand)?;
        let request = fill(info, &Fields(fields))?;
        request.encode()?;
        Ok(request)
    }
}

fn fill(info: &CommandInfo, fields: &Fields<'_>) -> Result<Request, BuildError> {
    let code = u8::try_from(info.code).map_err(|_| BuildError::UnknownCommand)?;
    Ok(match code {
        command::QUERY_ID => Request::QueryId,
        command::READ => {
            let register = Register(fields.count(&f::REGISTER)?);
            Request::Read { register, width: width(register, fields)? }
        }
        command::WRITE => {
            let (register, value) = write(fields)?;
            Request::Write { register, value }
        }
        command::ASYNC_WRITE => {
            let (register, value) = write(fields)?;
            Request::AsyncWrite { register, value }
        }
        command::EXECUTE => Request::Execute,
        command::RESET => Request::Reset,
        command::READ_MAGNETIC_ANGLE => Request::ReadMagneticAngle,
        command::SELF_TEST => Request::SelfTest,
        command::FAULTY_SELF_TEST => Request::FaultySelfTest,
        _ => return Err(BuildError::UnknownCommand),
    })
}

fn width(register: Register, fields: &Fields<'_>) -> Result<Width, BuildError> {
    match (fields.count::<u8>(&f::BYTES), register.info()) {
        (Ok(1), _) => Ok(Width::Byte),
        (Ok(_), _) => Ok(Width::Word),
        (Err(BuildError::MissingField { .. }), Some(info)) => Ok(info.width),
        (Err(error), _) => Err(error),
    }
}

fn write(fields: &Fields<'_>) -> Result<(Register, Value), BuildError> {
    let register = Register(fields.count(&f::REGISTER)?);
    let Some(info) = register.info() else {
        // No register without a function is written; the codec says so of whatever value.
        register.check_write(Value::Byte(0))?;
        return Err(BuildError::UnknownCommand);
    };
    let own = info.field_info();
    let value: i64 = match fields.count(&own) {
        Err(BuildError::MissingField { .. }) => fields.count(&FieldInfo { name: f::VALUE.name, ..own })?,
        given => given?,
    };
    let value = info.encode(value)?;
    // What goes to the next register as well is given under that one's own name (D5 manual, table row 7, frame format).
    let next = register.written_with().map(|next| (next, fields.count::<i64>(&next.field_info())));
    match (value, next) {
        (Value::Byte(low), Some((next, Ok(high)))) => {
            let Value::Byte(high) = next.encode(high)? else { return Ok((register, value)) };
            Ok((register, Value::Word(u16::from_le_bytes([low, high]))))
        }
        (_, Some((_, Err(error)))) if !matches!(error, BuildError::MissingField { .. }) => Err(error),
        _ => Ok((register, value)),
    }
}
