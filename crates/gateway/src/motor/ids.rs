//! Which CAN ids an axis is sent frames on, and on which its motor acts or answers (GUARANTEES G7).

use super::d5;
use crate::axis::AxisConfig;
use ::rmd::can::{BROADCAST_ID, CAN_ID_ID};
use embedded_can::StandardId;
use heapless::Vec;
use host_protocol::{AxisParameter, Protocol};

/// Ids of single motors that one axis is sent frames on: commands, and for RMD motion mode as well.
const MAX_SENT: usize = 2;

/// The first id on which `axis` is sent frames and on which the motor of `other`, on the same CAN bus, acts or answers.
///
/// The group ids of a protocol are not among those sent to one axis.
pub(crate) fn sent_on_an_id_of(axis: &AxisConfig, other: &AxisConfig) -> Option<u16> {
    sent(axis).into_iter().find(|id| uses(other, *id, axis.protocol() == other.protocol()))
}

fn sent(config: &AxisConfig) -> Vec<u16, MAX_SENT> {
    let ids: &[Option<StandardId>] = match config.protocol() {
        Some(Protocol::Rmd) => {
            let node = rmd_node(config);
            &[node.map(::rmd::can::request_id), node.map(::rmd::can::motion_request_id)]
        }
        Some(Protocol::Thruster) => &[thruster_node(config).map(::thruster::can::request_id)],
        Some(Protocol::D5) => &[d5::request_id(config)],
        None => &[],
    };
    ids.iter().flatten().map(StandardId::as_raw).collect()
}

/// Whether the motor of an axis acts on an id or answers with it. `same_protocol`: the frame on it is one of its own protocol.
fn uses(config: &AxisConfig, id: u16, same_protocol: bool) -> bool {
    let is = |own: Option<StandardId>| own.is_some_and(|own| own.as_raw() == id);
    let more = match config.protocol() {
        Some(Protocol::Rmd) => {
            let node = rmd_node(config);
            is(node.map(::rmd::can::reply_id))
                || is(node.map(::rmd::can::motion_reply_id))
                || [BROADCAST_ID, CAN_ID_ID].contains(&id)
        }
        // Streams come on the id of replies.
        Some(Protocol::Thruster) => is(thruster_node(config).map(::thruster::can::reply_id)),
        // A motor of its own protocol tells replies from requests, and motors apart, by the bytes of the frame.
        Some(Protocol::D5) => {
            !same_protocol && config.unsigned(AxisParameter::D5ReplyId) == Some(u32::from(id))
        }
        None => false,
    };
    more || sent(config).contains(&id)
}

fn rmd_node(config: &AxisConfig) -> Option<::rmd::Node> {
    ::rmd::Node::new(config.node()?).ok()
}

fn thruster_node(config: &AxisConfig) -> Option<::thruster::Node> {
    ::thruster::Node::new(config.node()?).ok()
}
