//! Sockets and threads around the [`Gate`]: each connection is one request, which is answered, or
//! becomes a visitor.

use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use tungstenite::handshake::derive_accept_key;

use crate::gate::{Asker, Gate, Grant, Refusal};
use crate::http::{self, BadHead, Head};
use crate::outbox::Outbox;
use crate::page;
use crate::socket::{self, Heard};

/// Connections at a time that have not shown the token.
pub const STRANGERS: usize = 64;
/// Visitors at a time.
pub const VISITORS: usize = 32;
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
    let (strangers, visitors) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
    loop {
        let Ok((mut stream, _)) = listener.accept() else {
            thread::sleep(LOOK_AGAIN);
            continue;
        };
        let Some(place) = Place::take(&strangers, STRANGERS) else {
            refuse_quickly(&mut stream);
            continue;
        };
        let (all, visitors) = (all.clone(), visitors.clone());
        thread::spawn(move || {
            let (gate, house) = &*all;
            if let Some((visitor, _place)) = receive(stream, gate, house, &visitors) {
                drop(place);
                (house.attend)(visitor);
            }
        });
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

fn refuse_quickly(stream: &mut TcpStream) {
    use std::io::Write;
    let _ = stream.set_write_timeout(Some(LOOK_AGAIN));
    let _ = stream.write_all(b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n");
}

/// Answers a request, or makes a visitor of who asks.
fn receive(
    mut stream: TcpStream,
    gate: &Gate,
    house: &House,
    visitors: &Arc<AtomicUsize>,
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
    match answer(&mut stream, &head, &asker, gate, house, visitors) {
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
    gate: &Gate,
    house: &House,
    visitors: &Arc<AtomicUsize>,
) -> Result<Option<(Grant, Speech, Place)>, Refusal> {
    gate.check_host(asker.host)?;
    let host = asker.host.unwrap_or_default();
    let is_root = head.path == "/";
    match head.method.as_str() {
        "GET" if head.path == LIVE || is_root && head.asks_for_websocket() => {
            let grant = gate.check(asker)?;
            return Ok(welcome(stream, head, grant, visitors));
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
            gate.check_command(asker)?;
            let (taken, text) = (house.stop)();
            http::answer_text(stream, if taken { 200 } else { 503 }, &text);
        }
        "POST" => {
            gate.check_command(asker)?;
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
    visitors: &Arc<AtomicUsize>,
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
    let Some(place) = Place::take(visitors, VISITORS) else {
        let text = format!("{VISITORS} visitors are here: close a page first");
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
