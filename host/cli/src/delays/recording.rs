//! The delays in a recording: requests and replies that both arrived on a bus, so that both have
//! the gateway's time.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, UNIX_EPOCH};

use serde_json::Value;

use super::histogram::{Histogram, LONGEST_US};
use super::identity::Identity;
use super::pairing::{Motor, Pairing};
use super::table::{Entry, Key, Table, UNKNOWN, to_word};
use super::wire_time::wire_time_us;
use crate::args::Told;
use crate::commands::recorded_frame;

/// Who measures where the gateway is simulated.
pub const SIMULATOR: &str = "simulator";
/// What a simulated gateway calls its board.
const SIMULATED: &str = "simulated";

/// Delays of a motor by command.
type Delays = BTreeMap<(Motor, &'static str), Histogram>;

/// A recording, as far as it has been read.
#[derive(Default)]
pub struct Reading {
    pairing: Pairing,
    delays: Delays,
    identities: BTreeMap<Motor, Identity>,
    kinds: BTreeMap<u64, &'static str>,
    days: BTreeSet<String>,
    gateways: BTreeSet<String>,
    is_simulated: bool,
}

impl Reading {
    /// Takes a message; `log_ns` is the host's time, since 1970.
    ///
    /// # Errors
    /// The bitrate of a bus is not known.
    pub fn take(&mut self, value: &Value, log_ns: u64, told: &Told) -> Result<(), String> {
        match value["event"].as_str() {
            Some("frame") if value["direction"] == "received" => self.frame(value, log_ns, told),
            Some("reply") if value["request"] == "hello" => {
                let body = &value["body"];
                self.gateways.extend(body["firmware"].as_str().map(to_word));
                self.is_simulated |= body["board"] == SIMULATED;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn frame(&mut self, value: &Value, log_ns: u64, told: &Told) -> Result<(), String> {
        let (Some(bus), Some(time_us)) = (value["bus"].as_u64(), value["time_us"].as_u64()) else {
            return Ok(());
        };
        let (kind, text) = (value["kind"].as_str(), value["frame"].as_str());
        let (kind, text) = (kind.unwrap_or_default(), text.unwrap_or_default());
        let Some(frame) = recorded_frame(kind, text) else { return Ok(()) };
        let Some(pair) = self.pairing.take(bus, &frame, time_us) else { return Ok(()) };
        let bitrate = told.bitrate(bus).ok_or_else(|| {
            format!("the bitrate of bus {bus} is not in a recording; add --bitrate {bus}=BIT_S")
        })?;
        self.kinds.insert(bus, if kind == "can" { "can" } else { "rs485" });
        self.identities.entry(pair.motor).or_default().hear(&pair);
        let delay = pair.span_us.saturating_sub(wire_time_us(&frame, bitrate));
        let Some(delay) = u32::try_from(delay).ok().filter(|delay| *delay <= LONGEST_US) else {
            return Ok(());
        };
        self.days.insert(day(log_ns));
        let one = Histogram::of(delay);
        self.delays
            .entry((pair.motor, pair.command))
            .and_modify(|delays| delays.add(&one))
            .or_insert(one);
        Ok(())
    }

    /// The table of it.
    ///
    /// # Errors
    /// Somebody claims that a simulation was none.
    pub fn table(self, told: &Told) -> Result<Table, String> {
        let place = match (&told.place, self.is_simulated) {
            (Some(place), true) if place != SIMULATOR => {
                return Err(format!(
                    "the gateway of this recording is simulated, so --where can be {SIMULATOR} only"
                ));
            }
            (_, true) => SIMULATOR.to_owned(),
            (place, false) => place.clone().unwrap_or_else(|| UNKNOWN.to_owned()),
        };
        let known = |own: Option<String>, told: &Option<String>| {
            own.or_else(|| told.clone()).unwrap_or_else(|| UNKNOWN.to_owned())
        };
        let mut gateways = self.gateways;
        if gateways.is_empty() {
            gateways.insert(known(None, &told.gateway));
        }
        let mut table = Table::default();
        for ((motor, command), delays) in self.delays {
            let identity = self.identities.get(&motor).cloned().unwrap_or_default();
            let key = Key {
                protocol: motor.protocol.to_owned(),
                model: known(identity.model(), &told.model),
                firmware: known(identity.firmware(), &told.firmware),
                bus: self.kinds.get(&motor.bus).copied().unwrap_or("can").to_owned(),
                bitrate: told.bitrate(motor.bus).unwrap_or_default(),
                command: command.to_owned(),
                place: place.clone(),
            };
            let (days, gateways) = (self.days.clone(), gateways.clone());
            table.add(key, Entry { delays, days, gateways });
        }
        Ok(table)
    }
}

/// The day of a time since 1970 (UTC).
pub fn day(since_1970_ns: u64) -> String {
    let time = UNIX_EPOCH + Duration::from_nanos(since_1970_ns);
    let mut day = humantime::format_rfc3339_seconds(time).to_string();
    day.truncate("2026-11-24".len());
    day
}
