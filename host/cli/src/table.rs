//! Tables: columns as wide as their widest cell, two spaces between, numbers to the right.

/// Between two columns.
const GAP: &str = "  ";

/// Where the text of a column stands in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    Left,
    Right,
}

/// Rows of text under headings.
pub struct Table {
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these headings. A heading that begins with `>` belongs to a column of numbers.
    pub fn new(headings: &[&str]) -> Self {
        let column = |heading: &&str| match heading.strip_prefix('>') {
            Some(text) => (text.to_owned(), Align::Right),
            None => ((*heading).to_owned(), Align::Left),
        };
        Self { columns: headings.iter().map(column).collect(), rows: Vec::new() }
    }

    /// Adds a row; a cell for each heading.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// The lines, headings first.
    pub fn lines(&self) -> Vec<String> {
        self.lines_in(&mut Vec::new())
    }

    /// The lines in columns at least as wide as `widths`, which grow to what was needed: tables of
    /// the same columns that follow each other then line up.
    pub fn lines_in(&self, widths: &mut Vec<usize>) -> Vec<String> {
        let headings: Vec<String> =
            self.columns.iter().map(|(heading, _)| heading.clone()).collect();
        let all = || std::iter::once(&headings).chain(&self.rows);
        widths.resize(self.columns.len(), 0);
        for (index, width) in widths.iter_mut().enumerate() {
            let cells = all().filter_map(|row| row.get(index)).map(|cell| cell.chars().count());
            *width = cells.max().unwrap_or(0).max(*width);
        }
        all().map(|row| self.line(row, widths)).collect()
    }

    fn line(&self, row: &[String], widths: &[usize]) -> String {
        let mut line = String::new();
        for ((cell, (_, align)), width) in row.iter().zip(&self.columns).zip(widths) {
            if !line.is_empty() {
                line.push_str(GAP);
            }
            match align {
                Align::Left => line.push_str(&format!("{cell:<width$}")),
                Align::Right => line.push_str(&format!("{cell:>width$}")),
            }
        }
        line.trim_end().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_and_numbers_stand_right() {
        let mut table = Table::new(&["axis", ">motor °C", "state"]);
        table.row(["0".into(), "31".into(), "idle".into()]);
        table.row(["12".into(), "-".into(), "armed".into()]);
        let mut widths = vec![6];
        assert_eq!(table.lines_in(&mut widths)[1], "0             31  idle");
        assert_eq!(widths, [6, 8, 5]);
        assert_eq!(
            table.lines(),
            ["axis  motor °C  state", "0           31  idle", "12           -  armed"]
        );
    }
}
