//! Cable or supply cut at the frames of what changes where a motor is found, and of a restore: a
//! scan finds the motor afterwards, under one id, and what was told as done is so. At every frame
//! that changes something and around it, and at some of those that only look; with
//! `MGW_EVERY_FRAME` set, at every one (`MGW_EVERY_FRAME=1 cargo test --release -p host-tests
//! --test motor cuts`, results in cuts.txt).

use host_protocol::Protocol::{self, D5, Rmd, Thruster};

use mgw_cli::Outcome;

use crate::rig::{Cut, MOTOR, Rig};

const V3_9: u8 = 3;
const V4_4: u8 = 6;
/// Frames that only look for motors are cut at each so many'th.
const LOOKS: usize = 96;

/// A command, and where its motor may be found afterwards.
struct Step {
    motors: &'static [(u8, Protocol, u8, u8)],
    /// What is configured before.
    before: &'static [&'static str],
    typed: &'static str,
    old: &'static str,
    new: &'static str,
}

impl Step {
    fn rig(&self) -> Rig {
        let rig = Rig::with(self.motors);
        for typed in self.before {
            let words: Vec<&str> = typed.split_whitespace().collect();
            assert_eq!(rig.run(&words).exit_code, 0, "{typed}");
        }
        rig
    }

    fn run(&self, cut: Cut) -> (Rig, Outcome, usize) {
        let rig = self.rig();
        let words: Vec<&str> = self.typed.split_whitespace().chain(["--yes"]).collect();
        let (outcome, messages) = rig.run_until(cut, &words);
        (rig, outcome, messages)
    }

    fn check(&self, cut: Cut) {
        let (rig, outcome, _) = self.run(cut);
        rig.mend(&outcome);
        let (old, new) = (rig.finds(self.old), rig.finds(self.new));
        assert!(old != new, "{}, {cut:?}: old {old}, new {new}: {outcome:?}", self.typed);
        assert!(
            outcome.exit_code != 0 || new,
            "{}, {cut:?}: told as done, and it is not",
            self.typed
        );
        rig.assert_still();
    }

    /// Cuts at every frame.
    fn check_all(&self) {
        let (rig, outcome, messages) = self.run(Cut::Never);
        assert_eq!(outcome.exit_code, 0, "{}: {outcome:?}", self.typed);
        let frames = rig.sent.borrow().clone();
        let mut cuts = 0;
        for at in 1..=frames.len() {
            // A step that does more than look is between two that differ.
            let is_look = |at: usize| {
                let kind = |at: usize| frames.get(at).map(|frame| frame.get(..12));
                at == 0 || kind(at - 1) == kind(at)
            };
            let near =
                (at.saturating_sub(2)..=at + 2).any(|at| at < frames.len() && writes(&frames[at]));
            if every_frame() || near || !is_look(at) && at % 8 == 0 || at % LOOKS == 0 {
                self.check(Cut::Power(at));
                self.check(Cut::Gateway(at));
                cuts += 2;
            }
        }
        for at in (0..messages).step_by(step(messages)).chain(messages.saturating_sub(6)..messages)
        {
            self.check(Cut::Cable(at));
            cuts += 1;
        }
        assert!(cuts > 20, "{cuts}");
        println!("{}: {} frames, {messages} messages, {cuts} cuts", self.typed, frames.len());
    }
}

fn every_frame() -> bool {
    std::env::var_os("MGW_EVERY_FRAME").is_some()
}

/// So that a command of many messages is cut at about 16 of them.
fn step(messages: usize) -> usize {
    if every_frame() { 1 } else { (messages / 16).max(1) }
}

/// Whether a frame changes the motor.
fn writes(frame: &str) -> bool {
    [
        "#80", "#2005", "#76", "#79", "#B4", "#43", "#32", "#63", "D50B0503", "D50C0503",
        "D50B0506", "D50C0506",
    ]
    .iter()
    .any(|command| frame.contains(command))
}

#[test]
fn the_id_of_an_rmd_of_v4_4() {
    Step {
        motors: &[(0, Rmd, 1, V4_4), (0, Rmd, 7, V4_4)],
        before: &[],
        typed: "motor 0:1@1000000 id 2",
        old: "0:rmd:1@1000000",
        new: "0:rmd:2@1000000",
    }
    .check_all();
}

#[test]
fn the_id_of_an_rmd_of_v3_9() {
    Step {
        motors: &[(0, Rmd, 1, V3_9)],
        before: &[],
        typed: "motor 0:1@1000000 id 2",
        old: "0:rmd:1@1000000",
        new: "0:rmd:2@1000000",
    }
    .check_all();
}

#[test]
fn the_id_of_an_rmd_that_is_an_axis() {
    Step {
        motors: &[(0, Rmd, 1, V3_9)],
        before: &[
            "config bus 0 bitrate=1000000 protocols=rmd",
            "config axis 3 bus=0 protocol=rmd node=1 stop_action=hold rmd_dialect=v3_9",
        ],
        typed: "motor 3 id 2",
        old: "0:rmd:1@1000000",
        new: "0:rmd:2@1000000",
    }
    .check_all();
}

#[test]
fn the_id_of_a_d5() {
    Step {
        motors: &[(1, D5, 11, 0)],
        before: &[],
        typed: "motor 1:11@210526 id 12",
        old: "1:d5:11@210526",
        new: "1:d5:12@210526",
    }
    .check_all();
}

#[test]
fn the_reset_of_a_d5() {
    Step {
        motors: &[(1, D5, 12, 0)],
        before: &[],
        typed: "motor 1:12@210526 reset",
        old: "1:d5:12@210526",
        new: "1:d5:11@210526",
    }
    .check_all();
}

#[test]
fn the_id_of_a_thruster() {
    Step {
        motors: &[(0, Thruster, 11, 0)],
        before: &[],
        typed: "motor 0:thruster:11@1000000 id 12",
        old: "0:thruster:11@1000000",
        new: "0:thruster:12@1000000",
    }
    .check_all();
}

#[test]
fn the_bitrate_of_an_rmd() {
    for dialect in [V3_9, V4_4] {
        Step {
            motors: if dialect == V3_9 { &[(0, Rmd, 1, V3_9)] } else { &[(0, Rmd, 1, V4_4)] },
            before: &[],
            typed: "motor 0:1@1000000 bitrate 500000",
            old: "0:rmd:1@1000000",
            new: "0:rmd:1@500000",
        }
        .check_all();
    }
}

#[test]
fn the_bitrate_of_a_thruster() {
    Step {
        motors: &[(0, Thruster, 11, 0)],
        before: &[],
        typed: "motor 0:thruster:11@1000000 bitrate 500000",
        old: "0:thruster:11@1000000",
        new: "0:thruster:11@500000",
    }
    .check_all();
}

/// Each setting is the old or the new one, and all are new where that was told.
#[test]
fn a_restore() {
    let file = std::env::temp_dir().join(format!("mgw-motor-{}.toml", std::process::id()));
    let path = file.to_str().unwrap();
    let typed = format!("motor 0:1@1000000 restore {path} --yes");
    let words: Vec<&str> = typed.split_whitespace().collect();
    let motors = [(0, Rmd, 1, V4_4)];
    let rig = Rig::with(&motors);
    assert_eq!(rig.run(&["motor", "0:1@1000000", "dump", "--output", path]).exit_code, 0);
    let text = std::fs::read_to_string(path).unwrap();
    let text = text
        .replace("speed_kp = 0.5", "speed_kp = 0.25")
        .replace("velocity_acceleration_dps2 = 11459", "velocity_acceleration_dps2 = 3000")
        .replace("encoder_offset_pulses = 0", "encoder_offset_pulses = 100");
    std::fs::write(path, text).unwrap();
    let (outcome, messages) = rig.run_until(Cut::Never, &words);
    assert_eq!(outcome.exit_code, 0, "{outcome:?}");
    let frames = rig.sent.borrow().len();
    let diff = ["motor", "0:1@1000000", "diff", path];
    assert_eq!(rig.run(&diff).exit_code, 0);

    let cables = (0..messages).step_by(step(messages)).map(Cut::Cable);
    let supplies = (1..=frames).step_by(if every_frame() { 1 } else { 2 });
    let gateways = supplies.clone().filter(|_| every_frame()).map(Cut::Gateway);
    let cuts: Vec<Cut> = supplies.map(Cut::Power).chain(gateways).chain(cables).collect();
    println!("restore: {frames} frames, {messages} messages, {} cuts", cuts.len());
    for cut in cuts {
        let rig = Rig::with(&motors);
        let (outcome, _) = rig.run_until(cut, &words);
        rig.mend(&outcome);
        assert!(rig.finds("0:rmd:1@1000000"), "{cut:?}");
        let same = rig.run(&diff).exit_code == 0;
        assert!(outcome.exit_code != 0 || same, "{cut:?}: told as restored");
        // Once more, and it is.
        rig.mend(&outcome);
        let again = rig.run(&words);
        assert_eq!(again.exit_code, 0, "{cut:?}: {again:?}");
        rig.assert_still();
        assert_eq!(rig.world.borrow().motor(MOTOR).node(), 1);
    }
    std::fs::remove_file(path).unwrap();
}
