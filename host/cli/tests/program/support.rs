//! The program as a user runs it: its output, its exit code, and a simulated gateway beside it.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use host_protocol::{Deframer, MAX_FRAME, Reply, Request};
use nix::sys::signal::{self, Signal};
use nix::unistd::Pid;
use serde_json::Value;

use crate::schema;

/// No test waits longer than this for anything.
pub const LIMIT: Duration = Duration::from_secs(180);

/// A configuration of the simulated gateway.
pub const FOUR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/four-motors.toml");

/// What a run of the program left behind.
#[derive(Debug)]
pub struct Outcome {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Outcome {
    /// Asserts success and returns standard output.
    pub fn success(self) -> String {
        assert_eq!(self.code, Some(0), "{self:?}");
        self.stdout
    }

    /// Asserts success and reads each line as JSON that the schema allows.
    pub fn json_lines(self) -> Vec<Value> {
        self.success().lines().map(json).collect()
    }

    /// Reads each line of `mgw decode --json`, and asserts that the exit code says whether one has
    /// an error.
    pub fn decoded(self) -> Vec<Value> {
        let lines: Vec<Value> = self.stdout.lines().map(json).collect();
        let failed = lines.iter().any(|line| line["error"].is_string());
        assert_eq!(self.code, Some(i32::from(failed)), "{}", self.stderr);
        lines
    }

    /// Asserts that it failed with this exit code, printed nothing of a panic, and returns standard
    /// error.
    pub fn failure(self, code: i32) -> String {
        assert_eq!(self.code, Some(code), "{self:?}");
        assert!(!self.stderr.contains("panicked"), "{self:?}");
        assert!(!self.stderr.is_empty(), "{self:?}");
        self.stderr
    }
}

/// A line of JSON that the schema allows.
pub fn json(line: &str) -> Value {
    let line = serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"));
    schema::check(&line);
    line
}

/// A folder that ends with its test.
struct StateHome(PathBuf);

impl Drop for StateHome {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Where the program keeps what it remembers: each test in a place of its own.
pub fn state_home() -> PathBuf {
    thread_local! {
        static HOME: StateHome = {
            let test = format!("{:?}", thread::current().id()).replace(['(', ')'], "-");
            let name = format!("mgw-state-{}-{test}", std::process::id());
            StateHome(std::env::temp_dir().join(name))
        };
    }
    HOME.with(|home| home.0.clone())
}

/// A file or a folder of this test alone, which is not there and ends with the test.
pub fn file(name: &str) -> String {
    let home = state_home();
    std::fs::create_dir_all(&home).expect("a folder");
    let path = home.join(name);
    let _ = std::fs::remove_file(&path);
    path.to_str().expect("text").to_owned()
}

/// The program, its pipes open.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mgw"));
    command
        .args(arguments)
        .env_remove("MGW_PORT")
        .env("MGW_SOCKET", "")
        .env_remove("MGW_TOKEN")
        .env("XDG_STATE_HOME", state_home())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// Runs the program to its end.
pub fn mgw(arguments: &[&str]) -> Outcome {
    outcome(arguments, Running(command(arguments).spawn().expect("the program starts")))
}

/// Runs the program to its end with these in its environment.
pub fn outcome_of(arguments: &[&str], environment: &[(&str, &str)]) -> Outcome {
    let mut command = command(arguments);
    command.envs(environment.iter().copied());
    outcome(arguments, Running(command.spawn().expect("the program starts")))
}

/// Runs the program to its end with this on standard input.
pub fn mgw_reading(arguments: &[&str], input: impl Into<Vec<u8>>) -> Outcome {
    let mut child = command(arguments).stdin(Stdio::piped()).spawn().expect("the program starts");
    let (mut stdin, input) = (child.stdin.take().unwrap(), input.into());
    // A program that ends before it has read everything is no failure here.
    thread::spawn(move || stdin.write_all(&input));
    outcome(arguments, Running(child))
}

/// Runs the program to its end with this on standard input, reads so many lines of its output and
/// closes the pipe, as `head` does.
pub fn mgw_cut_short(arguments: &[&str], input: impl Into<Stdio>, lines: usize) -> Outcome {
    let child = command(arguments).stdin(input).spawn().expect("the program starts");
    let mut child = Running(child);
    let stdout = BufReader::new(child.0.stdout.take().unwrap());
    let stdout = stdout.lines().take(lines).map(|line| line.expect("text") + "\n").collect();
    let stderr = read_to_end(child.0.stderr.take().unwrap());
    let stderr =
        stderr.recv_timeout(LIMIT).unwrap_or_else(|_| panic!("{arguments:?} does not end"));
    Outcome { code: child.0.wait().expect("it has ended").code(), stdout, stderr }
}

fn outcome(arguments: &[&str], mut child: Running) -> Outcome {
    let stdout = read_to_end(child.0.stdout.take().unwrap());
    let stderr = read_to_end(child.0.stderr.take().unwrap());
    let text = |pipe: Receiver<String>| {
        pipe.recv_timeout(LIMIT).unwrap_or_else(|_| panic!("{arguments:?} does not end"))
    };
    let (stdout, stderr) = (text(stdout), text(stderr));
    let code = child.0.wait().expect("it has ended").code();
    Outcome { code, stdout, stderr }
}

fn read_to_end(mut pipe: impl Read + Send + 'static) -> Receiver<String> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = pipe.read_to_end(&mut bytes);
        sender.send(String::from_utf8_lossy(&bytes).into_owned())
    });
    receiver
}

/// A process that ends with its test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn lines_of(pipe: impl Read + Send + 'static) -> Receiver<String> {
    let (sender, lines) = channel();
    thread::spawn(move || {
        BufReader::new(pipe).lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
    });
    lines
}

/// A process whose lines are read while it runs.
pub struct Process {
    running: Running,
    stdin: Option<ChildStdin>,
    lines: Receiver<String>,
}

impl Process {
    pub fn start(arguments: &[&str]) -> Self {
        let mut command = command(arguments);
        command.stdin(Stdio::piped()).stderr(Stdio::inherit());
        let mut child = command.spawn().expect("the program starts");
        let stdin = child.stdin.take();
        let lines = lines_of(child.stdout.take().unwrap());
        Self { running: Running(child), stdin, lines }
    }

    /// One that tells on standard error, too, when it is ready; the line of that for which `find`
    /// finds something.
    pub fn start_until<T>(
        mut command: Command,
        what: &str,
        find: impl Fn(&str) -> Option<T>,
    ) -> (Self, T) {
        let mut child = command.stderr(Stdio::piped()).spawn().expect("the program starts");
        let said = lines_of(child.stderr.take().unwrap());
        let mut process = Self { running: Running(child), stdin: None, lines: said };
        let found = process.wait_for(what, find);
        process.lines = lines_of(process.running.0.stdout.take().unwrap());
        (process, found)
    }

    /// One that prints elsewhere; its lines are those of standard error.
    #[cfg(target_os = "linux")]
    pub fn printing_to(stdout: impl Into<Stdio>, arguments: &[&str]) -> Self {
        let mut child = command(arguments).stdout(stdout).spawn().expect("the program starts");
        let lines = lines_of(child.stderr.take().unwrap());
        Self { running: Running(child), stdin: None, lines }
    }

    /// The next line for which `find` finds something, and that.
    pub fn wait_for<T>(&self, what: &str, find: impl Fn(&str) -> Option<T>) -> T {
        let end = Instant::now() + LIMIT;
        let mut seen = Vec::new();
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let Ok(line) = self.lines.recv_timeout(left) else {
                panic!("{what} was never printed; these were:\n{}", seen.join("\n"));
            };
            if let Some(found) = find(&line) {
                return found;
            }
            seen.push(line);
        }
    }

    /// Until a state that it prints as JSON is one of motion.
    pub fn await_motion(&self) {
        self.wait_for("motion", |line| {
            let state: Value = serde_json::from_str(line).ok()?;
            state["velocity_rad_s"]["value"].as_f64().filter(|speed| speed.abs() > 0.5)
        });
    }

    /// The first line of those printed by now for which `find` finds something, and that.
    pub fn line_that<T>(&self, find: impl Fn(&str) -> Option<T>) -> Option<T> {
        self.lines.try_iter().find_map(|line| find(&line))
    }

    /// A line that is typed.
    pub fn type_line(&mut self, line: &str) {
        let stdin = self.stdin.as_mut().expect("its standard input is a pipe");
        writeln!(stdin, "{line}").expect("it is read");
    }

    /// The number of the process.
    pub fn id(&self) -> u32 {
        self.running.0.id()
    }

    /// SIGINT, as Ctrl-C sends it, and the exit code that follows.
    pub fn interrupt(&mut self) -> Option<i32> {
        self.signal(Signal::SIGINT)
    }

    /// A signal, and the exit code that follows.
    pub fn signal(&mut self, signal: Signal) -> Option<i32> {
        self.send(signal);
        self.wait()
    }

    fn send(&self, signal: Signal) {
        let id = self.running.0.id().cast_signed();
        signal::kill(Pid::from_raw(id), signal).expect("it is there");
    }

    /// A signal again and again until it ends, and how.
    #[cfg(target_os = "linux")]
    pub fn insist(&mut self, signal: Signal) -> std::process::ExitStatus {
        let end = Instant::now() + LIMIT;
        loop {
            self.send(signal);
            match self.lines.recv_timeout(Duration::from_millis(100)) {
                Err(RecvTimeoutError::Disconnected) => break,
                _ => assert!(Instant::now() < end, "it does not end"),
            }
        }
        self.running.0.wait().expect("it ends")
    }

    /// The exit code once it has ended by itself.
    pub fn wait(&mut self) -> Option<i32> {
        // Its output ends when it does.
        loop {
            match self.lines.recv_timeout(LIMIT) {
                Ok(_) => {}
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => panic!("it does not end"),
            }
        }
        self.running.0.wait().expect("it ends").code()
    }

    /// SIGKILL: the process has no time for anything.
    pub fn kill(&mut self) {
        self.running.0.kill().expect("it runs");
        self.running.0.wait().expect("it was killed");
    }
}

/// What a host is told for which there is no link.
const LINKS_TAKEN: &str = "all host links are taken";

/// Repeats a command as long as it fails for a reason that passes.
fn mgw_despite(port: &str, passing: &str, arguments: &[&str]) -> Outcome {
    let end = Instant::now() + LIMIT;
    loop {
        let outcome = mgw(&[&["--port", port], arguments].concat());
        if !outcome.stderr.contains(passing) || Instant::now() >= end {
            return outcome;
        }
    }
}

/// A gateway for one session that answers by `reply`; how it is reached.
pub fn scripted_gateway(reply: impl Fn(&Request) -> Reply + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut deframer = Deframer::new();
        let mut bytes = [0; 512];
        while let Ok(length @ 1..) = stream.read(&mut bytes) {
            for byte in &bytes[..length] {
                let Some(Ok(frame)) = deframer.push(*byte) else { continue };
                let Ok(request) = Request::decode(frame.number, frame.body) else { continue };
                let mut out = [0; MAX_FRAME];
                let length = reply(&request).encode_frame(frame.sequence, &mut out).unwrap();
                stream.write_all(&out[..length]).unwrap();
            }
        }
    });
    port
}

/// `mgw sim` on a port of its own.
pub struct Sim {
    pub process: Process,
    pub port: String,
}

impl Sim {
    pub fn start() -> Self {
        Self::with(&[])
    }

    /// One whose axes and link bear that this machine holds a process up for a while.
    pub fn patient() -> Self {
        Self::with_times(10_000_000, 10_000_000)
    }

    /// One with these times to live of setpoints, and this silence of the link that ends authority,
    /// in µs.
    pub fn with_times(ttl_us: u32, link_silence_us: u32) -> Self {
        let sim = Self::start();
        sim.mgw(&["config", "gateway", &format!("link_silence_us={link_silence_us}")]).success();
        for axis in ["0", "1", "2", "3"] {
            sim.mgw_once_in_command(&["config", "axis", axis, &format!("ttl_us={ttl_us}")])
                .success();
        }
        sim
    }

    pub fn with(arguments: &[&str]) -> Self {
        let process = Process::start(&[&["sim", "--listen", "127.0.0.1:0"], arguments].concat());
        let port = process
            .wait_for("the port", |line| line.strip_prefix("listening on ").map(str::to_owned));
        assert!(port.starts_with("tcp:127.0.0.1:") && !port.ends_with(":0"), "{port}");
        Self { process, port }
    }

    /// Runs the program against it.
    pub fn mgw(&self, arguments: &[&str]) -> Outcome {
        mgw(&[&["--port", &self.port], arguments].concat())
    }

    /// Leaves an axis that has these parameters only, lines of a file, as a program may.
    pub fn half_configure(&self, axis: u8, parameters: &str) {
        let text = format!("[[axis]]\naxis = {axis}\nincomplete = true\n{parameters}");
        let end = Instant::now() + LIMIT;
        loop {
            let merge = ["--port", &self.port, "config", "apply", "--merge", "-"];
            let outcome = mgw_reading(&merge, text.as_str());
            if !outcome.stderr.contains("is in command") || Instant::now() >= end {
                return drop(outcome.success());
            }
        }
    }

    /// Until this motor itself says that it has stopped, and not the gateway.
    pub fn await_stop(&self, motor: &str) {
        self.process.wait_for("the motor's stop", |line| {
            let is_it =
                line.starts_with("t=") && line.contains(motor) && line.contains("  stopped");
            is_it.then_some(())
        });
    }

    /// Types a line into the simulator, and waits until it has done that.
    pub fn typed(&mut self, line: &str) {
        self.process.type_line(line);
        self.process.wait_for(line, |said| said.ends_with(line).then_some(()));
    }

    /// Runs the program against it with these words as soon as nobody else is in command.
    pub fn once(&self, words: &str) -> Outcome {
        self.mgw_once_in_command(&words.split(' ').collect::<Vec<_>>())
    }

    /// Repeats a command that needs authority until a host that has gone no longer holds it.
    pub fn mgw_once_in_command(&self, arguments: &[&str]) -> Outcome {
        self.mgw_despite("is in command", arguments)
    }

    /// Repeats such a command as long as a motor runs out, too.
    pub fn mgw_once_at_rest(&self, arguments: &[&str]) -> Outcome {
        let end = Instant::now() + LIMIT;
        loop {
            let outcome = self.mgw_once_in_command(arguments);
            let turns = outcome.stderr.contains("let it come to a standstill first");
            if !turns || Instant::now() >= end {
                return outcome;
            }
        }
    }

    /// Runs a command, and beside it `meanwhile` as soon as an axis is in one of these states.
    pub fn mgw_beside(
        &self,
        arguments: &[&str],
        axis: &str,
        states: &[&str],
        meanwhile: impl FnOnce(),
    ) -> Outcome {
        let port = &self.port;
        thread::scope(|scope| {
            let command = scope.spawn(move || mgw_despite(port, LINKS_TAKEN, arguments));
            let end = Instant::now() + LIMIT;
            loop {
                let outcome = self.mgw_once_connected(&["--json", "state", axis]);
                // A busy machine may keep the axis busy for as long as it is waited for.
                let axes = outcome.stdout.lines().next().map(json).unwrap_or_default();
                if states.iter().any(|state| axes["axes"][0]["state"] == *state) {
                    break;
                }
                assert!(Instant::now() < end, "axis {axis}: {outcome:?}");
            }
            meanwhile();
            command.join().expect("it runs")
        })
    }

    /// Repeats a command until one of the host links is free for it.
    pub fn mgw_once_connected(&self, arguments: &[&str]) -> Outcome {
        self.mgw_despite(LINKS_TAKEN, arguments)
    }

    fn mgw_despite(&self, passing: &str, arguments: &[&str]) -> Outcome {
        mgw_despite(&self.port, passing, arguments)
    }

    /// Repeats `mgw state AXIS --json` until `is` holds, and returns the state.
    pub fn await_state(&self, axis: &str, is: impl Fn(&Value) -> bool) -> Value {
        await_state(&self.port, axis, is)
    }
}

/// The same at any port.
pub fn await_state(port: &str, axis: &str, is: impl Fn(&Value) -> bool) -> Value {
    let end = Instant::now() + LIMIT;
    loop {
        let lines = mgw(&["--port", port, "--json", "state", axis]).json_lines();
        let state = lines[0]["axes"][0].clone();
        if is(&state) {
            return state;
        }
        assert!(Instant::now() < end, "axis {axis} stays {state}");
    }
}
