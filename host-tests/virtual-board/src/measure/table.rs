//! The table of measurements as text, and the comparison with the committed one.

use std::fmt;

/// By how much a value may grow before the table must be renewed: a twentieth.
const TOLERANCE: u64 = 20;
/// Ends the unit of a row that is shown and not compared: whether something else the firmware does
/// falls together with one of the repetitions is chance, and moves the greatest value by half.
const NOT_COMPARED: &str = "worst";
/// Ends the unit of a row that is worked out from a trace, when the table is renewed.
const OF_A_TRACE: &str = "last";
/// Between the columns.
const SEPARATOR: char = '|';
/// Begins a line that says something to people.
const COMMENT: char = '#';
/// The first word of the line with the compiler.
const COMPILER: &str = "compiler";

/// One line: something that was measured, in one unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// What was measured.
    pub what: String,
    /// Its unit, and which of several values it is.
    pub unit: String,
    /// One value for each speed of the core, or a single one that does not depend on it.
    pub values: Vec<u64>,
}

/// What was measured of one image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// The compiler that built the image.
    pub compiler: String,
    /// The measurements.
    pub rows: Vec<Row>,
}

/// Why the committed table does not fit what was measured.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Complaint {
    /// Another compiler built the image.
    Compiler {
        /// The one of the committed table.
        committed: String,
        /// The one of the image.
        measured: String,
    },
    /// A value has grown by more than the tolerance.
    Grown {
        /// What, and its unit.
        row: String,
        /// The committed value.
        committed: u64,
        /// The measured value.
        measured: u64,
    },
    /// The committed table has no such row, or one with fewer or more values.
    NotCommitted(String),
    /// A row of the committed table is measured no more.
    NotMeasured(String),
}

/// A line that is not of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Malformed {
    /// Its number, from 1; 0 for a text without the compiler.
    pub line: usize,
}

impl Row {
    /// A row.
    #[must_use]
    pub fn new(what: &str, unit: &str, values: &[u64]) -> Self {
        Self { what: what.to_owned(), unit: unit.to_owned(), values: values.to_vec() }
    }

    fn name(&self) -> String {
        format!("{}, {}", self.what, self.unit)
    }

    fn is_of(&self, other: &Self) -> bool {
        (&self.what, &self.unit, self.values.len())
            == (&other.what, &other.unit, other.values.len())
    }
}

impl Table {
    /// Reads what [`Display`](fmt::Display) has written, comments and empty lines in between.
    ///
    /// # Errors
    ///
    /// The first line that is none of a table.
    pub fn parse(text: &str) -> Result<Self, Malformed> {
        let mut compiler = None;
        let mut rows = Vec::new();
        for (line, content) in (1..).zip(text.lines()) {
            if content.trim().is_empty() || content.starts_with(COMMENT) {
                continue;
            }
            let mut columns = content.split(SEPARATOR).map(str::trim);
            let (Some(what), Some(second)) = (columns.next(), columns.next()) else {
                return Err(Malformed { line });
            };
            if what == COMPILER {
                compiler = Some(second.to_owned());
                continue;
            }
            let values: Result<Vec<u64>, _> = columns.map(str::parse).collect();
            match values {
                Ok(values) if !values.is_empty() => rows.push(Row::new(what, second, &values)),
                _ => return Err(Malformed { line }),
            }
        }
        let compiler = compiler.ok_or(Malformed { line: 0 })?;
        Ok(Self { compiler, rows })
    }

    /// What is wrong with a committed table, measured by this one. Nothing: it holds.
    #[must_use]
    pub fn complaints(&self, committed: &Self) -> Vec<Complaint> {
        if self.compiler != committed.compiler {
            let (committed, measured) = (committed.compiler.clone(), self.compiler.clone());
            return vec![Complaint::Compiler { committed, measured }];
        }
        let mut complaints = Vec::new();
        for row in &self.rows {
            match committed.rows.iter().find(|other| row.is_of(other)) {
                Some(other) => complaints.extend(growth(row, other)),
                None => complaints.push(Complaint::NotCommitted(row.name())),
            }
        }
        let gone = committed.rows.iter().filter(|row| {
            !row.unit.ends_with(OF_A_TRACE) && !self.rows.iter().any(|other| row.is_of(other))
        });
        complaints.extend(gone.map(|row| Complaint::NotMeasured(row.name())));
        complaints
    }
}

fn growth(row: &Row, committed: &Row) -> impl Iterator<Item = Complaint> {
    let compared = !row.unit.ends_with(NOT_COMPARED);
    let pairs = row.values.iter().zip(&committed.values).filter(move |_| compared);
    let grown =
        pairs.filter(|(measured, committed)| *measured * TOLERANCE > *committed * (TOLERANCE + 1));
    grown.map(|(measured, committed)| Complaint::Grown {
        row: row.name(),
        committed: *committed,
        measured: *measured,
    })
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{COMPILER} {SEPARATOR} {}", self.compiler)?;
        let width = |column: fn(&Row) -> &str| {
            self.rows.iter().map(|row| column(row).chars().count()).max().unwrap_or_default()
        };
        let (what_width, unit_width) = (width(|row| &row.what), width(|row| &row.unit));
        for Row { what, unit, values } in &self.rows {
            write!(f, "{what:what_width$} {SEPARATOR} {unit:unit_width$}")?;
            for value in values {
                write!(f, " {SEPARATOR} {value:>10}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

impl fmt::Display for Complaint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Compiler { committed, measured } => {
                write!(f, "the table is of {committed}, the image of {measured}: renew the table")
            }
            Self::Grown { row, committed, measured } => {
                write!(f, "{row}: grown by more than 5 %, from {committed} to {measured}")
            }
            Self::NotCommitted(row) => write!(f, "{row}: the table has no such row: renew it"),
            Self::NotMeasured(row) => {
                write!(f, "{row}: is in the table, but is measured no more: renew it")
            }
        }
    }
}

impl fmt::Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "no line names the compiler"),
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
compiler | rustc version 1.95.0 (59807616e 2026-04-14)

stop in | instructions, median |       1000 |       1000
image   | flash, bytes         |     100000
";

    fn measured() -> Table {
        Table::parse(COMMITTED).unwrap()
    }

    fn complaints(planted: &str, with: &str) -> Vec<Complaint> {
        assert!(COMMITTED.contains(planted));
        measured().complaints(&Table::parse(&COMMITTED.replace(planted, with)).unwrap())
    }

    #[test]
    fn a_table_is_read_as_it_was_written() {
        let table = measured();
        assert_eq!(table.compiler, "rustc version 1.95.0 (59807616e 2026-04-14)");
        assert_eq!(table.rows[0], Row::new("stop in", "instructions, median", &[1000, 1000]));
        assert_eq!(table.rows[1], Row::new("image", "flash, bytes", &[100_000]));
        assert_eq!(COMMITTED, format!("# A comment.\n{table}").replacen(")\n", ")\n\n", 1));
    }

    #[test]
    fn a_table_that_holds_raises_no_complaint() {
        assert_eq!(measured().complaints(&measured()), []);
    }

    /// 1000 was measured: 953 × 1.05 = 1000.65 holds, 952 × 1.05 = 999.6 does not.
    #[test]
    fn growth_is_noticed_above_a_twentieth() {
        assert_eq!(complaints("1000 |       1000", "1000 | 953"), []);
        let row = "stop in, instructions, median".to_owned();
        let grown = Complaint::Grown { row, committed: 952, measured: 1000 };
        assert_eq!(complaints("1000 |       1000", "1000 | 952"), [grown]);
        assert_eq!(complaints("100000", "90000").len(), 1, "every row counts");
    }

    #[test]
    fn the_worst_of_several_is_not_compared() {
        let worst = |value| Table {
            compiler: String::new(),
            rows: vec![Row::new("stop in", "ns, worst", &[value])],
        };
        assert_eq!(worst(1000).complaints(&worst(500)), []);
    }

    #[test]
    fn less_is_no_growth() {
        assert_eq!(complaints("1000 |       1000", "5000 | 5000"), []);
    }

    #[test]
    fn another_compiler_asks_for_a_new_table_and_for_nothing_else() {
        let found = complaints("1.95.0 (59807616e 2026-04-14)\n\nstop in", "1.94.0\nstop now");
        let [Complaint::Compiler { committed, measured }] = &found[..] else { panic!("{found:?}") };
        assert_eq!(committed, "rustc version 1.94.0");
        assert_eq!(measured, "rustc version 1.95.0 (59807616e 2026-04-14)");
    }

    #[test]
    fn rows_that_only_one_table_has_are_named() {
        let found = complaints("flash", "fridge");
        let (flash, fridge) = ("image, flash, bytes".to_owned(), "image, fridge, bytes".to_owned());
        assert_eq!(found, [Complaint::NotCommitted(flash), Complaint::NotMeasured(fridge)]);
        assert_eq!(
            complaints("1000 |       1000", "1000").len(),
            2,
            "a row with one value is another row"
        );
    }

    #[test]
    fn what_is_no_table_is_refused_with_its_line() {
        assert_eq!(Table::parse("compiler | x\nstop in"), Err(Malformed { line: 2 }));
        assert_eq!(Table::parse("compiler | x\nstop in | us | many"), Err(Malformed { line: 2 }));
        assert_eq!(Table::parse("compiler | x\nstop in | us"), Err(Malformed { line: 2 }));
        assert_eq!(Table::parse("stop in | us | 1"), Err(Malformed { line: 0 }));
    }
}
