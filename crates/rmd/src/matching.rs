//! Whether a received frame answers a request. Which motor it came from is the caller's to compare.

use crate::field::{DATA_LEN, command};
use crate::reply::Reply;
use crate::request::Request;

/// What a received frame says about a pending request.
///
/// The protocol has no refusal: a faulted motor keeps answering and does nothing (RMD V3.6 §2.17.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Answer {
    /// The motor's answer to the request.
    Reply(Reply),
    /// The motor threw a closed-loop command back unchanged: received, not executed, and no state in it.
    NotExecuted,
    /// The frame answers something else, or nothing.
    Unrelated,
}

/// Whether `received`, from the motor that `request` went to, answers it.
///
/// After its communication timeout a motor sends closed-loop commands (0xA1 to 0xA8) back unchanged. A cold motor at
/// rest at its zero point answers a command of all zeros with the same bytes, so there the equality proves nothing:
/// it counts as a reply, and only 0x9C tells whether the motor follows.
pub fn answer(request: &Request, received: &Reply) -> Answer {
    if matches!(received, Reply::TimeoutNotice { .. }) || received.command() != request.command() {
        return Answer::Unrelated;
    }
    if thrown_back(&request.to_bytes(), &received.to_bytes()) {
        return Answer::NotExecuted;
    }
    if let (Request::SetCommunicationTimeout { timeout: sent }, Reply::CommunicationTimeout { timeout }) =
        (request, received)
        && timeout != sent
        && timeout.0 != 0
    {
        return Answer::Unrelated;
    }
    Answer::Reply(*received)
}

/// Whether a motor's bytes are a closed-loop request's own, and cannot also be a state by chance.
fn thrown_back(sent: &[u8; DATA_LEN], received: &[u8; DATA_LEN]) -> bool {
    let [command, payload @ ..] = sent;
    command::CLOSED_LOOP.contains(command) && sent == received && payload.iter().any(|byte| *byte != 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Centiamps, Milliseconds};

    #[track_caller]
    fn of(request: [u8; 8], received: [u8; 8]) -> Answer {
        answer(&Request::decode(&request), &Reply::decode_full(&received))
    }

    #[track_caller]
    fn is_reply(request: [u8; 8], received: [u8; 8]) {
        assert_eq!(of(request, received), Answer::Reply(Reply::decode_full(&received)));
    }

    /// RMD V3.6 §2.11.4 to §2.20.4: the printed pairs.
    #[test]
    fn replies_answer_their_requests() {
        is_reply([0x92, 0, 0, 0, 0, 0, 0, 0], [0x92, 0, 0, 0, 0xA0, 0x8C, 0, 0]);
        is_reply([0x9A, 0, 0, 0, 0, 0, 0, 0], [0x9A, 0x32, 0, 0x01, 0xE5, 0x01, 0x04, 0]);
        is_reply([0x9C, 0, 0, 0, 0, 0, 0, 0], [0x9C, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
        is_reply([0xA1, 0, 0, 0, 0x64, 0, 0, 0], [0xA1, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
        is_reply([0xA2, 0, 0, 0, 0x10, 0x27, 0, 0], [0xA2, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
        is_reply([0xA4, 0, 0xF4, 0x01, 0xA0, 0x8C, 0, 0], [0xA4, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
    }

    /// RMD V3.6 §2.15.3, §2.16.3, §2.26.3, §2.27.3: for these the echo is the answer.
    #[test]
    fn echoes_answer_stops_and_brake() {
        for command in [0x80, 0x81, 0x77, 0x78] {
            is_reply([command, 0, 0, 0, 0, 0, 0, 0], [command, 0, 0, 0, 0, 0, 0, 0]);
        }
    }

    /// A query of a cold motor at rest is answered with the query's bytes.
    #[test]
    fn a_status_of_zeros_is_a_reply() {
        is_reply([0x92, 0, 0, 0, 0, 0, 0, 0], [0x92, 0, 0, 0, 0, 0, 0, 0]);
        is_reply([0x9C, 0, 0, 0, 0, 0, 0, 0], [0x9C, 0, 0, 0, 0, 0, 0, 0]);
    }

    /// The bytes of RMD V3.6 §2.17.4, §2.18.4, §2.20.4 and §2.22.4 thrown back.
    #[test]
    fn a_closed_loop_command_thrown_back_was_not_executed() {
        for data in [
            [0xA1, 0x00, 0x00, 0x00, 0x64, 0x00, 0x00, 0x00],
            [0xA2, 0x00, 0x00, 0x00, 0xF0, 0xD8, 0xFF, 0xFF],
            [0xA4, 0x00, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00],
            [0xA8, 0x00, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00],
        ] {
            assert_eq!(of(data, data), Answer::NotExecuted);
        }
    }

    /// Bytes 6 and 7 read as an angle of −32768, which cannot be encoded, must not hide that they were thrown back.
    #[test]
    fn thrown_back_with_an_angle_beyond_the_range() {
        let data = [0xA2, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x80];
        assert_eq!(of(data, data), Answer::NotExecuted);
    }

    /// Zero current and zero speed: the state of a motor at 0 °C, at rest, at its zero point has the same bytes.
    #[test]
    fn all_zero_counts_as_a_reply() {
        for command in [0xA1, 0xA2, 0xA4, 0xA8] {
            is_reply([command, 0, 0, 0, 0, 0, 0, 0], [command, 0, 0, 0, 0, 0, 0, 0]);
        }
    }

    /// RMD V3.6 §2.30.3 and §2.30.4 example 2; another timeout is the answer to an earlier request.
    #[test]
    fn timeout_is_answered_by_echo_or_zero() {
        let request = [0xB3, 0, 0, 0, 0xE8, 0x03, 0, 0];
        is_reply(request, [0xB3, 0, 0, 0, 0xE8, 0x03, 0, 0]);
        is_reply(request, [0xB3, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(of(request, [0xB3, 0, 0, 0, 0xE9, 0x03, 0, 0]), Answer::Unrelated);
        let off = Request::SetCommunicationTimeout { timeout: Milliseconds(0) };
        let reply = Reply::CommunicationTimeout { timeout: Milliseconds(1000) };
        assert_eq!(answer(&off, &reply), Answer::Unrelated);
    }

    #[test]
    fn other_commands_and_notices_answer_nothing() {
        let request = Request::TorqueCurrent { current: Centiamps(100) };
        let status = Reply::decode_full(&[0x9C, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
        assert_eq!(answer(&request, &status), Answer::Unrelated);
        assert_eq!(answer(&Request::Stop, &Reply::Shutdown), Answer::Unrelated);
        assert_eq!(of([0xF1, 0, 0, 0, 0, 0, 0, 0], [0xF1, 0, 0, 0, 0, 0, 0, 0]), Answer::Unrelated);
    }

    /// RMD V3.6 §2.14.4 (0x9D): a command without a variant is matched by its code.
    #[test]
    fn unknown_commands_are_matched_by_code() {
        is_reply([0x9D, 0, 0, 0, 0, 0, 0, 0], [0x9D, 0x32, 0xC2, 0x0B, 0x10, 0xFA, 0xC0, 0xF9]);
        assert_eq!(of([0x9D, 0, 0, 0, 0, 0, 0, 0], [0x70, 0, 0, 0, 0, 0, 0, 1]), Answer::Unrelated);
    }
}
