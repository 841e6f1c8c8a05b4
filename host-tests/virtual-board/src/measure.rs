//! What the firmware costs: exact instruction counts, virtual latency, stack and static memory.
//!
//! An operation is run twice. The first run finds the instants at which it begins and ends; the
//! second, the same to the last access, reads the instruction count there. So a count is of all
//! that the core executes between the two instants, interrupts and other tasks included; a core
//! that sleeps executes nothing.

mod bench;
mod fetches;
mod image;
mod life;
mod operations;
mod profile;
mod stack;
mod stages;
mod table;

pub use table::{Row, Table};

use std::panic::resume_unwind;
use std::path::Path;
use std::{fmt, fs, thread};

use crate::board::Board;
use crate::machine::Builder;
use bench::{Bench, Count, Span};
pub(crate) use fetches::{Fetches, Traced};
use image::ImageFacts;
use operations::Session;
pub(crate) use profile::Profiler;
pub(crate) use stages::{Functions, STAGES};

/// Speeds of the core of the STM32H743, instructions per second: what it reaches at 400 MHz with
/// its caches, and a bad case without.
pub const SPEEDS: [u64; 2] = [250_000_000, 100_000_000];

/// Repetitions of each operation, its last ones, of which the table has a trace; the first of them
/// fills the cache.
const TRACED: usize = 2;

/// Decides the motors' reply times.
const SEED: u64 = 1;

/// An image that cannot be measured.
#[derive(Debug)]
pub struct NotMeasurable(pub(crate) String);

impl fmt::Display for NotMeasurable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for NotMeasurable {}

/// Measures an image. `is_traced`: with the rows that a trace of every instruction gives, which
/// takes minutes.
/// Fails if the file is no image.
/// Panics if the firmware does not do what it is asked for, or the emulation is not deterministic.
pub fn measure(image: &Path, is_traced: bool) -> Result<Table, NotMeasurable> {
    let unreadable =
        |error: &dyn fmt::Display| NotMeasurable(format!("{}: {error}", image.display()));
    let file = fs::read(image).map_err(|error| unreadable(&error))?;
    let facts = ImageFacts::read(&file).map_err(|error| unreadable(&error))?;
    let functions = is_traced.then(|| Functions::of(image)).transpose()?;
    // Once as a trial: from then on it is the same file.
    Builder::new(image).map_err(|error| NotMeasurable(error.to_string()))?;
    let board = &|| Builder::new(image).expect("the image that was just read");

    let [fast, slow] = thread::scope(|scope| {
        // What is executed is nearly the same at each speed.
        let [fast, slow] = Board::chosen().speeds;
        let runs = [(fast, functions), (slow, None)]
            .map(|(speed, functions)| scope.spawn(move || measure_at(board, speed, functions)));
        runs.map(|run| run.join().unwrap_or_else(|panic| resume_unwind(panic)))
    });
    let row = |(what, unit, fast): &Measured| {
        let slow = slow.iter().find(|(other, other_unit, _)| (other, other_unit) == (what, unit));
        let values: Vec<u64> =
            std::iter::once(*fast).chain(slow.map(|(_, _, slow)| *slow)).collect();
        Row::new(what, unit, &values)
    };
    let mut rows: Vec<Row> = fast.iter().map(row).collect();
    rows.push(Row::new("image", "flash, bytes", &[facts.flash]));
    rows.push(Row::new("image", "static RAM, bytes", &[facts.static_ram]));
    Ok(Table { compiler: facts.compiler, rows })
}

/// Everything that is measured on one board, from power-on to its end: what, and when.
fn run(bench: &mut Bench) -> Vec<(&'static str, Vec<Span>)> {
    let mut session = Session::open(bench);
    let unconfigured = operations::idle_second(bench, &mut session);
    session.configure(bench);
    let configured = operations::idle_second(bench, &mut session);
    let mut found = vec![
        ("idle second, unconfigured", unconfigured),
        ("idle second, 8 idle axes", configured),
        ("setpoint in, CAN frame out", operations::setpoint(bench, &mut session)),
        ("stop in, CAN frame out", operations::stop(bench, &mut session)),
        ("e-stop in, first CAN frame out", operations::e_stop(bench, &mut session)),
        ("CAN reply in, state out", operations::state(bench, &mut session)),
        ("round over 8 axes", operations::round(bench, &mut session)),
    ];
    session.calm(bench);
    found.extend([
        ("idle bus, 2 Mbaud: setpoint in, frame out", operations::setpoint(bench, &mut session)),
        ("idle bus, 2 Mbaud: reply in, state out", operations::state(bench, &mut session)),
    ]);
    session.move_to_usb(bench);
    found.extend([
        ("idle bus, USB: setpoint in, frame out", operations::setpoint(bench, &mut session)),
        ("idle bus, USB: reply in, state out", operations::state(bench, &mut session)),
    ]);
    found
}

/// Where the instructions of each operation go on a core of the higher speed, in a repetition of
/// median cost and in the worst, by function and by line. It takes minutes.
/// Fails if the file is no image.
/// Panics as [`measure`] does.
pub fn profile(image: &Path) -> Result<String, NotMeasurable> {
    let functions = Functions::of(image)?;
    let profiler = Profiler::new(image, functions.clone())?;
    let board = || Builder::new(image).expect("the image that was just read");
    let [fast, _] = Board::chosen().speeds;
    let runs = run(&mut Bench::power_on(board(), fast, Vec::new()));
    let (_, counted) = count(&board, fast, &runs, Vec::new(), None);
    let repeated = counted.iter().filter(|operation| operation.costs.len() > 1);
    let looked_at: Vec<_> =
        repeated.map(|operation| (operation, operation.median_and_worst())).collect();
    let mut traced: Vec<Span> =
        looked_at.iter().flat_map(|(operation, at)| at.map(|at| operation.spans[at])).collect();
    traced.sort_by_key(|span| span.from);
    traced.dedup();
    let (_, found) = count(&board, fast, &runs, traced, Some(functions));
    let table = |(operation, at): &(&Operation, [usize; 2])| {
        let found = found.iter().find(|other| other.what == operation.what)?;
        let tables = ["median", "worst"].into_iter().zip(at).map(|(which, at)| {
            let what = format!("{}, {which}", operation.what);
            profiler.table(&what, &found.costs[*at].trace.executed, 1)
        });
        Some(tables.collect::<Vec<_>>().join("\n"))
    };
    Ok(looked_at.iter().filter_map(table).collect::<Vec<_>>().join("\n"))
}

/// What was measured of an operation, by repetition.
struct Operation {
    what: &'static str,
    spans: Vec<Span>,
    costs: Vec<Cost>,
}

impl Operation {
    /// A repetition of median cost, and the dearest.
    fn median_and_worst(&self) -> [usize; 2] {
        let costs = || self.costs.iter().map(|cost| cost.instructions);
        let (median, worst) = median_and_worst(costs());
        [median, worst].map(|wanted| costs().position(|cost| cost == wanted).expect("one of them"))
    }
}

/// Runs everything once more to count at instants that were found: the bench at its end, and what
/// was counted. With the functions of the image, the spans `traced` are traced.
fn count(
    board: &dyn Fn() -> Builder,
    instructions_per_second: u64,
    runs: &[(&'static str, Vec<Span>)],
    traced: Vec<Span>,
    functions: Option<Functions>,
) -> (Bench, Vec<Operation>) {
    let marks = runs.iter().flat_map(|(_, spans)| spans).flat_map(|span| [span.from, span.to]);
    let mut bench = Bench::power_on(board(), instructions_per_second, marks.collect())
        .traced(traced, functions);
    assert_eq!(run(&mut bench), runs, "the same orders make the same run");
    let mut costs = bench.counts().chunks_exact(2).map(|pair| Cost::between(&pair[0], &pair[1]));
    let operation = |(what, spans): &(&'static str, Vec<Span>)| {
        let costs = costs.by_ref().take(spans.len()).collect();
        Operation { what, spans: spans.clone(), costs }
    };
    let operations = runs.iter().map(operation).collect();
    (bench, operations)
}

/// One row for a core of one speed: what, in which unit, how much.
type Measured = (&'static str, String, u64);

/// The rows of one speed.
fn measure_at(
    board: &dyn Fn() -> Builder,
    instructions_per_second: u64,
    functions: Option<Functions>,
) -> Vec<Measured> {
    let is_traced = functions.is_some();
    let runs = run(&mut Bench::power_on(board(), instructions_per_second, Vec::new()));
    let traced = runs.iter().filter(|(what, _)| is_traced && !what.starts_with(table::IDLE_BUS));
    let traced = traced.filter_map(|(_, spans)| last_of(spans));
    let traced = traced.collect();
    let (mut bench, operations) = count(board, instructions_per_second, &runs, traced, functions);
    let read_cycles = bench.read_cycles();
    let mut rows = Vec::new();
    let mut row = |what: &'static str, unit: &str, value| rows.push((what, unit.to_owned(), value));
    for Operation { what, spans, costs } in &operations {
        match costs[..] {
            [Cost { instructions, .. }] => row(what, "instructions", instructions),
            _ => {
                let (median, worst) = median_and_worst(costs.iter().map(|cost| cost.instructions));
                row(what, "instructions, median", median);
                row(what, "instructions, worst", worst);
                let is_traced = is_traced && !what.starts_with(table::IDLE_BUS);
                if let (true, Some(Cost { instructions, trace })) = (is_traced, costs.last()) {
                    for ((stage, _), count) in STAGES.iter().zip(trace.stages) {
                        row(what, &format!("of these {stage}, last"), count);
                    }
                    row(what, "reads of the flash, last", trace.reads);
                    let cycles = instructions + trace.reads * read_cycles;
                    row(what, "cycles with cache misses, last", cycles);
                }
                let (median, worst) = median_and_worst(spans.iter().map(Span::nanos));
                row(what, "latency ns, median", median);
                if let Some(p99) = p99(spans.iter().map(Span::nanos)) {
                    row(what, "latency ns, p99", p99);
                }
                row(what, "latency ns, worst", worst);
            }
        }
    }
    let depth = life::stack_used(board(), instructions_per_second);
    row("stack, start-up", "bytes", depth.start_up);
    row("stack, afterwards", "bytes", depth.life.max(bench.stack_used()));
    rows
}

/// What an operation costs.
#[derive(Debug, Clone)]
struct Cost {
    instructions: u64,
    /// Nothing without a trace.
    trace: Traced,
}

impl Cost {
    fn between(from: &Count, to: &Count) -> Self {
        let trace = to
            .trace
            .clone()
            .zip(from.trace.clone())
            .map(|(to, from)| to - from)
            .unwrap_or_default();
        Self { instructions: to.instructions - from.instructions, trace }
    }
}

/// The time of the repetitions that are traced; none where there are no repetitions.
fn last_of(spans: &[Span]) -> Option<Span> {
    let first = spans.len().checked_sub(TRACED)?;
    Some(Span { from: spans[first].from, to: spans[spans.len() - 1].to })
}

/// The lower median, and the greatest.
fn median_and_worst(values: impl Iterator<Item = u64>) -> (u64, u64) {
    let mut values: Vec<u64> = values.collect();
    values.sort_unstable();
    (values[(values.len() - 1) / 2], values[values.len() - 1])
}

/// What 99 of 100 do not exceed; nothing of less than 100.
fn p99(values: impl Iterator<Item = u64>) -> Option<u64> {
    let mut values: Vec<u64> = values.collect();
    values.sort_unstable();
    let at = (values.len() * 99).div_ceil(100).checked_sub(1)?;
    values.get(at).copied().filter(|_| values.len() >= 100)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_100_values_one_is_beyond_the_99th() {
        assert_eq!(p99((1..=100).rev()), Some(99));
        assert_eq!(p99(1..=99), None);
    }

    #[test]
    fn the_median_is_one_of_the_values() {
        assert_eq!(median_and_worst([7, 1, 5].into_iter()), (5, 7));
        assert_eq!(median_and_worst([7, 1, 5, 9].into_iter()), (5, 9));
        assert_eq!(median_and_worst([3].into_iter()), (3, 3));
    }
}
