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
pub const FEW_PHASES: u32 = 25;

/// What the lines of the table mean.
pub const LEGEND: &str = "\
# Reaction times on the virtual board: microseconds of virtual time from the last bit of a host's command on UART B to the first
# bit of a stop. Sixteen axes are armed on the one bus in question, eleven on that at 210526 bit/s, which takes no more; the core
# executes 250 million instructions a second. Best, median and worst of the phases, which are spread evenly over the time of one frame, and with a load over sixteen
# periods of it as well; each is a branch of one run, as from a snapshot. The bound is that of GUARANTEES G5.
#
#     .ci/virtual-board reaction                          25 phases, compared with this table, as CI does
#     .ci/virtual-board reaction --phases 1000 --renew    writes it anew
#
# CI fails when the worst of its 25 phases is more than 5 % and 20 us above the worst here, or above the bound and that of the
# table is not: a line with \"over\" breaks its bound, and says so. never: no stop came within 100 ms of the bound.
#
# quiet      the axes stand, nothing else is on the bus at that time
# own        all axes move; refresh and polls take the 80 % of the bus that the gateway allows
# foreign    the axes stand; another node sends its id 0x7FF without a pause
# behind lowest, middle, before highest
#            the same with an id right behind that of the first axis, in the middle of the axes, right before that of the last, from
#            shortly before the command on: the stops with a lower id than that have a bound, and are measured. The others have none: a
#            test shows that they are reported, and their axes unreachable
# one        Stop of one axis, another one in each phase
# first      EStop of all axes: the first of their stops
# last       EStop of all axes: the last, of those that have a bound
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

/// Measures the lines of the table whose names contain `filter`.
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
    let left = &Mutex::new(wanted(filter).into_iter().enumerate());
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let mut found = thread::scope(|scope| {
        let work = || {
            let next = || left.lock().expect("no worker panics here").next();
            let measured = |(place, (situation, lines)): (usize, (Situation, Vec<Line>))| {
                (place, rows(board, situation, &lines, phases))
            };
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

/// What the bus carried about the stop that took longest: of each line of the table whose name contains `filter`.
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
    for (situation, lines) in wanted(filter) {
        let rig = Rig::new(&board, situation);
        for line in lines {
            let took = |phase: &u32| {
                let times = times(&rig, situation, &[line], *phase, phases);
                times.into_iter().flatten().max().unwrap_or(Duration::MAX)
            };
            let worst = (0..phases).max_by_key(took).unwrap_or_default();
            let (after, bound) = (situation.offset(worst, phases), line.bound(situation));
            let trace = match line {
                Line::One => rig.trace(after, &stop_of(situation.stopped(worst)), bound),
                Line::First | Line::Last => rig.trace(after, &EStop {}, bound),
            };
            text += &format!("{}, phase {worst} of {phases}\n{trace}", line.name(situation));
        }
    }
    Ok(text)
}

/// The lines of the table of one situation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Line {
    /// Stop of one axis, another one in each phase.
    One,
    /// E-stop of all: the first of the stops that have a bound,
    First,
    /// and the last of them.
    Last,
}

impl Line {
    const ALL: [Self; 3] = [Self::One, Self::First, Self::Last];

    fn name(self, situation: Situation) -> String {
        let stop = match self {
            Self::One => "one",
            Self::First => "first",
            Self::Last => "last",
        };
        format!("{situation}, {stop}")
    }

    fn bound(self, situation: Situation) -> Duration {
        match self {
            Self::One | Self::First => situation.bound(1),
            Self::Last => situation.bound(situation.winners()),
        }
    }
}

/// The lines whose names contain `filter`, by their situations.
fn wanted(filter: &str) -> Vec<(Situation, Vec<Line>)> {
    let lines = |situation: Situation| {
        let named = |line: &Line| line.name(situation).contains(filter);
        (situation, Line::ALL.into_iter().filter(named).collect::<Vec<_>>())
    };
    Situation::all().into_iter().map(lines).filter(|(_, lines)| !lines.is_empty()).collect()
}

fn stop_of(axis: u8) -> Stop {
    Stop { target: StopTarget::Axis(axis) }
}

/// What these lines take in one phase; `None`: an axis is not stopped at all.
fn times(rig: &Rig, situation: Situation, lines: &[Line], phase: u32, phases: u32) -> Vec<Option<Duration>> {
    let after = situation.offset(phase, phases);
    let one = || {
        let axis = situation.stopped(phase);
        rig.react(after, &stop_of(axis), Line::One.bound(situation), axis..axis + 1)
    };
    let all = || rig.react(after, &EStop {}, Line::Last.bound(situation), 0..situation.winners());
    let all = if lines.iter().any(|line| *line != Line::One) { all() } else { Vec::new() };
    let took = |line: &Line| match line {
        Line::One => one().into_iter().flatten().min(),
        Line::First => all.iter().copied().flatten().min(),
        Line::Last => all.iter().copied().collect::<Option<Vec<_>>>().and_then(|all| all.into_iter().max()),
    };
    lines.iter().map(took).collect()
}

/// The build that runs, and the rows of one situation.
fn rows(
    board: &dyn Fn() -> Builder,
    situation: Situation,
    lines: &[Line],
    phases: u32,
) -> (String, Vec<Row>) {
    let rig = Rig::new(board, situation);
    let times: Vec<_> = (0..phases).map(|phase| times(&rig, situation, lines, phase, phases)).collect();
    let row = |(index, line): (usize, &Line)| {
        let took: Vec<_> = times.iter().map(|times| times[index]).collect();
        Row::new(&line.name(situation), &took, line.bound(situation))
    };
    (rig.build_id().to_owned(), lines.iter().enumerate().map(row).collect())
}
