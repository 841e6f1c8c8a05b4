//! The table of cycle rates as text, and the comparison with the committed one.

use std::fmt;

use crate::sections::{COMMENT, Malformed, SEPARATOR, lines, not_committed, not_measured};

/// By how much a rate may fall, and what a cycle costs, or a gap, may grow: a fiftieth, and a
/// twentieth.
const RATE_TOLERANCE: u64 = 50;
const COST_TOLERANCE: u64 = 20;
/// And by how much the gap of 99 in 100 may grow: tenths of a bit, where that is more: where the
/// core is full, one line run alone has 4 bits more than among the others.
const GAP_TOLERANCE: u64 = 100;
/// How many columns every line has.
const COLUMNS: usize = 13;
/// The places of what is compared.
const RATE: usize = 1;
const COST: usize = 11;
/// The heads of the columns.
const HEADS: [&str; COLUMNS] = [
    "period us",
    "0.1 Hz",
    "limit o/oo",
    "bits/10",
    "busy o/oo",
    "told o/oo",
    "bus o/oo",
    "motor",
    "host",
    "gateway",
    "late us",
    "instr.",
    "load o/oo",
];

const GAP_HEADS: [&str; 3] = ["gap p50", "gap p99", "gap max"];
/// In the place of gaps.
const NONE: &str = "-";

/// A free-running cycle at one speed of the core.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// Axes, motors and period.
    pub what: String,
    /// Million instructions a second.
    pub speed: u64,
    /// The columns.
    pub values: [u64; COLUMNS],
    /// Where a request was always due: tenths of bits that the bus was free ahead of one beyond
    /// what must be, median, the 99th of 100 and the greatest.
    pub gaps: Option<[u64; GAP_HEADS.len()]>,
}

/// What was measured of one image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// The lines.
    pub rows: Vec<Row>,
    /// What is said of stages: read by people only.
    pub stages: Vec<String>,
}

impl Row {
    fn name(&self) -> String {
        format!("{} at {} M", self.what, self.speed)
    }

    fn is_of(&self, other: &Self) -> bool {
        (&self.what, self.speed) == (&other.what, other.speed)
    }

    fn complaints(&self, committed: &Self) -> Vec<String> {
        let (rate, cost) = (self.values[RATE], self.values[COST]);
        let (rate_before, cost_before) = (committed.values[RATE], committed.values[COST]);
        let mut complaints = Vec::new();
        if rate * RATE_TOLERANCE < rate_before * (RATE_TOLERANCE - 1) {
            complaints.push(format!(
                "{}: the rate fell by more than 2 %, from {rate_before} to {rate}",
                self.name()
            ));
        }
        if cost * COST_TOLERANCE > cost_before * (COST_TOLERANCE + 1) {
            complaints.push(format!(
                "{}: instructions grew by more than 5 %, from {cost_before} to {cost}",
                self.name()
            ));
        }
        if let (Some([_, gap, _]), Some([_, before, _])) = (self.gaps, committed.gaps)
            && gap > before + (before / COST_TOLERANCE).max(GAP_TOLERANCE)
        {
            complaints.push(format!(
                "{}: the gap grew by more than 5 % and 10 bits, from {before} to {gap} tenths",
                self.name()
            ));
        }
        complaints
    }
}

impl Table {
    /// Reads what [`Display`](fmt::Display) has written, comments and empty lines in between.
    /// Fails with the first line that is none of a table.
    pub fn parse(text: &str) -> Result<Self, Malformed> {
        let row = |(line, columns): (usize, Vec<&str>)| {
            let [what, speed, ref values @ ..] = columns[..] else {
                return Err(Malformed { line });
            };
            let number = |text: &&str| text.parse().map_err(|_| Malformed { line });
            let numbers =
                |texts: &[&str]| texts.iter().map(number).collect::<Result<Vec<u64>, _>>();
            let (values, gaps) = values.split_at_checked(COLUMNS).ok_or(Malformed { line })?;
            let values = numbers(values)?.try_into().map_err(|_| Malformed { line })?;
            let gaps = match gaps {
                [NONE, NONE, NONE] => None,
                gaps => Some(numbers(gaps)?.try_into().map_err(|_| Malformed { line })?),
            };
            Ok(Row { what: what.to_owned(), speed: number(&speed)?, values, gaps })
        };
        let rows = lines(text).map(row).collect::<Result<_, _>>()?;
        Ok(Self { rows, stages: Vec::new() })
    }

    /// What is wrong with a committed table, measured by this one, as far as it was measured: the
    /// lines whose names contain `filter`.
    pub fn complaints(&self, committed: &Self, filter: &str) -> Vec<String> {
        let mut complaints = Vec::new();
        for row in &self.rows {
            match committed.rows.iter().find(|other| row.is_of(other)) {
                Some(other) => complaints.extend(row.complaints(other)),
                None => complaints.push(not_committed(&row.name())),
            }
        }
        let gone = committed.rows.iter().filter(|row| {
            row.what.contains(filter) && !self.rows.iter().any(|other| row.is_of(other))
        });
        complaints.extend(gone.map(|row| not_measured(&row.name())));
        complaints
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.rows.iter().map(|row| row.what.len()).max().unwrap_or_default();
        write!(f, "{:width$} {SEPARATOR} speed", format!("{COMMENT} axes x buses, delay"))?;
        let heads = HEADS.iter().chain(&GAP_HEADS);
        heads.into_iter().try_for_each(|head| write!(f, " {SEPARATOR} {head:>9}"))?;
        writeln!(f)?;
        for Row { what, speed, values, gaps } in &self.rows {
            write!(f, "{what:width$} {SEPARATOR} {speed:>5}")?;
            values.iter().try_for_each(|value| write!(f, " {SEPARATOR} {value:>9}"))?;
            match gaps {
                Some(gaps) => {
                    gaps.iter().try_for_each(|gap| write!(f, " {SEPARATOR} {gap:>9}"))?;
                }
                None => GAP_HEADS.iter().try_for_each(|_| write!(f, " {SEPARATOR} {NONE:>9}"))?,
            }
            writeln!(f)?;
        }
        self.stages.iter().try_for_each(|stages| writeln!(f, "{COMMENT} {stages}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rate: u64, cost: u64) -> Table {
        let mut values = [7; COLUMNS];
        (values[RATE], values[COST]) = (rate, cost);
        Table {
            rows: vec![Row { what: "4 x 2, 0 us".to_owned(), speed: 250, values, gaps: None }],
            stages: Vec::new(),
        }
    }

    #[test]
    fn a_table_is_read_as_it_was_written() {
        let written = table(10_000, 5_000);
        assert_eq!(Table::parse(&format!("# A comment.\n{written}")), Ok(written));
        assert_eq!(Table::parse("4 x 2 | 250 | 1"), Err(Malformed { line: 1 }));
        let mut written = table(10_000, 5_000);
        written.rows[0].gaps = Some([0, 10, 20]);
        assert_eq!(Table::parse(&written.to_string()), Ok(written.clone()));
        let short = written.to_string().replace("|        20", "");
        assert_eq!(Table::parse(&short), Err(Malformed { line: 2 }));
    }

    #[test]
    fn a_gap_that_grows_by_more_than_5_percent_and_10_bits_is_told() {
        let with_gap = |gap| {
            let mut table = table(10_000, 5_000);
            table.rows[0].gaps = Some([0, gap, 2 * gap]);
            table
        };
        let complaints = |gap, before| with_gap(gap).complaints(&with_gap(before), "").len();
        assert_eq!(complaints(100, 0), 0);
        assert_eq!(complaints(101, 0), 1);
        assert_eq!(complaints(3_150, 3_000), 0);
        assert_eq!(complaints(3_151, 3_000), 1);
        assert_eq!(complaints(0, 600), 0);
    }

    #[test]
    fn a_rate_that_falls_and_a_cost_that_grows_are_told() {
        let committed = table(10_000, 5_000);
        let complaints = |rate, cost| table(rate, cost).complaints(&committed, "").len();
        assert_eq!(complaints(9_800, 5_250), 0);
        assert_eq!(complaints(9_799, 5_250), 1);
        assert_eq!(complaints(9_800, 5_251), 1);
        assert_eq!(complaints(20_000, 100), 0);
    }

    #[test]
    fn lines_that_only_one_table_has_are_named() {
        let (none, one) = (Table { rows: Vec::new(), stages: Vec::new() }, table(1, 1));
        assert_eq!(one.complaints(&none, ""), [not_committed("4 x 2, 0 us at 250 M")]);
        assert_eq!(none.complaints(&one, "4 x"), [not_measured("4 x 2, 0 us at 250 M")]);
        assert_eq!(none.complaints(&one, "1 x"), [""; 0]);
    }
}
