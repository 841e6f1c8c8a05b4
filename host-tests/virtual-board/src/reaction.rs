//! Reaction times: from the last bit of a host's command to the first bit of the stops, at many
//! phases of what the buses carry, beside the bounds of GUARANTEES G5.
//!
//! A [`Situation`] is set up once at each speed: a bus with as many armed axes as it takes, sixteen
//! at most, and a load. Every phase is a branch of that run.

mod computers;
mod rig;
mod situation;
mod stops;
mod table;
mod trace;
mod turns;

pub use situation::Situation;
pub use table::{Row, Table, Times};

use std::ops::Range;
use std::panic::resume_unwind;
use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;
use std::{slice, thread};

use host_protocol::StopTarget;
use host_protocol::requests::{EStop, Stop};

use crate::board::Board;
use crate::machine::Builder;
use crate::measure::{Functions, NotMeasurable, SPEEDS};
use computers::Cause;
use rig::{Rig, Stand};
use situation::{Bus, Load};

/// Phases that a run in CI looks at, at each speed.
pub const FEW_PHASES: [u32; SPEEDS.len()] = [20, 5];

/// What one board measures: the situations of one bus, or of many together, at one speed.
struct Task {
    speed: usize,
    bus: Bus,
}

/// What was measured of one situation at one speed.
struct Measured {
    situation: Situation,
    speed: usize,
    build_id: String,
    times: Vec<(Line, Times)>,
}

/// Measures the lines of the table whose names contain `filter`.
/// Fails if the file is no image.
/// Panics if the gateway does not do what it is asked for, or an axis is not stopped at all.
pub fn measure(
    image: &Path,
    phases: [u32; SPEEDS.len()],
    filter: &str,
) -> Result<Table, NotMeasurable> {
    // Once as a trial: from then on it is the same file.
    Builder::new(image).map_err(|error| NotMeasurable(error.to_string()))?;
    let board = &|| Builder::new(image).expect("the image that was just read");
    let wanted = &wanted(filter);
    // The bus with most situations first.
    let tasks = Bus::ALL
        .into_iter()
        .flat_map(|bus| (0..SPEEDS.len()).map(move |speed| Task { speed, bus }));
    let left = &Mutex::new(tasks);
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let found: Vec<Measured> = thread::scope(|scope| {
        let work = || {
            let next = || left.lock().expect("no worker panics here").next();
            let measured = |task: Task| measured(board, &task, wanted, phases[task.speed]);
            std::iter::from_fn(next).flat_map(measured).collect::<Vec<_>>()
        };
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let joined = workers
            .into_iter()
            .map(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        joined.flatten().collect()
    });
    let image = found.first().map(|measured| measured.build_id.clone()).unwrap_or_default();
    let row = |(situation, line): (Situation, Line)| {
        let times = |speed| {
            let measured =
                found.iter().find(|other| (other.situation, other.speed) == (situation, speed));
            let mut times = measured.into_iter().flat_map(|measured| &measured.times);
            times.find(|(other, _)| *other == line).expect("every line is measured").1
        };
        Row::new(&line.name(situation), std::array::from_fn(times), line.bound(situation))
    };
    let lines = wanted
        .iter()
        .flat_map(|(situation, lines)| lines.iter().map(move |line| (*situation, *line)));
    Ok(Table { image, phases, rows: lines.map(row).collect() })
}

/// Measures on one board.
fn measured(
    board: &dyn Fn() -> Builder,
    &Task { speed, bus }: &Task,
    wanted: &[(Situation, Vec<Line>)],
    phases: u32,
) -> Vec<Measured> {
    let mut wanted = wanted.iter().filter(|(situation, _)| situation.bus == bus).peekable();
    if wanted.peek().is_none() {
        return Vec::new();
    }
    let mut stand =
        Stand::new(&|| board().instructions_per_second(Board::chosen().speeds[speed]), bus);
    let measured = |(situation, lines): &(Situation, Vec<Line>)| {
        let rig = stand.set_up(*situation);
        let phases = situation.phases(phases);
        let took: Vec<_> =
            (0..phases).map(|phase| times(&rig, *situation, lines, phase, phases)).collect();
        let of_line = |(index, line): (usize, &Line)| {
            (*line, Times::of(&took.iter().map(|took| took[index]).collect::<Vec<_>>()))
        };
        let times = lines.iter().enumerate().map(of_line).collect();
        Measured { situation: *situation, speed, build_id: rig.build_id().to_owned(), times }
    };
    wanted.map(measured).collect()
}

/// What somebody looks at who looks for the cause of a late stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// What the bus carried about the stop that took longest, of each line.
    Trace,
    /// The longest turns of the tasks before that, in each situation.
    Turns,
    /// Every turn of them behind the cause of the latest stop, of the first line of each situation.
    TurnsBehind,
}

/// Looks at the lines of the table whose names contain `filter`, at each speed.
/// Fails if the file is no image.
/// Panics if the gateway does not do what it is asked for.
pub fn look(
    look: Look,
    image: &Path,
    phases: [u32; SPEEDS.len()],
    filter: &str,
) -> Result<String, NotMeasurable> {
    Builder::new(image).map_err(|error| NotMeasurable(error.to_string()))?;
    let functions = Functions::of(image)?;
    let mut text = String::new();
    for (speed, phases) in Board::chosen().speeds.into_iter().zip(phases) {
        let board = || {
            Builder::new(image)
                .expect("the image that was just read")
                .instructions_per_second(speed)
        };
        for (situation, lines) in wanted(filter) {
            let rig = Stand::new(&board, situation.bus).set_up(situation);
            let turns = match look {
                Look::Trace => {
                    let told = lines.into_iter();
                    text.extend(told.map(|line| trace(&rig, situation, line, speed, phases)));
                    continue;
                }
                Look::Turns => rig.turns(&functions),
                Look::TurnsBehind => {
                    let line = *lines.first().expect("a situation with none is not wanted");
                    let (phase, after) = worst(&rig, situation, line, phases);
                    rig.turns_behind(after, &line.cause(&rig, situation, phase, after), &functions)
                }
            };
            text += &format!("{situation}, at {speed} a second\n{turns}");
        }
    }
    Ok(text)
}

fn trace(rig: &Rig, situation: Situation, line: Line, speed: u64, phases: u32) -> String {
    let (phase, after) = worst(rig, situation, line, phases);
    let cause = line.cause(rig, situation, phase, after);
    let trace = rig.trace(after, &cause, line.bound(situation));
    let phases = situation.phases(phases);
    format!("{}, at {speed} a second, phase {phase} of {phases}\n{trace}", line.name(situation))
}

/// The phase in which a line takes longest, and where that is.
fn worst(rig: &Rig, situation: Situation, line: Line, phases: u32) -> (u32, Duration) {
    let phases = situation.phases(phases);
    let took = |phase: &u32| {
        let times = times(rig, situation, &[line], *phase, phases);
        times.into_iter().flatten().max().unwrap_or(Duration::MAX)
    };
    let phase = (0..phases).max_by_key(took).unwrap_or_default();
    (phase, situation.offset(phase, phases))
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
    /// Stop of all axes: the first.
    All,
    /// The setpoints of all axes expire at one instant: the first.
    Expired,
}

impl Line {
    const ALL: [Self; 5] = [Self::One, Self::First, Self::Last, Self::All, Self::Expired];

    /// Whether the table has it of a situation.
    fn is_of(self, situation: Situation) -> bool {
        match self {
            Self::One | Self::First | Self::Last => true,
            Self::All => matches!(situation.load, Load::Quiet | Load::Own | Load::Cycle),
            Self::Expired => matches!(situation.load, Load::Own | Load::Cycle),
        }
    }

    /// What the stops of a phase follow from.
    fn cause(self, rig: &Rig, situation: Situation, phase: u32, after: Duration) -> Cause {
        let stop = |target| Cause::command(&Stop { target });
        match self {
            Self::One => stop(StopTarget::Axis(situation.stopped(phase))),
            Self::First | Self::Last => Cause::command(&EStop {}),
            Self::All => stop(StopTarget::All),
            Self::Expired => rig.expiry(after),
        }
    }

    fn name(self, situation: Situation) -> String {
        let stop = match self {
            Self::One => "one",
            Self::First => "first",
            Self::Last => "last",
            Self::All => "all",
            Self::Expired => "expired",
        };
        format!("{situation}, {stop}")
    }

    fn bound(self, situation: Situation) -> Duration {
        match self {
            Self::One | Self::First | Self::All | Self::Expired => situation.bound(1),
            Self::Last => situation.bound(situation.winners()),
        }
    }
}

/// The lines whose names contain `filter`, by their situations.
fn wanted(filter: &str) -> Vec<(Situation, Vec<Line>)> {
    let lines = |situation: Situation| {
        let named = |line: &Line| line.is_of(situation) && line.name(situation).contains(filter);
        (situation, Line::ALL.into_iter().filter(named).collect::<Vec<_>>())
    };
    Situation::all().into_iter().map(lines).filter(|(_, lines)| !lines.is_empty()).collect()
}

/// What these lines take in one phase; `None`: an axis is not stopped at all.
fn times(
    rig: &Rig,
    situation: Situation,
    lines: &[Line],
    phase: u32,
    phases: u32,
) -> Vec<Option<Duration>> {
    let after = situation.offset(phase, phases);
    let stops = |line: Line, axes: &[Range<u8>]| {
        rig.react(after, &line.cause(rig, situation, phase, after), line.bound(situation), axes)
    };
    // Of the first stops of the buses the last: each has its bound.
    let first = |stops: Vec<Vec<Option<Duration>>>| {
        let firsts = stops.into_iter().map(|stops| stops.into_iter().flatten().min());
        firsts.collect::<Option<Vec<_>>>().and_then(|firsts| firsts.into_iter().max())
    };
    let last = |stops: Vec<Vec<Option<Duration>>>| {
        let stops = stops.into_iter().flatten().collect::<Option<Vec<_>>>();
        stops.and_then(|stops| stops.into_iter().max())
    };
    let counted = situation.counted();
    // One branch for both.
    let mut of_e_stop = None;
    let mut of_e_stop = || of_e_stop.get_or_insert_with(|| stops(Line::Last, &counted)).clone();
    let took = |line: &Line| match line {
        Line::One => {
            let axis = situation.stopped(phase);
            first(stops(Line::One, slice::from_ref(&(axis..axis + 1))))
        }
        Line::First => first(of_e_stop()),
        Line::Last => last(of_e_stop()),
        Line::All | Line::Expired => first(stops(*line, &counted)),
    };
    lines.iter().map(took).collect()
}
