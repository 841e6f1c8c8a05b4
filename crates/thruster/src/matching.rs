//! Whether a received reply answers the request that waits.

use crate::command;
use crate::field::POSITION_LIMITS;
use crate::payload::Payload;
use crate::reply::Reply;
use crate::request::Request;
use crate::returned::ReturnSource;

/// What a received reply is to a pending request.
///
/// There is no echo of our own among them: replies have ids of their own (Thruster manual §1.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Answer {
    /// It answers the request.
    Reply(Reply),
    /// The device refuses the request; EF says why (Thruster manual §1.3).
    Refused,
    /// No request is answered by it, but it may tell of the device: a frame that VM or SR asked for
    /// (Thruster manual §2.4, §2.5), or a speed or current such as ML and MM make a device send
    /// (§2.1).
    Unsolicited,
    /// It belongs to something else.
    Unrelated,
}

/// What `received` is to `request`, both of one node.
///
/// Only the command word decides, for SP and RP the sub-command too: bytes 2–3 carry the speed of a
/// position command, and the echoed value may be that of an earlier request of the same kind. A
/// caller who needs the value confirmed compares it. A speed that ML or MM sends cannot be told
/// from the answer to QV, nor a current from that to QC.
pub fn answer(request: &Request, received: &Reply) -> Answer {
    match received {
        Reply::Returned(returned) if answers_instead(returned.source, request) => {
            Answer::Reply(*received)
        }
        Reply::Returned(_) => Answer::Unsolicited,
        reply if reply.command() != request.command() => match reply {
            Reply::MeasuredSpeed { .. } | Reply::Current { .. } => Answer::Unsolicited,
            _ => Answer::Unrelated,
        },
        reply if sub_command_of_reply(reply) != sub_command_of_request(request) => {
            Answer::Unrelated
        }
        Reply::Refused { command, .. } if command::sets(*command) => Answer::Refused,
        Reply::Refused { .. } => Answer::Unrelated,
        // A command that carries data sets something, and can be refused (Thruster manual §1.2,
        // §1.3).
        Reply::Unknown { payload } if payload.has_refusal_data() && carries_data(request) => {
            Answer::Refused
        }
        reply => Answer::Reply(*reply),
    }
}

/// Whether VM makes a device return such a frame instead of the echo of this request (Thruster
/// manual §2.4).
fn answers_instead(source: ReturnSource, request: &Request) -> bool {
    matches!(
        (source, request),
        (ReturnSource::Signal, Request::Signal { .. })
            | (ReturnSource::Speed, Request::Speed { .. })
    )
}

fn carries_data(request: &Request) -> bool {
    matches!(request, Request::Unknown { payload: Payload::Full(_) })
}

fn sub_command_of_request(request: &Request) -> Option<u16> {
    match *request {
        Request::SetParameter { parameter, .. } | Request::ReadParameter { parameter } => {
            Some(parameter)
        }
        Request::SetPositionLimits { .. } | Request::ReadPositionLimits => Some(POSITION_LIMITS),
        _ => None,
    }
}

fn sub_command_of_reply(reply: &Reply) -> Option<u16> {
    match *reply {
        Reply::ParameterSet { parameter, .. }
        | Reply::Parameter { parameter, .. }
        | Reply::Refused { command: command::SET_PARAMETER, parameter } => Some(parameter),
        Reply::PositionLimitsSet { .. } | Reply::PositionLimits { .. } => Some(POSITION_LIMITS),
        _ => None,
    }
}
