//! `mgw serve` between a simulated gateway and several programs.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use host_protocol::requests::Hello;
use host_protocol::{Call as _, Kind, MAX_FRAME, PROTOCOL_MAJOR, PROTOCOL_MINOR, encode};
use serde_json::Value;

use crate::support::{Outcome, Process, Sim, await_state, mgw, outcome_of};

/// No wait is longer.
const LIMIT: Duration = Duration::from_secs(60);

/// A server, and how it is reached.
pub struct Server {
    pub process: Process,
    pub port: String,
    pub socket: PathBuf,
}

impl Server {
    pub fn start(cable: &str, arguments: &[&str]) -> Self {
        let server = Self::open(cable, arguments);
        server.await_gateway();
        server
    }

    /// One that may not have its gateway yet.
    pub fn open(cable: &str, arguments: &[&str]) -> Self {
        let unique = cable.rsplit(':').next().unwrap();
        let name = format!("mgw-test-{}-{unique}.sock", std::process::id());
        let socket = std::env::temp_dir().join(name);
        let path = socket.to_str().unwrap();
        let line = ["--port", cable, "serve", "--listen", "127.0.0.1:0", "--socket", path];
        let process = Process::start(&[&line, arguments].concat());
        let port = process
            .wait_for("the port", |line| line.strip_prefix("listening on ").map(str::to_owned));
        assert!(port.starts_with("tcp:127.0.0.1:"), "{port}");
        Self { process, port, socket }
    }

    pub fn await_gateway(&self) {
        self.process.wait_for("the gateway", |line| line.starts_with("gateway: ").then_some(()));
    }

    /// A program that finds it by itself.
    fn mgw(&self, arguments: &[&str]) -> Outcome {
        outcome_of(arguments, &[("MGW_SOCKET", self.socket.to_str().unwrap())])
    }

    /// A program that runs beside it.
    fn program(&self, arguments: &[&str]) -> Process {
        Process::start(&[&["--port", &self.port], arguments].concat())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.socket);
    }
}

#[test]
fn several_programs_use_one_gateway_and_find_the_server_by_themselves() {
    let sim = Sim::patient();
    let server = Server::start(&sim.port, &[]);
    let found = server.mgw(&["info"]);
    assert!(found.stderr.contains("through the server at unix:"), "{found:?}");
    assert!(found.success().contains("simulat"));
    let socket = server.socket.to_str().unwrap();
    outcome_of(&["info"], &[("MGW_SOCKET", socket), ("MGW_PORT", "")]).success();
    let mut watchers: Vec<_> =
        (0..6).map(|_| server.program(&["--json", "watch", "0", "--period", "50"])).collect();
    let mut host = server.program(&["--json", "set", "0", "velocity", "2", "--for", "60"]);
    host.await_motion();
    for watcher in &watchers {
        watcher.wait_for("a sample in motion", |line| {
            let line: Value = serde_json::from_str(line).ok()?;
            line["velocity_rad_s"]["value"].as_f64().filter(|speed| *speed > 0.5)
        });
    }
    // Another one may not command, and may stop. It is told who does, here over TCP.
    let refused = server.mgw(&["set", "0", "velocity", "1", "--for", "1"]).failure(1);
    let commander = "the program at 127.0.0.1:";
    assert!(refused.contains(commander) && refused.contains(" is in command; wait"), "{refused}");
    assert!(!refused.contains("host link"), "{refused}");
    let info = server.mgw(&["--json", "info"]).json_lines();
    assert!(info[0]["commander"].as_str().unwrap().starts_with(commander), "{info:?}");
    server.mgw(&["stop", "0"]).success();
    sim.await_stop("bus 0  rmd 1");
    assert_ne!(host.wait(), Some(0), "somebody else has stopped it");
    for watcher in &mut watchers {
        assert_eq!(watcher.interrupt(), Some(0));
    }
}

/// Only the socket that every `mgw` looks for is found by itself.
#[test]
fn a_server_says_by_which_socket_it_is_found() {
    let sim = Sim::start();
    let server = Server::open(&sim.port, &[]);
    let path = server.socket.to_str().unwrap();
    let found = format!("`MGW_SOCKET={path} mgw` without --port uses it.");
    server.process.wait_for("how", |line| line.contains(&found).then_some(()));
}

/// By its name and process on this computer, also when it has gone and the gateway still waits.
#[cfg(target_os = "linux")]
#[test]
fn a_program_on_this_computer_is_named_by_its_process() {
    let sim = Sim::patient();
    let server = Server::start(&sim.port, &[]);
    let port = format!("unix:{}", server.socket.display());
    let nobody = server.mgw(&["info"]).success();
    assert!(nobody.contains("command") && nobody.contains("nobody"), "{nobody}");
    let mut host = Process::start(&["--port", &port, "arm", "0"]);
    host.wait_for("the arming", |line| line.contains("is armed").then_some(()));
    let name = format!("mgw (process {})", host.id());
    let info = server.mgw(&["info"]).success();
    assert!(info.contains(&name), "{info}");
    host.kill();
    server.process.wait_for("the end", |line| {
        line.contains(&format!("{name} was in command and has gone")).then_some(())
    });
    let refused = server.mgw(&["config", "gateway", "name=a"]).failure(1);
    assert!(refused.contains(&format!("{name} is in command; wait")), "{refused}");
}

#[test]
fn the_axes_of_a_program_that_is_killed_trip_though_others_watch() {
    let sim = Sim::with_times(10_000_000, 1_500_000);
    let server = Server::start(&sim.port, &[]);
    let watcher = server.program(&["--json", "watch", "0", "--period", "20"]);
    let mut host = server.program(&["--json", "set", "0", "velocity", "2", "--for", "60"]);
    host.await_motion();
    host.kill();
    sim.await_stop("bus 0  rmd 1");
    let is_stopped = |state: &Value| state["state"] == "tripped" && state["stop_confirmed"] == true;
    let state = await_state(&server.port, "0", is_stopped);
    assert_eq!(state["trip"]["reason"], "host_silent");
    watcher.wait_for("the trip", |line| line.contains("host_silent").then_some(()));
    // Then somebody else commands.
    server.mgw(&["clear", "0"]).success();
    server.mgw(&["set", "0", "velocity", "1", "--for", "0.3"]).success();
}

#[test]
fn a_server_without_its_gateway_says_so_and_finds_it_again() {
    let mut sim = Sim::patient();
    let address = sim.port.strip_prefix("tcp:").unwrap().to_owned();
    let server = Server::start(&sim.port, &[]);
    let mut watcher = server.program(&["watch", "0"]);
    watcher.wait_for("a sample", |line| line.contains('0').then_some(()));
    sim.process.kill();
    server.process.wait_for("the loss", |line| line.contains("gateway lost").then_some(()));
    assert_eq!(watcher.wait(), Some(1));
    let end = Instant::now() + LIMIT;
    loop {
        let text = server.mgw(&["info"]).failure(1);
        if text.contains("the server has lost the gateway") {
            break;
        }
        assert!(Instant::now() < end, "{text}");
    }
    let text = server.mgw(&["stop"]).failure(3);
    assert!(text.contains("nothing answered within 3000 ms"), "{text}");
    let _again = Process::start(&["sim", "--listen", &address]);
    server.await_gateway();
    server.mgw(&["info"]).success();
}

#[test]
fn beyond_this_computer_a_token_is_needed() {
    let text = mgw(&["--port", "tcp:127.0.0.1:9", "serve", "--listen", "0.0.0.0:0"]).failure(2);
    assert!(text.contains("--token"), "{text}");
    let short = ["--listen", "0.0.0.0:0", "--token", "fifteen-bytes.."];
    let text = mgw(&[&["--port", "tcp:127.0.0.1:9", "serve"], &short[..]].concat()).failure(2);
    assert!(text.contains("at least 16 bytes"), "{text}");
    let sim = Sim::start();
    let server = Server::start(&sim.port, &["--token", "a secret"]);
    let arguments = ["--port", &server.port, "info"];
    let text = mgw(&arguments).failure(1);
    assert!(text.contains("token"), "{text}");
    let text = outcome_of(&arguments, &[("MGW_TOKEN", "a secreT")]).failure(1);
    assert!(text.contains("token"), "{text}");
    outcome_of(&arguments, &[("MGW_TOKEN", "a secret")]).success();
    // The socket is this user's own.
    server.mgw(&["info"]).success();
}

/// A page can have its browser post bytes to this computer.
#[test]
fn what_a_browser_posts_is_no_request() {
    let sim = Sim::start();
    let server = Server::start(&sim.port, &[]);
    let address = server.port.strip_prefix("tcp:").unwrap();
    let mut out = [0; MAX_FRAME];
    let hello =
        Hello { protocol_major: PROTOCOL_MAJOR, protocol_minor: PROTOCOL_MINOR, session: 1 };
    let length = encode(Kind::Request, 1, Hello::NUMBER, &hello, &mut out).unwrap();
    let answer = |first: &[u8]| {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        stream.write_all(&[first, &out[..length]].concat()).unwrap();
        let mut bytes = [0; MAX_FRAME];
        stream.read(&mut bytes).unwrap_or(0)
    };
    assert_eq!(answer(b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"), 0);
    assert_ne!(answer(b"noise"), 0, "what is not from a browser may begin with garbage");
    server.mgw(&["info"]).success();
}

/// It would be asked for by one program, and found again by none.
#[test]
fn a_rate_for_a_shared_line_is_refused_before_anything_is_served() {
    let socket = std::env::temp_dir().join(format!("mgw-test-{}-rate.sock", std::process::id()));
    let line = ["--port", "/dev/ttyACM0@2000000", "serve", "--listen", "127.0.0.1:0", "--socket"];
    let said = mgw(&[&line[..], &[socket.to_str().unwrap()]].concat()).failure(2);
    assert!(said.contains("run it at the default rate") && said.contains("E-"), "{said}");
    assert!(!socket.exists());
}

#[test]
fn a_second_server_is_refused_and_the_socket_of_a_dead_one_is_not_in_its_way() {
    let sim = Sim::start();
    let mut server = Server::start(&sim.port, &[]);
    let path = server.socket.to_str().unwrap().to_owned();
    let line = ["--port", &sim.port, "serve", "--listen", "127.0.0.1:0", "--socket", &path];
    let text = mgw(&line).failure(2);
    assert!(text.contains("a server runs already"), "{text}");
    server.process.kill();
    // Nobody serves there: it is passed over.
    let without = server.mgw(&["--port", &sim.port, "info"]);
    without.success();
    let _again = Server::start(&sim.port, &[]);
    server.mgw(&["info"]).success();
}

/// It owns the cable, so that there is no other way to the gateway.
#[cfg(target_os = "linux")]
#[test]
fn a_server_that_hangs_is_named_and_neither_passed_over_nor_replaced() {
    use socket2::{Domain, SockAddr, Socket, Type};
    let path = std::env::temp_dir().join(format!("mgw-hung-server-{}", std::process::id()));
    let _ = std::fs::remove_file(&path);
    let socket = || Socket::new(Domain::UNIX, Type::STREAM, None).unwrap();
    let (listener, address) = (socket(), SockAddr::unix(&path).unwrap());
    listener.bind(&address).unwrap();
    listener.listen(0).unwrap();
    let connects = || {
        let one = socket();
        one.set_nonblocking(true).unwrap();
        one.connect(&address).is_ok().then_some(one)
    };
    let _waiting: Vec<Socket> = std::iter::from_fn(connects).collect();
    let socket = path.to_str().unwrap();
    let text = outcome_of(&["stop"], &[("MGW_SOCKET", socket), ("MGW_PORT", "")]).failure(1);
    assert!(text.contains(socket) && text.contains("it hangs and takes no connection"), "{text}");
    let sim = Sim::start();
    let line = ["--port", &sim.port, "serve", "--listen", "127.0.0.1:0", "--socket", socket];
    let text = mgw(&line).failure(2);
    assert!(text.contains(&format!("a server runs already: {socket} hangs")), "{text}");
    assert!(path.exists(), "it was taken away");
    std::fs::remove_file(&path).unwrap();
}
