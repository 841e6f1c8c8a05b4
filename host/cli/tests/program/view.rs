//! The page of `mgw serve --view`: who may open it, what it may do, and what becomes of the axes of
//! a page that goes. As a browser, and whoever attacks one, would speak to it.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket, client::client};

use crate::flood::Flood;
use crate::support::{LIMIT, Process, Sim, file, json, mgw};

/// A page in command says this often that it is there.
const BEAT: Duration = Duration::from_millis(50);

/// A server with a page.
struct View {
    process: Process,
    /// `127.0.0.1:PORT`.
    address: String,
    token: String,
    socket: PathBuf,
}

impl View {
    fn start(cable: &str, arguments: &[&str]) -> Self {
        let unique = cable.rsplit(':').next().unwrap();
        let name = format!("mgw-view-{}-{unique}.sock", std::process::id());
        let socket = std::env::temp_dir().join(name);
        let path = socket.to_str().unwrap();
        let line = [
            "--port",
            cable,
            "serve",
            "--listen",
            "127.0.0.1:0",
            "--socket",
            path,
            "--view",
            "127.0.0.1:0",
        ];
        let process = Process::start(&[&line, arguments].concat());
        let url = process
            .wait_for("the page", |line| line.strip_prefix("the page: http://").map(str::to_owned));
        process.wait_for("the gateway", |line| line.starts_with("gateway: ").then_some(()));
        let (address, token) = url.split_once("/#token=").expect("an address with a token");
        let (address, token) = (address.to_owned(), token.to_owned());
        assert_eq!(token.len(), 32, "128 bits");
        Self { process, address, token, socket }
    }

    /// What is answered to a request: the status and all the rest.
    fn ask(&self, request: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        // One that is refused early may not be read to its end.
        let _ = stream.write_all(request.as_bytes());
        let mut answer = Vec::new();
        if let Err(error) = stream.read_to_end(&mut answer) {
            assert_eq!(error.kind(), ErrorKind::ConnectionReset);
        }
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let status = answer.split(' ').nth(1).and_then(|status| status.parse().ok());
        (status.unwrap_or_else(|| panic!("no answer: {answer:?}")), answer)
    }

    fn get(&self, path: &str) -> (u16, String) {
        self.ask(&format!("GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", self.address))
    }

    /// A WebSocket with these headers, or the status of the refusal.
    fn open(&self, headers: &[(&str, &str)]) -> Result<Page, u16> {
        self.open_as(&self.address, "/live", headers)
    }

    fn open_as(&self, host: &str, path: &str, headers: &[(&str, &str)]) -> Result<Page, u16> {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(BEAT)).unwrap();
        let mut request = tungstenite::http::Request::builder()
            .uri(format!("ws://{}{path}", self.address))
            .header("Host", host)
            .header("Connection", "Upgrade")
            .header("Upgrade", "websocket")
            .header("Sec-WebSocket-Version", "13")
            .header("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ==");
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let mut opening = client(request.body(()).unwrap(), stream);
        loop {
            opening = match opening {
                Ok((socket, _)) => return Ok(Page(socket)),
                Err(tungstenite::HandshakeError::Interrupted(middle)) => middle.handshake(),
                Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
                    return Err(answer.status().as_u16());
                }
                Err(other) => panic!("{other}"),
            };
        }
    }

    fn protocols(&self) -> String {
        let digits: String = self.token.bytes().map(|byte| format!("{byte:02x}")).collect();
        format!("mgw.view.v1, token.{digits}")
    }

    /// Our own page.
    fn page(&self) -> Page {
        let origin = format!("http://{}", self.address);
        let headers = [("Origin", origin.as_str()), ("Sec-WebSocket-Protocol", &self.protocols())];
        self.open(&headers).expect("the own page is let in")
    }
}

impl Drop for View {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.socket);
    }
}

struct Page(WebSocket<TcpStream>);

impl Page {
    fn say(&mut self, ask: Value) {
        self.0.send(Message::text(ask.to_string())).expect("it is heard");
    }

    /// The first message for which `find` finds something. Meanwhile the page says that it is
    /// there.
    fn wait_for<T>(&mut self, what: &str, find: impl Fn(&Value) -> Option<T>) -> T {
        self.wait_for_saying(what, &json!({ "ask": "here" }), find)
    }

    /// The same; meanwhile the page says this again and again, and draws only if that is an ask.
    fn wait_for_saying<T>(
        &mut self,
        what: &str,
        said: &Value,
        find: impl Fn(&Value) -> Option<T>,
    ) -> T {
        let (end, mut beat) = (Instant::now() + LIMIT, Instant::now());
        let mut last = Value::Null;
        while Instant::now() < end {
            if beat.elapsed() >= BEAT {
                beat = Instant::now();
                self.say(said.clone());
            }
            let message: Value = match self.0.read() {
                Ok(Message::Text(text)) => serde_json::from_str(&text).unwrap(),
                Ok(_) => continue,
                Err(tungstenite::Error::Io(error))
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    continue;
                }
                Err(error) => panic!("{what}: {error}, after {last}"),
            };
            if said["ask"].is_string()
                && let Some(tick) = Value::as_u64(&message["tick"])
            {
                self.say(json!({ "ask": "seen", "tick": tick }));
            }
            if let Some(found) = find(&message) {
                return found;
            }
            if message["event"] != "samples" {
                last = message;
            }
        }
        panic!("{what} never came; the last was {last}");
    }

    fn event(&mut self, name: &str) -> Value {
        self.wait_for(name, |message| (message["event"] == name).then(|| message.clone()))
    }

    fn refusal(&mut self) -> String {
        self.event("refused")["message"].as_str().expect("a text").to_owned()
    }

    fn await_state(&mut self, axis: u8, state: &str) -> Value {
        self.wait_for(state, |message| {
            let of = &message["axis"];
            let is_it = message["event"] == "axis" && of["axis"] == axis && of["state"] == state;
            is_it.then(|| message.clone())
        })
    }

    fn take_command(&mut self) {
        self.say(json!({ "ask": "take" }));
        let command = self.event("command");
        assert_eq!(command["state"], "taken", "{command}");
    }

    /// Arms an axis; one that still turns is refused until it stands.
    fn arm_once_at_rest(&mut self, axis: u8) {
        loop {
            self.say(json!({ "ask": "arm", "axis": axis }));
            let is_answer =
                |told: &Value| ["armed", "refused"].iter().any(|name| told["event"] == *name);
            let answer = self.wait_for("an answer", |told| is_answer(told).then(|| told.clone()));
            if answer["event"] == "armed" {
                return;
            }
        }
    }

    /// Turns an axis.
    fn turn(&mut self, axis: u8) {
        self.take_command();
        self.say(json!({ "ask": "arm", "axis": axis }));
        assert_eq!(self.event("armed")["axis"], axis);
        self.say(json!({ "ask": "set", "axis": axis, "mode": "velocity", "value": 2.0 }));
        self.wait_for("motion", |message| {
            let of = message["axes"].as_array()?.iter().find(|of| of["axis"] == axis)?;
            of["velocity_rad_s"][2].as_f64().filter(|speed| *speed > 0.5)
        });
    }
}

/// What the motor itself says of a stop: the byte of its manual's command, and that it stands.
fn motor_is_stopped(sim: &Sim) {
    sim.process.wait_for("the stop on the bus", |line| {
        (line.contains("bus 0  rmd 1  command 0x81 stop") && !line.contains("ignored"))
            .then_some(())
    });
    sim.process.wait_for("the motor's stop", |line| {
        (line.contains("bus 0  rmd 1") && line.contains("  stopped")).then_some(())
    });
}

#[test]
fn the_page_is_served_to_its_own_name_only() {
    let sim = Sim::start();
    let view = View::start(&sim.port, &[]);
    let (status, page) = view.get("/");
    assert_eq!(status, 200);
    for header in [
        "Content-Security-Policy: default-src 'none'; script-src 'self'",
        "frame-ancestors 'none'",
        "X-Frame-Options: DENY",
        "X-Content-Type-Options: nosniff",
        "Referrer-Policy: no-referrer",
    ] {
        assert!(page.contains(header), "{header}: {page}");
    }
    assert!(!page.contains("Access-Control"), "no other page reads it");
    assert!(!page.contains(&view.token), "it is no way to the token");
    let port = view.address.rsplit(':').next().unwrap();
    for host in [
        "evil.example",
        &format!("evil.example:{port}"),
        "127.0.0.1",
        "localhost:1",
        &format!("127.0.0.1.nip.io:{port}"),
        "",
    ] {
        let (status, text) = view.ask(&format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n"));
        assert_eq!(status, 421, "{host}: {text}");
        assert!(text.contains(&view.address), "it says which name is ours: {text}");
    }
    assert_eq!(view.ask("GET / HTTP/1.1\r\n\r\n").0, 421);
    let (status, _) = view.ask(&format!("GET / HTTP/1.1\r\nHost: localhost:{port}\r\n\r\n"));
    assert_eq!(status, 200);
}

#[test]
fn there_are_no_other_files_and_no_endless_requests() {
    let sim = Sim::start();
    let view = View::start(&sim.port, &[]);
    for path in [
        "/../Cargo.toml",
        "/..%2f..%2fetc/passwd",
        "//etc/passwd",
        "/view.css/../../x",
        "/%2e%2e/x",
        "/view.js%00",
        "/index.html",
    ] {
        let (status, text) = view.get(path);
        assert_eq!(status, 404, "{path}: {text}");
    }
    let host = &view.address;
    let long = format!("GET / HTTP/1.1\r\nHost: {host}\r\nX: {}\r\n\r\n", "x".repeat(10_000));
    assert_eq!(view.ask(&long).0, 431);
    let many = format!("GET / HTTP/1.1\r\nHost: {host}\r\n{}\r\n", "a: b\r\n".repeat(100));
    assert_eq!(view.ask(&many).0, 431);
    for bad in [
        "hello\r\n\r\n".to_owned(),
        format!("GET / HTTP/1.1\r\nHost: {host}\r\nHost: {host}\r\n\r\n"),
        format!("POST /stop HTTP/1.1\r\nHost: {host}\r\nContent-Length: 3\r\n\r\nabc"),
    ] {
        assert_eq!(view.ask(&bad).0, 400, "{bad}");
    }
    for method in ["PUT", "DELETE", "OPTIONS", "HEAD"] {
        let (status, _) = view.ask(&format!("{method} / HTTP/1.1\r\nHost: {host}\r\n\r\n"));
        assert_eq!(status, 405, "{method}");
    }
    assert_eq!(view.get("/live").0, 401, "no token");
}

#[test]
fn no_page_of_another_origin_and_nobody_without_the_token_gets_in() {
    let sim = Sim::start();
    let reader = "https://app.foxglove.dev";
    let view = View::start(&sim.port, &["--allow-origin", reader]);
    let own = format!("http://{}", view.address);
    let protocols = view.protocols();
    let speaks = ("Sec-WebSocket-Protocol", protocols.as_str());
    for foreign in [
        "http://evil.example",
        "null",
        "http://127.0.0.1",
        "http://localhost:7480",
        "file://",
        "https://app.foxglove.dev.evil.example",
    ] {
        let refused = view.open(&[("Origin", foreign), speaks]).err();
        assert_eq!(refused, Some(403), "{foreign}");
    }
    // A name that points here, as DNS rebinding makes one.
    let port = view.address.rsplit(':').next().unwrap();
    let evil = format!("evil.example:{port}");
    let origin = format!("http://{evil}");
    let refused = view.open_as(&evil, "/live", &[("Origin", &origin), speaks]).err();
    assert_eq!(refused, Some(421));
    for wrong in ["mgw.view.v1", "mgw.view.v1, token.", "mgw.view.v1, token.00ff", "token.zz"] {
        for origin in [own.as_str(), reader] {
            let headers = [("Origin", origin), ("Sec-WebSocket-Protocol", wrong)];
            assert_eq!(view.open(&headers).err(), Some(401), "{wrong}");
        }
    }
    // Another subprotocol, or none.
    let query = format!("/live?token={}", view.token);
    let refused = view.open_as(&view.address, &query, &[("Origin", &own)]).err();
    assert_eq!(refused, Some(426));
    view.page().event("welcome");
}

#[test]
fn an_allowed_origin_reads_and_does_not_command() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &["--allow-origin", "https://app.foxglove.dev"]);
    let headers =
        [("Origin", "https://app.foxglove.dev"), ("Sec-WebSocket-Protocol", &*view.protocols())];
    let mut page = view.open(&headers).unwrap();
    assert_eq!(page.event("welcome")["grant"], "read");
    let axes = page.event("axes");
    assert_eq!(axes["axes"].as_array().map(Vec::len), Some(4), "{axes}");
    for ask in [
        json!({ "ask": "stop" }),
        json!({ "ask": "take" }),
        json!({ "ask": "arm", "axis": 0 }),
        json!({ "ask": "jog", "axis": 0, "mode": "velocity", "value": 1.0 }),
    ] {
        page.say(ask.clone());
        let text = page.refusal();
        assert!(text.contains("may read, not command"), "{ask}: {text}");
    }
    // Nor by a POST.
    let digits: String = view.token.bytes().map(|byte| format!("{byte:02x}")).collect();
    let post = |origin: &str, token: &str| {
        let host = &view.address;
        let origin =
            if origin.is_empty() { String::new() } else { format!("Origin: {origin}\r\n") };
        let request = format!(
            "POST /stop HTTP/1.1\r\nHost: {host}\r\n{origin}Authorization: Bearer {token}\r\n\
             Content-Length: 0\r\n\r\n"
        );
        view.ask(&request).0
    };
    let own = format!("http://{}", view.address);
    assert_eq!(post("https://app.foxglove.dev", &digits), 403);
    assert_eq!(post("http://evil.example", &digits), 403);
    assert_eq!(post("", &digits), 403, "a browser says the origin of a POST");
    assert_eq!(post(&own, "00"), 401);
    assert_eq!(post(&own, &digits), 200);
}

#[test]
fn beyond_this_computer_the_page_needs_a_token_that_was_given() {
    let line = ["--port", "tcp:127.0.0.1:9", "serve", "--listen", "127.0.0.1:0", "--view"];
    let text = mgw(&[&line[..], &["0.0.0.0:0"]].concat()).failure(2);
    assert!(text.contains("--token"), "{text}");
    let text = mgw(&[&line[..], &["0.0.0.0:0", "--token", "fifteen-bytes.."]].concat()).failure(2);
    assert!(text.contains("at least 16 bytes"), "{text}");
    let text = mgw(&[&line[..], &["127.0.0.1:0", "--allow-origin", "*"]].concat()).failure(2);
    assert!(text.contains("SCHEME://HOST"), "{text}");
    let alone = &line[..line.len() - 1];
    let text = mgw(&[alone, &["--allow-origin", "https://a.example"]].concat()).failure(2);
    assert!(text.contains("--view"), "{text}");
}

#[test]
fn neither_idle_connections_nor_readers_shut_the_own_page_out() {
    let sim = Sim::start();
    let view = View::start(&sim.port, &["--allow-origin", "https://reader.example"]);
    let idle: Vec<_> = (0..200).map(|_| TcpStream::connect(&view.address).unwrap()).collect();
    let protocols = view.protocols();
    let headers =
        [("Origin", "https://reader.example"), ("Sec-WebSocket-Protocol", protocols.as_str())];
    let readers: Vec<_> = (0..40).map(|_| view.open(&headers)).collect();
    assert_eq!(readers.iter().filter(|reader| reader.is_ok()).count(), 16);
    assert!(readers.iter().all(|reader| !matches!(reader, Err(status) if *status != 503)));
    let mut page = view.page();
    page.wait_for("the axes", |message| (message["event"] == "axes").then_some(()));
    let digits = protocols.rsplit('.').next().unwrap();
    let (status, answer) = view.ask(&format!(
        "POST /stop HTTP/1.1\r\nHost: {0}\r\nOrigin: http://{0}\r\nAuthorization: Bearer {digits}\r\n\r\n",
        view.address
    ));
    assert_eq!(status, 200, "{answer}");
    drop((idle, readers));
}

#[test]
fn a_stop_of_the_page_is_on_the_bus_whoever_commands() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    assert_eq!(page.event("welcome")["grant"], "command");
    let socket = format!("unix:{}", view.socket.display());
    let mut host =
        Process::start(&["--port", &socket, "--json", "set", "0", "velocity", "2", "--for", "60"]);
    page.wait_for("motion", |message| {
        let of = message["axes"].as_array()?.iter().find(|of| of["axis"] == 0)?;
        of["velocity_rad_s"][2].as_f64().filter(|speed| *speed > 0.5)
    });
    page.say(json!({ "ask": "take" }));
    let refused = page.event("command");
    assert_eq!(refused["state"], "lost", "{refused}");
    assert!(refused["message"].as_str().unwrap().contains("is in command"), "{refused}");
    page.say(json!({ "ask": "stop" }));
    let phase = |phase: &'static str| {
        move |message: &Value| {
            let is_it = message["event"] == "stop" && message["phase"] == phase;
            is_it.then(|| message.clone())
        }
    };
    page.wait_for("that it was taken", phase("taken"));
    motor_is_stopped(&sim);
    let report = page.wait_for("the report", phase("report"));
    let axes = report["axes"].as_array().unwrap();
    assert_eq!(axes.len(), 4, "{report}");
    assert!(axes.iter().all(|axis| axis["stop"] == "confirmed"), "{report}");
    assert_ne!(host.wait(), Some(0), "somebody else has stopped it");
}

#[test]
fn a_page_moves_only_what_it_has_armed_in_command() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.event("welcome");
    let jog = json!({ "ask": "jog", "axis": 0, "mode": "velocity", "value": 1.0 });
    page.say(jog.clone());
    assert!(page.refusal().contains("take command first"));
    page.take_command();
    page.say(jog.clone());
    assert!(page.refusal().contains("arm it first"));
    page.say(json!({ "ask": "arm", "axis": 99 }));
    assert!(page.refusal().contains("axis 99"));
    page.say(json!({ "ask": "fly" }));
    assert!(page.refusal().contains("fly"));
    page.say(json!({ "ask": "arm", "axis": 0 }));
    assert_eq!(page.event("armed")["axis"], 0);
    // Beyond the limit of the axis.
    page.say(json!({ "ask": "set", "axis": 0, "mode": "velocity", "value": 1000.0 }));
    assert!(page.refusal().contains("velocity"));
    assert_eq!(page.event("disarmed")["axis"], 0, "what was refused ends what was armed");
}

#[test]
fn a_message_that_is_refused_or_cannot_be_read_stops_what_its_page_has_armed() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.take_command();
    for refused in [
        // Readable, and refused: the page has not armed this axis.
        json!({ "ask": "set", "axis": 1, "mode": "velocity", "value": 1.0 }),
        json!({ "ask": "jog", "axis": 1, "mode": "velocity", "value": 1.0 }),
        json!({ "ask": "set", "axis": 0, "mode": "velocity", "value": null }),
        json!({ "ask": "set", "axis": 0, "mode": "velocity", "value": 1e300 }),
        json!("slower"),
    ] {
        page.arm_once_at_rest(0);
        page.say(json!({ "ask": "set", "axis": 0, "mode": "velocity", "value": 2.0 }));
        page.await_state(0, "active");
        page.say(refused.clone());
        assert!(!page.refusal().is_empty());
        assert_eq!(page.event("disarmed")["axis"], 0, "{refused}");
        motor_is_stopped(&sim);
    }
}

#[test]
fn a_page_that_says_only_what_cannot_be_read_counts_as_silent() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.take_command();
    let ended = page.wait_for_saying("the end", &json!("here"), |message| {
        (message["event"] == "command").then(|| message["message"].as_str().unwrap().to_owned())
    });
    assert!(ended.contains("silent"), "{ended}");
}

#[test]
fn a_jog_that_is_not_repeated_stops_by_itself() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.take_command();
    page.say(json!({ "ask": "arm", "axis": 0 }));
    assert_eq!(page.event("armed")["axis"], 0);
    page.say(json!({ "ask": "jog", "axis": 0, "mode": "velocity", "value": 2.0 }));
    // The page is still there, and says nothing of the jog.
    assert_eq!(page.event("disarmed")["axis"], 0);
    motor_is_stopped(&sim);
    // An RMD that was stopped holds.
    page.await_state(0, "holding");
}

#[test]
fn the_axes_of_a_page_in_command_that_vanishes_trip() {
    let sim = Sim::with_times(10_000_000, 1_500_000);
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.turn(0);
    let mut other = view.page();
    other.event("axes");
    drop(page);
    motor_is_stopped(&sim);
    let told = other.await_state(0, "tripped");
    assert_eq!(told["axis"]["trip"]["reason"], "host_silent", "{told}");
    assert!(told["trip_text"].as_str().unwrap().contains("axis 0 tripped"), "{told}");
}

#[test]
fn the_axes_of_a_page_in_command_that_hangs_trip() {
    let sim = Sim::with_times(10_000_000, 1_500_000);
    let view = View::start(&sim.port, &[]);
    let mut page = view.page();
    page.turn(0);
    // It says nothing any more, and its connection stays.
    motor_is_stopped(&sim);
    let ended = page.wait_for("the end", |message| {
        (message["event"] == "command").then(|| message["message"].as_str().unwrap().to_owned())
    });
    assert!(ended.contains("silent"), "{ended}");
    let told = page.await_state(0, "tripped");
    assert_eq!(told["axis"]["trip"]["reason"], "host_silent", "{told}");
}

#[test]
fn foxglove_reads_what_a_recording_has() {
    let sim = Sim::start();
    let view = View::start(&sim.port, &["--allow-origin", "https://app.foxglove.dev"]);
    let query = format!("/?token={}", view.token);
    for (name, headers) in [
        ("foxglove.sdk.v1", vec![("Origin", "https://app.foxglove.dev")]),
        ("foxglove.websocket.v1", vec![]),
    ] {
        let headers = [headers, vec![("Sec-WebSocket-Protocol", name)]].concat();
        assert_eq!(view.open_as(&view.address, "/", &headers).err(), Some(401), "no token");
        let mut page = view.open_as(&view.address, &query, &headers).unwrap();
        let read = |page: &mut Page| loop {
            match page.0.read() {
                Ok(message) => return message,
                Err(tungstenite::Error::Io(_)) => {}
                Err(error) => panic!("{error}"),
            }
        };
        let text =
            |message: Message| -> Value { serde_json::from_str(&message.to_string()).unwrap() };
        assert_eq!(text(read(&mut page))["op"], "serverInfo");
        let mut advertised = text(read(&mut page));
        while advertised["channels"].as_array().is_none_or(Vec::is_empty) {
            advertised = text(read(&mut page));
        }
        let channels = advertised["channels"].as_array().unwrap();
        let topics: Vec<_> = channels.iter().map(|of| of["topic"].as_str().unwrap()).collect();
        let samples = ["/axis/0/sample", "/axis/1/sample", "/axis/2/sample", "/axis/3/sample"];
        assert_eq!(topics, [&samples[..], &["/event", "/cycle"]].concat());
        let schema: Value = serde_json::from_str(channels[0]["schema"].as_str().unwrap()).unwrap();
        assert_eq!(schema["properties"]["velocity_rad_s"]["type"], "object");
        page.say(json!({ "op": "setParameters", "parameters": [] }));
        let id = channels[0]["id"].as_u64().unwrap();
        let subscription = json!({ "id": 7, "channelId": id });
        page.say(json!({ "op": "subscribe", "subscriptions": [subscription] }));
        let status = text(read(&mut page));
        assert_eq!((&status["op"], &status["level"]), (&json!("status"), &json!(2)));
        let Message::Binary(data) = read(&mut page) else { panic!("no data") };
        assert_eq!(data[..5], [1, 7, 0, 0, 0], "message data of subscription 7");
        let sample: Value = serde_json::from_slice(&data[13..]).unwrap();
        assert_eq!(sample["axis"], 0, "{sample}");
        assert!(sample["time_us"].is_u64(), "{sample}");
    }
}

#[test]
fn a_flood_holds_up_no_stop_and_what_is_not_recorded_is_counted() {
    let mut sim = Sim::patient();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let cable = format!("tcp:{}", listener.local_addr().unwrap());
    let flood = Arc::new(Flood::default());
    let (served, gateway) = (flood.clone(), sim.port.trim_start_matches("tcp:").to_owned());
    thread::spawn(move || served.serve(&listener, &gateway, 8_000));
    let path = file("view.mcap");
    let mut view = View::start(&cable, &["--view-period", "1", "--record", &path, "--force"]);
    // One reads and draws nothing, and one does.
    let mut slow = view.page();
    let mut page = view.page();
    page.turn(0);
    flood.on.store(true, Ordering::Relaxed);
    page.wait_for("a flood", |message| {
        let of = message["axes"].as_array()?.iter().find(|of| of["axis"] == 0)?;
        of["samples"].as_u64().filter(|count| *count > 20)
    });
    slow.say(json!({ "ask": "stop" }));
    motor_is_stopped(&sim);
    // It is spared what it does not draw, and told how much that was.
    let now = page.wait_for("a picture", |message| message["tick"].as_u64());
    page.wait_for("40 more", |message| message["tick"].as_u64().filter(|tick| *tick > now + 40));
    let before = slow.wait_for("pictures", |message| message["tick"].as_u64());
    let left_out = slow.wait_for("what was left out", |message| {
        let after = message["tick"].as_u64()?;
        message["left_out"].as_u64().filter(|count| after > before && *count > 0)
    });
    assert!(left_out < 10_000, "{left_out}");
    flood.on.store(false, Ordering::Relaxed);
    let sent = flood.sent.load(Ordering::Relaxed);
    assert!(sent > 8_000, "{sent}");
    // What is answered by the gateway now comes behind all of that.
    page.say(json!({ "ask": "stop" }));
    page.wait_for("the end of the flood", |message| {
        (message["event"] == "stop" && message["phase"] == "report").then_some(())
    });
    drop((slow, page));
    // The gateway's own samples end, too, or the recording grows while it is read.
    sim.process.kill();
    let play = |topic| mgw(&["--json", "play", &path, "--topic", topic]).stdout;
    let lost = || {
        // Behind the messages it is told that the file has no end yet.
        let told = play("/recording").lines().map(json).rfind(|line| line["message"].is_object());
        let Some(told) = told else { return 0 };
        let count = |name| told["message"][name].as_u64().expect("a number");
        let unwritten = count("lost_unwritten");
        assert!(count("lost_on_the_way") <= unwritten, "no other number is missing: {told}");
        unwritten
    };
    // The thread that writes may be behind; what it has is in the file each second.
    let end = Instant::now() + LIMIT;
    loop {
        let recorded = play("/axis/").lines().count() as u64;
        // Only a machine that is busy with other things writes too slowly.
        let lost = if recorded < sent { lost() } else { 0 };
        if recorded + lost >= sent {
            break;
        }
        assert!(Instant::now() < end, "{recorded} of {sent} are recorded, and {lost} not");
    }
    assert_eq!(view.process.interrupt(), Some(0));
    lost();
}
