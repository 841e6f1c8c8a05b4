//! What a bus may be configured with: every check that needs no more than its port. The gateway
//! makes them, and a program may before it asks.

use crate::filled::filled;
use crate::protocol::Info;
use host_protocol::{BusConfig, BusKind, Error, Protocol, Quantity, REPLY_WINDOW_US};

/// Refuses a configuration that no gateway would take for a bus of this kind with these bitrates,
/// whatever is on it.
///
/// # Errors
/// [`Error::BitrateNotOffered`], [`Error::OutOfRange`], [`Error::WrongBusKind`] and
/// [`Error::NeedsOwnBus`].
pub fn check_bus_config(
    bus: u8,
    kind: BusKind,
    bitrates: &[u32],
    config: &BusConfig,
) -> Result<(), Error> {
    let BusConfig { bitrate, protocols, reply_window_us, .. } = *config;
    if !bitrates.contains(&bitrate) {
        return Err(not_offered(bus, bitrate, bitrates.iter().copied()));
    }
    Quantity::ReplyWindow.check(reply_window_us, REPLY_WINDOW_US)?;
    for protocol in protocols.iter() {
        check_kind(bus, kind, protocol)?;
        let info = Info::of(protocol);
        if let Some(range) = info.can_bitrates.filter(|_| kind == BusKind::Can) {
            Quantity::Bitrate.check(bitrate, range)?;
        }
        if info.free_ids && protocols.iter().any(|other| other != protocol) {
            return Err(Error::NeedsOwnBus { bus, protocol });
        }
    }
    Ok(())
}

/// A bitrate that a bus cannot have, and those that it can.
pub(crate) fn not_offered(bus: u8, bitrate: u32, rates: impl Iterator<Item = u32>) -> Error {
    Error::BitrateNotOffered { bus, bitrate, offered: filled(rates) }
}

/// Which protocol runs on which kind of bus.
pub(crate) fn check_kind(bus: u8, kind: BusKind, protocol: Protocol) -> Result<(), Error> {
    if Info::of(protocol).runs_on(kind) { Ok(()) } else { Err(Error::WrongBusKind { bus, kind }) }
}
