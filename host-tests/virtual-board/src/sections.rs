//! A committed table of several boards: what its lines mean, then a section for each board, which
//! begins with its name.

use std::error::Error;
use std::fmt::Display;
use std::process::ExitCode;
use std::{fmt, fs};

use crate::board::Board;

/// Between the columns.
pub(crate) const SEPARATOR: char = '|';
/// Begins a line that says something to people.
pub(crate) const COMMENT: char = '#';

/// A line that is not of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Malformed {
    /// Its number, from 1; 0 for a text that does not say what was measured.
    pub line: usize,
}

impl Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "no line says what was measured"),
            line => write!(f, "line {line} is none of a table"),
        }
    }
}

impl Error for Malformed {}

/// The lines of a table with their numbers, in columns, without comments.
pub(crate) fn lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let lines = (1..).zip(text.lines());
    lines
        .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with(COMMENT))
        .map(|(number, line)| (number, line.split(SEPARATOR).map(str::trim).collect()))
}

/// What to say of a row that the committed table lacks.
pub(crate) fn not_committed(row: &str) -> String {
    format!("{row}: the table has no such row: renew it")
}

/// What to say of a row that only the committed table has.
pub(crate) fn not_measured(row: &str) -> String {
    format!("{row}: is in the table, but is measured no more: renew it")
}

/// Prints what was measured and how it compares with the chosen board's section of a committed
/// file, or writes that section anew. Whether it holds.
/// Fails when the file cannot be read or written, or holds no such table.
pub fn settle(
    path: &str,
    renew: bool,
    measured: &dyn Display,
    complaints: impl FnOnce(&str) -> Result<Vec<String>, Malformed>,
) -> Result<bool, Box<dyn Error>> {
    print!("{measured}");
    let board = Board::chosen();
    let text = fs::read_to_string(path).map_err(|error| format!("{path}: {error}"))?;
    if renew {
        fs::write(path, renewed(&text, board, &measured.to_string()))
            .map_err(|error| format!("{path}: {error}"))?;
        println!("renewed {path}");
        return Ok(true);
    }
    let section =
        section(&text, board).ok_or_else(|| format!("{path}: nothing of {}", board.name()))?;
    let complaints = complaints(section).map_err(|error| format!("{path}: {error}"))?;
    for complaint in &complaints {
        eprintln!("{complaint}");
    }
    if complaints.is_empty() {
        println!("{path} holds");
    }
    Ok(complaints.is_empty())
}

/// How a comparison ends its program.
pub fn exit_code(holds: Result<bool, Box<dyn Error>>) -> ExitCode {
    let holds = holds.unwrap_or_else(|error| {
        eprintln!("{error}");
        false
    });
    if holds { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// The section of a board, without its name.
fn section(text: &str, board: Board) -> Option<&str> {
    let (_, rest) = text.split_once(&begin(board))?;
    Some(rest.split("\nboard | ").next().expect("at least one part"))
}

/// The text with another section of a board. Sections keep the order of the boards.
fn renewed(text: &str, board: Board, table: &str) -> String {
    let section = |of: Board| {
        let table = if of == board { Some(table) } else { section(text, of) };
        table.map(|table| format!("{}{}\n", begin(of), table.trim_end()))
    };
    let sections: Vec<String> = Board::ALL.into_iter().filter_map(section).collect();
    let legend = text.split("\nboard | ").next().expect("at least one part");
    format!("{legend}{}", sections.concat())
}

/// The line that a section begins with, and the end of the line before it.
fn begin(board: Board) -> String {
    format!("\nboard | {}\n", board.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEGEND: &str = "# What it means\n";
    const H743: Board = Board::NucleoH743zi;
    const G474: Board = Board::NucleoG474re;

    #[test]
    fn a_section_is_found_among_others_and_replaced_alone() {
        let one = renewed(LEGEND, G474, "b | 1\n");
        assert_eq!(one, "# What it means\n\nboard | nucleo-g474re\nb | 1\n");
        let both = renewed(&one, H743, "a | 1\na | 2\n");
        assert_eq!(section(&both, H743), Some("a | 1\na | 2\n"));
        assert_eq!(section(&both, G474), Some("b | 1\n"));
        let changed = renewed(&both, H743, "a | 3\n");
        assert_eq!(
            changed,
            "# What it means\n\nboard | nucleo-h743zi\na | 3\n\nboard | nucleo-g474re\nb | 1\n"
        );
    }

    #[test]
    fn a_board_without_a_section_has_none() {
        assert_eq!(section("# What it means\n\nboard | nucleo-h743zi\na | 1\n", G474), None);
    }
}
