//! The commands of docs/first-turn, typed as printed, with what is printed below each.

use std::time::Instant;

use crate::support::{LIMIT, Sim, file};
use crate::typed::{Typed, all_typed, is_printed};

/// A guide of that folder.
macro_rules! guide {
    ($name:literal) => {
        include_str!(concat!("../../../../docs/first-turn/", $name))
    };
}

/// Has setpoints live for as long as this machine may hold the one who sends them up.
fn bear_a_busy_machine(sim: &Sim) {
    let axes = sim.mgw_once_connected(&["--json", "axes"]).json_lines().remove(0);
    for axis in axes["axes"].as_array().into_iter().flatten() {
        let axis = axis["axis"].to_string();
        sim.mgw_once_at_rest(&["config", "axis", &axis, "ttl_us=10000000"]).success();
    }
}

/// Types a guide; the motors that it turns before it cuts their power, in its order.
fn follow(guide: &'static str, turned: &[&str]) {
    let files = ["robot.toml", "board.flash"].map(|name| (name, file(name)));
    let in_directory = |word: &str| {
        let file = files.iter().find(|(name, _)| *name == word);
        file.map_or(word.to_owned(), |(_, path)| path.clone())
    };
    let mut all = all_typed(guide).into_iter();
    let Some(Typed::Command(sim, _)) = all.next() else { panic!("the simulation comes first") };
    assert_eq!(sim[0], "sim");
    let sim: Vec<String> = sim[1..].iter().map(|word| in_directory(word)).collect();
    let mut sim = Sim::with(&sim.iter().map(String::as_str).collect::<Vec<_>>());
    // So that a machine that is busy with other things ends no scan.
    sim.mgw(&["config", "gateway", "link_silence_us=10000000"]).success();
    let mut moving = turned.iter();
    let mut count = 0;
    for typed in all {
        let (words, wanted) = match typed {
            Typed::Command(words, wanted) => (words, wanted),
            Typed::Simulator(line) => {
                let cut = if line == "power off" { turned.len() } else { 0 };
                for turned in moving.by_ref().take(cut) {
                    let line = format!("{turned}  moving");
                    sim.process.wait_for(&line, |said| said.contains(&line).then_some(()));
                }
                sim.typed(line);
                continue;
            }
        };
        let typed: Vec<String> = words.iter().map(|word| in_directory(word)).collect();
        let typed: Vec<&str> = typed.iter().map(String::as_str).collect();
        let end = Instant::now() + LIMIT;
        let outcome = loop {
            let outcome = sim.mgw_once_at_rest(&typed);
            // So `mgw doctor` says that this machine is busy.
            let is_busy = ["wrong  link", "wrong  clock", "wrong link", "wrong clock"]
                .iter()
                .any(|said| outcome.stdout.contains(said));
            if !is_busy || Instant::now() >= end {
                break outcome;
            }
        };
        let mut printed = outcome.success();
        for (name, path) in &files {
            printed = printed.replace(path, name);
        }
        for line in wanted {
            assert!(is_printed(line, &printed), "`mgw {}`:\n{line}\n{printed}", words.join(" "));
        }
        if typed.starts_with(&["config", "apply"]) {
            bear_a_busy_machine(&sim);
        }
        count += 1;
    }
    assert!(count > 7 && moving.next().is_none(), "{count} commands");
}

#[test]
fn the_guide_turns_motors_from_the_box() {
    follow(
        guide!("README.md"),
        // The simulator goes on calling a motor by the id from its box.
        &[
            "bus 0  rmd 1",
            "bus 0  rmd 1",
            "bus 0  thruster 0x0B",
            "bus 1  d5 0x0B",
            "bus 1  d5 0x0B",
            "bus 2  rmd 1",
        ],
    );
}

#[test]
fn the_guide_of_each_family_turns_its_motor_and_again_after_a_loss_of_power() {
    follow(guide!("rmd.md"), &["bus 0  rmd 1"]);
    follow(guide!("thruster.md"), &["bus 0  thruster 0x0B"]);
    follow(guide!("d5.md"), &["bus 1  d5 0x0B"]);
}

#[test]
fn a_line_that_is_not_printed_is_missed() {
    assert!(is_printed("axis 0 … still", "t=1  axis 0 stop confirmed, standing still"));
    assert!(!is_printed("axis 0 … moving", "t=1  axis 0 stop confirmed, standing still"));
    assert!(!is_printed("still … axis 0", "t=1  axis 0 stop confirmed, standing still"));
}
