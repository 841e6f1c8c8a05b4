//! What happened of late: trips and starts, also those that the gateway remembers, and events as
//! they come.

use std::collections::VecDeque;

use host_protocol::{Incident, Trip};

use crate::commands::incident_line;
use crate::faults::Protocols;
use crate::printable::printable;

/// Lines that are kept: more than a screen shows.
const KEPT: usize = 200;
/// Trips that are known again when the gateway tells its memory: more than it keeps.
const REMEMBERED: usize = 64;

/// Lines, the latest last.
#[derive(Debug, Default)]
pub struct Log {
    lines: VecDeque<String>,
    /// Of trips and starts alone.
    history: VecDeque<String>,
    /// Axis and time of trips that have their line.
    trips: VecDeque<(u8, u64)>,
    /// Starts that have their line.
    starts: VecDeque<u32>,
}

impl Log {
    /// Something that this program has to say.
    pub fn note(&mut self, text: &str) {
        self.push(format!("mgw: {text}"));
    }

    /// A line.
    pub fn push(&mut self, line: String) {
        remember(&mut self.lines, printable(&line).into_owned(), KEPT);
    }

    fn push_history(&mut self, line: String) {
        remember(&mut self.history, printable(&line).into_owned(), KEPT);
    }

    /// A trip, as it is told.
    pub fn tripped(&mut self, axis: u8, trip: &Trip, line: String) {
        if !self.trips.contains(&(axis, trip.time_us)) {
            remember(&mut self.trips, (axis, trip.time_us), REMEMBERED);
            self.push_history(line);
        }
    }

    /// What the gateway remembers, the latest first; what has its line already gets no other.
    pub fn incidents(&mut self, incidents: &[Incident], motors: &Protocols) {
        for incident in incidents.iter().rev() {
            let line = incident_line(incident, motors);
            match incident {
                Incident::Tripped { axis, trip, .. } => self.tripped(*axis, trip, line),
                Incident::Started { start, .. } if !self.starts.contains(start) => {
                    remember(&mut self.starts, *start, REMEMBERED);
                    self.push_history(line);
                }
                Incident::Started { .. } => {}
            }
        }
    }

    /// The last events and notes, up to `count`, the latest last.
    pub fn events(&self, count: usize) -> impl Iterator<Item = &str> {
        last(&self.lines, count)
    }

    /// The last trips and starts, up to `count`, the latest last.
    pub fn history(&self, count: usize) -> impl Iterator<Item = &str> {
        last(&self.history, count)
    }
}

fn last(lines: &VecDeque<String>, count: usize) -> impl Iterator<Item = &str> {
    lines.iter().skip(lines.len().saturating_sub(count)).map(String::as_str)
}

fn remember<T>(known: &mut VecDeque<T>, one: T, most: usize) {
    known.push_back(one);
    if known.len() > most {
        known.pop_front();
    }
}
