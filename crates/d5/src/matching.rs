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
