//! The page of `mgw serve --view`, spoken to as a browser would.

mod access;
mod command;
mod reading;

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket, client::client};

use crate::server::Server;
use crate::support::{LIMIT, Sim};

/// A page in command says this often that it is there.
const BEAT: Duration = Duration::from_millis(50);

/// A server with a page.
struct View {
    server: Server,
    /// `127.0.0.1:PORT`.
    address: String,
    token: String,
}

impl View {
    fn start(cable: &str, arguments: &[&str]) -> Self {
        let server = Server::open(cable, &[&["--view", "127.0.0.1:0"], arguments].concat());
        let url = server
            .process
            .wait_for("the page", |line| line.strip_prefix("the page: http://").map(str::to_owned));
        server.await_gateway();
        let (address, token) = url.split_once("/#token=").expect("an address with a token");
        let (address, token) = (address.to_owned(), token.to_owned());
        assert_eq!(token.len(), 32, "128 bits");
        Self { server, address, token }
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

    /// One of a page of this origin, with the token.
    fn open_from(&self, origin: &str) -> Result<Page, u16> {
        self.open(&[("Origin", origin), ("Sec-WebSocket-Protocol", &self.protocols())])
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

    /// The origin of our own page.
    fn own(&self) -> String {
        format!("http://{}", self.address)
    }

    /// The token in digits.
    fn digits(&self) -> String {
        self.token.bytes().map(|byte| format!("{byte:02x}")).collect()
    }

    fn protocols(&self) -> String {
        format!("mgw.view.v1, token.{}", self.digits())
    }

    /// Our own page.
    fn page(&self) -> Page {
        self.open_from(&self.own()).expect("the own page is let in")
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

    fn arm(&mut self, axis: u8) {
        self.say(json!({ "ask": "arm", "axis": axis }));
        assert_eq!(self.event("armed")["axis"], axis);
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
        self.arm(axis);
        self.say(json!({ "ask": "set", "axis": axis, "mode": "velocity", "value": 2.0 }));
        self.await_motion(axis);
    }

    fn await_motion(&mut self, axis: u8) {
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
    sim.await_stop("bus 0  rmd 1");
}
