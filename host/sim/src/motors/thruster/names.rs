//! What the log calls the commands of a thruster.

use thruster::{Percent, Request, Rpm};

/// What the log calls a command; nothing for queries.
pub(super) fn name(request: &Request) -> Option<&'static str> {
    Some(match request {
        Request::Signal { signal: Percent(0) } => "TC 0",
        Request::Signal { .. } => "TC signal",
        Request::Speed { speed: Rpm(0) } => "VC 0",
        Request::Speed { .. } => "VC speed",
        Request::ClearFaults => "CF clear faults",
        Request::SetTimeout { .. } => "ST timeout",
        Request::RequestMode => "MQ request mode",
        Request::LowSpeedMode => "ML low speed mode",
        Request::MediumSpeedMode => "MM medium speed mode",
        Request::SetId { .. } => "CI id",
        Request::SetBitrate { .. } => "CB bitrate",
        Request::ConfigureReturn { .. } => "VM return format",
        Request::ConfigureStream { .. } => "SR stream",
        Request::SetParameter { .. } => "SP parameter",
        Request::AbsolutePosition { .. } => "LA position",
        Request::SetAbsoluteZero => "AZ absolute zero",
        Request::SetPositionLimits { .. } => "SP LA position limits",
        Request::RelativePosition { .. } => "LR relative position",
        Request::SetRelativeZero => "RZ relative zero",
        Request::ClearRelativePosition => "RC clear relative position",
        Request::EmergencyStop => "LS emergency stop",
        request if request.only_reads() => return None,
        _ => "other",
    })
}
