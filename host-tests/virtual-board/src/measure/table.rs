//! The table of measurements as text, and the comparison with the committed one.

use std::fmt;

use crate::sections::{Malformed, SEPARATOR, lines, not_committed, not_measured};

/// By how much a value may grow before the table must be renewed: a twentieth.
const TOLERANCE: u64 = 20;
/// End the unit of a row that is shown and not compared: whether something else the firmware does
/// falls together with one of the repetitions is chance, and moves these values by half. A place
/// of the checkout with a longer name is enough: it moves the image's code.
const NOT_COMPARED: [&str; 2] = ["p99", "worst"];
/// Begins what is measured on such a bus.
pub(super) const IDLE_BUS: &str = "idle bus";
/// Ends the unit of a row that is worked out from a trace, when the table is renewed.
const OF_A_TRACE: &str = "last";
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

impl Row {
    /// A row.
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
    /// Fails with the first line that is none of a table.
    pub fn parse(text: &str) -> Result<Self, Malformed> {
        let mut compiler = None;
        let mut rows = Vec::new();
        for (line, columns) in lines(text) {
            match columns[..] {
                [COMPILER, name] => compiler = Some(name.to_owned()),
                [what, unit, _, ..] => {
                    let values: Result<Vec<u64>, _> =
                        columns[2..].iter().map(|value| value.parse()).collect();
                    rows.push(Row::new(what, unit, &values.map_err(|_| Malformed { line })?));
                }
                _ => return Err(Malformed { line }),
            }
        }
        let compiler = compiler.ok_or(Malformed { line: 0 })?;
        Ok(Self { compiler, rows })
    }

    /// What is wrong with a committed table, measured by this one. Nothing: it holds.
    pub fn complaints(&self, committed: &Self) -> Vec<String> {
        if self.compiler != committed.compiler {
            return vec![format!(
                "the table is of {}, the image of {}: renew the table",
                committed.compiler, self.compiler
            )];
        }
        let mut complaints = Vec::new();
        for row in &self.rows {
            match committed.rows.iter().find(|other| row.is_of(other)) {
                Some(other) => complaints.extend(growth(row, other)),
                None => complaints.push(not_committed(&row.name())),
            }
        }
        let gone = committed.rows.iter().filter(|row| {
            !row.unit.ends_with(OF_A_TRACE) && !self.rows.iter().any(|other| row.is_of(other))
        });
        complaints.extend(gone.map(|row| not_measured(&row.name())));
        complaints
    }
}

fn growth(row: &Row, committed: &Row) -> impl Iterator<Item = String> {
    let compared = !NOT_COMPARED.iter().any(|end| row.unit.ends_with(end));
    let pairs = row.values.iter().zip(&committed.values).filter(move |_| compared);
    let grown =
        pairs.filter(|(measured, committed)| *measured * TOLERANCE > *committed * (TOLERANCE + 1));
    grown.map(|(measured, committed)| {
        format!("{}: grown by more than 5 %, from {committed} to {measured}", row.name())
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

    fn complaints(planted: &str, with: &str) -> Vec<String> {
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
        assert_eq!(measured().complaints(&measured()), [""; 0]);
    }

    /// 1000 was measured: 953 × 1.05 = 1000.65 holds, 952 × 1.05 = 999.6 does not.
    #[test]
    fn growth_is_noticed_above_a_twentieth() {
        assert_eq!(complaints("1000 |       1000", "1000 | 953"), [""; 0]);
        let grown = "stop in, instructions, median: grown by more than 5 %, from 952 to 1000";
        assert_eq!(complaints("1000 |       1000", "1000 | 952"), [grown]);
        assert_eq!(complaints("100000", "90000").len(), 1, "every row counts");
    }

    #[test]
    fn the_tail_of_several_is_not_compared() {
        for unit in ["ns, p99", "ns, worst"] {
            let tail = |value| Table {
                compiler: String::new(),
                rows: vec![Row::new("stop in", unit, &[value])],
            };
            assert_eq!(tail(1000).complaints(&tail(500)), [""; 0]);
        }
    }

    #[test]
    fn less_is_no_growth() {
        assert_eq!(complaints("1000 |       1000", "5000 | 5000"), [""; 0]);
    }

    #[test]
    fn another_compiler_asks_for_a_new_table_and_for_nothing_else() {
        let found = complaints("1.95.0 (59807616e 2026-04-14)\n\nstop in", "1.94.0\nstop now");
        assert_eq!(
            found,
            ["the table is of rustc version 1.94.0, the image of rustc version 1.95.0 \
              (59807616e 2026-04-14): renew the table"]
        );
    }

    #[test]
    fn rows_that_only_one_table_has_are_named() {
        let found = complaints("flash", "fridge");
        assert_eq!(
            found,
            [not_committed("image, flash, bytes"), not_measured("image, fridge, bytes")]
        );
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
