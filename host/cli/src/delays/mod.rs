//! `mgw delays`: how long motors take to begin their replies, by model and firmware: a table as
//! text, taken out of recordings and merged of tables. docs/reply-delays.md describes it.

mod histogram;
mod identity;
pub mod pairing;
mod recording;
mod table;
mod wire_time;

use std::io::Read;
use std::path::Path;

use serde_json::{Value, json};

use crate::args::{DelaysArgs, Told};
use crate::failure::Failure;
use crate::given;
use crate::output::Output;
use crate::record;
use crate::written;

pub use histogram::{Histogram, LONGEST_US};
use recording::Reading;
pub use recording::{SIMULATOR, day};
pub use table::{Entry, Key, Table, UNKNOWN, to_word, typed_word};

/// The longest file that is read as a table, bytes.
const LONGEST_TABLE: u64 = 64 << 20;

/// Merges recordings and tables, and prints the table or writes it.
pub fn run(arguments: &DelaysArgs, out: Output) -> Result<(), Failure> {
    let mut merged = Table::default();
    for path in &arguments.files {
        merged.merge(of_file(path, &arguments.told, out)?);
    }
    match &arguments.output {
        None => {
            merged.to_string().lines().try_for_each(|line| out.text(line))?;
            out.object(&json!({ "reply_delays": to_json(&merged) }))
        }
        Some(path) => {
            written::write(path, merged.to_string(), arguments.force)?;
            let (count, file) = (merged.entries().count(), path.display().to_string());
            out.event(
                "delays_written",
                format!("{} are in {file}", crate::words::count(count, "entry", "entries")),
                json!({ "file": file, "entries": count }),
            )
        }
    }
}

/// The table of a file: of a recording what is measured in it.
fn of_file(path: &Path, told: &Told, out: Output) -> Result<Table, Failure> {
    let name = path.display().to_string();
    let wrong = |what: String| Failure::Usage(format!("{name}: {what}"));
    let failed = |source| given::unread(path, source);
    let mut begin = Vec::new();
    let mut file = given::open(path)?;
    let count = record::MAGIC.len() as u64;
    Read::by_ref(&mut file).take(count).read_to_end(&mut begin).map_err(failed)?;
    if begin != record::MAGIC {
        file.take(LONGEST_TABLE).read_to_end(&mut begin).map_err(failed)?;
        if begin.len() as u64 >= LONGEST_TABLE {
            return Err(wrong(format!(
                "it is longer than {LONGEST_TABLE} bytes, and no recording"
            )));
        }
        let text = String::from_utf8(begin).map_err(|_| {
            wrong(
                "it is neither a recording (MCAP) nor a table of delays, which is text".to_owned(),
            )
        })?;
        return Table::parse(&text).map_err(wrong);
    }
    let mut reading = Reading::default();
    let is_whole = record::each_message(path, |message| {
        reading.take(&message.value, message.log_ns, told).map_err(wrong)
    })?;
    if !is_whole {
        record::tell_cut_off(path, out)?;
    }
    let table = reading.table(told).map_err(wrong)?;
    if table.entries().next().is_none() {
        return Err(Failure::not_measured(format!(
            "{name} has no request with its reply, both received on a bus. `mgw record --frames \
             BUS` hears them where something else asks the motors; what this gateway sends itself \
             has no time in a recording, and `mgw bench --table` measures that"
        )));
    }
    Ok(table)
}

/// The entries for programs.
fn to_json(table: &Table) -> Vec<Value> {
    let entry = |(key, entry): (&Key, &Entry)| {
        let delays = &entry.delays;
        json!({
            "protocol": key.protocol, "model": key.model, "firmware": key.firmware,
            "bus": key.bus, "bitrate": key.bitrate, "command": key.command, "where": key.place,
            "count": delays.count(), "min_us": delays.least(),
            "p50_us": delays.percentile(50), "p99_us": delays.percentile(99),
            "max_us": delays.most(), "when": entry.days, "gateway": entry.gateways,
            "buckets": delays.counts().map(|(us, count)| json!({ "us": us, "count": count }))
                .collect::<Vec<_>>(),
        })
    };
    table.entries().map(entry).collect()
}

#[cfg(test)]
mod tests;
