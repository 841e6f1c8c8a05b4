//! Whether a received reply answers the request that waits.

use crate::motor_error::MotorError;
use crate::node::Node;
use crate::payload::Value;
use crate::register::Register;
use crate::reply::Reply;
use crate::request::Request;

/// What a received reply is to a pending request.
///
/// There is no echo of our own among them: a reply has a header of its own (D5 manual, frame
/// format).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Answer {
    /// It answers the request.
    Reply(Reply),
    /// The motor refuses the request: it does not know the command, or the checksum arrived wrong.
    Refused(MotorError),
    /// It does not answer the request, but tells which id a motor has: it answers a query of all
    /// ids, comes from the new id after a change, or from the factory id after a reset (D5
    /// manual, table rows 1 and 6, common commands, row 1).
    Unsolicited,
    /// It belongs to something else.
    Unrelated,
}

/// What `received`, a reply from motor `from`, is to `request`, sent to the one motor `node`.
///
/// A write is answered only by its own value, so that a late reply to an earlier speed does not
/// confirm a stop. The reply to an id change comes from the new id, the reply to a reset from
/// [`Node::FACTORY`]. Broadcasts have no single answer and are not for this function.
pub fn answer(request: &Request, node: Node, from: Node, received: &Reply) -> Answer {
    let answers = match received {
        Reply::Error { error, command } => {
            return match refusal(*error, *command, request) {
                Some(error) if from == node => Answer::Refused(error),
                _ => Answer::Unrelated,
            };
        }
        reply => from == request.answering_node(node) && has_the_answer_of(request, reply),
    };
    if answers {
        Answer::Reply(*received)
    } else if tells_an_id(received, from) {
        Answer::Unsolicited
    } else {
        Answer::Unrelated
    }
}

/// Whether a reply that answers nothing says which id its motor has.
fn tells_an_id(reply: &Reply, from: Node) -> bool {
    match *reply {
        Reply::Id => true,
        Reply::ResetDone => from == Node::FACTORY,
        Reply::Written { register: Register::ID, value: Value::Word(id) } => {
            id == u16::from(from.get())
        }
        _ => false,
    }
}

/// What an error says about the request, if it comes from its motor.
///
/// An id error is never for the motor addressed: some other motor objects to a request that was not
/// for it. The command of a checksum error is that of an earlier request (D5 manual, table row 3),
/// so it says nothing.
fn refusal(error: MotorError, command: u8, request: &Request) -> Option<MotorError> {
    match error {
        MotorError::Id => None,
        MotorError::Command => (command == request.command()).then_some(error),
        MotorError::Checksum => Some(error),
    }
}

impl Request {
    /// The motor whose reply to wait for after this request to `node`.
    ///
    /// A new id is confirmed from that id, a reset from the factory id (D5 manual, table row 6,
    /// common commands, row 1).
    pub fn answering_node(&self, node: Node) -> Node {
        match *self {
            Request::Write { register: Register::ID, value: Value::Word(id) } => {
                u8::try_from(id).ok().and_then(|id| Node::new(id).ok()).unwrap_or(node)
            }
            Request::Reset => Node::FACTORY,
            _ => node,
        }
    }
}

fn has_the_answer_of(request: &Request, reply: &Reply) -> bool {
    match (*request, *reply) {
        (Request::QueryId, Reply::Id)
        | (Request::Execute, Reply::Executed { .. })
        | (Request::Reset, Reply::ResetDone)
        | (Request::ReadMagneticAngle, Reply::MagneticAngle { .. })
        | (Request::SelfTest, Reply::SelfTest { .. }) => true,
        (Request::Read { register, width }, Reply::Read { register: read, value }) => {
            register == read && width == value.width()
        }
        (Request::Write { register, value }, Reply::Written { register: written, value: now }) => {
            // The motor resets this register by itself, so it may already show 0.
            let may_differ = register == Register::CLEAR_PROTECTION && value.width() == now.width();
            register == written && (value == now || may_differ)
        }
        (
            Request::AsyncWrite { register, value },
            Reply::AsyncWritten { register: written, value: waiting },
        ) => register == written && value == waiting,
        (Request::Unknown { raw }, Reply::Unknown { raw: received }) => {
            raw.command() == received.command()
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{decode_reply_frame, decode_request_frame};
    use crate::node::Address;

    /// What the reply frame is to the request frame.
    #[track_caller]
    fn of(request: [u8; 8], reply: [u8; 8]) -> Answer {
        let (Address::Node(node), request) = decode_request_frame(&request).unwrap() else {
            panic!("broadcast")
        };
        let (from, reply) = decode_reply_frame(&reply).unwrap();
        answer(&request, node, from, &reply)
    }

    #[track_caller]
    fn is_reply(request: [u8; 8], reply: [u8; 8]) {
        assert_eq!(of(request, reply), Answer::Reply(decode_reply_frame(&reply).unwrap().1));
    }

    const WRITE_SPEED: [u8; 8] = [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x11, 0x11, 0x55];
    const SPEED_WRITTEN: [u8; 8] = [0x5D, 0x0B, 0x05, 0x03, 0x20, 0x11, 0x11, 0x55];

    /// D5 manual, table rows 2 and 7 to 14: the printed pairs.
    #[test]
    fn printed_replies_answer_their_requests() {
        for (request, reply) in [
            (
                [0xD5, 0x0B, 0x05, 0x01, 0, 0, 0, 0x11],
                [0x5D, 0x0B, 0x05, 0x01, 0xCC, 0xCC, 0xCC, 0x75],
            ),
            (
                [0xD5, 0x0B, 0x05, 0x02, 0x15, 0, 0, 0x27],
                [0x5D, 0x0B, 0x05, 0x02, 0x15, 0x48, 0x48, 0xB7],
            ),
            (
                [0xD5, 0x0B, 0x04, 0x02, 0x15, 0, 0, 0x26],
                [0x5D, 0x0B, 0x04, 0x02, 0x15, 0x48, 0x00, 0x6E],
            ),
            (WRITE_SPEED, SPEED_WRITTEN),
            (
                [0xD5, 0x0B, 0x04, 0x03, 0x05, 0x22, 0, 0x39],
                [0x5D, 0x0B, 0x04, 0x03, 0x05, 0x22, 0x00, 0x39],
            ),
            (
                [0xD5, 0x0B, 0x05, 0x04, 0x20, 0x0B, 0x04, 0x43],
                [0x5D, 0x0B, 0x05, 0x04, 0x20, 0x0B, 0x04, 0x43],
            ),
            (
                [0xD5, 0x0B, 0x05, 0x05, 0, 0, 0, 0x15],
                [0x5D, 0x0B, 0x04, 0x05, 0x21, 0x84, 0x00, 0xB9],
            ),
            (
                [0xD5, 0x0B, 0x05, 0xD4, 0, 0, 0, 0xE4],
                [0x5D, 0x0B, 0x05, 0xD4, 0x57, 0x61, 0x01, 0x9D],
            ),
        ] {
            is_reply(request, reply);
        }
    }

    /// D5 manual, table row 6, and common commands, row 1: the reply has another id than the
    /// request.
    #[test]
    fn reset_and_id_change_answer_from_the_new_id() {
        let reset = [0xD5, 0x0D, 0x05, 0x06, 0x00, 0x00, 0x00, 0x18];
        is_reply(reset, [0x5D, 0x0B, 0x05, 0x00, 0xFF, 0xFF, 0xFF, 0x0D]);
        assert_eq!(of(reset, [0x5D, 0x0C, 0x05, 0x00, 0xFF, 0xFF, 0xFF, 0x0E]), Answer::Unrelated);
        let change = [0xD5, 0x0B, 0x05, 0x03, 0x03, 0x0D, 0x00, 0x23];
        is_reply(change, [0x5D, 0x0D, 0x05, 0x03, 0x03, 0x0D, 0x00, 0x25]);
        assert_eq!(of(change, [0x5D, 0x0B, 0x05, 0x03, 0x03, 0x0D, 0x00, 0x23]), Answer::Unrelated);
    }

    /// D5 manual, table rows 9 and 10: the reply repeats the write, so another value, width,
    /// register, command or motor is not it.
    #[test]
    fn only_its_own_echo_answers_a_write() {
        for other in [
            [0x5D, 0x0B, 0x05, 0x03, 0x20, 0x00, 0x00, 0x33],
            [0x5D, 0x0B, 0x04, 0x03, 0x20, 0x11, 0x00, 0x43],
            [0x5D, 0x0B, 0x05, 0x03, 0x26, 0x11, 0x11, 0x5B],
            [0x5D, 0x0B, 0x05, 0x04, 0x20, 0x11, 0x11, 0x56],
            [0x5D, 0x0C, 0x05, 0x03, 0x20, 0x11, 0x11, 0x56],
        ] {
            assert_eq!(of(WRITE_SPEED, other), Answer::Unrelated);
        }
    }

    /// D5 manual, table rows 7 and 8: a read is answered with its own register and width.
    #[test]
    fn a_read_is_answered_by_its_register_and_width() {
        let read = [0xD5, 0x0B, 0x05, 0x02, 0x26, 0x00, 0x00, 0x38];
        assert_eq!(of(read, [0x5D, 0x0B, 0x05, 0x02, 0x28, 0x00, 0x00, 0x3A]), Answer::Unrelated);
        assert_eq!(of(read, [0x5D, 0x0B, 0x04, 0x02, 0x26, 0x00, 0x00, 0x37]), Answer::Unrelated);
        is_reply(read, [0x5D, 0x0B, 0x05, 0x02, 0x26, 0x00, 0x00, 0x38]);
    }

    /// D5 manual, table rows 1 and 6, common commands, row 1: replies that tell an id, while
    /// something else waits.
    #[test]
    fn ids_are_told_unasked() {
        for told in [
            [0x5D, 0x0C, 0x05, 0x01, 0xCC, 0xCC, 0xCC, 0x76],
            [0x5D, 0x0B, 0x05, 0x00, 0xFF, 0xFF, 0xFF, 0x0D],
            [0x5D, 0x0D, 0x05, 0x03, 0x03, 0x0D, 0x00, 0x25],
        ] {
            assert_eq!(of(WRITE_SPEED, told), Answer::Unsolicited);
        }
    }

    /// D5 manual, table rows 3 to 5: the self test, sound and spoilt.
    #[test]
    fn self_tests() {
        let request = [0xD5, 0x0B, 0x05, 0xCF, 0x12, 0x34, 0x56, 0x7B];
        is_reply(request, [0x5D, 0x0B, 0x05, 0xCF, 0x12, 0x34, 0x56, 0x7B]);
        assert_eq!(of(request, SPEED_WRITTEN), Answer::Unrelated);
        let spoilt = [0xD5, 0x0B, 0x05, 0xCE, 0x12, 0x34, 0x56, 0x7A];
        let error = [0x5D, 0x0B, 0x05, 0xCE, 0x03, 0xEE, 0xEE, 0xBD];
        assert_eq!(of(spoilt, error), Answer::Refused(MotorError::Command));
    }

    /// D5 manual, register 0x19: the register returns to 0 by itself.
    #[test]
    fn the_echo_of_clear_protection_may_be_zero_already() {
        let clear = [0xD5, 0x0B, 0x04, 0x03, 0x19, 0x01, 0x00, 0x2C];
        is_reply(clear, [0x5D, 0x0B, 0x04, 0x03, 0x19, 0x01, 0x00, 0x2C]);
        is_reply(clear, [0x5D, 0x0B, 0x04, 0x03, 0x19, 0x00, 0x00, 0x2B]);
    }

    /// D5 manual, table row 5: motor 0x0B objects to a request for 0x0C; that is not the answer of
    /// 0x0C. Nor is it one when it seems to come from the motor addressed.
    #[test]
    fn an_id_error_answers_nothing() {
        let request = [0xD5, 0x0C, 0x05, 0xCF, 0x12, 0x34, 0x56, 0x7C];
        assert_eq!(
            of(request, [0x5D, 0x0B, 0x05, 0xCF, 0x01, 0xEE, 0xEE, 0xBC]),
            Answer::Unrelated
        );
        assert_eq!(
            of(request, [0x5D, 0x0C, 0x05, 0xCF, 0x01, 0xEE, 0xEE, 0xBD]),
            Answer::Unrelated
        );
    }

    /// D5 manual, table row 4: the error carries the command of the request.
    #[test]
    fn a_command_error_refuses_its_request() {
        let request = [0xD5, 0x0B, 0x05, 0xCE, 0x12, 0x34, 0x56, 0x7A];
        let error = [0x5D, 0x0B, 0x05, 0xCE, 0x03, 0xEE, 0xEE, 0xBD];
        assert_eq!(of(request, error), Answer::Refused(MotorError::Command));
        assert_eq!(of(WRITE_SPEED, error), Answer::Unrelated);
        let from_another = [0x5D, 0x0C, 0x05, 0xCE, 0x03, 0xEE, 0xEE, 0xBE];
        assert_eq!(of(request, from_another), Answer::Unrelated);
    }

    /// D5 manual, table row 3: the error carries the command of the request before.
    #[test]
    fn a_checksum_error_refuses_whatever_waits() {
        let error = [0x5D, 0x0B, 0x05, 0xCE, 0x07, 0xEE, 0xEE, 0xC1];
        assert_eq!(of(WRITE_SPEED, error), Answer::Refused(MotorError::Checksum));
        let from_another = [0x5D, 0x0C, 0x05, 0xCE, 0x07, 0xEE, 0xEE, 0xC2];
        assert_eq!(of(WRITE_SPEED, from_another), Answer::Unrelated);
    }
}
