//! A memory of trips and starts that is wrong.

use super::*;

const READ: u16 = 0x60;
/// Start 1 after power came on, without crash report.
const STARTED: &[u8] = &[0, 1, 0, 0];
const STARTED_AGAIN: &[u8] = &[0, 2, 3, 1];
/// The host fell silent at 5 µs; nothing was measured, and the motor can be reached.
const SILENT: &[u8] = &[1, 5, 0, 0, 0, 0];
/// The speed 0.0 was beyond the limit 0.0 at 6 µs; it was -0.0.
const BEYOND: &[u8] = &[7, 2, 0, 0, 0, 0, 0, 0, 0, 0, 6, 1, 0, 0, 0, 0x80, 0, 0, 0];

impl Trace {
    fn trips(&mut self, axis: u8, trip: &[u8]) {
        self.event(0x8001, &[&[axis], trip].concat());
        self.settle();
    }

    /// A page from `first` on that has these incidents, and is the last.
    fn remembered(&mut self, first: u8, incidents: &[&[u8]]) {
        let sequence = self.ask(2, READ, &[first]);
        let count = u8::try_from(incidents.len()).unwrap();
        self.answer(
            2,
            sequence,
            2,
            READ,
            &[&[count], incidents.concat().as_slice(), &[0]].concat(),
        );
        self.settle();
    }
}

fn tripped(start: u8, axis: u8, trip: &[u8]) -> Vec<u8> {
    [&[1, start, axis], trip].concat()
}

#[test]
fn what_was_told_is_remembered() {
    let mut trace = Trace::new(HOLD);
    trace.trips(3, SILENT);
    trace.trips(1, BEYOND);
    trace.remembered(0, &[&tripped(1, 1, BEYOND), &tripped(1, 3, SILENT), STARTED]);
    trace.remembered(1, &[&tripped(1, 3, SILENT), STARTED]);
    trace.remembered(7, &[]);
    trace.breaks_nothing();
}

#[test]
fn a_trip_that_is_missing_another_or_in_another_place() {
    let remembered: [&[&[u8]]; 4] = [
        &[STARTED],
        &[&tripped(1, 3, BEYOND), STARTED],
        &[STARTED, &tripped(1, 3, SILENT)],
        &[&tripped(2, 3, SILENT), STARTED],
    ];
    for incidents in remembered {
        let mut trace = Trace::new(HOLD);
        trace.trips(3, SILENT);
        trace.remembered(0, incidents);
        trace.breaks(Check::HistoryWrong);
    }
}

#[test]
pub fn a_list_that_ends_too_early() {
    let mut trace = Trace::new(HOLD);
    for _ in 0..9 {
        trace.trips(3, SILENT);
    }
    let trip = tripped(1, 3, SILENT);
    trace.remembered(0, &[trip.as_slice(); 8]);
    trace.breaks(Check::HistoryWrong);
}

fn after_reset(interrupted: bool, incidents: &[&[u8]]) -> Trace {
    let mut trace = Trace::new(HOLD);
    trace.trips(3, SILENT);
    trace.now += 1_000;
    trace.oracle.reset(trace.now, interrupted);
    trace.send(STOP);
    trace.remembered(0, incidents);
    trace
}

#[test]
fn what_a_reset_leaves() {
    let trip = tripped(1, 3, SILENT);
    after_reset(false, &[STARTED_AGAIN, &trip, STARTED]).breaks_nothing();
    after_reset(false, &[&tripped(2, 0, SILENT), STARTED_AGAIN, &trip, STARTED]).breaks_nothing();
    after_reset(true, &[STARTED_AGAIN, &tripped(1, 0, BEYOND), &trip, STARTED]).breaks_nothing();
}

#[test]
fn what_a_reset_must_not_lose() {
    let trip = tripped(1, 3, SILENT);
    after_reset(false, &[&trip, STARTED]).breaks(Check::HistoryWrong);
    after_reset(true, &[STARTED_AGAIN, STARTED]).breaks(Check::HistoryWrong);
    after_reset(false, &[STARTED_AGAIN, &tripped(1, 0, BEYOND), &trip, STARTED])
        .breaks(Check::HistoryWrong);
}

#[test]
fn an_axis_that_was_in_motion_at_a_reset_has_tripped() {
    let mut trace = Trace::active();
    trace.oracle.reset(trace.now, false);
    trace.send(STOP);
    trace.remembered(0, &[STARTED_AGAIN, STARTED]);
    trace.breaks(Check::HistoryWrong);
}

#[test]
fn a_loss_of_power_that_leaves_a_trip() {
    let mut trace = Trace::new(HOLD);
    trace.trips(3, SILENT);
    trace.oracle.power_lost(trace.now);
    trace.remembered(0, &[STARTED, &tripped(1, 3, SILENT)]);
    trace.breaks(Check::HistoryWrong);
}
