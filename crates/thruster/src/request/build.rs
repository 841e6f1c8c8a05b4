//! A request from a name and numbers.

use codec::{BuildError, CommandInfo, Fields};

use super::Request;
use crate::field::command;
use crate::returned::{ReturnFlags, ReturnFrames};
use crate::table::{self, COMMANDS, field as f};
use crate::units::{Decidegrees, Kilobits, LimitDecidegrees, Milliseconds, Percent, Rpm, RpmLimit};

impl Request {
    /// The command of this name in [`COMMANDS`](crate::COMMANDS) with the values that `fields` gives for the names in
    /// its [`request`](crate::CommandInfo::request), in the units of those names; a bit mask as a number.
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
        let info = COMMANDS.iter().find(|info| info.name == name).ok_or(BuildError::UnknownCommand)?;
        let request = fill(info, &Fields(fields))?;
        request.encode()?;
        Ok(request)
    }
}

fn fill(info: &CommandInfo, fields: &Fields<'_>) -> Result<Request, BuildError> {
    Ok(match info.code {
        command::TC => Request::Signal { signal: Percent(fields.count(&f::SIGNAL)?) },
        command::VC => Request::Speed { speed: Rpm(fields.count(&f::SPEED)?) },
        command::QV => Request::ReadSpeed,
        command::QC => Request::ReadCurrent,
        command::QP => Request::ReadVoltage,
        command::QT => Request::ReadMotorTemperature,
        command::EQ => Request::ReadDriverTemperature,
        command::EF => Request::ReadFaults,
        command::CF => Request::ClearFaults,
        command::MQ => Request::RequestMode,
        command::ML => Request::LowSpeedMode,
        command::MM => Request::MediumSpeedMode,
        command::CI => Request::SetId { id: fields.count(&f::ID)? },
        command::CB => Request::SetBitrate { bitrate: Kilobits(fields.count(&f::BITRATE)?) },
        command::ST => Request::SetTimeout { timeout: Milliseconds(fields.count(&f::TIMEOUT)?) },
        command::VM => Request::ConfigureReturn {
            flags: ReturnFlags::from_bits_retain(fields.count(&f::FLAGS)?),
            frames: ReturnFrames::from_bits_retain(fields.count(&f::FRAMES)?),
        },
        command::SR => Request::ConfigureStream {
            frames: ReturnFrames::from_bits_retain(fields.count(&f::FRAMES)?),
            interval: Milliseconds(fields.count(&f::INTERVAL)?),
        },
        command::FR => Request::ReadFaultRecord,
        command::SP if *info == table::SET_POSITION_LIMITS => Request::SetPositionLimits {
            reverse: LimitDecidegrees(fields.count(&f::REVERSE)?),
            forward: LimitDecidegrees(fields.count(&f::FORWARD)?),
        },
        command::SP => {
            let (parameter, value) = (fields.count(&f::PARAMETER)?, fields.count::<u32>(&f::VALUE)?);
            Request::SetParameter { parameter, data: value.to_be_bytes() }
        }
        command::RP if *info == table::READ_POSITION_LIMITS => Request::ReadPositionLimits,
        command::RP => Request::ReadParameter { parameter: fields.count(&f::PARAMETER)? },
        command::LA => Request::AbsolutePosition {
            speed: RpmLimit(fields.count(&f::MOVE_SPEED)?),
            position: Decidegrees(fields.count(&f::ANGLE)?),
        },
        command::QA => Request::ReadAbsolutePosition,
        command::AZ => Request::SetAbsoluteZero,
        command::LR => Request::RelativePosition {
            speed: RpmLimit(fields.count(&f::MOVE_SPEED)?),
            position: Decidegrees(fields.count(&f::WIDE_ANGLE)?),
        },
        command::QR => Request::ReadRelativePosition,
        command::RZ => Request::SetRelativeZero,
        command::RC => Request::ClearRelativePosition,
        command::LS => Request::EmergencyStop,
        // The rest of the table is what devices return by themselves.
        _ => return Err(BuildError::UnknownCommand),
    })
}
