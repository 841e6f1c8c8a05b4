//! Which CAN ids an axis is sent frames on, and on which its motor acts or answers (GUARANTEES G7).

use super::Info;
use crate::config::AxisConfig;
use embedded_can::Id;
use host_protocol::CanId;

/// The CAN ids of one motor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ids {
    /// Those that only this motor is sent frames on.
    pub sent: [Option<CanId>; 2],
    /// Those that it answers with, or sends on by itself.
    pub replies: [Option<CanId>; 2],
    /// Those on which every motor of its protocol acts; no axis is sent frames on them.
    pub groups: [Option<CanId>; 2],
}

impl Ids {
    fn of(config: &AxisConfig) -> Option<Self> {
        Some((Info::of_axis(config)?.ids)(config.node()?, config))
    }
}

/// The first id on which `axis` is sent frames and on which the motor of `other`, on the same CAN
/// bus, acts or answers.
pub(crate) fn sent_on_an_id_of(axis: &AxisConfig, other: &AxisConfig) -> Option<CanId> {
    let (sent, used) = (Ids::of(axis)?.sent, Ids::of(other)?);
    // Motors of one protocol without ids of its own tell replies from requests, and themselves
    // apart, by the bytes of the frame.
    let told_apart = axis.protocol() == other.protocol()
        && Info::of_axis(other).is_some_and(|info| info.free_ids);
    sent.into_iter().flatten().find(|id| {
        let is_in = |ids: &[Option<CanId>]| ids.contains(&Some(*id));
        is_in(&used.sent) || is_in(&used.groups) || !told_apart && is_in(&used.replies)
    })
}

/// Whether frames to the motor of an axis, or those that it answers with, have ids of 29 bits.
pub(crate) fn has_extended_ids(config: &AxisConfig) -> bool {
    Ids::of(config).is_some_and(|ids| {
        ids.sent.into_iter().chain(ids.replies).flatten().any(CanId::is_extended)
    })
}

/// Whether the motor of an axis is asked with an id of 29 bits.
pub(crate) fn has_extended_request_id(config: &AxisConfig) -> bool {
    matches!(stop_id(config), Some(CanId(Id::Extended(_))))
}

/// The id on CAN of every frame that a stop sends to the axis's motor.
pub(crate) fn stop_id(config: &AxisConfig) -> Option<CanId> {
    (Info::of_axis(config)?.request_id)(config.node()?, config)
}

/// The id on CAN of the motor's replies.
pub(crate) fn reply_id(config: &AxisConfig) -> Option<Id> {
    Ids::of(config)?.replies.into_iter().flatten().next().map(|CanId(id)| id)
}
