//! `mgw watch`

use std::time::Duration;

use crate::failure::Failure;
use crate::interrupt;
use crate::output::to_json;
use crate::session::{Session, print_event};
use crate::states;

/// Prints states at a rhythm and events as they come.
pub fn run(session: &mut Session, axes: &[u8], period_ms: u64, count: Option<u64>) -> Result<(), Failure> {
    interrupt::note();
    let axes = session.axes_or_all(axes)?;
    let period = Duration::from_millis(period_ms);
    let mut printed = 0;
    let mut next = session.client.now();
    while count.is_none_or(|count| printed < count) && !interrupt::came() {
        let mut reports = Vec::new();
        for axis in &axes {
            reports.push(session.client.read_state(*axis)?);
        }
        // The headings once: the columns of later rows keep their order, if not always their width.
        let lines = states::table(&reports).lines();
        for line in lines.iter().skip(usize::from(printed > 0)) {
            session.out.text(line)?;
        }
        for report in &reports {
            session.out.object(&to_json(report))?;
        }
        printed += 1;
        next += period;
        if count.is_none_or(|count| printed < count) {
            print_events_until(session, next)?;
        }
    }
    Ok(())
}

fn print_events_until(session: &mut Session, end: Duration) -> Result<(), Failure> {
    while session.client.now() < end && !interrupt::came() {
        let left = end.saturating_sub(session.client.now());
        if let Some(event) = session.client.poll_event(left.min(LONGEST_WAIT))? {
            print_event(&event, session.out)?;
        }
    }
    Ok(())
}

/// An interrupt is looked for this often.
const LONGEST_WAIT: Duration = Duration::from_millis(100);
