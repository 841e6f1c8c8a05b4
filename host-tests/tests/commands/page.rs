//! The tables of `docs/commands.md` as rows.

use host_protocol::CanFrame;
use mgw_sim::Wire;

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/commands.md");
const COMMANDS_HEAD: &str =
    "| Command | Frame | Section | Decoded | Encoded | Native | Typed | Simulated |";
const REFUSED_HEAD: &str = "| Protocol | Frame | Error | Reason |";

/// The page, its lines numbered from 1.
pub struct Page {
    lines: Vec<(usize, String)>,
}

/// What the project does with one command.
pub struct Row {
    pub line: usize,
    pub command: String,
    pub frame: Wire,
    pub section: String,
    pub decoded: Cell,
    pub encoded: Cell,
    pub native: Cell,
    pub typed: Cell,
    pub simulated: Cell,
}

/// A cell: what the code is asked for, and the reason behind the first colon.
pub struct Cell {
    pub fact: String,
    pub reason: String,
}

/// A frame that no native command may be.
pub struct Refused {
    pub line: usize,
    pub protocol: String,
    pub frame: Wire,
    pub error: String,
    pub reason: String,
}

impl Page {
    pub fn read() -> Self {
        let text = std::fs::read_to_string(PATH).unwrap_or_else(|e| panic!("{PATH}: {e}"));
        Self { lines: (1..).zip(text.lines().map(str::to_owned)).collect() }
    }

    /// The rows of all tables of commands below a heading.
    pub fn commands(&self, heading: &str) -> Vec<Row> {
        let rows = self.rows(heading, COMMANDS_HEAD).into_iter().map(|(line, cells)| {
            let [command, frame, section, decoded, encoded, native, typed, simulated] = cells;
            Row {
                line,
                command: bare(&command),
                frame: wire(&bare(&frame)),
                section,
                decoded: cell(&decoded),
                encoded: cell(&encoded),
                native: cell(&native),
                typed: cell(&typed),
                simulated: cell(&simulated),
            }
        });
        rows.collect()
    }

    /// The frames that are refused natively.
    pub fn refused(&self) -> Vec<Refused> {
        let rows = self.rows("Refused", REFUSED_HEAD).into_iter().map(|(line, cells)| {
            let [protocol, frame, error, reason] = cells;
            Refused { line, protocol, frame: wire(&bare(&frame)), error: bare(&error), reason }
        });
        rows.collect()
    }

    /// The rows below a heading of the second level whose tables have this head.
    fn rows<const N: usize>(&self, heading: &str, head: &str) -> Vec<(usize, [String; N])> {
        let heading = format!("## {heading}");
        let section = self.lines.iter().skip_while(|(_, line)| *line != heading).skip(1);
        let section: Vec<_> = section.take_while(|(_, line)| !line.starts_with("## ")).collect();
        let mut rows = Vec::new();
        let mut inside = false;
        for (number, line) in section {
            if !line.starts_with('|') {
                inside = false;
            } else if line == head {
                inside = true;
            } else if inside && !line.starts_with("|---") {
                let cells: Vec<String> =
                    line.trim_matches('|').split('|').map(|c| c.trim().to_owned()).collect();
                let count = cells.len();
                let cells = cells
                    .try_into()
                    .unwrap_or_else(|_| panic!("{PATH}:{number}: {count} cells, not {N}"));
                rows.push((*number, cells));
            }
        }
        rows
    }
}

fn bare(text: &str) -> String {
    text.replace('`', "")
}

fn cell(text: &str) -> Cell {
    let (fact, reason) = text.split_once(':').unwrap_or((text, ""));
    Cell { fact: bare(fact).trim().into(), reason: reason.trim().into() }
}

/// `ID#HEX` on CAN, else serial bytes.
pub fn wire(text: &str) -> Wire {
    match text.split_once('#') {
        Some((id, data)) => {
            let id = u16::from_str_radix(id, 16).unwrap_or_else(|_| panic!("{text}: no CAN id"));
            Wire::Can(
                CanFrame::standard(id, &bytes(data))
                    .unwrap_or_else(|| panic!("{text}: no CAN frame")),
            )
        }
        None => Wire::Serial(bytes(text)),
    }
}

fn bytes(hex: &str) -> Vec<u8> {
    let byte = |at| u8::from_str_radix(hex.get(at..at + 2).unwrap_or("?"), 16);
    (0..hex.len())
        .step_by(2)
        .map(|at| byte(at).unwrap_or_else(|_| panic!("{hex}: no hexadecimal")))
        .collect()
}
