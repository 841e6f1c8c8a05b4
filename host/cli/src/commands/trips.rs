//! `mgw trips`

use host_protocol::Incident;
use serde_json::json;

use crate::failure::Failure;
use crate::output::to_json;
use crate::session::Session;
use crate::table::Table;
use crate::words;

/// Shows what the gateway remembers over a reset: its last words, its trips and its starts.
pub fn run(session: &mut Session) -> Result<(), Failure> {
    let last_words = session.client.last_words()?;
    let incidents = session.client.incidents()?;
    let out = session.out;
    out.object(&json!({ "last_words": last_words, "incidents": to_json(&incidents) }))?;
    if !last_words.is_empty() {
        out.text(format!("before this start: {last_words}"))?;
    }
    let mut table = Table::new(&[">start", ">time s", "what"]);
    for incident in &incidents {
        table.row(row(incident));
    }
    out.table(&table)
}

fn row(incident: &Incident) -> [String; 3] {
    match incident {
        Incident::Started { start, boot, last_words } => {
            let left = if *last_words { ", last words were left" } else { "" };
            [start.to_string(), words::seconds(0), format!("started: {boot:?}{left}")]
        }
        Incident::Tripped { start, axis, trip } => [
            start.to_string(),
            words::seconds(trip.time_us),
            format!("axis {axis} tripped: {}", words::trip_reason(&trip.reason)),
        ],
    }
}
