//! What a request does, by its number.

use host_protocol::{Call, requests as ask};

/// Whether a request can set a motor in motion, or make it possible.
pub(crate) fn moves(number: u16) -> bool {
    [
        ask::Arm::NUMBER,
        ask::ArmTogether::NUMBER,
        ask::Setpoint::NUMBER,
        ask::MoveRelative::NUMBER,
        ask::Native::NUMBER,
        ask::StartTogether::NUMBER,
        ask::Cycle::NUMBER,
        ask::RawSend::NUMBER,
        ask::ProvisionMotorTimeout::NUMBER,
    ]
    .contains(&number)
}

/// Whether a request stops.
pub(crate) fn stops(number: u16) -> bool {
    [ask::Stop::NUMBER, ask::EStop::NUMBER, ask::Disarm::NUMBER].contains(&number)
}

/// Whether a request that the gateway does not know for a repeated one does something again.
pub(crate) fn acts_each_time(number: u16) -> bool {
    moves(number) || number == ask::RawReceive::NUMBER
}
