//! One run: the deeds, and what is checked after each.

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use mgw_client::host_protocol::{
    AxisParameter, AxisState, Event, GatewayParameter, StopTarget, Value,
};
use mgw_client::{Client, Transport, open};

use crate::Outcome;
use crate::cable::Cable;
use crate::programs::{self, AXIS, COUNTED_AXIS, Kind};
use crate::times::Times;
use crate::witness::Witness;

/// How much later than its bound something may come, of this computer's time.
const LATE: Duration = Duration::from_millis(5);
/// The silence of a host after which its axes trip.
const SILENCE: Duration = Duration::from_millis(250);
/// That of the gateway where a late trip is planted.
const PLANTED_SILENCE: Duration = Duration::from_millis(300);
/// The programs beside the one that stops, which is this one.
const PROGRAMS: [(Kind, usize); 4] =
    [(Kind::Commands, 1), (Kind::Watches, 27), (Kind::DoesNotRead, 1), (Kind::Floods, 2)];
/// Whatever is waited for comes within this time.
const PATIENCE: Duration = Duration::from_secs(10);
/// The memory of the server, KiB, at most.
const MEMORY_KIB: u64 = 64 * 1_024;

/// What a program has said.
#[derive(Default)]
struct Said {
    served: Option<Instant>,
    /// The number that was acknowledged last.
    acknowledged: u32,
    /// What it complains of.
    complaint: Option<String>,
}

struct Program {
    kind: Kind,
    process: Child,
    said: Arc<Mutex<Said>>,
}

/// A server, its gateway and its programs.
pub struct Run {
    socket: String,
    plant: String,
    cable: Cable,
    witness: Witness,
    reader: Client<Box<dyn Transport + Send>>,
    programs: Vec<Program>,
    servers: Vec<Child>,
    bound: Duration,
    stops: Times,
    reactions: Times,
    kills: Times,
    cuts: Times,
    back: Times,
    killed: usize,
}

impl Run {
    /// Starts everything. `plant`: the fault that must be noticed, or nothing.
    pub fn begin(mgw: PathBuf, plant: String) -> Outcome<Self> {
        let folder = std::env::temp_dir().join(format!("mgw-load-{}", std::process::id()));
        std::fs::create_dir_all(&folder)?;
        let socket = folder.join("mgw.sock").display().to_string();
        let address = TcpListener::bind("127.0.0.1:0")?.local_addr()?.to_string();
        let gateway = format!("tcp:{address}");
        let quietly = |arguments: &[&str]| {
            let mut command = Command::new(&mgw);
            command.args(arguments).env_remove("MGW_PORT").env("MGW_SOCKET", &socket);
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()
        };
        let sim = quietly(&["sim", "--listen", &address])?;
        let mut reader = Client::connect(until("the simulator", || open(&gateway).ok())?)?;
        let silence = if plant == "late-trip" { PLANTED_SILENCE } else { SILENCE };
        let us = |time: Duration| Value::Unsigned(u32::try_from(time.as_micros()).unwrap_or(0));
        let number = AxisParameter::TtlUs;
        reader.configure_gateway(GatewayParameter::LinkSilenceUs, us(silence))?;
        reader.configure_axis(AXIS, number, us(programs::TTL))?;
        reader.configure_axis(COUNTED_AXIS, number, Value::Unsigned(programs::FIRST))?;
        reader.release_authority()?;
        let cable = Cable::new(&address, plant == "late-stop")?;
        let server = quietly(&[
            "--port",
            &cable.name,
            "serve",
            "--listen",
            "127.0.0.1:0",
            "--socket",
            &socket,
        ])?;
        let witness = Witness::new(&gateway)?;
        let bound = bound(&mgw)?;
        let mut run = Self {
            socket: format!("unix:{socket}"),
            plant,
            cable,
            witness,
            reader,
            programs: Vec::new(),
            servers: vec![server, sim],
            bound,
            stops: Times::default(),
            reactions: Times::default(),
            kills: Times::default(),
            cuts: Times::default(),
            back: Times::default(),
            killed: 0,
        };
        until("the server", || Client::connect(open(&run.socket).ok()?).ok())?;
        for (kind, count) in PROGRAMS {
            for _ in 0..count {
                let program = run.start(kind, programs::FIRST)?;
                run.programs.push(program);
            }
        }
        Ok(run)
    }

    /// The end.
    pub fn kill_all(&mut self) {
        for child in self.programs.iter_mut().map(|one| &mut one.process).chain(&mut self.servers) {
            let _ = child.kill();
        }
    }

    fn start(&self, kind: Kind, number: u32) -> Outcome<Program> {
        let number = format!("{number}{}", if self.plant == "forgotten" { "+" } else { "" });
        let mut process = Command::new(std::env::current_exe()?)
            .args(["program", kind.name(), &self.socket, &number])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let said = Arc::new(Mutex::new(Said::default()));
        let lines = BufReader::new(process.stdout.take().ok_or("no output")?).lines();
        let hears = said.clone();
        thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let Ok(mut said) = hears.lock() else { return };
                match line.split_once(' ').unwrap_or((&line, "")) {
                    ("served", _) => said.served = Some(Instant::now()),
                    ("set", number) => said.acknowledged = number.parse().unwrap_or(u32::MAX),
                    _ => said.complaint = Some(line),
                }
            }
        });
        Ok(Program { kind, process, said })
    }

    /// Stops, kills and unplugs until then.
    pub fn go_on_until(&mut self, end: Instant) -> Outcome<()> {
        while Instant::now() < end {
            self.check_programs()?;
            match fastrand::u8(..8) {
                0..4 => self.stop()?,
                4..6 => self.kill_who_commands()?,
                6 => self.kill_another()?,
                _ => self.pull_the_cable()?,
            }
            self.check_acknowledged()?;
        }
        Ok(())
    }

    /// Waits until the axis moves, and some time more.
    fn moving(&self) -> Outcome<()> {
        until("motion", || (self.witness.state() == Some(AxisState::Active)).then_some(()))?;
        thread::sleep(Duration::from_millis(fastrand::u64(20..300)));
        Ok(())
    }

    /// A stop of one that watches.
    fn stop(&mut self) -> Outcome<()> {
        let mut program = Client::connect(open(&self.socket)?)?;
        self.moving()?;
        if self.witness.state() != Some(AxisState::Active) {
            return Ok(());
        }
        let asked = Instant::now();
        program.stop(StopTarget::Axis(AXIS))?;
        let passed = self.cable.stop_since(asked).ok_or("an answered stop was not on the cable")?;
        self.stops.note(passed - asked);
        if passed - asked > LATE {
            return Err(format!("a stop took {:?} through the server", passed - asked).into());
        }
        let is_it = |event: &Event| match *event {
            Event::StopConfirmed { axis: AXIS, reaction_us, .. } => Some(reaction_us),
            _ => None,
        };
        let reaction_us = until("an answered stop", || self.witness.since(asked, is_it))?.1;
        let reaction = Duration::from_micros(reaction_us.into());
        self.reactions.note(reaction);
        if reaction > self.bound {
            return Err(format!("a stop left after {reaction:?}, not {:?}", self.bound).into());
        }
        Ok(())
    }

    /// The time from the last word of who commanded until its axis has tripped.
    fn tripped_since(&self, then: Instant) -> Outcome<Duration> {
        let is_it =
            |event: &Event| matches!(event, Event::Tripped { axis: AXIS, .. }).then_some(());
        let (at, ()) = until("a trip", || self.witness.since(then, is_it))?;
        let after = at - self.cable.last_word();
        if after > SILENCE + LATE {
            return Err(format!("an axis tripped {after:?} after the last word for it").into());
        }
        Ok(after)
    }

    fn kill_who_commands(&mut self) -> Outcome<()> {
        self.moving()?;
        if self.witness.state() != Some(AxisState::Active) {
            return Ok(());
        }
        let then = Instant::now();
        self.programs[0].process.kill()?;
        self.programs[0].process.wait()?;
        let after = self.tripped_since(then)?;
        self.kills.note(after);
        self.killed += 1;
        self.check_acknowledged()?;
        let next = self.counted()? + 1;
        self.programs[0] = self.start(Kind::Commands, next)?;
        Ok(())
    }

    fn kill_another(&mut self) -> Outcome<()> {
        let place = fastrand::usize(1..self.programs.len());
        self.programs[place].process.kill()?;
        self.programs[place].process.wait()?;
        self.killed += 1;
        self.programs[place] = self.start(self.programs[place].kind, programs::FIRST)?;
        Ok(())
    }

    fn pull_the_cable(&mut self) -> Outcome<()> {
        self.moving()?;
        if self.witness.state() != Some(AxisState::Active) {
            return Ok(());
        }
        let then = Instant::now();
        self.cable.pull();
        let after = self.tripped_since(then)?;
        self.cuts.note(after);
        thread::sleep(Duration::from_millis(fastrand::u64(200..2_000)));
        self.cable.put_back();
        let back = Instant::now();
        until("a server that serves again", || Client::connect(open(&self.socket).ok()?).ok())?;
        self.back.note(back.elapsed());
        for program in self.programs.iter().filter(|one| one.kind == Kind::Watches) {
            let is_served = || {
                let said = program.said.lock().ok()?;
                said.served.filter(|at| *at > back).map(drop)
            };
            until("a program that is served again", is_served)?;
        }
        Ok(())
    }

    /// Every program is there and is served.
    fn check_programs(&mut self) -> Outcome<()> {
        for program in &mut self.programs {
            let name = program.kind.name();
            if let Some(status) = program.process.try_wait()? {
                return Err(format!("one that {name} has ended: {status}").into());
            }
            let said = program.said.lock().map_err(|_| "a thread has failed")?;
            if let Some(complaint) = &said.complaint {
                return Err(format!("one that {name}: {complaint}").into());
            }
            if said.served.is_some_and(|at| at.elapsed() > PATIENCE) {
                return Err(format!("one that {name} is not served").into());
            }
        }
        for server in &mut self.servers {
            if let Some(status) = server.try_wait()? {
                return Err(format!("the server or the simulator has ended: {status}").into());
            }
        }
        Ok(())
    }

    /// What the gateway has of what is counted in its configuration.
    fn counted(&mut self) -> Outcome<u32> {
        match self.reader.read_axis_parameter(COUNTED_AXIS, AxisParameter::TtlUs)? {
            Some(Value::Unsigned(number)) => Ok(number),
            other => Err(format!("the counted parameter is {other:?}").into()),
        }
    }

    /// What was acknowledged is there, and nothing that was not asked for.
    fn check_acknowledged(&mut self) -> Outcome<()> {
        let acknowledged =
            |run: &Self| run.programs[0].said.lock().map_or(0, |said| said.acknowledged);
        let least = acknowledged(self);
        let counted = self.counted()?;
        // The next one may be under way, or acknowledged and not told of yet.
        thread::sleep(Duration::from_millis(20));
        let most = acknowledged(self).max(programs::FIRST) + 1;
        if least > counted || (counted > most && least > 0) {
            return Err(format!("{least} to {most} were acknowledged, {counted} is there").into());
        }
        self.reader.ping()?;
        Ok(())
    }

    fn memory_kib(&self) -> Outcome<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.servers[0].id()))?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        Ok(line.and_then(|line| line.split_whitespace().next()).ok_or("no memory")?.parse()?)
    }

    /// Nothing is wrong in the end, and everything has happened once.
    pub fn check_end(&mut self) -> Outcome<()> {
        self.check_programs()?;
        self.check_acknowledged()?;
        self.witness.check()?;
        let memory = self.memory_kib()?;
        if memory > MEMORY_KIB {
            return Err(format!("the server has {memory} KiB").into());
        }
        for (what, times) in [
            ("stop", &self.stops),
            ("kill of who commands", &self.kills),
            ("cable out", &self.cuts),
        ] {
            if times.count() == 0 {
                return Err(format!("no {what} in all that time: let it run for longer").into());
            }
        }
        Ok(())
    }

    /// What came of it, as a table.
    pub fn print(&self, span: Duration) {
        let count: usize = PROGRAMS.iter().map(|(_, count)| count).sum();
        let said = self.programs.first().and_then(|one| Some(one.said.lock().ok()?.acknowledged));
        println!("{} programs for {:.0} s", count + 1, span.as_secs_f32());
        println!("{} killed (kill -9), the cable out {} times", self.killed, self.cuts.count());
        let late = format!("at most {LATE:?} late");
        for (what, times, bound) in [
            ("stop, from its write to the cable", &self.stops, late.clone()),
            ("stop, from the gateway to its bus", &self.reactions, format!("{:?}", self.bound)),
            ("killed in command, last word to trip", &self.kills, format!("{SILENCE:?}, {late}")),
            ("cable out, last word to trip", &self.cuts, format!("{SILENCE:?}, {late}")),
            ("cable in, until one more is served", &self.back, "none".into()),
        ] {
            println!("{what:37} {times}   bound: {bound}");
        }
        println!("numbers acknowledged: {}", said.unwrap_or(0).saturating_sub(programs::FIRST));
        println!("memory of the server: {} KiB", self.memory_kib().unwrap_or(0));
    }
}

/// Within what time a stop of the axis leaves the gateway, as `mgw plan` says.
fn bound(mgw: &Path) -> Outcome<Duration> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../cli/examples/four-motors.toml");
    let planned = Command::new(mgw).args(["--json", "plan", file]).output()?;
    let planned = String::from_utf8(planned.stdout)?;
    let of_axis = planned.split_once("\"axis\":0,").ok_or("no plan")?.1;
    let bound = of_axis.split_once("\"stop_together_us\":").ok_or("no bound")?.1;
    let digits: String = bound.chars().take_while(char::is_ascii_digit).collect();
    Ok(Duration::from_micros(digits.parse()?))
}

/// Looks again and again.
fn until<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> Outcome<T> {
    let begin = Instant::now();
    loop {
        if let Some(found) = look() {
            return Ok(found);
        }
        if begin.elapsed() > PATIENCE {
            return Err(format!("waited {PATIENCE:?} for {what}").into());
        }
        thread::sleep(Duration::from_millis(2));
    }
}
