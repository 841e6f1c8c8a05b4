//! The table of reaction times as text, and the comparison with the committed one.

use std::fmt;
use std::time::Duration;

use crate::board::Board;
use crate::measure::SPEEDS;
use crate::sections::{COMMENT, Malformed, SEPARATOR, lines, not_committed, not_measured};

/// By how much the worst may be worse than the committed worst: a twentieth, and 20 µs. The
/// committed table has looked at more phases, so what is beyond that is the software's.
const TOLERANCE: u64 = 20;
const TOLERANCE_NS: u64 = 20_000;
/// The first words of the lines with the build and the number of phases.
const IMAGE: &str = "image";
const PHASES: &str = "phases";
/// Ends a row that breaks its bound: at both speeds, or at the lower one.
const OVER: &str = "over";
const OVER_WHEN_SLOW: &str = "over at 100 M";
/// The table is in tenths of a microsecond.
const TENTH_NS: u64 = 100;
/// No stop came in all the time that it was waited for.
const NEVER: u64 = u64::MAX;
const NEVER_TEXT: &str = "never";

/// The reaction times of one command in one situation at one speed, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// Of all phases.
    pub best: u64,
    /// The lower median.
    pub median: u64,
    /// Of all phases.
    pub worst: u64,
}

/// The reaction times of one command in one situation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// The situation, and which stop.
    pub what: String,
    /// At each of the [`SPEEDS`].
    pub times: [Times; SPEEDS.len()],
    /// What they may be, ns.
    pub bound: u64,
}

/// What was measured of one image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// The build, as the firmware names it.
    pub image: String,
    /// How many phases were looked at, at each speed.
    pub phases: [u32; SPEEDS.len()],
    /// The reaction times.
    pub rows: Vec<Row>,
}

impl Times {
    /// Of all phases, rounded up to tenths of a microsecond, as the table has them; `None`: no stop
    /// came.
    /// Panics without any.
    pub fn of(took: &[Option<Duration>]) -> Self {
        let mut took: Vec<u64> = took.iter().map(|took| took.map_or(NEVER, rounded)).collect();
        took.sort_unstable();
        let last = took.len().checked_sub(1).expect("a phase");
        Self { best: took[0], median: took[last / 2], worst: took[last] }
    }
}

/// Nanoseconds, rounded up to tenths of a microsecond.
fn rounded(span: Duration) -> u64 {
    u64::try_from(span.as_nanos()).expect("short").next_multiple_of(TENTH_NS)
}

impl Row {
    /// A row.
    pub fn new(what: &str, times: [Times; SPEEDS.len()], bound: Duration) -> Self {
        Self { what: what.to_owned(), times, bound: rounded(bound) }
    }

    fn parse(what: &str, columns: &[&str]) -> Option<Self> {
        let values: Option<Vec<u64>> = columns.iter().map(|column| tenths(column)).collect();
        let [best, median, worst, slow_best, slow_median, slow_worst, bound] = values?[..] else {
            return None;
        };
        let fast = Times { best, median, worst };
        let slow = Times { best: slow_best, median: slow_median, worst: slow_worst };
        Some(Self { what: what.to_owned(), times: [fast, slow], bound })
    }

    fn is_over(&self, speed: usize) -> bool {
        self.times[speed].worst > self.bound
    }

    fn verdict(&self) -> &'static str {
        match (self.is_over(0), self.is_over(1)) {
            (true, _) => OVER,
            (false, true) => OVER_WHEN_SLOW,
            (false, false) => "",
        }
    }
}

/// `123.4` µs in ns.
fn tenths(text: &str) -> Option<u64> {
    if text == NEVER_TEXT {
        return Some(NEVER);
    }
    let (whole, tenth) = text.split_once('.')?;
    let tenth: u64 = (tenth.len() == 1).then(|| tenth.parse().ok()).flatten()?;
    Some((whole.parse::<u64>().ok()? * 10 + tenth) * TENTH_NS)
}

impl Table {
    /// Reads what [`Display`](fmt::Display) has written, comments and empty lines in between.
    /// Fails with the first line that is none of a table.
    pub fn parse(text: &str) -> Result<Self, Malformed> {
        let (mut image, mut phases, mut rows) = (None, None, Vec::new());
        for (line, columns) in lines(text) {
            let malformed = Malformed { line };
            match columns[..] {
                [IMAGE, build] => image = Some(build.to_owned()),
                [PHASES, fast, slow] => {
                    let count = |text: &str| text.parse().map_err(|_| Malformed { line });
                    phases = Some([count(fast)?, count(slow)?]);
                }
                [what, ref columns @ .., verdict] => {
                    let row = Row::parse(what, columns).filter(|row| row.verdict() == verdict);
                    rows.push(row.ok_or(malformed)?);
                }
                _ => return Err(malformed),
            }
        }
        match (image, phases) {
            (Some(image), Some(phases)) => Ok(Self { image, phases, rows }),
            _ => Err(Malformed { line: 0 }),
        }
    }

    /// What is wrong with a committed table, measured by this one, which has the rows whose names
    /// contain `only`. Nothing: it holds.
    pub fn complaints(&self, committed: &Self, only: &str) -> Vec<String> {
        let mut complaints = Vec::new();
        for row in &self.rows {
            match committed.rows.iter().find(|other| other.what == row.what) {
                None => complaints.push(not_committed(&row.what)),
                Some(other) => complaints
                    .extend((0..SPEEDS.len()).filter_map(|speed| worse(row, other, speed))),
            }
        }
        let gone = committed.rows.iter().map(|row| &row.what).filter(|what| {
            what.contains(only) && !self.rows.iter().any(|other| other.what == **what)
        });
        complaints.extend(gone.map(|what| not_measured(what)));
        complaints
    }
}

/// What is worse at one speed.
fn worse(row: &Row, committed: &Row, at: usize) -> Option<String> {
    let (measured, before) = (row.times[at].worst, committed.times[at].worst);
    let against = if row.is_over(at) && !committed.is_over(at) {
        format!("and the bound is {} us", Tenths(row.bound))
    } else if measured > tolerated(before) {
        format!("the table has {} us", Tenths(before))
    } else {
        return None;
    };
    let (what, speed) = (&row.what, Board::chosen().speeds[at]);
    Some(format!("{what}, at {speed} a second: {} us, {against}", Tenths(measured)))
}

fn tolerated(worst: u64) -> u64 {
    worst.saturating_add(worst / TOLERANCE + TOLERANCE_NS)
}

/// Nanoseconds as the table has them.
struct Tenths(u64);

impl fmt::Display for Tenths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == NEVER {
            return f.pad(NEVER_TEXT);
        }
        let tenths = self.0 / TENTH_NS;
        f.pad(&format!("{}.{}", tenths / 10, tenths % 10))
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{IMAGE} {SEPARATOR} {}", self.image)?;
        let [fast, slow] = self.phases;
        writeln!(f, "{PHASES} {SEPARATOR} {fast} {SEPARATOR} {slow}")?;
        let width = self.rows.iter().map(|row| row.what.chars().count()).max().unwrap_or_default();
        let million = Board::chosen().speeds.map(|speed| format!("{} M:", speed / 1_000_000));
        let head = [&million[0], "", "", &million[1], "", ""]
            .map(|speed| format!(" {SEPARATOR} {speed:>9}"));
        writeln!(
            f,
            "{COMMENT}{:1$}{2} {SEPARATOR} {3:>9}",
            "",
            width.saturating_sub(1),
            head.concat(),
            ""
        )?;
        let times =
            ["best us", "median us", "worst us"].map(|column| format!(" {SEPARATOR} {column:>9}"));
        let times = times.concat().repeat(SPEEDS.len());
        writeln!(
            f,
            "{COMMENT}{:1$}{times} {SEPARATOR} {2:>9}",
            "",
            width.saturating_sub(1),
            "bound us"
        )?;
        for row in &self.rows {
            write!(f, "{:width$}", row.what)?;
            let times = row.times.iter().flat_map(|times| [times.best, times.median, times.worst]);
            for value in times.chain([row.bound]) {
                write!(f, " {SEPARATOR} {:>9}", Tenths(value))?;
            }
            let verdict = row.verdict();
            writeln!(f, " {SEPARATOR}{}{verdict}", if verdict.is_empty() { "" } else { " " })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMITTED: &str = "\
# A comment.
image | 0123456789ab
phases | 1000 | 500
#                  |   best us | median us |  worst us |   best us | median us |  worst us |  bound us
CAN, quiet, one    |     100.0 |     150.5 |     180.0 |     101.0 |     151.5 |     190.0 |     200.0 |
CAN, quiet, first  |     100.0 |     150.5 |     170.0 |     101.0 |     251.5 |     290.0 |     200.0 | over at 100 M
CAN, own, last     |    1000.0 |    1500.0 |    5000.0 |    1000.0 |    1500.0 |    6000.0 |    4285.0 | over
";

    fn table() -> Table {
        Table::parse(COMMITTED).unwrap()
    }

    fn complaints(committed: &str, measured: &str) -> Vec<String> {
        assert!(COMMITTED.contains(committed));
        Table::parse(&COMMITTED.replace(committed, measured)).unwrap().complaints(&table(), "")
    }

    #[test]
    fn a_table_is_read_as_it_was_written() {
        assert_eq!((table().image.as_str(), table().phases), ("0123456789ab", [1000, 500]));
        assert_eq!(
            (table().rows[0].times[0].median, table().rows[2].times[1].worst),
            (150_500, 6_000_000)
        );
        let written = table().to_string();
        assert_eq!(Table::parse(&written).unwrap(), table());
        assert!(
            written.contains("| over at 100 M\n") && written.ends_with("| over\n"),
            "{written}"
        );
    }

    #[test]
    fn times_are_best_median_and_worst_rounded_up() {
        let took = [3_050, 1_000, 2_001, 9_999].map(|ns| Some(Duration::from_nanos(ns)));
        let times = Times::of(&took);
        assert_eq!((times.best, times.median, times.worst), (1_000, 2_100, 10_000));
        let none = Times::of(&[took[0], None]);
        assert_eq!((none.best, none.worst), (3_100, NEVER));
        let row = Row::new("x", [times, none], Duration::from_micros(10));
        let table = Table { image: String::new(), phases: [2, 2], rows: vec![row] };
        assert_eq!(Table::parse(&table.to_string()).unwrap(), table);
        assert_eq!(table.complaints(&table, ""), [""; 0]);
    }

    #[test]
    fn a_table_that_holds_raises_no_complaint() {
        assert_eq!(table().complaints(&table(), ""), [""; 0]);
        assert_eq!(complaints("180.0", "120.0"), [""; 0], "faster");
    }

    /// 5000 × 1.05 + 20 = 5270.
    #[test]
    fn slower_is_noticed_above_the_tolerance_at_each_speed() {
        assert_eq!(complaints("5000.0", "5270.0"), [""; 0]);
        let slower = "CAN, own, last, at 250000000 a second: 5270.1 us, the table has 5000.0 us";
        assert_eq!(complaints("5000.0", "5270.1"), [slower]);
        let slower = "CAN, own, last, at 100000000 a second: 6320.1 us, the table has 6000.0 us";
        assert_eq!(complaints("6000.0", "6320.1"), [slower]);
    }

    #[test]
    fn a_bound_that_was_kept_must_be_kept_at_each_speed() {
        assert_eq!(complaints("180.0", "200.0"), [""; 0]);
        let over = |speed: u64| {
            [format!("CAN, quiet, one, at {speed} a second: 200.1 us, and the bound is 200.0 us")]
        };
        let found = complaints(
            "180.0 |     101.0 |     151.5 |     190.0 |     200.0 |",
            "200.1 | 1.0 | 1.0 | 1.0 | 200.0 | over",
        );
        assert_eq!(found, over(250_000_000));
        let found = complaints("190.0 |     200.0 |", "200.1 |     200.0 | over at 100 M");
        assert_eq!(found, over(100_000_000));
    }

    #[test]
    fn rows_that_only_one_table_has_are_named() {
        let found = complaints("CAN, own", "RS485, own");
        assert_eq!(found, [not_committed("RS485, own, last"), not_measured("CAN, own, last")]);
        let quiet = Table { rows: table().rows[..2].to_vec(), ..table() };
        assert_eq!(quiet.complaints(&table(), "quiet"), [""; 0], "nothing else was asked for");
    }

    #[test]
    fn what_is_no_table_is_refused_with_its_line() {
        assert_eq!(Table::parse("image | x"), Err(Malformed { line: 0 }));
        assert_eq!(Table::parse("image | x\nphases | 1 | many"), Err(Malformed { line: 2 }));
        let row = |row: &str| Table::parse(&format!("image | x\nphases | 5 | 5\nCAN | {row}"));
        assert!(row("1.0 | 2.0 | 3.0 | 1.0 | 2.0 | 3.0 | 4.0 |").is_ok());
        for wrong in ["1.0 | 2.0 | 3.0 | 4.0 |", "1.00 | 2.0 | 3.0 | 1.0 | 2.0 | 3.0 | 4.0 |"] {
            assert_eq!(row(wrong), Err(Malformed { line: 3 }));
        }
        assert_eq!(
            row("1.0 | 2.0 | 5.0 | 1.0 | 2.0 | 3.0 | 4.0 |"),
            Err(Malformed { line: 3 }),
            "over, untold"
        );
    }
}
