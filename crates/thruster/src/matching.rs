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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Decidegrees, Percent, Rpm, RpmLimit};

    fn received(bytes: [u8; 8]) -> Reply {
        Reply::decode(&bytes).unwrap()
    }

    /// Thruster manual §1.3: echo, refusal, and a reply to something else.
    #[test]
    fn the_command_word_decides() {
        let request = Request::Signal { signal: Percent(5) };
        let echo = received([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0x00, 0x05]);
        let refusal = received([0x54, 0x43, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE]);
        let voltage = received([0x51, 0x50, 0x00, 0x00, 0x00, 0x00, 0x00, 0x05]);
        assert_eq!(answer(&request, &echo), Answer::Reply(Reply::Signal { signal: Percent(5) }));
        assert_eq!(answer(&request, &refusal), Answer::Refused);
        assert_eq!(answer(&request, &voltage), Answer::Unrelated);
        assert_eq!(answer(&Request::ReadSpeed, &refusal), Answer::Unrelated);
    }

    /// Thruster manual §4.1: the speed in bytes 2–3 of LA takes no part.
    #[test]
    fn the_speed_of_a_position_command_takes_no_part() {
        let request =
            Request::AbsolutePosition { speed: RpmLimit(300), position: Decidegrees(900) };
        let other_speed = received([0x4C, 0x41, 0x00, 0x00, 0x00, 0x00, 0x03, 0x84]);
        assert_eq!(answer(&request, &other_speed), Answer::Reply(other_speed));
        let refusal = received([0x4C, 0x41, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE]);
        assert_eq!(answer(&request, &refusal), Answer::Refused);
    }

    /// Thruster manual §1.3: the pattern of a refusal in a query's reply is a value.
    #[test]
    fn a_query_is_answered_by_any_value() {
        let speed = received([0x51, 0x56, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE]);
        let expected = Answer::Reply(Reply::MeasuredSpeed { speed: Rpm(-4370) });
        assert_eq!(answer(&Request::ReadSpeed, &speed), expected);
    }

    /// Thruster manual §2.4: `54 0n` stands for the echo of TC, `56 0n` for that of VC.
    #[test]
    fn a_returned_frame_answers_its_command() {
        let signal = Request::Signal { signal: Percent(5) };
        let of_signal = received([0x54, 0x01, 0x03, 0xE8, 0x00, 0xF0, 0x00, 0x0A]);
        let of_speed = received([0x56, 0x02, 0x00, 0x00, 0x00, 0x19, 0x00, 0x1E]);
        assert_eq!(answer(&signal, &of_signal), Answer::Reply(of_signal));
        assert_eq!(answer(&signal, &of_speed), Answer::Unsolicited);
        assert_eq!(answer(&Request::Speed { speed: Rpm(0) }, &of_speed), Answer::Reply(of_speed));
        assert_eq!(answer(&Request::ReadSpeed, &of_signal), Answer::Unsolicited);
    }

    /// Thruster manual §2.5 and §2.1: the power-on stream, and what ML and MM send.
    #[test]
    fn streams_answer_nothing() {
        let stream = received([0x41, 0x01, 0x03, 0xE8, 0x00, 0xF0, 0x00, 0x0A]);
        let speed = received([0x51, 0x56, 0x00, 0x00, 0x00, 0x00, 0x03, 0xE8]);
        let current = received([0x51, 0x43, 0x00, 0x00, 0x00, 0x00, 0x00, 0x0A]);
        for request in
            [Request::Signal { signal: Percent(5) }, Request::ReadFaults, Request::EmergencyStop]
        {
            for unasked in [stream, speed, current] {
                assert_eq!(answer(&request, &unasked), Answer::Unsolicited);
            }
        }
        assert_eq!(answer(&Request::ReadSpeed, &speed), Answer::Reply(speed));
        assert_eq!(answer(&Request::ReadCurrent, &speed), Answer::Unsolicited);
    }

    /// Thruster manual §2.7, §4.1: the sub-command counts for SP and RP.
    #[test]
    fn the_sub_command_of_a_parameter_counts() {
        let read = Request::ReadParameter { parameter: 0x4D01 };
        let value = received([0x52, 0x50, 0x4D, 0x01, 0x00, 0x00, 0xEE, 0xEE]);
        let limits = received([0x52, 0x50, 0x4C, 0x41, 0xFC, 0x7C, 0x03, 0x84]);
        assert_eq!(answer(&read, &value), Answer::Reply(value));
        assert_eq!(answer(&read, &limits), Answer::Unrelated);
        assert_eq!(answer(&Request::ReadPositionLimits, &limits), Answer::Reply(limits));
        let set = Request::SetParameter { parameter: 0x4D01, data: [0, 0, 0, 1] };
        let refusal = received([0x53, 0x50, 0x4D, 0x01, 0x00, 0x00, 0xEE, 0xEE]);
        let other_refusal = received([0x53, 0x50, 0x4C, 0x41, 0x00, 0x00, 0xEE, 0xEE]);
        assert_eq!(answer(&set, &refusal), Answer::Refused);
        assert_eq!(answer(&set, &other_refusal), Answer::Unrelated);
    }

    /// Thruster manual §2.7: a command that no manual names is matched by its command word, and
    /// refused like any other if it carries data.
    #[test]
    fn unknown_commands_match_by_command_word() {
        let query = Request::decode(&[0x5A, 0x5A, 0x00, 0x00]).unwrap();
        let set = Request::decode(&[0x5A, 0x5A, 0x00, 0x00, 0x00, 0x00, 0x00, 0x01]).unwrap();
        let pattern = received([0x5A, 0x5A, 0x00, 0x00, 0x00, 0x00, 0xEE, 0xEE]);
        let other = received([0x5A, 0x59, 0x00, 0x00, 0x00, 0x00, 0x00, 0x01]);
        assert_eq!(answer(&query, &pattern), Answer::Reply(pattern));
        assert_eq!(answer(&set, &pattern), Answer::Refused);
        assert_eq!(answer(&set, &other), Answer::Unrelated);
    }
}
