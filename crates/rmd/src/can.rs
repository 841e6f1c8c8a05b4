//! CAN frames: standard ids, data frames, DLC 8 (RMD V3.6 §1.1.2).
//!
//! A single motor is addressed as 0x140 + node and answers as 0x240 + node; motion mode has ids of
//! its own. Frames to every motor at once are 0x280 and, for the CAN id, 0x300.

use codec::Decode;
use embedded_can::{Frame, Id, StandardId};

use crate::bus_id::{self, Access};
use crate::dialect::Dialect;
use crate::error::{DecodeError, EncodeError};
use crate::field::DATA_LEN;
use crate::motion_mode::{MotionCommand, MotionFeedback};
use crate::node::{Node, Target};
use crate::reply::Reply;
use crate::request::Request;

/// Request id of a motor = this + node: 0x141..=0x160 (RMD V3.6 §1.1.2).
pub const REQUEST_BASE: u16 = 0x140;
/// Reply id of a motor = this + node: 0x241..=0x260 (RMD V3.6 §1.1.2).
pub const REPLY_BASE: u16 = 0x240;
/// Id of requests to every motor (RMD V3.6 §3). Only motors without their CAN-id filter hear it
/// (§2.33.4).
pub const BROADCAST_ID: u16 = 0x280;
/// Id of the commands that read and set the CAN id, and of their replies (RMD V3.6 §4).
pub const CAN_ID_ID: u16 = 0x300;
/// Motion-mode request id of a motor = this + node: 0x401..=0x420 (RMD V3.6 §5).
pub const MOTION_REQUEST_BASE: u16 = 0x400;
/// Motion-mode reply id of a motor = this + node: 0x501..=0x520 (RMD V3.6 §5.4).
pub const MOTION_REPLY_BASE: u16 = 0x500;

/// Id on which the motor listens.
pub fn request_id(node: Node) -> StandardId {
    id::<REQUEST_BASE>(node)
}

/// Id on which the motor answers.
pub fn reply_id(node: Node) -> StandardId {
    id::<REPLY_BASE>(node)
}

/// Id on which the motor listens for motion mode.
pub fn motion_request_id(node: Node) -> StandardId {
    id::<MOTION_REQUEST_BASE>(node)
}

/// Id on which the motor answers motion mode.
pub fn motion_reply_id(node: Node) -> StandardId {
    id::<MOTION_REPLY_BASE>(node)
}

/// The motor that sends with this id, if any does.
pub fn node_of_reply_id(id: Id) -> Option<Node> {
    let Id::Standard(id) = id else { return None };
    node_above(REPLY_BASE, id).or_else(|| node_above(MOTION_REPLY_BASE, id))
}

/// The frame that carries a request to a motor. The commands that read and set the CAN id go to
/// every motor on the bus, whatever the node.
pub fn request<F: Frame>(node: Node, request: &Request) -> Result<F, EncodeError> {
    let id = match request {
        Request::MotionMode { .. } => motion_request_id(node),
        _ => request_id(node),
    };
    frame(id, request)
}

/// The frame that carries a request to every motor; refused for motion mode.
pub fn broadcast<F: Frame>(request: &Request) -> Result<F, EncodeError> {
    if let Request::MotionMode { .. } = request {
        return Err(not_here(request.command(), "motion mode addresses one motor"));
    }
    frame(fixed::<BROADCAST_ID>(), request)
}

/// The motor addressed by a frame and the request in it.
pub fn decode_request<F: Frame>(frame: &F) -> Result<(Node, Request), DecodeError> {
    match decode_any_request(frame)? {
        (Target::Node(node), request) => Ok((node, request)),
        (Target::All, _) => Err(DecodeError::WrongId { id: standard(frame)?.as_raw() }),
    }
}

/// The motor or motors addressed by a frame and the request in it.
pub fn decode_any_request<F: Frame>(frame: &F) -> Result<(Target, Request), DecodeError> {
    let id = standard(frame)?;
    if let Some(node) = node_above(REQUEST_BASE, id) {
        return Ok((Target::Node(node), Request::decode(data(frame)?)));
    }
    if let Some(node) = node_above(MOTION_REQUEST_BASE, id) {
        let Ok(command) = MotionCommand::get::<0>(data(frame)?);
        return Ok((Target::Node(node), Request::MotionMode { command }));
    }
    match id.as_raw() {
        BROADCAST_ID => Ok((Target::All, Request::decode(data(frame)?))),
        CAN_ID_ID => {
            let data = data(frame)?;
            let request =
                match bus_id::access(data).ok_or(DecodeError::WrongId { id: CAN_ID_ID })? {
                    Access::Read => Request::ReadCanId,
                    Access::Write => Request::SetCanId { id: bus_id::written(data) },
                };
            Ok((Target::All, request))
        }
        other => Err(DecodeError::WrongId { id: other }),
    }
}

/// The frame that carries a reply from a motor. A timeout notice has as many bytes as it was
/// received with.
pub fn reply<F: Frame>(node: Node, reply: &Reply) -> Result<F, EncodeError> {
    let id = match reply {
        Reply::MotionMode { .. } => motion_reply_id(node),
        Reply::CanId { .. } | Reply::CanIdSet { .. } => fixed::<CAN_ID_ID>(),
        Reply::Rs485Id { .. } | Reply::Rs485IdSet { .. } => {
            return Err(rs485_only(reply.command()));
        }
        _ => reply_id(node),
    };
    let data = reply.encode()?;
    let data = data.get(..reply.frame_len()).unwrap_or(&data);
    F::new(id, data).ok_or(EncodeError::Frame)
}

/// The motor that sent a frame and the reply in it. A reply about the CAN id names its motor in the
/// data: the new id once that is set.
pub fn decode_reply<F: Frame>(frame: &F) -> Result<(Node, Reply), DecodeError> {
    decode_reply_in(Dialect::V3_6, frame)
}

/// [`decode_reply`] of a motor of this dialect.
pub fn decode_reply_in<F: Frame>(
    dialect: Dialect,
    frame: &F,
) -> Result<(Node, Reply), DecodeError> {
    let id = standard(frame)?;
    if let Some(node) = node_above(REPLY_BASE, id) {
        return Ok((node, Reply::decode_in(dialect, frame.data())?));
    }
    if let Some(node) = node_above(MOTION_REPLY_BASE, id) {
        let Ok(feedback) = MotionFeedback::get::<0>(data(frame)?);
        return Ok((node, Reply::MotionMode { feedback }));
    }
    let wrong = DecodeError::WrongId { id: id.as_raw() };
    if id.as_raw() != CAN_ID_ID {
        return Err(wrong);
    }
    let data = data(frame)?;
    match bus_id::access(data).ok_or(wrong)? {
        Access::Read => bus_id::can_node(data).map(|id| (id, Reply::CanId { id })),
        Access::Write => bus_id::written_node(data).map(|id| (id, Reply::CanIdSet { id })),
    }
}

/// The frame of a request under an id, unless the request has an id of its own or none on CAN.
fn frame<F: Frame>(id: StandardId, request: &Request) -> Result<F, EncodeError> {
    let id = match request {
        Request::ReadCanId | Request::SetCanId { .. } => fixed::<CAN_ID_ID>(),
        Request::ReadRs485Id | Request::SetRs485Id { .. } => {
            return Err(rs485_only(request.command()));
        }
        _ => id,
    };
    if let Request::SetBaudRate { code } = request {
        code.check_on_can()?;
    }
    F::new(id, &request.encode()?).ok_or(EncodeError::Frame)
}

fn rs485_only(command: u8) -> EncodeError {
    not_here(command, "this command is for RS485")
}

fn not_here(command: u8, reason: &'static str) -> EncodeError {
    EncodeError::Forbidden { field: "command", value: i64::from(command), reason }
}

fn id<const BASE: u16>(node: Node) -> StandardId {
    const { assert!(StandardId::new(BASE + Node::MAX as u16).is_some()) };
    // The assertion above leaves the fallback without a case.
    StandardId::new(BASE + u16::from(node.get())).unwrap_or(StandardId::MAX)
}

fn fixed<const ID: u16>() -> StandardId {
    const {
        match StandardId::new(ID) {
            Some(id) => id,
            None => panic!("11 bits"),
        }
    }
}

fn node_above(base: u16, id: StandardId) -> Option<Node> {
    let node = u8::try_from(id.as_raw().checked_sub(base)?).ok()?;
    Node::new(node).ok()
}

/// The standard id of a data frame.
fn standard<F: Frame>(frame: &F) -> Result<StandardId, DecodeError> {
    let id = match frame.id() {
        Id::Standard(id) => id,
        Id::Extended(id) => return Err(DecodeError::ExtendedId { id: id.as_raw() }),
    };
    if frame.is_remote_frame() {
        return Err(DecodeError::RemoteFrame);
    }
    Ok(id)
}

fn data<F: Frame>(frame: &F) -> Result<&[u8; DATA_LEN], DecodeError> {
    let data = frame.data();
    <&[u8; DATA_LEN]>::try_from(data)
        .map_err(|_| DecodeError::Length { got: data.len(), expected: DATA_LEN })
}
