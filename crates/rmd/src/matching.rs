//! Whether a received frame answers a request. Which motor it came from is the caller's to compare:
//! the one that the request went to, or for an id command the one that [`Request::answering_node`]
//! says.

use crate::command;
use crate::field::DATA_LEN;
use crate::node::Node;
use crate::reply::Reply;
use crate::request::Request;

/// What a received frame says about a pending request.
///
/// The protocol has no refusal: a faulted motor keeps answering and does nothing (RMD V3.6
/// §2.17.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Answer {
    /// The motor's answer to the request.
    Reply(Reply),
    /// The motor threw a closed-loop command back unchanged: received, not executed, and no state
    /// in it.
    NotExecuted,
    /// Our own bytes, heard on a line that carries both directions.
    Echo,
    /// The motor sent it on its own account: a timeout notice, or a 0x9A that reports a fault
    /// nobody asked about.
    Unsolicited,
    /// The frame answers something else, or nothing.
    Unrelated,
}

/// Whether `received`, from the motor that `request` went to, answers it.
///
/// After its communication timeout a motor sends closed-loop commands (0xA1 to 0xA8) back
/// unchanged. A motor at rest at its zero point answers a command of zeros with the same bytes, if
/// its temperature is 0 °C too, or the torque cap in that place of the command. There the equality
/// proves nothing: it counts as a reply, and only 0x9C tells whether the motor follows.
///
/// Nothing answers 0x76 and 0xB4 ([`Request::is_answered`]): they are done once sent.
pub fn answer(request: &Request, received: &Reply) -> Answer {
    if received.is_event() {
        return Answer::Unsolicited;
    }
    if !belongs(request, received) {
        return stray(received);
    }
    if thrown_back(&request.to_bytes(), &received.to_bytes()) {
        return Answer::NotExecuted;
    }
    Answer::Reply(*received)
}

/// [`answer`] on a half-duplex line that lets us hear ourselves. While `echo_due`, from the sending
/// until the echo has come, a frame equal to the request is our own; taken for a reply it would
/// confirm a stop that nobody received.
pub fn answer_on_line(request: &Request, received: &Reply, echo_due: bool) -> Answer {
    if echo_due && received.repeats(request) {
        return Answer::Echo;
    }
    answer(request, received)
}

impl Request {
    /// The motor whose reply to wait for after this request to `node`; `None` where any motor may
    /// answer.
    ///
    /// A new id is confirmed from that id (RMD V3.6 §4.3, §7.3).
    pub fn answering_node(&self, node: Node) -> Option<Node> {
        match self {
            Request::ReadCanId | Request::ReadRs485Id => None,
            Request::SetCanId { id } | Request::SetRs485Id { id } => Node::new(*id).ok(),
            _ => Some(node),
        }
    }
}

/// Whether a frame is of the kind that answers the request, and carries what it echoes of it.
fn belongs(request: &Request, received: &Reply) -> bool {
    match (request, received) {
        (Request::MotionMode { .. }, Reply::MotionMode { .. })
        | (Request::ReadCanId, Reply::CanId { .. })
        | (Request::ReadRs485Id, Reply::Rs485Id { .. }) => true,
        (Request::SetCanId { id }, Reply::CanIdSet { id: set })
        | (Request::SetRs485Id { id }, Reply::Rs485IdSet { id: set }) => *id == set.get(),
        _ if has_own_id(request) || is_under_own_id(received) => false,
        _ if request.command() != received.command() || !request.is_answered() => false,
        (
            Request::WritePidRam { .. }
            | Request::WritePidRom { .. }
            | Request::WriteAcceleration { .. }
            | Request::WriteGainRam { .. }
            | Request::WriteGainRom { .. }
            | Request::WriteEncoderOffset { .. }
            | Request::Function { .. },
            _,
        ) => request.to_bytes() == received.to_bytes(),
        (
            Request::SetCommunicationTimeout { timeout: sent },
            Reply::CommunicationTimeout { timeout },
        ) => timeout == sent || timeout.0 == 0,
        // A reply repeats the index: another one answers something else, or is an old one.
        (Request::ReadGain { .. } | Request::ReadRamp { .. }, _) => {
            head(request.to_bytes()) == head(received.to_bytes())
        }
        (Request::ReadModelPart { part: asked }, Reply::ModelPart { part, .. }) => part == asked,
        (Request::ReadModelPart { .. }, _) | (_, Reply::ModelPart { .. } | Reply::Gain { .. }) => {
            false
        }
        _ => true,
    }
}

/// Command and index.
fn head([command, index, ..]: [u8; DATA_LEN]) -> [u8; 2] {
    [command, index]
}

/// Requests under ids of their own, where a command code says nothing.
fn has_own_id(request: &Request) -> bool {
    matches!(
        request,
        Request::MotionMode { .. }
            | Request::ReadCanId
            | Request::SetCanId { .. }
            | Request::ReadRs485Id
            | Request::SetRs485Id { .. }
    )
}

/// Replies under ids of their own, where a command code says nothing.
fn is_under_own_id(reply: &Reply) -> bool {
    matches!(
        reply,
        Reply::MotionMode { .. }
            | Reply::CanId { .. }
            | Reply::CanIdSet { .. }
            | Reply::Rs485Id { .. }
            | Reply::Rs485IdSet { .. }
    )
}

/// Motors set to report faults send 0x9A unasked (RMD V3.6 §2.33.4); without a fault it can only
/// answer someone.
fn stray(received: &Reply) -> Answer {
    match received {
        Reply::Status1 { faults, .. } if !faults.is_empty() => Answer::Unsolicited,
        _ => Answer::Unrelated,
    }
}

/// Whether a motor's bytes are a closed-loop request's own, and cannot also be a state by chance.
fn thrown_back(sent: &[u8; DATA_LEN], received: &[u8; DATA_LEN]) -> bool {
    // Where a command has a cap a reply has the temperature.
    let [command, _, payload @ ..] = sent;
    command::CLOSED_LOOP.contains(command)
        && sent == received
        && payload.iter().any(|byte| *byte != 0)
}
