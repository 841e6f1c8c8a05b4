//! Sockets and threads around the [`Gate`]: each connection is one request, which is answered, or
//! becomes a visitor.

use std::collections::VecDeque;
use std::net::{IpAddr, Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use tungstenite::handshake::derive_accept_key;

use crate::gate::{Asker, Gate, Grant, Refusal};
use crate::http::{self, BadHead, Head};
use crate::outbox::Outbox;
use crate::page;
use crate::socket::{self, Heard};

/// Connections at a time that have not shown the token: one more ends the oldest.
pub const STRANGERS: usize = 64;
/// Visitors at a time that may command, and as many that may read: neither shut the others out.
pub const VISITORS: usize = 16;
/// After a connection that could not be accepted.
const LOOK_AGAIN: Duration = Duration::from_millis(50);
/// Where a WebSocket is opened.
const LIVE: &str = "/live";
/// What stops without a WebSocket.
const STOP: &str = "/stop";
/// The subprotocol of the page.
pub const PAGE_PROTOCOL: &str = "mgw.view.v1";
/// What stands before the token, in hexadecimal digits, in a subprotocol that is offered.
const TOKEN_PROTOCOL: &str = "token.";
/// Foxglove's subprotocols, the one that we prefer first.
const FOXGLOVE: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// What stands before the token of a POST.
const BEARER: &str = "Bearer ";

/// How a visitor speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Speech {
    /// As our page does.
    Page,
    /// Foxglove's protocol.
    Foxglove,
}

/// Somebody whose token was right, on a WebSocket.
pub struct Visitor {
    /// What it may do.
    pub grant: Grant,
    /// How it speaks.
    pub speech: Speech,
    /// The way to it.
    pub outbox: Outbox,
    heard: Heard,
}

impl Visitor {
    /// The next text that it says; nothing once it has gone.
    pub fn hear(&mut self) -> Option<String> {
        self.heard.next()
    }
}

/// What is done for whom the gate admits.
pub struct House {
    /// Attends to a visitor until it has gone, in a thread of the visitor's own.
    pub attend: Box<dyn Fn(Visitor) + Send + Sync>,
    /// Stops everything, and says what became of that: whether it was taken, and a text.
    pub stop: Box<dyn Fn() -> (bool, String) + Send + Sync>,
}

/// Serves until the process ends.
pub fn serve(listener: &TcpListener, gate: Gate, house: House) {
    let all = Arc::new((gate, house));
    let (strangers, rooms) = (Strangers::default(), Rooms::default());
    for number in 0.. {
        let accepted = listener.accept();
        let entered =
            accepted.and_then(|(stream, _)| Ok((strangers.enter(number, &stream)?, stream)));
        let Ok((stranger, stream)) = entered else {
            thread::sleep(LOOK_AGAIN);
            continue;
        };
        let (all, rooms) = (all.clone(), rooms.clone());
        thread::spawn(move || {
            let (gate, house) = &*all;
            if let Some((visitor, _place)) = receive(stream, stranger, gate, house, &rooms) {
                (house.attend)(visitor);
            }
        });
    }
}

/// The connections that have not shown the token, the oldest first.
#[derive(Clone, Default)]
struct Strangers(Arc<Mutex<VecDeque<(u64, TcpStream)>>>);

impl Strangers {
    /// One more. Where there are too many the oldest ends: whoever has the token shows it at once,
    /// and is let in however many others wait.
    fn enter(&self, number: u64, stream: &TcpStream) -> std::io::Result<Stranger> {
        let stream = stream.try_clone()?;
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if all.len() >= STRANGERS
            && let Some((_, oldest)) = all.pop_front()
        {
            let _ = oldest.shutdown(Shutdown::Both);
        }
        all.push_back((number, stream));
        Ok(Stranger { among: self.clone(), number })
    }
}

/// One of them, until this is dropped.
struct Stranger {
    among: Strangers,
    number: u64,
}

impl Drop for Stranger {
    fn drop(&mut self) {
        let mut all = self.among.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|(number, _)| *number != self.number);
    }
}

/// How many visitors there are of each [`Grant`].
#[derive(Clone, Default)]
struct Rooms {
    command: Arc<AtomicUsize>,
    read: Arc<AtomicUsize>,
}

impl Rooms {
    fn of(&self, grant: Grant) -> &Arc<AtomicUsize> {
        match grant {
            Grant::Command => &self.command,
            Grant::Read => &self.read,
        }
    }
}

/// A place among so many, until it is dropped.
struct Place(Arc<AtomicUsize>);

impl Place {
    fn take(taken: &Arc<AtomicUsize>, of: usize) -> Option<Self> {
        if taken.fetch_add(1, Ordering::Relaxed) < of {
            return Some(Self(taken.clone()));
        }
        taken.fetch_sub(1, Ordering::Relaxed);
        None
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Answers a request, or makes a visitor of who asks.
fn receive(
    mut stream: TcpStream,
    stranger: Stranger,
    gate: &Gate,
    house: &House,
    rooms: &Rooms,
) -> Option<(Visitor, Place)> {
    let head = match http::read_head(&mut stream) {
        Ok(head) => head,
        Err(BadHead::Gone) => return None,
        Err(BadHead::TooLong) => {
            let text = format!("the head of a request has at most {} bytes", http::LONGEST_HEAD);
            http::answer_text(&mut stream, 431, &text);
            return None;
        }
        Err(BadHead::NotHttp) => {
            let text = "this is not a request of HTTP/1.1 without a body";
            http::answer_text(&mut stream, 400, text);
            return None;
        }
    };
    let token = token(&head);
    let asker =
        Asker { host: head.only("host"), origin: head.only("origin"), token: token.as_deref() };
    let local = stream.local_addr().ok()?.ip();
    // Who is known is not ended for others, as one whose stop is awaited.
    let _stranger = if gate.check(&asker, local).is_ok() { None } else { Some(stranger) };
    match answer(&mut stream, &head, &asker, local, gate, house, rooms) {
        Ok(Some((grant, speech, place))) => {
            let outbox = Outbox::default();
            let heard = socket::open(stream, &outbox).ok()?;
            Some((Visitor { grant, speech, outbox, heard }, place))
        }
        Ok(None) => None,
        Err(refusal) => {
            http::answer_text(&mut stream, refusal.status(), &refusal.to_string());
            None
        }
    }
}

/// The token of a request: in a subprotocol, which a page can choose, in the address, which is all
/// that Foxglove lets its user choose, or as that of a POST.
fn token(head: &Head) -> Option<Vec<u8>> {
    let mut offered = head.items("sec-websocket-protocol");
    let hidden = offered.find_map(|item| item.strip_prefix(TOKEN_PROTOCOL));
    let bearer = head.only("authorization").and_then(|of| of.strip_prefix(BEARER));
    match hidden.or(bearer) {
        Some(digits) => http::hex_decoded(digits),
        None => head.parameter("token"),
    }
}

fn answer(
    stream: &mut TcpStream,
    head: &Head,
    asker: &Asker<'_>,
    local: IpAddr,
    gate: &Gate,
    house: &House,
    rooms: &Rooms,
) -> Result<Option<(Grant, Speech, Place)>, Refusal> {
    gate.check_host(asker.host, local)?;
    let host = asker.host.unwrap_or_default();
    let is_root = head.path == "/";
    match head.method.as_str() {
        "GET" if head.path == LIVE || is_root && head.asks_for_websocket() => {
            let grant = gate.check(asker, local)?;
            return Ok(welcome(stream, head, grant, rooms));
        }
        "GET" => match page::FILES.iter().find(|file| file.path == head.path) {
            Some(file) => {
                let policy = page::policy(host);
                let headers =
                    [("Content-Type", file.kind), ("Content-Security-Policy", policy.as_str())];
                http::answer(stream, 200, &headers, file.text.as_bytes());
            }
            None => {
                let paths: Vec<_> = page::FILES.iter().map(|file| file.path).collect();
                let text = format!("there is {} and {LIVE}, nothing else", paths.join(", "));
                http::answer_text(stream, 404, &text);
            }
        },
        "POST" if head.path == STOP => {
            gate.check_command(asker, local)?;
            let (taken, text) = (house.stop)();
            http::answer_text(stream, if taken { 200 } else { 503 }, &text);
        }
        "POST" => {
            gate.check_command(asker, local)?;
            http::answer_text(stream, 404, &format!("a POST goes to {STOP}, nowhere else"));
        }
        _ => http::answer_text(stream, 405, "GET, or POST to stop"),
    }
    Ok(None)
}

/// The handshake of a WebSocket.
fn welcome(
    stream: &mut TcpStream,
    head: &Head,
    grant: Grant,
    rooms: &Rooms,
) -> Option<(Grant, Speech, Place)> {
    use std::io::Write;
    let offers = |name: &str| head.items("sec-websocket-protocol").any(|item| item == name);
    let foxglove = FOXGLOVE.into_iter().find(|name| offers(name));
    let spoken = match foxglove {
        _ if offers(PAGE_PROTOCOL) => Some((Speech::Page, PAGE_PROTOCOL)),
        Some(name) => Some((Speech::Foxglove, name)),
        None => None,
    };
    let version = head.only("sec-websocket-version");
    let key = head.only("sec-websocket-key").filter(|_| version == Some("13"));
    let (Some((speech, name)), Some(key), true) = (spoken, key, head.asks_for_websocket()) else {
        let text = format!(
            "a WebSocket of version 13 is opened here, with the subprotocol {PAGE_PROTOCOL}, {}",
            FOXGLOVE.join(" or ")
        );
        http::answer_text(stream, 426, &text);
        return None;
    };
    let Some(place) = Place::take(rooms.of(grant), VISITORS) else {
        let who = match grant {
            Grant::Command => "pages that may command",
            Grant::Read => "visitors that read",
        };
        let text = format!("{VISITORS} {who} are here: close one first");
        http::answer_text(stream, 503, &text);
        return None;
    };
    let answer = format!(
        "HTTP/1.1 101 Switching Protocols\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Accept: {}\r\nSec-WebSocket-Protocol: {name}\r\n\r\n",
        derive_accept_key(key.as_bytes())
    );
    let _ = stream.set_write_timeout(Some(http::ANSWER_WITHIN));
    stream.write_all(answer.as_bytes()).ok()?;
    Some((grant, speech, place))
}
