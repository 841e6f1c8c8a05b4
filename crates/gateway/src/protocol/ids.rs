//! Which CAN ids an axis is sent frames on, and on which its motor acts or answers (GUARANTEES G7).

use super::d5;
use crate::axis::AxisConfig;
use ::d5::Address;
use ::rmd::can::{BROADCAST_ID, CAN_ID_ID};
use embedded_can::StandardId;
use heapless::Vec;
use host_protocol::{CanId, Protocol};

/// Ids of single motors that one axis is sent frames on: commands, and for RMD motion mode as well.
const MAX_SENT: usize = 2;

/// The first id on which `axis` is sent frames and on which the motor of `other`, on the same CAN
/// bus, acts or answers.
///
/// The group ids of a protocol are not among those sent to one axis.
pub(crate) fn sent_on_an_id_of(axis: &AxisConfig, other: &AxisConfig) -> Option<CanId> {
    sent(axis).into_iter().find(|id| uses(other, *id, axis.protocol() == other.protocol()))
}

/// Whether frames to the motor of an axis, or those that it answers with, have ids of 29 bits.
pub(crate) fn has_extended_ids(config: &AxisConfig) -> bool {
    let answers = || config.protocol() == Some(Protocol::D5) && is_extended(d5::reply_id(config));
    has_extended_request_id(config) || answers()
}

/// Whether the motor of an axis is asked with an id of 29 bits.
pub(crate) fn has_extended_request_id(config: &AxisConfig) -> bool {
    config.protocol() == Some(Protocol::D5) && is_extended(d5::request_id(config))
}

fn is_extended(id: Option<CanId>) -> bool {
    id.is_some_and(CanId::is_extended)
}

fn sent(config: &AxisConfig) -> Vec<CanId, MAX_SENT> {
    let ids: &[Option<CanId>] = match config.protocol() {
        Some(Protocol::Rmd) => {
            let node = rmd_node(config);
            &[standard(node, ::rmd::can::request_id), standard(node, ::rmd::can::motion_request_id)]
        }
        Some(Protocol::Thruster) => &[standard(thruster_node(config), ::thruster::can::request_id)],
        Some(Protocol::D5) => &[d5::request_id(config)],
        None => &[],
    };
    ids.iter().flatten().copied().collect()
}

fn standard<N>(node: Option<N>, id: fn(N) -> StandardId) -> Option<CanId> {
    node.map(|node| CanId(id(node).into()))
}

/// Whether the motor of an axis acts on an id or answers with it. `same_protocol`: the frame on it
/// is one of its own protocol.
fn uses(config: &AxisConfig, id: CanId, same_protocol: bool) -> bool {
    let is = |own: Option<CanId>| own == Some(id);
    let more = match config.protocol() {
        Some(Protocol::Rmd) => {
            let node = rmd_node(config);
            is(standard(node, ::rmd::can::reply_id))
                || is(standard(node, ::rmd::can::motion_reply_id))
                || [BROADCAST_ID, CAN_ID_ID]
                    .into_iter()
                    .any(|group| is(CanId::standard(group.into())))
        }
        // Streams come on the id of replies.
        Some(Protocol::Thruster) => is(standard(thruster_node(config), ::thruster::can::reply_id)),
        // A motor of its own protocol tells replies from requests, and motors apart, by the bytes
        // of the frame; all hear one id.
        Some(Protocol::D5) => {
            let all = u32::from(Address::BROADCAST_ID);
            is(CanId::standard(all))
                || is(CanId::extended(all))
                || !same_protocol && is(d5::reply_id(config))
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
