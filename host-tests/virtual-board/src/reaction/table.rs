//! The table of reaction times as text, and the comparison with the committed one.

use std::fmt;
use std::time::Duration;

/// By how much the worst may be worse than the committed worst: a twentieth, and 20 µs. The committed table has looked at more
/// phases, so what is beyond that is the software's.
const TOLERANCE: u64 = 20;
const TOLERANCE_NS: u64 = 20_000;
/// Between the columns.
const SEPARATOR: char = '|';
/// Begins a line that says something to people.
const COMMENT: char = '#';
/// The first words of the lines with the build and the number of phases.
const IMAGE: &str = "image";
const PHASES: &str = "phases";
/// Ends a row that breaks its bound.
const OVER: &str = "over";
/// The table is in tenths of a microsecond.
const TENTH_NS: u64 = 100;
/// No stop came in all the time that it was waited for.
const NEVER: u64 = u64::MAX;
const NEVER_TEXT: &str = "never";

/// The reaction times of one command in one situation, ns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// The situation, and which stop.
    pub what: String,
    /// Of all phases.
    pub best: u64,
    /// The lower median.
    pub median: u64,
    /// Of all phases.
    pub worst: u64,
    /// What it may be.
    pub bound: u64,
}

/// What was measured of one image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// The build, as the firmware names it.
    pub image: String,
    /// How many phases were looked at.
    pub phases: u32,
    /// The reaction times.
    pub rows: Vec<Row>,
}

/// Why the committed table does not fit what was measured.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Complaint {
    /// The worst is worse than the committed worst by more than the tolerance.
    Slower {
        /// What was measured.
        measured: Row,
        /// The committed worst, ns.
        committed: u64,
    },
    /// The worst is beyond its bound, and the committed one is not.
    OverBound(Row),
    /// The committed table has no such row.
    NotCommitted(String),
    /// A row of the committed table is measured no more.
    NotMeasured(String),
}

/// A line that is not of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Malformed {
    /// Its number, from 1; 0 for a text without image or phases.
    pub line: usize,
}

impl Row {
    /// Of the times of all phases, rounded up to tenths of a microsecond, as the table has them; `None`: no stop came.
    ///
    /// # Panics
    ///
    /// Without any.
    #[must_use]
    pub fn new(what: &str, took: &[Option<Duration>], bound: Duration) -> Self {
        let ns = |span: Duration| u64::try_from(span.as_nanos()).expect("short").next_multiple_of(TENTH_NS);
        let mut took: Vec<u64> = took.iter().map(|took| took.map_or(NEVER, ns)).collect();
        took.sort_unstable();
        let last = took.len().checked_sub(1).expect("a phase");
        Self {
            what: what.to_owned(),
            best: took[0],
            median: took[last / 2],
            worst: took[last],
            bound: ns(bound),
        }
    }

    fn parse(what: &str, columns: &[&str]) -> Option<Self> {
        let values: Option<Vec<u64>> = columns.iter().map(|column| tenths(column)).collect();
        let [best, median, worst, bound] = values?[..] else { return None };
        Some(Self { what: what.to_owned(), best, median, worst, bound })
    }

    fn is_over(&self) -> bool {
        self.worst > self.bound
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
    ///
    /// # Errors
    ///
    /// The first line that is none of a table.
    pub fn parse(text: &str) -> Result<Self, Malformed> {
        let (mut image, mut phases, mut rows) = (None, None, Vec::new());
        for (line, content) in (1..).zip(text.lines()) {
            if content.trim().is_empty() || content.starts_with(COMMENT) {
                continue;
            }
            let malformed = Malformed { line };
            let columns: Vec<&str> = content.split(SEPARATOR).map(str::trim).collect();
            match columns[..] {
                [IMAGE, build] => image = Some(build.to_owned()),
                [PHASES, count] => phases = Some(count.parse().map_err(|_| malformed)?),
                [what, ref columns @ .., "" | OVER] => rows.push(Row::parse(what, columns).ok_or(malformed)?),
                _ => return Err(malformed),
            }
        }
        match (image, phases) {
            (Some(image), Some(phases)) => Ok(Self { image, phases, rows }),
            _ => Err(Malformed { line: 0 }),
        }
    }

    /// What is wrong with a committed table, measured by this one. Nothing: it holds.
    #[must_use]
    pub fn complaints(&self, committed: &Self) -> Vec<Complaint> {
        let mut complaints = Vec::new();
        for row in &self.rows {
            match committed.rows.iter().find(|other| other.what == row.what) {
                None => complaints.push(Complaint::NotCommitted(row.what.clone())),
                Some(other) if row.is_over() && !other.is_over() => {
                    complaints.push(Complaint::OverBound(row.clone()));
                }
                Some(other) if row.worst > tolerated(other.worst) => {
                    complaints.push(Complaint::Slower { measured: row.clone(), committed: other.worst });
                }
                Some(_) => {}
            }
        }
        let gone = committed.rows.iter().filter(|row| !self.rows.iter().any(|other| other.what == row.what));
        complaints.extend(gone.map(|row| Complaint::NotMeasured(row.what.clone())));
        complaints
    }
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
        writeln!(f, "{PHASES} {SEPARATOR} {}", self.phases)?;
        let width = self.rows.iter().map(|row| row.what.chars().count()).max().unwrap_or_default();
        let head = ["best us", "median us", "worst us", "bound us"]
            .map(|column| format!(" {SEPARATOR} {column:>9}"));
        writeln!(f, "{COMMENT}{:1$}{2}", "", width.saturating_sub(1), head.concat())?;
        for row in &self.rows {
            write!(f, "{:width$}", row.what)?;
            for value in [row.best, row.median, row.worst, row.bound] {
                write!(f, " {SEPARATOR} {:>9}", Tenths(value))?;
            }
            writeln!(f, " {SEPARATOR}{}", if row.is_over() { " over" } else { "" })?;
        }
        Ok(())
    }
}

impl fmt::Display for Complaint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slower { measured: Row { what, worst, .. }, committed } => {
                write!(f, "{what}: {} us, the table has {} us", Tenths(*worst), Tenths(*committed))
            }
            Self::OverBound(Row { what, worst, bound, .. }) => {
                write!(f, "{what}: {} us, and the bound is {} us", Tenths(*worst), Tenths(*bound))
            }
            Self::NotCommitted(row) => write!(f, "{row}: the table has no such row: renew it"),
            Self::NotMeasured(row) => write!(f, "{row}: is in the table, but is measured no more: renew it"),
        }
    }
}

impl fmt::Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "no line names the image, or how many phases were looked at"),
            line => write!(f, "line {line} is none of a table"),
        }
    }
}

impl std::error::Error for Malformed {}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMITTED: &str = "\
# A comment.
image | 0123456789ab
phases | 1000
#                  |   best us | median us |  worst us |  bound us
CAN, quiet, one    |     100.0 |     150.5 |     180.0 |     200.0 |
CAN, own, last     |    1000.0 |    1500.0 |    5000.0 |    4285.0 | over
";

    fn table() -> Table {
        Table::parse(COMMITTED).unwrap()
    }

    fn complaints(committed: &str, measured: &str) -> Vec<Complaint> {
        assert!(COMMITTED.contains(committed));
        Table::parse(&COMMITTED.replace(committed, measured)).unwrap().complaints(&table())
    }

    #[test]
    fn a_table_is_read_as_it_was_written() {
        assert_eq!((table().image.as_str(), table().phases), ("0123456789ab", 1000));
        assert_eq!((table().rows[0].median, table().rows[1].worst), (150_500, 5_000_000));
        let written = table().to_string();
        assert_eq!(Table::parse(&written).unwrap(), table());
        assert!(written.ends_with("| over\n"), "{written}");
    }

    #[test]
    fn a_row_has_best_median_and_worst_rounded_up() {
        let took = [3_050, 1_000, 2_001, 9_999].map(|ns| Some(Duration::from_nanos(ns)));
        let row = Row::new("x", &took, Duration::from_micros(5));
        assert_eq!((row.best, row.median, row.worst, row.bound), (1_000, 2_100, 10_000, 5_000));
        let none = Row::new("x", &[took[0], None], Duration::from_micros(5));
        assert_eq!((none.best, none.worst), (3_100, NEVER));
        let table = Table { image: String::new(), phases: 2, rows: vec![none] };
        assert_eq!(Table::parse(&table.to_string()).unwrap(), table);
        assert_eq!(table.complaints(&table), []);
    }

    #[test]
    fn a_table_that_holds_raises_no_complaint() {
        assert_eq!(table().complaints(&table()), []);
        assert_eq!(complaints("180.0", "120.0"), [], "faster");
    }

    /// 5000 × 1.05 + 20 = 5270.
    #[test]
    fn slower_is_noticed_above_the_tolerance() {
        assert_eq!(complaints("5000.0", "5270.0"), []);
        let found = complaints("5000.0", "5270.1");
        assert!(matches!(&found[..], [Complaint::Slower { committed: 5_000_000, .. }]), "{found:?}");
    }

    #[test]
    fn a_bound_that_was_kept_must_be_kept() {
        assert_eq!(complaints("180.0", "200.0"), []);
        let found = complaints("180.0", "200.1");
        assert!(matches!(&found[..], [Complaint::OverBound(row)] if row.worst == 200_100), "{found:?}");
    }

    #[test]
    fn rows_that_only_one_table_has_are_named() {
        let found = complaints("CAN, own", "RS485, own");
        let (can, rs485) = ("CAN, own, last".to_owned(), "RS485, own, last".to_owned());
        assert_eq!(found, [Complaint::NotCommitted(rs485), Complaint::NotMeasured(can)]);
    }

    #[test]
    fn what_is_no_table_is_refused_with_its_line() {
        assert_eq!(Table::parse("image | x"), Err(Malformed { line: 0 }));
        assert_eq!(Table::parse("image | x\nphases | many"), Err(Malformed { line: 2 }));
        assert_eq!(
            Table::parse("image | x\nphases | 5\nCAN | 1.0 | 2.0 | 3.0 |"),
            Err(Malformed { line: 3 })
        );
        assert_eq!(
            Table::parse("image | x\nphases | 5\nCAN | 1.00 | 2.0 | 3.0 | 4.0 |"),
            Err(Malformed { line: 3 })
        );
    }
}
