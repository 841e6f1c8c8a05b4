//! A committed table of several boards: what its lines mean, then a section for each board, which
//! begins with its name.

use crate::board::Board;

/// The section of a board, without its name.
#[must_use]
pub fn section(text: &str, board: Board) -> Option<&str> {
    let (_, rest) = text.split_once(&begin(board))?;
    Some(rest.split("\nboard | ").next().expect("at least one part"))
}

/// The text with another section of a board and another legend. Sections keep the order of the
/// boards.
#[must_use]
pub fn renewed(text: &str, legend: &str, board: Board, table: &str) -> String {
    let section = |of: Board| {
        let table = if of == board { Some(table) } else { section(text, of) };
        table.map(|table| format!("{}{}\n", begin(of), table.trim_end()))
    };
    let sections: Vec<String> = Board::ALL.into_iter().filter_map(section).collect();
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
        let one = renewed("", LEGEND, G474, "b | 1\n");
        assert_eq!(one, "# What it means\n\nboard | nucleo-g474re\nb | 1\n");
        let both = renewed(&one, LEGEND, H743, "a | 1\na | 2\n");
        assert_eq!(section(&both, H743), Some("a | 1\na | 2\n"));
        assert_eq!(section(&both, G474), Some("b | 1\n"));
        let changed = renewed(&both, "# Other\n", H743, "a | 3\n");
        assert_eq!(
            changed,
            "# Other\n\nboard | nucleo-h743zi\na | 3\n\nboard | nucleo-g474re\nb | 1\n"
        );
    }

    #[test]
    fn a_board_without_a_section_has_none() {
        assert_eq!(section("# What it means\n\nboard | nucleo-h743zi\na | 1\n", G474), None);
    }
}
