//! The commands of docs/first-turn.md, typed as printed, with what is printed below each.

use std::path::PathBuf;

use crate::support::Sim;

const GUIDE: &str = include_str!("../../../../docs/first-turn.md");

/// What the guide has typed.
enum Typed {
    /// A command, and the lines below it.
    Command(Vec<&'static str>, Vec<&'static str>),
    /// A line in the window of the simulator.
    Simulator(&'static str),
}

fn all_typed() -> Vec<Typed> {
    let mut all = Vec::new();
    let mut is_console = false;
    for line in GUIDE.lines() {
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
fn is_printed(wanted: &str, printed: &str) -> bool {
    printed.lines().any(|line| {
        let mut rest = Some(line);
        for part in wanted.split('…') {
            rest = rest.and_then(|rest| rest.find(part.trim_end()).map(|at| &rest[at..]));
        }
        rest.is_some()
    })
}

#[test]
fn the_guide_turns_motors_from_the_box() {
    let directory = std::env::temp_dir().join(format!("mgw-guide-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    let file: PathBuf = directory.join("robot.toml");
    let path = file.to_str().expect("text");
    let mut all = all_typed().into_iter();
    let Some(Typed::Command(sim, _)) = all.next() else { panic!("the simulation comes first") };
    assert_eq!(sim[0], "sim");
    let mut sim = Sim::with(&sim[1..]);
    // So that a machine that is busy with other things ends no scan.
    sim.mgw(&["config", "gateway", "link_silence_us=10000000"]).success();
    // In the order in which the guide turns them, before it cuts their power.
    let mut moving =
        ["bus 0  rmd 1", "bus 0  thruster 0x0B", "bus 1  d5 0x0B", "bus 2  rmd 1"].into_iter();
    let mut count = 0;
    for typed in all {
        let (words, wanted) = match typed {
            Typed::Command(words, wanted) => (words, wanted),
            Typed::Simulator(line) => {
                for turned in moving.by_ref() {
                    let line = format!("{turned}  moving");
                    sim.process.wait_for(&line, |said| said.contains(&line).then_some(()));
                }
                sim.process.type_line(line);
                sim.process.wait_for(line, |said| said.contains(line).then_some(()));
                continue;
            }
        };
        let typed: Vec<&str> =
            words.iter().map(|word| if *word == "robot.toml" { path } else { word }).collect();
        let printed = sim.mgw_once_in_command(&typed).success().replace(path, "robot.toml");
        for line in wanted {
            assert!(is_printed(line, &printed), "`mgw {}`:\n{line}\n{printed}", words.join(" "));
        }
        count += 1;
    }
    assert!(count > 12 && moving.next().is_none(), "{count} commands");
    std::fs::remove_dir_all(&directory).unwrap();
}

#[test]
fn a_line_that_is_not_printed_is_missed() {
    assert!(is_printed("axis 0 … still", "t=1  axis 0 stop confirmed, standing still"));
    assert!(!is_printed("axis 0 … moving", "t=1  axis 0 stop confirmed, standing still"));
    assert!(!is_printed("still … axis 0", "t=1  axis 0 stop confirmed, standing still"));
}
