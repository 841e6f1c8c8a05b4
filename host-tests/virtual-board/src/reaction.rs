//! Reaction times: from the last bit of a host's command to the first bit of the stops, at many phases of what the buses
//! carry, beside the bounds of GUARANTEES G5.
//!
//! A [`Situation`] is set up once: a bus with as many armed axes as it takes, sixteen at most, and a load. Every phase is a
//! branch of that run.

mod rig;
mod situation;
mod stops;
mod table;
mod trace;

pub use situation::Situation;
pub use table::{Complaint, Malformed, Row, Table};

use std::panic::resume_unwind;
use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;
use std::{fmt, thread};

use host_protocol::StopTarget;
use host_protocol::requests::{EStop, Stop};

use crate::machine::Builder;
use rig::Rig;

/// Phases that a run in CI looks at.
pub const FEW_PHASES: u32 = 50;

/// What the lines of the table mean.
pub const LEGEND: &str = "\
# Reaction times on the virtual board: microseconds of virtual time from the last bit of a host's command on UART B to the first
# bit of a stop. Sixteen axes are armed on the one bus in question, eleven on that at 210526 bit/s, which takes no more; the core
# executes 250 million instructions a second. Best, median and worst of the phases, which are spread evenly over the time of one frame, and with a load over sixteen
# periods of it as well; each is a branch of one run, as from a snapshot. The bound is that of GUARANTEES G5.
#
#     .ci/virtual-board reaction                          50 phases, compared with this table, as CI does
#     .ci/virtual-board reaction --phases 1000 --renew    writes it anew
#
# CI fails when the worst of its 50 phases is more than 5 % and 20 us above the worst here, or above the bound and that of the
# table is not: a line with \"over\" breaks its bound, and says so. never: no stop came within 100 ms of the bound.
#
# quiet      the axes stand, nothing else is on the bus at that time
# own        all axes move; refresh and polls take the 80 % of the bus that the gateway allows
# foreign    the axes stand; another node sends its id 0x7FF without a pause
# one        Stop of one axis, another one in each phase
# first      EStop of all axes: the first of their stops
# last       EStop of all axes: the last
";

/// An image that cannot be run.
#[derive(Debug)]
pub struct NotRunnable(String);

impl fmt::Display for NotRunnable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for NotRunnable {}

/// Measures an image in every situation, or those whose names contain `filter`.
///
/// # Errors
///
/// If the file is no image.
///
/// # Panics
///
/// If the gateway does not do what it is asked for, or an axis is not stopped at all.
pub fn measure(image: &Path, phases: u32, filter: &str) -> Result<Table, NotRunnable> {
    // Once as a trial: from then on it is the same file.
    Builder::new(image).map_err(|error| NotRunnable(error.to_string()))?;
    let board = &|| Builder::new(image).expect("the image that was just read");
    let left =
        &Mutex::new(Situation::all().into_iter().filter(|one| one.to_string().contains(filter)).enumerate());
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let mut found = thread::scope(|scope| {
        let work = || {
            let next = || left.lock().expect("no worker panics here").next();
            let measured = |(place, situation)| (place, rows(board, situation, phases));
            std::iter::from_fn(next).map(measured).collect::<Vec<_>>()
        };
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let joined =
            workers.into_iter().map(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        joined.flatten().collect::<Vec<_>>()
    });
    found.sort_by_key(|(place, _)| *place);
    let image = found.first().map(|(_, (image, _))| image.clone()).unwrap_or_default();
    Ok(Table { image, phases, rows: found.into_iter().flat_map(|(_, (_, rows))| rows).collect() })
}

/// What the bus carried about the e-stop that took longest to its last stop: of each situation whose name contains `filter`.
///
/// # Errors
///
/// If the file is no image.
///
/// # Panics
///
/// If the gateway does not do what it is asked for.
pub fn traces(image: &Path, phases: u32, filter: &str) -> Result<String, NotRunnable> {
    Builder::new(image).map_err(|error| NotRunnable(error.to_string()))?;
    let board = || Builder::new(image).expect("the image that was just read");
    let mut text = String::new();
    for situation in Situation::all().into_iter().filter(|one| one.to_string().contains(filter)) {
        let rig = Rig::new(&board, situation);
        let bound = situation.bound(situation.bus.axes());
        let last = |phase: &u32| {
            let axes = 0..situation.bus.axes();
            let stops = rig.react(situation.offset(*phase, phases), &EStop {}, bound, axes);
            last_stop(&stops).unwrap_or(Duration::MAX)
        };
        let worst = (0..phases).max_by_key(last).unwrap_or_default();
        let trace = rig.trace(situation.offset(worst, phases), &EStop {}, bound);
        text += &format!("{situation}, phase {worst} of {phases}\n{trace}");
    }
    Ok(text)
}

/// `None`: an axis is not stopped at all.
fn last_stop(stops: &[Option<Duration>]) -> Option<Duration> {
    stops.iter().copied().collect::<Option<Vec<_>>>().and_then(|stops| stops.into_iter().max())
}

/// The build that runs, and the rows of one situation.
fn rows(board: &dyn Fn() -> Builder, situation: Situation, phases: u32) -> (String, Vec<Row>) {
    let rig = Rig::new(board, situation);
    let axes = situation.bus.axes();
    let [mut one, mut first, mut last] = [Vec::new(), Vec::new(), Vec::new()];
    for phase in 0..phases {
        let after = situation.offset(phase, phases);
        let axis = u8::try_from(phase % u32::from(axes)).expect("small");
        let stop = Stop { target: StopTarget::Axis(axis) };
        one.extend(rig.react(after, &stop, situation.bound(1), axis..axis + 1));
        let stops = rig.react(after, &EStop {}, situation.bound(axes), 0..axes);
        first.push(stops.iter().copied().flatten().min());
        last.push(last_stop(&stops));
    }
    let row =
        |stop: &str, took: &[Option<Duration>], bound| Row::new(&format!("{situation}, {stop}"), took, bound);
    let rows = vec![
        row("one", &one, situation.bound(1)),
        row("first", &first, situation.bound(1)),
        row("last", &last, situation.bound(axes)),
    ];
    (rig.build_id().to_owned(), rows)
}
