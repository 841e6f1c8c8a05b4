//! Whether a received reply answers the request that waits.

use crate::field::command;
use crate::reply::Reply;
use crate::request::Request;

/// What a received reply is to a pending request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Answer {
    /// It answers the request.
    Reply(Reply),
    /// The device refuses the request; EF says why (Thruster manual §1.3).
    Refused,
    /// It belongs to something else.
    Unrelated,
}

/// What `received` is to `request`, both of one node.
///
/// Only the command word decides: bytes 2–3 carry the speed of a position command, and the echoed value may be
/// that of an earlier request of the same kind. A caller who needs the value confirmed compares it.
pub fn answer(request: &Request, received: &Reply) -> Answer {
    if received.command() != request.command() {
        return Answer::Unrelated;
    }
    match received {
        Reply::Refused { command, .. } if command::SET.contains(command) => Answer::Refused,
        Reply::Refused { .. } => Answer::Unrelated,
        reply => Answer::Reply(*reply),
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
        let speed = received([0x51, 0x56, 0x00, 0x00, 0x00, 0x00, 0x00, 0x05]);
        assert_eq!(answer(&request, &echo), Answer::Reply(Reply::Signal { signal: Percent(5) }));
        assert_eq!(answer(&request, &refusal), Answer::Refused);
        assert_eq!(answer(&request, &speed), Answer::Unrelated);
        assert_eq!(answer(&Request::ReadSpeed, &refusal), Answer::Unrelated);
    }

    /// Thruster manual §4.1: the speed in bytes 2–3 of LA takes no part.
    #[test]
    fn the_speed_of_a_position_command_takes_no_part() {
        let request = Request::AbsolutePosition { speed: RpmLimit(300), position: Decidegrees(900) };
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

    /// Thruster manual §2.1: MQ, not named here, is matched by its command word.
    #[test]
    fn unknown_commands_match_by_command_word() {
        let request = Request::decode(&[0x4D, 0x51, 0x00, 0x00]).unwrap();
        let reply = Reply::decode(&[0x4D, 0x51, 0x00, 0x00]).unwrap();
        assert_eq!(answer(&request, &reply), Answer::Reply(reply));
        let other = Reply::decode(&[0x4D, 0x4C, 0x00, 0x00]).unwrap();
        assert_eq!(answer(&request, &other), Answer::Unrelated);
    }
}
