//! From the box to the first turn on the image: commands by the code of `mgw`, in virtual time, and
//! docs/first-turn as printed, whose steps are done to the board and its motors.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::Duration;

use mgw_cli::{factory_motors, print_on};
use mgw_client::Interrupt;
use mgw_sim::{Injection, MotorEvent};
use virtual_board::machine::{CanPort, Machine};
use virtual_board::outside::Outside;
use virtual_board::transport::BoardTransport;
use virtual_stm32::fdcan::{FrameEnd, Sender};

use crate::gaps;
use crate::lab::SEED;
use crate::typed::{Typed, all_typed, is_printed};

const GUIDE: &str = include_str!("../../../../docs/first-turn/README.md");
/// Nobody types faster than that.
const TYPING: Duration = Duration::from_millis(50);
/// For how long a command is typed again because a motor still runs out.
const PATIENCE: Duration = Duration::from_secs(10);

/// A board with motors from their boxes, and who types.
struct Table {
    machine: Rc<RefCell<Machine>>,
    outside: Outside,
    files: PathBuf,
}

impl Table {
    /// With the motors of an `mgw sim`.
    fn set(sim: &[&str]) -> Self {
        let (motors, injections) = factory_motors(sim).expect("the simulation comes first");
        let mut board = Machine::builder();
        let outside = Outside::connect(&mut board, &motors, SEED).expect("a sound wiring");
        let mut machine = board.power_on();
        for (motor, injection) in injections {
            outside.inject(&mut machine, motor, injection);
        }
        let name = format!("first-turn-{}-{}", std::process::id(), motors.len());
        let files = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&files).expect("a directory");
        Self { machine: Rc::new(RefCell::new(machine)), outside, files }
    }

    fn file(&self, word: &str) -> String {
        let is_file = Path::new(word).extension().is_some_and(|end| end == "toml");
        let path = if is_file { self.files.join(word) } else { word.into() };
        path.to_str().expect("text").to_owned()
    }

    /// A command of `mgw`, which has to succeed; what it prints.
    fn mgw(&self, words: &[&str]) -> String {
        let typed: Vec<String> = words.iter().map(|word| self.file(word)).collect();
        let typed: Vec<&str> = typed.iter().map(String::as_str).collect();
        let end = self.machine.borrow().now() + PATIENCE;
        loop {
            self.run_for(TYPING);
            let host = self.outside.hosts[0];
            self.machine.borrow_mut().line(host).clear();
            let transport = Box::new(BoardTransport::new(&self.machine, host));
            let (outcome, printed) = print_on(transport, Interrupt::default(), &typed);
            let runs_out = outcome
                .failure
                .as_ref()
                .is_some_and(|(_, text)| text.contains("let it come to a standstill first"));
            if !runs_out || self.machine.borrow().now() >= end {
                assert_eq!(outcome.failure, None, "`mgw {}`: {printed}", words.join(" "));
                return printed.replace(&format!("{}/", self.files.display()), "");
            }
        }
    }

    /// A line for the window of the simulator.
    fn step(&self, line: &str) {
        self.run_for(TYPING);
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut machine = self.machine.borrow_mut();
        match words.as_slice() {
            ["power", "off"] => machine.power_off(),
            ["power", "on"] => machine.power_on(),
            ["motor", motor, rest @ ..] => {
                let motor: usize = motor.parse().expect("a number");
                let injection = match rest {
                    // Without its supply it hears nothing.
                    ["power", state] => {
                        self.outside.power_cycle(&mut machine, motor);
                        Some(Injection::Unplugged(*state == "off"))
                    }
                    [name] => Injection::switch(name, true),
                    [name, "off"] => Injection::switch(name, false),
                    _ => None,
                };
                let injection = injection.unwrap_or_else(|| panic!("{line}"));
                self.outside.inject(&mut machine, motor, injection);
            }
            _ => panic!("{line}"),
        }
    }

    fn run_for(&self, duration: Duration) {
        self.machine.borrow_mut().run_for(duration);
    }

    /// Which motors have moved since an instant.
    fn moved(&self, since: Duration) -> Vec<usize> {
        let mut machine = self.machine.borrow_mut();
        let mut moved = |motor: &usize| {
            let log = self.outside.motor(&mut machine, *motor).log();
            log.entries().any(|entry| {
                u128::from(entry.time_us) >= since.as_micros()
                    && matches!(entry.what, MotorEvent::Moving { .. })
            })
        };
        (0..self.outside.motors()).filter(|motor| moved(motor)).collect()
    }
}

/// No test may meet a gap of the emulator that nobody knows.
impl Drop for Table {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.files);
        if !std::thread::panicking() {
            let met = gaps::met(&mut self.machine.borrow_mut());
            gaps::check_known(&met, gaps::known()).unwrap_or_else(|error| panic!("{error}"));
        }
    }
}

/// The guide's buses are those of the NUCLEO-H743ZI: its third is the line.
mod only_h743 {
    use super::*;

    #[test]
    fn the_guide_turns_six_motors_from_the_box_and_again_after_a_loss_of_power() {
        let mut all = all_typed(GUIDE).into_iter();
        let Some(Typed::Command(sim, _)) = all.next() else { panic!("the simulation comes first") };
        let table = Table::set(&sim);
        let (mut powered, mut sets, mut losses) = (Duration::ZERO, 0, 0);
        for typed in all {
            match typed {
                Typed::Simulator(line) => {
                    if line == "power off" {
                        assert_eq!(table.moved(powered), [0, 1, 2, 3, 4, 5]);
                        losses += 1;
                    }
                    table.step(line);
                    if line == "power on" {
                        (powered, sets) = (table.machine.borrow().now(), 0);
                    }
                }
                Typed::Command(words, wanted) => {
                    let motion = words[0] == "set";
                    if motion && sets == 0 {
                        assert_eq!(
                            table.moved(powered),
                            [] as [usize; 0],
                            "before the first `set`"
                        );
                    }
                    sets += usize::from(motion);
                    let printed = table.mgw(&words);
                    for line in wanted {
                        let is_printed = is_printed(line, &printed);
                        assert!(is_printed, "`mgw {}`:\n{line}\n{printed}", words.join(" "));
                    }
                }
            }
        }
        assert_eq!((table.moved(powered), losses, sets), (vec![0, 1, 2, 3, 4, 5], 1, 6));
    }

    /// A motor has the bitrate that it was told once it is switched on again, not before.
    #[test]
    fn motors_that_are_told_another_bitrate_are_found_there() {
        let table =
            Table::set(&["sim", "--motor", "0:rmd:1:v4_4", "--motor", "2:rmd:1:v3_9@500000"]);
        for (motor, place, old, new) in
            [(0, "0:1", 1_000_000, 500_000), (1, "2:rmd:1", 500_000, 115_200)]
        {
            let (before, after) = (format!("{place}@{old}"), format!("{place}@{new}"));
            table.mgw(&["motor", &before, "bitrate", &new.to_string(), "--yes"]);
            table.mgw(&["motor", &before, "pid"]);
            table.step(&format!("motor {motor} power off"));
            table.step(&format!("motor {motor} power on"));
            let printed = table.mgw(&["motor", &after, "bitrate"]);
            assert!(printed.contains(&format!("bitrate_bit_s = {new}\n")), "{printed}");
        }
        assert_eq!(table.moved(Duration::ZERO), [] as [usize; 0]);
    }
}

/// One of two motors at 500 kbit/s sends by itself, and the other acknowledges that.
#[test]
fn a_scan_at_a_wrong_bitrate_asks_nothing_and_destroys_no_frame() {
    let table = Table::set(&["sim", "--motor", "0:rmd:1@500000", "--motor", "0:rmd:2@500000"]);
    table.outside.inject(&mut table.machine.borrow_mut(), 0, Injection::ActiveReplies(true));
    let printed = table.mgw(&["scan", "0@1000000,250000"]);
    assert!(printed.contains("bus 0 is not asked: something sends there"), "{printed}");
    let log = table.machine.borrow_mut().can_mut(CanPort::Bus0).take_log();
    assert!(log.len() > 20, "{} frames", log.len());
    for record in log {
        assert_eq!((record.sender, record.outcome), (Sender::Node(0), FrameEnd::Acknowledged));
    }
    // At its own bitrate it is heard, and only there it is asked.
    let printed = table.mgw(&["scan", "0@1000000,500000"]);
    let found =
        |node| printed.lines().any(|line| is_printed(&format!("0  500000  rmd {node}"), line));
    assert!(found(1) && found(2), "{printed}");
    let log = table.machine.borrow_mut().can_mut(CanPort::Bus0).take_log();
    assert!(log.iter().any(|record| record.sender == Sender::Controller));
    assert!(log.iter().all(|record| record.outcome == FrameEnd::Acknowledged), "{log:?}");
}
