//! `mgw trips`

use host_protocol::Incident;
use serde_json::json;

use crate::failure::Failure;
use crate::faults::Protocols;
use crate::json;
use crate::session::Session;
use crate::table::Table;
use crate::words;

/// Shows what the gateway remembers over a reset: its crash report, its trips and its starts.
pub fn run(session: &mut Session) -> Result<(), Failure> {
    let crash_report = session.client.crash_report()?;
    let incidents = session.client.incidents()?;
    let out = session.out;
    let told = incidents.iter().map(|incident| json::gateway::incident(incident, &out.motors));
    out.object(&json!({ "crash_report": crash_report, "incidents": told.collect::<Vec<_>>() }))?;
    if !crash_report.is_empty() {
        out.text(format!("before this start: {crash_report}"))?;
    }
    let mut table = Table::new(&[">start", ">time s", "what"]);
    for incident in &incidents {
        table.row(row(incident, &out.motors));
    }
    out.table(&table)
}

/// A trip or a start as one line.
pub fn line(incident: &Incident, motors: &Protocols) -> String {
    let [_, time, what] = row(incident, motors);
    format!("t={time}  {what}")
}

fn row(incident: &Incident, motors: &Protocols) -> [String; 3] {
    match incident {
        Incident::Started { start, boot, has_crash_report } => {
            let left = if *has_crash_report { ", crash report kept" } else { "" };
            [start.to_string(), words::seconds(0), format!("started: {}{left}", words::name(boot))]
        }
        Incident::Tripped { start, axis, trip } => [
            start.to_string(),
            words::seconds(trip.time_us),
            words::tripped(*axis, &trip.reason, motors.of(*axis)),
        ],
    }
}
