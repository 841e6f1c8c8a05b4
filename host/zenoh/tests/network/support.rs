//! Simulated gateways in a network of this computer: explicit endpoints, no multicast.

use std::io::{BufRead, BufReader, Read};
use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use host_protocol::Kind;
use mgw_client::open_halves;
use mgw_serve::{Listener, SERVER, Seen};
use mgw_zenoh::Endpoints;
use serde_json::Value;
use zenoh::{Session, Wait};

/// No test waits longer than this for anything.
pub const LIMIT: Duration = Duration::from_secs(30);
/// So long may a commander be silent: a busy machine may hold one up.
pub const SILENCE: Duration = Duration::from_secs(1);

/// An example of this package.
pub fn example(name: &str) -> Command {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_mgw-zenoh"));
    let mut command = Command::new(program.with_file_name("examples").join(name));
    command.env_remove("MGW_PORT").env("MGW_SOCKET", "").env_remove("MGW_TOKEN");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// The program with these arguments.
pub fn mgw_zenoh(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mgw-zenoh"));
    command.args(arguments).env_remove("MGW_PORT").env("MGW_SOCKET", "").env_remove("MGW_TOKEN");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// A process that ends with the test, and the lines that it prints.
pub struct Running {
    pub child: Child,
    lines: Mutex<Receiver<String>>,
}

impl Running {
    pub fn start(command: &mut Command) -> Self {
        let mut child = command.spawn().expect("the program starts");
        let lines = Mutex::new(lines(child.stdout.take().unwrap()));
        // Also when nobody looks at it, it is read.
        lines_to_stderr(child.stderr.take().unwrap());
        Self { child, lines }
    }

    /// The next line that has this in it.
    pub fn line(&self, part: &str) -> String {
        let end = Instant::now() + LIMIT;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let line = self.lines.lock().unwrap().recv_timeout(left);
            let line = line.unwrap_or_else(|_| panic!("no line with `{part}`"));
            if line.contains(part) {
                return line;
            }
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn lines(output: impl Read + Send + 'static) -> Receiver<String> {
    let (sender, lines) = channel();
    thread::spawn(move || {
        for line in BufReader::new(output).lines().map_while(Result::ok) {
            // Read on though nobody listens, or the program waits for a pipe that is full.
            let _ = sender.send(line);
        }
    });
    lines
}

fn lines_to_stderr(output: impl Read + Send + 'static) {
    thread::spawn(move || {
        BufReader::new(output).lines().map_while(Result::ok).for_each(|line| eprintln!("{line}"));
    });
}

/// Runs a program to its end: its exit code, and what it said on standard output and error.
pub fn run(command: &mut Command) -> (Option<i32>, String, String) {
    let output = command.output().expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// A request that crossed the cable, and when.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    pub at: Instant,
    pub number: u16,
    /// Of a program that watches, or of the server: it keeps nobody in command.
    pub watches: bool,
}

/// A simulated gateway with a server, and every request that crosses its cable.
pub struct Gateway {
    sim: Running,
    /// Where the server listens.
    pub server: String,
    requests: Arc<Mutex<Vec<Request>>>,
}

impl Gateway {
    /// Four motors, configured; a commander may be silent for [`SILENCE`].
    pub fn start() -> Self {
        let sim = Running::start(example("mgw").args(["sim", "--listen", "127.0.0.1:0"]));
        let port = sim.line("listening on").split_whitespace().last().unwrap().to_owned();
        let silence = format!("link_silence_us={}", SILENCE.as_micros());
        for change in [
            vec!["gateway", &silence],
            vec!["axis", "0", "ttl_us=2000000"],
            vec!["axis", "1", "ttl_us=2000000"],
        ] {
            let mut command = example("mgw");
            let done = run(command.args(["--port", &port, "config"]).args(change));
            assert_eq!(done.0, Some(0), "{done:?}");
        }
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let server = format!("tcp:{}", listener.local_addr().unwrap());
        let requests = Arc::new(Mutex::new(Vec::new()));
        let kept = requests.clone();
        thread::spawn(move || {
            let tap = Box::new(move |seen: Seen| {
                if matches!(seen.kind, Kind::Request | Kind::WatcherRequest) {
                    let watches = seen.kind == Kind::WatcherRequest || seen.program == Some(SERVER);
                    let at = Instant::now();
                    kept.lock().unwrap().push(Request { at, number: seen.number, watches });
                }
            });
            let open = move || open_halves(&port).map_err(|error| error.to_string());
            mgw_serve::serve(vec![Listener::Tcp(listener, None)], open, |_: &str| {}, Some(tap))
        });
        Self { sim, server, requests }
    }

    /// Puts `mgw-zenoh` beside it, once it is in the network.
    pub fn join(&self, name: &str, endpoints: &[&str]) -> Running {
        let mut arguments = vec![name, "--serve", &self.server];
        arguments.extend(endpoints);
        let running = Running::start(&mut mgw_zenoh(&arguments));
        running.line("is in the network");
        running
    }

    /// What was asked by programs that do more than watch.
    pub fn commands(&self) -> Vec<Request> {
        let requests = self.requests.lock().unwrap();
        requests.iter().filter(|request| !request.watches).copied().collect()
    }

    /// How often this was asked.
    pub fn count(&self, number: u16) -> usize {
        let requests = self.requests.lock().unwrap();
        requests.iter().filter(|request| request.number == number).count()
    }

    /// What `mgw` prints on a command of this gateway.
    pub fn mgw(&self, arguments: &[&str]) -> Vec<Value> {
        let (code, out, error) =
            run(example("mgw").args(["--json", "--port", &self.server]).args(arguments));
        assert_eq!(code, Some(0), "{error}");
        out.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// The gateway is gone.
    pub fn end(&mut self) {
        self.sim.child.kill().unwrap();
    }
}

/// An endpoint that nobody has.
pub fn endpoint() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    format!("tcp/{}", listener.local_addr().unwrap())
}

/// A session of a peer that connects to these.
pub fn peer(endpoints: &[&String]) -> Session {
    let connect = endpoints.iter().map(|endpoint| (*endpoint).clone()).collect();
    mgw_zenoh::open(&Endpoints { connect, ..Endpoints::default() }).unwrap()
}

/// What is published under a key.
pub fn subscribe(session: &Session, key: &str) -> Receiver<(String, Value)> {
    let (sender, published) = channel();
    let subscriber = session.declare_subscriber(key).callback(move |sample| {
        let value = serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
        let _ = sender.send((sample.key_expr().to_string(), value));
    });
    subscriber.background().wait().unwrap();
    published
}

/// The first that is so.
pub fn wait_for(
    published: &Receiver<(String, Value)>,
    what: &str,
    is_it: impl Fn(&str, &Value) -> bool,
) -> Value {
    let end = Instant::now() + LIMIT;
    loop {
        let left = end.saturating_duration_since(Instant::now());
        let (key, value) = published.recv_timeout(left).unwrap_or_else(|_| panic!("no {what}"));
        if is_it(&key, &value) {
            return value;
        }
    }
}

/// Until it is so.
pub fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let end = Instant::now() + LIMIT;
    while !is_so() {
        assert!(Instant::now() < end, "{what}");
        thread::sleep(Duration::from_millis(20));
    }
}
