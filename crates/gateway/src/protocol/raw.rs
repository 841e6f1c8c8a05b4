//! Which raw frames are harmless: those that only read a motor, and those that no protocol of the
//! bus takes for its own (GUARANTEES G10). A frame that our codec cannot decode is not harmless: a
//! lenient motor may obey it.

use super::Info;
use crate::config::AxisConfig;
use embedded_can::{Id, StandardId};
use host_protocol::{CanFrame, CanId, ProtocolSet};

/// Bits of an extended id behind those that a standard id has.
const EXTENSION_BITS: u32 = 18;

/// Whether a frame on a CAN bus does no more to motors of these protocols than read them.
pub(crate) fn is_harmless_on_can(frame: &CanFrame, protocols: ProtocolSet) -> bool {
    let ids = standard_ids(frame);
    protocols.iter().map(Info::of).all(|info| {
        // Where the manual gives no ids any may be one of its.
        let is_own = info.free_ids || ids.into_iter().flatten().any(|id| is_of(info, id));
        !is_own || (info.reads)(frame)
    })
}

/// Whether bytes on a serial bus with these protocols are one whole frame that only reads a motor.
/// More than one frame would hold up a stop.
pub(crate) fn is_harmless_on_serial(bytes: &[u8], protocols: ProtocolSet) -> bool {
    let mut serials = protocols.iter().filter_map(|protocol| Info::of(protocol).serial.as_ref());
    serials.any(|serial| (serial.reads)(bytes))
}

/// The standard ids that a motor may take an id for: of an extended one its first and its last 11
/// bits.
fn standard_ids(frame: &CanFrame) -> [Option<CanId>; 2] {
    match frame.id() {
        Id::Standard(id) => [CanId::standard(id.as_raw().into()), None],
        Id::Extended(id) => {
            let mask = u32::from(StandardId::MAX.as_raw());
            [
                CanId::standard(id.as_raw() >> EXTENSION_BITS & mask),
                CanId::standard(id.as_raw() & mask),
            ]
        }
    }
}

/// Whether any motor of the protocol uses an id.
fn is_of(info: &Info, id: CanId) -> bool {
    let config = AxisConfig::new();
    (1..=info.last_node).any(|node| {
        let ids = (info.ids)(node, &config);
        ids.sent.contains(&Some(id))
            || ids.replies.contains(&Some(id))
            || ids.groups.contains(&Some(id))
    })
}
