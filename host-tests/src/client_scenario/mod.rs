//! Scenarios of the host's side: a command of `mgw` on a line with faults, in virtual time.
//! `client-scenarios/README.md` lists the steps.
//!
//! The command is the program's own code, the gateway and its motors are the simulator's. The seed
//! draws what is lost when, when exactly something happens, and how long each motor takes to
//! answer; the outcome must hold for every seed.

mod action;
mod channel;
mod expect;
mod forge;
mod image;
mod line;

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use mgw_cli::{Outcome, run_on};
use mgw_client::{Client, Interrupt};
use mgw_sim::{Injection, SimTransport, TraceEntry, Wiring, World};

use crate::scenario::words::{duration, motor, parse, without_comment};
use action::{Action, Moment};
use image::ImageFile;
use line::{Line, Wire};

/// The link over which the gateway is set up and looked at.
const CLEAN_LINK: u8 = 1;
/// How much later than at its best a motor may answer, µs.
const REPLY_JITTER_US: u64 = 1_500;
/// What the four motors are configured with.
const CONFIGURATION: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../host/cli/examples/four-motors.toml");

/// A gateway, its motors, and the line under test.
struct Bench {
    world: Rc<RefCell<World>>,
    line: Rc<RefCell<Line>>,
    /// How the last command ended, and how long it took.
    outcome: Option<(Outcome, Duration)>,
    /// What was on the buses while it ran.
    trace: Vec<TraceEntry>,
    /// The file that the word `IMAGE` of a command means.
    image: Option<ImageFile>,
}

/// Plays a scenario with one seed.
///
/// # Errors
/// The line that was wrong, what was expected, and what the program wrote.
pub fn run(text: &str, seed: u64) -> Result<(), String> {
    let lines = (1..).zip(text.lines());
    let words = |line| without_comment(line).split_whitespace().collect::<Vec<&str>>();
    let lines = lines.map(|(number, line)| (number, line, words(line)));
    let mut steps = lines.filter(|(_, _, words)| !words.is_empty()).peekable();
    // What hangs on the buses must be known before the world begins.
    let mut wiring = Wiring { seed, ..Wiring::four_motors() };
    while let Some((number, line, words)) =
        steps.next_if(|(_, _, words)| words.first() == Some(&"motor"))
    {
        wiring =
            motor(wiring, &words).map_err(|error| format!("line {number}: {line}\n  {error}"))?;
    }
    let mut bench = Bench::new(wiring, seed)?;
    for (number, line, words) in steps {
        bench
            .step(&words)
            .map_err(|error| format!("line {number}: {line}\n  {error}\n{}", bench.report()))?;
    }
    Ok(())
}

impl Bench {
    fn new(wiring: Wiring, seed: u64) -> Result<Self, String> {
        // The client library draws the numbers of its sessions.
        fastrand::seed(seed);
        let world = World::try_new(wiring).map_err(|e| e.to_string())?;
        let world = Rc::new(RefCell::new(world));
        let line = Rc::new(RefCell::new(Line::new(world.clone(), seed)));
        let motors = world.borrow().motors().len();
        for motor in 0..motors {
            let jitter = Duration::from_micros(line.borrow_mut().random.u64(..REPLY_JITTER_US));
            world.borrow_mut().inject(motor, Injection::ReplyJitter(jitter));
        }
        let mut bench = Self { world, line, outcome: None, trace: Vec::new(), image: None };
        bench.set_up(&["config", "apply", CONFIGURATION])?;
        Ok(bench)
    }

    fn step(&mut self, words: &[&str]) -> Result<(), String> {
        let rest = words.get(1..).unwrap_or_default();
        match words.first() {
            Some(&"setup") => self.set_up(rest),
            Some(&"mgw") => self.command(rest),
            Some(&"wait") => {
                let mut line = self.line.borrow_mut();
                let until = line.now() + duration(words, 1)?;
                line.advance(until, false);
                Ok(())
            }
            Some(&"mute") => {
                self.world.borrow_mut().inject(parse(words, 1, "motor")?, Injection::Mute(true));
                Ok(())
            }
            Some(&"dialect") => {
                let dialect = Injection::RmdDialect(parse(words, 2, "dialect")?);
                self.world.borrow_mut().inject(parse(words, 1, "motor")?, dialect);
                Ok(())
            }
            Some(&"ignore-stop") => {
                self.world
                    .borrow_mut()
                    .inject(parse(words, 1, "motor")?, Injection::IgnoreStop(true));
                Ok(())
            }
            Some(&"at" | &"when") => {
                let (moment, rest) = Moment::parse(words)?;
                self.line.borrow_mut().plan(moment, Action::parse(rest)?);
                Ok(())
            }
            Some(&"image") => {
                self.image = Some(ImageFile::new(&self.world, words.get(1).unwrap_or(&""))?);
                Ok(())
            }
            Some(&"baud") => {
                self.line.borrow_mut().wanted_baud = Some(parse(words, 1, "rate")?);
                Ok(())
            }
            Some(&"expect") => self.expect(rest),
            _ => {
                self.line.borrow_mut().happen(&Action::parse(words)?);
                Ok(())
            }
        }
    }

    /// Runs a command of `mgw` on a clean line, where it must succeed.
    fn set_up(&mut self, arguments: &[&str]) -> Result<(), String> {
        let transport = Box::new(SimTransport::new(self.world.clone(), CLEAN_LINK));
        match run_on(transport, Interrupt::default(), arguments) {
            Outcome { exit_code: 0, .. } => Ok(()),
            outcome => Err(format!("{outcome:?}")),
        }
    }

    /// Runs a command of `mgw` on the line under test.
    fn command(&mut self, arguments: &[&str]) -> Result<(), String> {
        self.line.borrow_mut().begin();
        // What came before it is not its own.
        self.world.borrow_mut().trace();
        let interrupt = self.line.borrow().interrupt.clone();
        let image = self.image.as_ref().map_or("IMAGE", ImageFile::path);
        let mut arguments = arguments.to_vec();
        arguments.iter_mut().filter(|word| **word == "IMAGE").for_each(|word| *word = image);
        let outcome = run_on(Box::new(Wire(self.line.clone())), interrupt, &arguments);
        self.trace = self.world.borrow_mut().trace();
        let line = self.line.borrow();
        self.outcome = Some((outcome, line.elapsed()));
        match line.still_to_come() {
            Some(action) => Err(format!("{action:?} never happened: {:?}", self.outcome)),
            None => Ok(()),
        }
    }

    /// A client on a clean line.
    fn observer(&self) -> Result<Client<SimTransport>, String> {
        Client::connect(SimTransport::new(self.world.clone(), CLEAN_LINK))
            .map_err(|e| e.to_string())
    }

    /// What the program wrote, and what happened meanwhile.
    fn report(&self) -> String {
        let line = self.line.borrow();
        let ms = |at: Duration| at.as_secs_f64() * 1e3;
        let mut text = format!("  {:?}\n", self.outcome);
        let mut marks = line.marks.iter().peekable();
        let mut last: Option<(&str, Duration, Duration, usize)> = None;
        let flush = |last: &mut Option<(&str, Duration, Duration, usize)>, text: &mut String| {
            if let Some((name, from, to, count)) = last.take() {
                let many = if count > 1 {
                    format!(" … {:.1} ms, {count} in all", ms(to))
                } else {
                    String::new()
                };
                text.push_str(&format!("  {:10.1} ms  {name}{many}\n", ms(from)));
            }
        };
        for (index, written) in line.written.iter().enumerate() {
            while let Some(mark) = marks.next_if(|mark| mark.written <= index) {
                flush(&mut last, &mut text);
                text.push_str(&format!("  {:10.1} ms  * {}\n", ms(mark.at), mark.name));
            }
            match &mut last {
                Some((name, _, to, count)) if *name == written.name => {
                    (*to, *count) = (written.at, *count + 1)
                }
                _ => {
                    flush(&mut last, &mut text);
                    last = Some((written.name, written.at, written.at, 1));
                }
            }
        }
        flush(&mut last, &mut text);
        for mark in marks {
            text.push_str(&format!("  {:10.1} ms  * {}\n", ms(mark.at), mark.name));
        }
        for motor in self.world.borrow().motors() {
            let entries: Vec<String> = motor
                .log()
                .entries()
                .filter(|entry| Duration::from_micros(entry.time_us) >= line.began())
                .map(|entry| {
                    format!("{:.1} {}", entry.time_us as f64 / 1e3 - ms(line.began()), entry.what)
                })
                .collect();
            let shown = entries.len().saturating_sub(12);
            text.push_str(&format!(
                "  {motor}: {}\n",
                entries.get(shown..).unwrap_or_default().join("; ")
            ));
        }
        text
    }
}
