//! `mgw motor` as a user types it, and docs/motor-settings.md as printed.

use std::fs::File;
use std::io::{BufReader, Read, Write};
use std::process::Stdio;
use std::time::Duration;

use nix::pty::openpty;

use crate::support::{Sim, command, file, state_home};
use crate::typed::{Typed, all_typed, is_printed};

const GUIDE: &str = include_str!("../../../../docs/motor-settings.md");

fn with_motors(motors: &[&str]) -> Sim {
    let words: Vec<&str> = motors.iter().flat_map(|motor| ["--motor", motor]).collect();
    unhurried(Sim::with(&words))
}

/// A machine that is busy with other things ends no command there.
fn unhurried(sim: Sim) -> Sim {
    sim.mgw(&["config", "gateway", "link_silence_us=10000000"]).success();
    sim
}

#[test]
fn the_page_on_settings_is_as_printed() {
    let path = file("knee");
    let mut all = all_typed(GUIDE).into_iter();
    let Some(Typed::Command(sim, _)) = all.next() else { panic!("the simulation comes first") };
    let mut sim = unhurried(Sim::with(&sim[1..]));
    let mut count = 0;
    for typed in all {
        match typed {
            Typed::Simulator(line) => sim.typed(line),
            Typed::Command(words, wanted) => {
                let typed =
                    words.iter().map(|word| if *word == "knee.toml" { &path } else { *word });
                let typed: Vec<&str> = typed.collect();
                let printed = sim.mgw_once_in_command(&typed).success();
                let printed = printed.replace(&path, "knee.toml");
                for line in wanted {
                    let words = words.join(" ");
                    assert!(is_printed(line, &printed), "`mgw {words}`:\n{line}\n{printed}");
                }
                count += 1;
            }
        }
    }
    assert!(count > 15, "{count} commands");
    // All that was lent is taken back.
    assert!(sim.mgw(&["axes"]).success().contains("no axis is configured"));
}

#[test]
fn what_stays_in_a_motor_needs_a_yes_where_there_is_no_terminal() {
    let sim = unhurried(Sim::start());
    for words in ["id 2", "bitrate 500000", "zero here", "pid speed_kp=1", "timeout 200", "reset"] {
        let text = sim.once(&format!("motor 0 {words}")).failure(2);
        assert!(text.contains("Add --yes"), "{words}: {text}");
    }
    let id = sim.mgw_once_in_command(&["motor", "0", "id"]).success();
    assert_eq!(id, "bus 0, rmd 1: id = 1\n");
}

/// Types an answer where it asks whether to go on; whether it did it.
fn answered(sim: &Sim, answer: &str, arguments: &[&str]) -> (Option<i32>, String) {
    let terminal = openpty(None, None).expect("a pseudo terminal");
    let arguments = [&["--port", &sim.port], arguments].concat();
    let mut command = command(&arguments);
    let program = command.stdin(Stdio::from(terminal.slave)).spawn().expect("it starts");
    let mut keys = File::from(terminal.master);
    writeln!(keys, "{answer}").expect("it is a terminal");
    let output = program.wait_with_output().expect("it ends");
    (output.status.code(), String::from_utf8(output.stderr).expect("text"))
}

#[test]
fn a_terminal_is_asked_and_a_no_changes_nothing() {
    let sim = with_motors(&["1:d5:11"]);
    let typed = ["motor", "1:11@210526", "id", "12"];
    let (code, asked) = answered(&sim, "n", &typed);
    assert_eq!(code, Some(2), "{asked}");
    assert!(asked.contains("d5 0x0B: gets id 12 for good"), "{asked}");
    assert!(asked.contains("Back with `mgw motor 1:d5:12 id 11`. Go on? [y/N]"), "{asked}");
    sim.mgw_once_in_command(&["motor", "1:11@210526", "id"]).success();
    assert_eq!(answered(&sim, "y", &typed).0, Some(0));
    sim.mgw_once_in_command(&["motor", "1:12@210526", "id"]).success();
}

#[test]
fn what_a_killed_command_has_lent_is_told_to_the_next_and_taken_back_by_its_file() {
    let sim = with_motors(&["1:d5:11"]);
    let terminal = openpty(None, None).expect("a pseudo terminal");
    let typed = ["--port", &sim.port, "motor", "1:11@210526", "id", "12"];
    let mut program =
        command(&typed).stdin(Stdio::from(terminal.slave)).spawn().expect("it starts");
    let mut asked = String::new();
    let mut said = BufReader::new(program.stderr.take().expect("a pipe"));
    while !asked.contains("gets id 12 for good") {
        let mut bytes = [0; 64];
        let count = said.read(&mut bytes).expect("a pipe");
        assert_ne!(count, 0, "it asks: {asked}");
        asked += std::str::from_utf8(&bytes[..count]).expect("ASCII");
    }
    program.kill().expect("it runs");
    program.wait().expect("it ends");
    assert!(sim.mgw(&["axes"]).success().contains("11"), "the axis that it was lent");

    let next = sim.mgw_once_in_command(&["motor", "1:11@210526", "id"]);
    assert_eq!(next.code, Some(0), "{next:?}");
    let (_, file) = next.stderr.split_once("`mgw config apply ").expect("what was before");
    let (file, _) = file.split_once('`').expect("a command");
    assert!(file.starts_with(state_home().to_str().expect("text")), "{file}");
    sim.mgw_once_in_command(&["config", "apply", file]).success();
    assert!(sim.mgw(&["axes"]).success().contains("no axis is configured"));
    let again = sim.mgw_once_in_command(&["motor", "1:11@210526", "id", "12", "--yes"]);
    assert!(!again.stderr.contains("config apply"), "{again:?}");
    again.success();
}

#[test]
fn the_row_of_an_axis_follows_its_motor() {
    let sim = Sim::patient();
    // What is known of a thruster's timeout comes and goes with its polls.
    let rows = || -> Vec<String> {
        let dump = sim.mgw(&["config", "dump"]).success();
        let is_row = |line: &&str| !line.starts_with("motor_timeout_ms");
        dump.lines().filter(is_row).map(str::to_owned).collect()
    };
    let mut expected = rows();
    let text = sim.mgw_once_in_command(&["motor", "2", "id", "12", "--yes"]).success();
    assert!(text.contains("axis 2: node = 12 in its row"), "{text}");
    let text = sim.mgw_once_in_command(&["motor", "0", "id", "2", "--yes"]).success();
    assert!(text.contains("axis 0: node = 2 in its row"), "{text}");
    for (axis, node) in [("axis = 0", "node = 2"), ("axis = 2", "node = 12")] {
        let row = expected.iter().position(|line| line == axis).unwrap();
        let place = expected[row..].iter().position(|line| line.starts_with("node")).unwrap();
        expected[row + place] = node.to_owned();
    }
    assert_eq!(rows(), expected);
    for axis in ["0", "2"] {
        sim.mgw_once_in_command(&["set", axis, "velocity", "3", "--for", "0.2"]).success();
    }
}

#[test]
fn an_id_that_is_taken_or_may_reach_others_is_refused() {
    let sim = with_motors(&["0:rmd:1:v3_9", "0:rmd:7:v3_9", "1:d5:11", "1:d5:12"]);
    let failed = |words: &str| sim.once(&format!("{words} --yes")).failure(1);
    let text = failed("motor 0:1@1000000 id 7");
    assert!(text.contains("rmd 7 answers already"), "{text}");
    let text = failed("motor 0:1@1000000 id 2");
    assert!(text.contains("0x79 gives every RMD of the bus that id"), "{text}");
    let text = failed("motor 1:11@210526 id 12");
    assert!(text.contains("d5 0x0C answers already"), "{text}");
    // A reset would make two of them 0x0B.
    let text = failed("motor 1:12@210526 reset");
    assert!(text.contains("d5 0x0B answers already"), "{text}");
    let text = failed("motor 0:9@1000000 pid");
    assert!(text.contains("no motor 9 answers; there are: rmd 1, rmd 7"), "{text}");
    let text = sim.mgw_once_in_command(&["motor", "0:1@1000000", "id", "33", "--yes"]).failure(2);
    assert!(text.contains("33 is no id. It takes 1 to 32"), "{text}");
    sim.mgw_once_in_command(&["scan", "0@1000000", "--listen", "0"]).success();
}

#[test]
fn a_motor_is_not_taken_for_the_axis_of_another_protocol_with_its_node() {
    let sim = with_motors(&["0:rmd:11:v4_4", "0:thruster:11"]);
    let bus = ["config", "bus", "0", "bitrate=1000000", "protocols=rmd,thruster"];
    sim.mgw_once_in_command(&bus).success();
    let axis = ["bus=0", "protocol=thruster", "node=11", "stop_action=coast"];
    sim.mgw_once_in_command(&[&["config", "axis", "0"], &axis[..]].concat()).success();
    let motor = |place: &str| {
        sim.mgw_once_in_command(&["--json", "motor", place, "id"]).json_lines()[0]["motor"].clone()
    };
    let rmd = motor("0:11");
    assert_eq!((&rmd["protocol"], &rmd["axis"]), (&"rmd".into(), &serde_json::Value::Null));
    let thruster = motor("0:thruster:11");
    assert_eq!((&thruster["protocol"], &thruster["axis"]), (&"thruster".into(), &0.into()));
}

#[test]
fn an_axis_that_is_configured_for_the_id_keeps_it() {
    let sim = unhurried(Sim::start());
    sim.once("config axis 5 bus=0 protocol=rmd node=9 stop_action=hold").success();
    let text = sim.mgw_once_in_command(&["motor", "0", "id", "9", "--yes"]).failure(1);
    assert!(text.contains("axis 5 is configured for rmd 9, which may be off"), "{text}");
}

#[test]
fn two_motors_with_one_id_are_shown_and_not_changed() {
    let sim = with_motors(&["0:rmd:1:v4_4", "0:rmd:1:v4_4"]);
    let typed = ["motor", "0:1@1000000", "id", "2", "--yes"];
    let text = sim.mgw_once_in_command(&typed).failure(1);
    assert!(text.contains("two motors seem to have this id"), "{text}");
}

#[test]
fn what_a_dialect_cannot_tell_is_not_written() {
    let sim = with_motors(&["2:rmd:1:v4_2", "0:rmd:1:v3_7"]);
    // V4.2 and V4.3 have the same gains, and the same codes of 0xB4.
    let typed = ["motor", "2:rmd:1@115200", "pid", "speed_kp=0.25", "--yes"];
    sim.mgw_once_in_command(&typed).success();
    sim.mgw_once_in_command(&["motor", "2:rmd:1@115200", "bitrate", "500000", "--yes"]).success();
    let text = sim.mgw_once_in_command(&["motor", "0:1@1000000", "acceleration"]).success();
    assert!(text.contains("no command of its dialect reads position_deceleration_dps2"), "{text}");
    let text = sim.mgw_once_in_command(&["motor", "0:1@1000000", "limits"]).failure(2);
    assert!(text.contains("stands in no manual"), "{text}");
    let typed = ["motor", "0:1@1000000", "bitrate", "250000", "--yes"];
    let text = sim.mgw_once_in_command(&typed).failure(2);
    assert!(text.contains("no code is known that sets 250000 bit/s"), "{text}");
    let typed = ["motor", "0:1@1000000", "bitrate", "123456", "--yes"];
    let text = sim.mgw_once_in_command(&typed).failure(2);
    assert!(text.contains("does not run at 123456 bit/s"), "{text}");
    let typed = ["motor", "0:1@1000000", "function", "fault-recovery", "on", "--yes"];
    sim.mgw_once_in_command(&typed).failure(2);
}

#[test]
fn a_dump_is_restored_and_all_that_is_wrong_with_a_file_is_told() {
    let sim = with_motors(&["0:rmd:1:v4_4", "0:rmd:7:v3_9", "1:d5:11"]);
    let (path, again) = (file("dump"), file("again"));
    let run = |words: &str| sim.once(words);
    run("motor 0:1@1000000 pid current_kp=0.1 speed_ki=1e-5 --yes").success();
    run(&format!("motor 0:1@1000000 dump --output {path}")).success();
    let text = run(&format!("motor 0:1@1000000 dump --output {path}")).failure(1);
    assert!(text.contains("is there already"), "{text}");
    run("motor 0:1@1000000 pid current_kp=0.7 speed_ki=0.3 --yes").success();
    run("motor 0:1@1000000 zero 500 --yes").success();
    run("motor 0:1@1000000 id 3 --yes").success();

    // Without --with-id the id stays.
    let text = run(&format!("motor 0:3@1000000 restore {path} --yes")).success();
    assert!(text.contains("encoder_offset_pulses 500 -> 0"), "{text}");
    let text = run(&format!("motor 0:3@1000000 diff {path}")).success();
    assert!(text.contains("the file has id = 1, which only --with-id restores"), "{text}");
    run(&format!("motor 0:3@1000000 restore {path} --with-id --yes")).success();
    run(&format!("motor 0:1@1000000 dump --output {again}")).success();
    let read = |path: &str| std::fs::read_to_string(path).unwrap();
    assert_eq!(read(&path), read(&again), "a round trip is the identity");

    for (other, names) in [("0:7@1000000", "rmd_dialect"), ("1:11@210526", "protocol")] {
        let text = run(&format!("motor {other} restore {path} --yes")).failure(2);
        assert!(text.contains(&format!("it is for {names} = ")), "{text}");
    }
    let wrong = read(&path)
        .replace("speed_kp = 0.5", "speed_kp = -1.0\nspeed_kx = 2")
        .replace("position_acceleration_dps2 = 11459", "position_acceleration_dps2 = 0")
        .replace("position_ki = 0.5", "position_ki = \"much\"");
    std::fs::write(&again, wrong).unwrap();
    let text = run(&format!("motor 0:1@1000000 restore {again} --yes")).failure(2);
    for part in
        ["`speed_kx` is not among", "position_ki takes a number", "speed_kp = -1", "dps2 = 0"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    run(&format!("motor 0:1@1000000 diff {path}")).success();
    run(&format!("motor 1:11@210526 dump --output {again} --force")).success();
    let mute = read(&again).replace("ack_level = 2", "ack_level = 0");
    std::fs::write(&again, mute).unwrap();
    let text = run(&format!("motor 1:11@210526 restore {again} --yes")).failure(2);
    assert!(text.contains("ack_level = 0: takes 1 or 2"), "{text}");
}

#[test]
fn what_is_typed_wrong_is_said() {
    let sim = unhurried(Sim::start());
    for words in [
        &["motor"][..],
        &["motor", "0"],
        &["motor", "x", "id"],
        &["motor", "0:servo:1", "id"],
        &["motor", "0:1@fast", "id"],
        &["motor", "2", "ack-level", "0"],
        &["motor", "1", "pid"],
        &["motor", "1", "reset"],
        &["motor", "0", "clear-faults"],
        &["motor", "0", "stream", "1", "100"],
        &["motor", "2", "bitrate", "200000"],
        &["motor", "0", "pid", "speed_kq=1"],
    ] {
        sim.mgw_once_in_command(words).failure(2);
    }
    let text = sim.mgw(&["motor", "9", "id"]).failure(1);
    assert!(text.contains("axis 9 is not configured"), "{text}");
    let text = sim.mgw_once_in_command(&["motor", "0:1@500000", "id"]).failure(1);
    assert!(text.contains("bus 0 belongs to axis 0"), "{text}");
}

#[test]
fn a_motor_whose_axis_is_in_use_is_left_alone() {
    let sim = Sim::patient();
    let moving = ["set", "0", "velocity", "2", "--for", "3"];
    let moved = sim.mgw_beside(&moving, "0", &["active"], || {
        sim.mgw_once_connected(&["motor", "0", "acceleration"]).failure(1);
        sim.mgw_once_connected(&["motor", "1", "timeout", "500", "--yes"]).failure(1);
    });
    moved.success();
}

#[test]
fn nothing_is_restored_of_a_file_that_is_wrong_anywhere() {
    let sim = with_motors(&["0:rmd:1:v4_4"]);
    let path = file("wrong");
    let run = |words: &str| sim.once(words);
    run(&format!("motor 0:1@1000000 dump --output {path}")).success();
    let whole = std::fs::read_to_string(&path).expect("the dump");
    let restore = format!("motor 0:1@1000000 restore {path} --with-id --with-bitrate --yes");
    let other = whole.replace("speed_kp = 0.5", "speed_kp = 0.9");
    assert_ne!(other, whole);
    for (old, new, said) in [
        ("id = 1\n", "id = 77\n", "77 is no id. It takes 1 to 32"),
        ("bitrate_bit_s = 1000000", "bitrate_bit_s = 123", "does not run at 123 bit/s"),
    ] {
        assert!(other.contains(old), "{other}");
        std::fs::write(&path, other.replace(old, new)).unwrap();
        let text = run(&restore).failure(2);
        assert!(text.contains(said), "{text}");
    }
    let (cut, _) = whole.split_once("\n[settings]").expect("settings");
    std::fs::write(&path, cut).unwrap();
    let text = run(&restore).failure(2);
    assert!(text.contains("there is no section [settings]: the file is not whole"), "{text}");
    let text = run("motor 0:1@1000000 pid speed_kp=0.1 speed_kp=0.2 --yes").failure(2);
    assert!(text.contains("speed_kp is given twice"), "{text}");
    let text = run("motor 0:1@1000000 pid").success();
    assert!(text.contains("speed_kp = 0.5\n"), "{text}");
}

#[test]
fn the_way_out_is_told_where_a_loss_of_power_comes_between_an_id_and_its_row() {
    let storage = file("storage");
    let mut sim = unhurried(Sim::with(&["--storage", &storage]));
    sim.mgw_once_in_command(&["config", "save"]).success();
    sim.mgw_once_in_command(&["motor", "0", "id", "2", "--yes"]).success();
    for line in ["power off", "motor 0 power off", "motor 0 power on", "power on"] {
        sim.typed(line);
    }
    let doctor = (0..600).map(|_| sim.mgw_once_in_command(&["doctor"])).find(|doctor| {
        let is_told = doctor.stdout.contains("a stop was not confirmed");
        if !is_told {
            std::thread::sleep(Duration::from_millis(100));
        }
        is_told
    });
    let doctor = doctor.expect("the trip");
    let told = "Where its motor cannot answer any more, as its id is another one, see that it stands, \
        then `mgw clear 0 --unreachable` and `mgw scan`";
    assert!(doctor.stdout.contains(told), "{doctor:?}");
    let text = sim.mgw_once_in_command(&["clear", "0"]).failure(1);
    assert!(text.contains("then `mgw clear 0 --unreachable`"), "{text}");
    sim.mgw_once_in_command(&["clear", "0", "--unreachable"]).success();
    let scan = sim.mgw_once_in_command(&["scan", "0"]).success();
    assert!(scan.contains("rmd 2"), "{scan}");
    let text = sim.mgw_once_in_command(&["motor", "0:rmd:2", "id", "1", "--yes"]).failure(1);
    assert!(text.contains("or, if this is its motor, `mgw config axis 0 node=2`"), "{text}");
    sim.mgw_once_in_command(&["config", "axis", "0", "node=2"]).success();
    sim.mgw_once_in_command(&["output-off", "3"]).success();
    sim.mgw_once_in_command(&["config", "save"]).success();
    sim.mgw_once_in_command(&["motor", "0", "id"]).success();
}

#[test]
fn a_motor_is_not_changed_while_its_neighbour_turns() {
    let sim = with_motors(&["0:rmd:1:v4_4", "0:rmd:3:v4_4"]);
    let run = |words: &str| sim.once(words);
    run("config bus 0 bitrate=1000000 protocols=rmd").success();
    run("raw --unsafe 0 send 141#A200000010270000").success();
    let text = run("motor 0:rmd:3 id 9 --yes").failure(1);
    assert!(
        text.contains("rmd 1 turns, at 1.75 rad/s, so nothing is changed on its bus"),
        "{text}"
    );
    let text = run("scan 0").success();
    assert!(text.contains("bus 0, rmd 1: it turns, at 1.75 rad/s"), "{text}");
    let text = run("motor 0:rmd:3 id").success();
    assert!(text.contains("id = 3"), "{text}");
}

#[test]
fn a_reset_of_the_gateway_in_mid_change_says_that_the_motor_may_have_been_changed() {
    let mut sim = with_motors(&["0:rmd:1:v4_4"]);
    sim.once("config bus 0 bitrate=1000000 protocols=rmd").success();
    sim.once("config axis 0 bus=0 protocol=rmd node=1 stop_action=hold rmd_dialect=v4_4 name=knee")
        .success();
    let words = ["--port", &sim.port, "motor", "knee", "id", "2", "--yes"];
    let program = command(&words).spawn().expect("it starts");
    // Its axis is away while frames are sent that no native command may send.
    (0..6_000)
        .find(|_| sim.mgw(&["axes"]).stdout.contains("no axis is configured"))
        .expect("it is taken out of the configuration");
    sim.process.type_line("reset");
    let output = program.wait_with_output().expect("it ends");
    let said = String::from_utf8(output.stderr).expect("text");
    if output.status.code() != Some(0) {
        assert!(said.contains("the motor may have been changed"), "{said}");
        assert!(said.contains("under its old or its new id"), "{said}");
    }
}

#[test]
fn a_name_that_a_killed_command_took_away_is_no_riddle() {
    let sim = with_motors(&["0:rmd:1:v4_4"]);
    let run = |words: &str| sim.once(words);
    run("config bus 0 bitrate=1000000 protocols=rmd").success();
    run("config axis 0 bus=0 protocol=rmd node=1 stop_action=hold rmd_dialect=v4_4 name=knee-17")
        .success();
    let before = run("config dump").success();
    let words = ["--port", &sim.port, "motor", "knee-17", "id", "2", "--yes"];
    let mut program = command(&words).spawn().expect("it starts");
    (0..6_000)
        .find(|_| sim.mgw(&["axes"]).stdout.contains("no axis is configured"))
        .expect("it is taken out of the configuration");
    program.kill().expect("it runs");
    program.wait().expect("it ends");
    let text = run("motor knee-17 id").failure(2);
    let (_, file) = text.split_once("`mgw config apply ").expect("what was before");
    let (file, _) = file.split_once('`').expect("a command");
    // The timeout of the motor may find nobody: what was before is there all the same.
    run(&format!("config apply {file}"));
    assert_eq!(run("config dump").success(), before);
}
