//! `mgw trips`

use std::path::Path;

use flight_recorder::Recording;
use host_protocol::{Incident, Trip};
use mgw_sim::RecordingFile;
use serde_json::json;

use crate::args::ShowTripArgs;
use crate::explain::Page;
use crate::failure::Failure;
use crate::faults::Protocols;
use crate::flight::{Told, is_same_trip};
use crate::json;
use crate::session::Session;
use crate::table::Table;
use crate::words;
use crate::written::unwritten;

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

/// Shows what led to a trip, as far as the flight recorder has kept it.
pub fn show(session: &mut Session, arguments: &ShowTripArgs) -> Result<(), Failure> {
    let ShowTripArgs { trip: number, around, save } = arguments;
    // Before anything is asked for: a recorder that is read adds nothing more to what it keeps.
    let save = save.as_deref().map(Save::new).transpose()?;
    let trips = trips(&session.client.incidents()?);
    let wanted = trips.get(number.unwrap_or(0)).copied();
    if let (None, Some(number)) = (wanted, number) {
        let count = trips.len();
        return Err(failure(format!("there is no trip {number}: the gateway remembers {count}")));
    }
    let kept = Kept::read(session)?;
    let (out, motors) = (session.out, &session.out.motors);
    if let Some(wanted) = wanted.filter(|wanted| !kept.has(*wanted)) {
        let (kept, other) = (kept.text(&trips, motors), text(wanted, motors));
        match number {
            Some(_) => return Err(failure(format!("{kept}, and not {other}"))),
            None => out.aside(format!("{kept}; later came {other}")),
        }
    }
    let saved = save.map(|save| save.keep(&kept.record)).transpose()?;
    if let Some(path) = &saved {
        out.aside(format!("what led to it is in {path}"));
    }
    let wrong = |why: String| match &saved {
        Some(_) => failure(why),
        None => failure(format!("{why}. Keep it with --save FILE, for the mgw of that build")),
    };
    kept.told.map_err(wrong)?.print(around.around, out, wrong)
}

/// What a flight recorder has kept.
struct Kept {
    /// As a file.
    record: Vec<u8>,
    trip: Option<(u8, Trip)>,
    /// Played, or why it cannot be.
    told: Result<Told, String>,
}

impl Kept {
    fn read(session: &mut Session) -> Result<Self, Failure> {
        let Some(record) = session.client.flight_record()? else {
            let text = "the flight recorder has kept nothing: no axis has tripped since one was \
                last armed";
            return Err(failure(text.to_owned()));
        };
        let told = match Recording::read_file(&record) {
            Ok(recording) => Told::new(&recording),
            Err(error) => {
                let hello = session.client.hello();
                let (firmware, build_id) = (&hello.firmware, &hello.build_id);
                let ours = env!("CARGO_PKG_VERSION");
                Err(format!(
                    "{error}; the gateway runs {firmware} ({build_id}), this is mgw {ours}"
                ))
            }
        };
        let trip = Recording::trip_of(&record);
        Ok(Self { record, trip, told })
    }

    /// Whether it has this trip: as its own, or played with it.
    fn has(&self, trip: (u8, Trip)) -> bool {
        match &self.told {
            Ok(told) => told.has(trip),
            Err(_) => self.trip.is_some_and(|kept| is_same_trip(kept, trip)),
        }
    }

    /// Which trip of these it is.
    fn text(&self, trips: &[(u8, Trip)], motors: &Protocols) -> String {
        let Some(kept) = self.trip else {
            return "the flight recorder has kept no trip".to_owned();
        };
        let number = trips.iter().position(|trip| is_same_trip(*trip, kept));
        let number = number.map(|number| format!("trip {number}, ")).unwrap_or_default();
        format!("the flight recorder keeps one trip: {number}{}", text(kept, motors))
    }
}

fn failure(text: String) -> Failure {
    Failure::named("FlightRecord", Page::FlightRecorder, text)
}

/// The trips among the incidents, the latest first.
fn trips(incidents: &[Incident]) -> Vec<(u8, Trip)> {
    let trip = |incident: &Incident| match incident {
        Incident::Tripped { axis, trip, .. } => Some((*axis, *trip)),
        Incident::Started { .. } => None,
    };
    incidents.iter().filter_map(trip).collect()
}

fn text((axis, trip): (u8, Trip), motors: &Protocols) -> String {
    let reason = words::trip_reason(&trip.reason, motors.of(axis));
    format!("that of axis {axis} at t={} ({reason})", words::seconds(trip.time_us))
}

/// The file that is to have it.
struct Save<'a> {
    path: &'a Path,
    file: RecordingFile,
}

impl<'a> Save<'a> {
    fn new(path: &'a Path) -> Result<Self, Failure> {
        match RecordingFile::new(path) {
            Ok(file) => Ok(Self { path, file }),
            Err(source) => Err(unwritten(path, source)),
        }
    }

    /// Writes it, and returns where it is.
    fn keep(&self, record: &[u8]) -> Result<String, Failure> {
        self.file.replace(record).map_err(|source| unwritten(self.path, source))?;
        Ok(self.path.display().to_string())
    }
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
