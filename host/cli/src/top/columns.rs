//! Tables that leave out what matters least where the terminal is narrow.

/// Between two columns.
const GAP: usize = 1;

/// A column of a table.
pub struct Column<T> {
    /// What stands above it.
    pub heading: &'static str,
    /// Characters.
    pub width: usize,
    /// Numbers stand right.
    pub right: bool,
    /// The least of these is left out first.
    pub weight: u8,
    /// What stands in it.
    pub cell: fn(&T) -> String,
}

impl<T> Column<T> {
    /// Of text.
    pub const fn left(
        heading: &'static str,
        width: usize,
        weight: u8,
        cell: fn(&T) -> String,
    ) -> Self {
        Self { heading, width, right: false, weight, cell }
    }

    /// Of numbers.
    pub const fn right(
        heading: &'static str,
        width: usize,
        weight: u8,
        cell: fn(&T) -> String,
    ) -> Self {
        Self { heading, width, right: true, weight, cell }
    }
}

/// The columns that fit into so many characters, in their order.
pub fn that_fit<T>(columns: &[Column<T>], width: usize) -> Vec<&Column<T>> {
    let mut fitting: Vec<&Column<T>> = columns.iter().collect();
    let taken = |all: &[&Column<T>]| all.iter().map(|one| one.width + GAP).sum::<usize>();
    while fitting.len() > 1 && taken(&fitting) > width + GAP {
        let least = fitting.iter().enumerate().min_by_key(|(_, column)| column.weight);
        let Some((place, _)) = least else { break };
        fitting.remove(place);
    }
    fitting
}

/// The headings.
pub fn headings<T>(columns: &[&Column<T>]) -> String {
    line(columns, |column| column.heading.to_owned())
}

/// The row of something.
pub fn row<T>(columns: &[&Column<T>], of: &T) -> String {
    line(columns, |column| (column.cell)(of))
}

fn line<T>(columns: &[&Column<T>], cell: impl Fn(&Column<T>) -> String) -> String {
    let cells = columns.iter().map(|column| {
        let text = cut(&cell(column), column.width);
        let width = column.width;
        if column.right { format!("{text:>width$}") } else { format!("{text:<width$}") }
    });
    cells.collect::<Vec<_>>().join(" ").trim_end().to_owned()
}

/// The text, or as much of it as fits, with a mark that there is more.
pub fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    let mut short: String = text.chars().take(width.saturating_sub(1)).collect();
    short.push('…');
    short
}

/// The text in lines of so many characters, broken between words, the later ones indented.
pub fn wrapped(text: &str, indent: usize, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = " ".repeat(indent);
    let mut is_empty = true;
    for word in text.split_whitespace() {
        let needs = line.chars().count() + usize::from(!is_empty) + word.chars().count();
        if !is_empty && needs > width {
            lines.push(std::mem::replace(&mut line, " ".repeat(indent)));
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line.push_str(word);
        is_empty = false;
    }
    lines.push(line);
    lines
}
