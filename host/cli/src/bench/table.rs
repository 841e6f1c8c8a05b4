//! What `mgw bench` estimates of every round, as a table of reply delays by motor.

use std::collections::BTreeSet;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use host_protocol::{BootReason, Bytes, MAX_CAN_DATA, Protocol};
use rmd::{Reply, Request};

use super::spread::Spread;
use super::{Bench, Cycles, delay_us};
use crate::delays::{Entry, Histogram, Key, LONGEST_US, SIMULATOR, Table, UNKNOWN, day, to_word};
use crate::failure::Failure;
use crate::session::Session;
use crate::words;

/// What these delays are of. They are no times of frames: what the gateway and the host's line
/// take, and how that varies, is in them.
const COMMAND: &str = "cycle-estimated";

/// The table of cycles of one axis each.
pub fn of(
    session: &mut Session,
    bench: &Bench<'_>,
    alone: &[Cycles],
    ping: &Spread,
) -> Result<Table, Failure> {
    let hello = session.client.hello().clone();
    let is_simulated = hello.boot == BootReason::Simulated;
    let place = match &bench.arguments.place {
        Some(place) if is_simulated && place != SIMULATOR => {
            let text = format!("the gateway is simulated, so --where can be {SIMULATOR} only");
            return Err(Failure::Usage(text));
        }
        _ if is_simulated => SIMULATOR.to_owned(),
        place => place.clone().unwrap_or_else(|| UNKNOWN.to_owned()),
    };
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let today = day(u64::try_from(now.as_nanos()).unwrap_or(u64::MAX));
    let mut table = Table::default();
    for cycles in alone {
        let times = cycles.spread.times().iter();
        let delays = times.map(|time| delay_us(cycles, *time, ping).min(LONGEST_US));
        let mut delays = delays.map(Histogram::of);
        let (Some(axis), Some(mut all)) = (cycles.axes.first(), delays.next()) else { continue };
        delays.for_each(|delay| all.add(&delay));
        let summary = session.client.list_axes()?.into_iter().find(|of| of.axis == *axis);
        let known = summary.and_then(|of| Some((of.bus?, of.protocol?)));
        let Some((bus, protocol)) = known else { continue };
        let (model, firmware) = identity(session, *axis, protocol);
        let kind = bench.premises.kinds.get(usize::from(bus));
        let key = Key {
            protocol: protocol.name().to_owned(),
            model,
            firmware,
            bus: words::kind(kind).to_owned(),
            bitrate: bench.configuration.buses.get(&bus).map_or(0, |bus| bus.bitrate),
            command: COMMAND.to_owned(),
            place: place.clone(),
        };
        let days = BTreeSet::from([today.clone()]);
        let gateways = BTreeSet::from([to_word(&hello.firmware)]);
        table.add(key, Entry { delays: all, days, gateways });
    }
    Ok(table)
}

/// Model and firmware as an RMD motor tells them.
fn identity(session: &mut Session, axis: u8, protocol: Protocol) -> (String, String) {
    let unknown = || UNKNOWN.to_owned();
    if protocol != Protocol::Rmd {
        return (unknown(), unknown());
    }
    let mut ask = |request: &Request| -> Option<Reply> {
        let data: Bytes<MAX_CAN_DATA> = Bytes::from_slice(&request.encode().ok()?).ok()?;
        // A motor that does not know the command answers nothing: it stays unknown.
        let reply = session.client.native_when_free(axis, 0, data, Duration::ZERO).ok()?;
        Reply::decode(&reply).ok()
    };
    let model = match ask(&Request::ReadModel) {
        Some(Reply::Model { model }) => model.as_str().map(to_word),
        _ => None,
    };
    let firmware = match ask(&Request::ReadVersionDate) {
        Some(Reply::VersionDate { date }) => Some(date.0.to_string()),
        _ => None,
    };
    (model.unwrap_or_else(unknown), firmware.unwrap_or_else(unknown))
}
