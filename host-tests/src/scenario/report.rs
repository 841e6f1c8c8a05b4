//! What a person is told of a scenario that failed.

use super::bench::{Bench, Told};
use mgw_sim::{Station, TraceEntry};
use std::fmt::Write as _;

/// Frames shown before and after the moment of the failure.
const SHOWN: usize = 16;
/// Events and lines of a motor's log shown.
const LATEST: usize = 12;

impl Bench {
    /// The wires about the moment of the failure, the axes, the events and the motors' own logs.
    pub fn report(&mut self) -> String {
        self.collect();
        let mut report = String::new();
        let (now, mark) = (self.now_us(), self.mark_us);
        let focus = self.focus_us.unwrap_or(now).min(now);
        let _ = writeln!(report, "  now {now} µs, last mark {mark} µs");
        self.tell_axes(&mut report);
        let after = self.trace.partition_point(|entry| entry.time_us <= focus);
        let shown = after.saturating_sub(SHOWN)..(after + SHOWN).min(self.trace.len());
        let _ = writeln!(report, "  on the wires about {focus} µs (time since the mark):");
        for entry in self.trace.get(shown).unwrap_or_default() {
            let _ = writeln!(report, "    {}", line(entry, mark));
        }
        let _ = writeln!(report, "  latest events:");
        for told in self.events.iter().skip(self.events.len().saturating_sub(LATEST)) {
            let Told { link, time_us, event } = told;
            let _ =
                writeln!(report, "    {:>10} µs  link {link}  {event:?}", since(*time_us, mark));
        }
        self.tell_motors(&mut report);
        report
    }

    /// Every frame of the run.
    pub fn whole_trace(&self) -> String {
        let lines: Vec<String> = self.trace.iter().map(|entry| line(entry, 0)).collect();
        lines.join("\n")
    }

    fn tell_axes(&mut self, report: &mut String) {
        for summary in self.client.list_axes().unwrap_or_default() {
            let trip = self.client.read_state(summary.axis).ok().and_then(|report| report.trip);
            let trip = trip.map(|trip| format!(": {}", trip.reason)).unwrap_or_default();
            let _ = writeln!(report, "  axis {} is {}{trip}", summary.axis, summary.state);
        }
    }

    fn tell_motors(&self, report: &mut String) {
        let world = self.world.borrow();
        for (index, motor) in world.motors().iter().enumerate() {
            let (speed, position) = (motor.speed_rad_s(), motor.position_rad());
            let _ = writeln!(
                report,
                "  motor {index} ({motor}, bus {}) turns at {speed:.3} rad/s at {position:.3} rad",
                motor.bus()
            );
            let entries: Vec<_> = motor.log().entries().rev().take(LATEST).collect();
            for entry in entries.iter().rev() {
                let _ = writeln!(
                    report,
                    "    {:>10} µs  {}",
                    since(entry.time_us, self.mark_us),
                    entry.what
                );
            }
        }
    }
}

fn line(entry: &TraceEntry, mark: u64) -> String {
    let from = match entry.from {
        Station::Gateway => "gateway".to_string(),
        Station::Motor(index) => format!("motor {index}"),
        Station::Stranger => "stranger".to_string(),
    };
    format!("{:>10} µs  bus {}  {from:8}  {}", since(entry.time_us, mark), entry.bus, entry.wire)
}

/// µs since a mark, negative before it.
fn since(time_us: u64, mark_us: u64) -> String {
    if time_us < mark_us {
        format!("-{}", mark_us - time_us)
    } else {
        (time_us - mark_us).to_string()
    }
}
