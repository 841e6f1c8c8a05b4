//! What a guide has typed, and what it says is printed. The virtual board reads its guide with
//! this, too.

/// What the guide has typed.
pub enum Typed {
    /// A command, and the lines below it.
    Command(Vec<&'static str>, Vec<&'static str>),
    /// A line in the window of the simulator.
    Simulator(&'static str),
}

pub fn all_typed(guide: &'static str) -> Vec<Typed> {
    let mut all = Vec::new();
    let mut is_console = false;
    for line in guide.lines() {
        if line.starts_with("```") {
            is_console = line == "```console";
        } else if is_console {
            if let Some(command) = line.strip_prefix("$ mgw ") {
                all.push(Typed::Command(command.split_whitespace().collect(), Vec::new()));
            } else if let Some(line) = line.strip_prefix("> ") {
                all.push(Typed::Simulator(line));
            } else if let Some(Typed::Command(_, printed)) = all.last_mut() {
                printed.push(line);
            }
        }
    }
    all
}

/// Whether a line is printed as the guide has it; `…` stands for anything, and more may follow.
pub fn is_printed(wanted: &str, printed: &str) -> bool {
    printed.lines().any(|line| {
        let mut rest = Some(line);
        for part in wanted.split('…') {
            rest = rest.and_then(|rest| rest.find(part.trim_end()).map(|at| &rest[at..]));
        }
        rest.is_some()
    })
}
