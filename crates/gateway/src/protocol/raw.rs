//! Which raw frames are harmless: those that only read a motor, and those that no protocol of the
//! bus takes for its own (GUARANTEES G10). A frame that our codec cannot decode is not harmless: a
//! lenient motor may obey it.

use super::{Effect, d5, rmd, thruster};
use ::rmd::can::{
    BROADCAST_ID, CAN_ID_ID, MOTION_REPLY_BASE, MOTION_REQUEST_BASE, REPLY_BASE, REQUEST_BASE,
};
use embedded_can::{Id, StandardId};
use heapless::Vec;
use host_protocol::{CanFrame, Protocol, ProtocolSet};

/// Bits of an extended id behind those that a standard id has.
const EXTENSION_BITS: u32 = 18;

/// Whether a frame on a CAN bus does no more to motors of these protocols than read them.
pub(crate) fn is_harmless_on_can(frame: &CanFrame, protocols: ProtocolSet) -> bool {
    protocols.iter().all(|protocol| match protocol {
        Protocol::Rmd => !standard_ids(frame).into_iter().any(is_of_rmd) || reads_rmd(frame),
        Protocol::Thruster => {
            !standard_ids(frame).into_iter().any(is_of_thruster) || reads_thruster(frame)
        }
        // Its manual gives no ids, so any id may be one of its.
        Protocol::D5 => reads_d5(frame),
    })
}

/// Whether bytes on a serial bus are one whole frame that only reads a motor. More than one frame
/// would hold up a stop.
pub(crate) fn is_harmless_on_serial(bytes: &[u8]) -> bool {
    let Ok(frame) = bytes.try_into() else { return false };
    let Ok((_, request)) = ::rmd::rs485::decode_any_request(frame) else { return false };
    let [_, _, _, data @ .., _, _] = frame;
    reads_by(request, data)
}

/// The standard ids that a motor may take an id for: of an extended one its first and its last 11
/// bits.
fn standard_ids(frame: &CanFrame) -> Vec<u16, 2> {
    let ids: &[u16] = match frame.id() {
        Id::Standard(id) => &[id.as_raw()],
        Id::Extended(id) => {
            let mask = u32::from(StandardId::MAX.as_raw());
            #[allow(clippy::cast_possible_truncation)]
            &[(id.as_raw() >> EXTENSION_BITS & mask) as u16, (id.as_raw() & mask) as u16]
        }
    };
    ids.iter().copied().collect()
}

/// Whether any motor of the protocol uses an id.
fn is_of_rmd(id: u16) -> bool {
    let nodes = u16::from(::rmd::Node::MIN)..=u16::from(::rmd::Node::MAX);
    let is_above = |base: u16| id.checked_sub(base).is_some_and(|node| nodes.contains(&node));
    [REQUEST_BASE, REPLY_BASE, MOTION_REQUEST_BASE, MOTION_REPLY_BASE].into_iter().any(is_above)
        || matches!(id, BROADCAST_ID | CAN_ID_ID)
}

/// Whether any device of the protocol uses an id.
fn is_of_thruster(id: u16) -> bool {
    let id = StandardId::new(id).map(Id::Standard);
    id.is_some_and(|id| {
        ::thruster::can::node_of_request_id(id).is_some()
            || ::thruster::can::node_of_reply_id(id).is_some()
    })
}

fn reads_rmd(frame: &CanFrame) -> bool {
    ::rmd::can::decode_any_request(frame).is_ok_and(|(_, request)| reads_by(request, frame.data()))
}

/// Whether a request reads, and its bytes are those that the manual prints: the codec overlooks
/// bytes without a meaning.
fn reads_by(request: ::rmd::Request, data: &[u8]) -> bool {
    rmd::effect(request, 1.0) == Some(Effect::Asks)
        && request.encode().is_ok_and(|bytes| bytes == data)
}

fn reads_thruster(frame: &CanFrame) -> bool {
    let decoded = ::thruster::can::decode_request(frame);
    decoded.is_ok_and(|(_, request)| thruster::effect(request, 1.0) == Some(Effect::Asks))
}

fn reads_d5(frame: &CanFrame) -> bool {
    ::d5::can::decode_request(frame).is_ok_and(|(address, request)| {
        // Every motor answers what all of them are asked: only a query is meant so (D5 manual,
        // table row 1).
        let to_all = address == ::d5::Address::Broadcast && request != ::d5::Request::QueryId;
        !to_all && d5::effect(request, 1.0) == Some(Effect::Asks)
    })
}
