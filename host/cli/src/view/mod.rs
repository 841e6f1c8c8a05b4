//! `mgw serve --view`: a page that shows the gateway and, to whom takes command, moves its axes;
//! and the same data by Foxglove's protocol.
//!
//! It is one more program of the server, or several: one that watches for all pages (`eye.rs`), one
//! for each page in command (`hand.rs`), one for each stop (`brake.rs`). Who may open it is decided
//! in `host/view`.

mod ask;
mod brake;
mod envelope;
mod eye;
mod hand;
mod hub;
mod reach;

use std::net::{SocketAddr, TcpListener};
use std::thread;
use std::time::Duration;

use mgw_view::{Gate, Grant, House, Speech, Visitor};
use serde_json::json;

use crate::failure::Failure;
use crate::output::Output;
use ask::Ask;
use hand::{Hand, Heard};
use hub::Hub;
use reach::from_here;

pub use reach::Reach;

/// Bytes of a token at least, where other computers can guess.
const LEAST_TOKEN: usize = 16;

/// What the page may be told on the command line.
#[derive(Debug, clap::Args)]
pub struct ViewArgs {
    /// Serve a page in the browser, too: curves, trips, stop, jog; and Foxglove. It prints the
    /// address with its token
    #[arg(
        long, num_args = 0..=1, default_missing_value = "127.0.0.1:7480", value_name = "HOST:PORT"
    )]
    pub view: Option<SocketAddr>,
    /// Pages of this origin, such as https://app.foxglove.dev, may read, with the token; may be
    /// given often
    #[arg(long, value_name = "ORIGIN", requires = "view", value_parser = origin)]
    pub allow_origin: Vec<String>,
    /// Between two samples of an axis for the page and Foxglove
    #[arg(
        long, default_value_t = 20, value_name = "MS", requires = "view",
        value_parser = clap::value_parser!(u64).range(1..=1_000)
    )]
    pub view_period: u64,
}

/// An origin as browsers write it.
fn origin(text: &str) -> Result<String, String> {
    let (scheme, host) = text.split_once("://").unwrap_or_default();
    let is_plain = |part: &str| {
        !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_graphic() && byte != b',')
    };
    if is_plain(scheme) && is_plain(host) && !host.contains(['/', '?', '#', '*', '@']) {
        Ok(text.to_owned())
    } else {
        Err("an origin is SCHEME://HOST or SCHEME://HOST:PORT, without a path: \
             https://app.foxglove.dev"
            .to_owned())
    }
}

/// The page's own listener.
pub struct View {
    listener: TcpListener,
    gate: Gate,
    period: Duration,
}

impl View {
    /// Listens, if that is wanted, and prints the address. Programs' token is the page's, too;
    /// without one it gets its own.
    ///
    /// # Errors
    /// The address is taken, or beyond this computer and there is no token.
    pub fn open(
        arguments: &ViewArgs,
        token: Option<&str>,
        out: Output,
    ) -> Result<Option<Self>, Failure> {
        let Some(address) = arguments.view else { return Ok(None) };
        check_token("--view", address, token)?;
        let failed = |source| Failure::no_port(address.to_string(), source);
        let listener = TcpListener::bind(address).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let token = match token {
            Some(token) => token.to_owned(),
            None => mgw_view::new_token().map_err(failed)?,
        };
        let url = format!("http://{}/#token={}", from_here(address), escaped(&token));
        let elsewhere = if address.ip().is_unspecified() {
            " (from elsewhere: with the number of this computer's address in it)"
        } else {
            ""
        };
        out.event("view", format!("the page: {url}{elsewhere}"), json!({ "url": url }))?;
        let gate = Gate::new(address, token, arguments.allow_origin.clone());
        let period = Duration::from_millis(arguments.view_period);
        Ok(Some(Self { listener, gate, period }))
    }

    /// Serves in threads of its own, until the process ends.
    pub fn start(self, reach: Reach) {
        let hub = Hub::default();
        let Self { listener, gate, period } = self;
        let (watched, told) = (reach.clone(), hub.clone());
        thread::spawn(move || eye::watch(&watched, &told, period));
        let stopped = reach.clone();
        let house = House {
            attend: Box::new(move |visitor| attend(visitor, &reach, &hub)),
            stop: Box::new(move || brake::stop_by_post(&stopped)),
        };
        thread::spawn(move || mgw_view::serve(&listener, gate, house));
    }
}

/// Refuses to listen where other computers get in without a token, or by one that they may guess.
pub fn check_token(option: &str, address: SocketAddr, token: Option<&str>) -> Result<(), Failure> {
    let why = match token.map(str::len) {
        _ if address.ip().is_loopback() => return Ok(()),
        Some(LEAST_TOKEN..) => return Ok(()),
        Some(_) => format!(
            ", which may guess as fast as they can: the --token has at least {LEAST_TOKEN} bytes there"
        ),
        None => ": give a --token that has to be shown there, or listen on 127.0.0.1".to_owned(),
    };
    Err(Failure::Usage(format!("{option} {address} can be reached from other computers{why}")))
}

/// A token as a part of an address.
fn escaped(token: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    let escape = |byte| match byte {
        byte if plain(byte) => char::from(byte).to_string(),
        byte => format!("%{byte:02X}"),
    };
    token.bytes().map(escape).collect()
}

/// Attends to one visitor until it has gone.
fn attend(mut visitor: Visitor, reach: &Reach, hub: &Hub) {
    if visitor.speech == Speech::Foxglove {
        let seat = hub.seat_foxglove(&visitor.outbox);
        while let Some(text) = visitor.hear() {
            hub.hear_foxglove(seat, &text);
        }
        return hub.leave(seat);
    }
    let outbox = visitor.outbox.clone();
    let grant = if visitor.grant == Grant::Command { "command" } else { "read" };
    outbox.put_json(&json!({ "event": "welcome", "grant": grant }));
    let seat = hub.seat_page(&outbox);
    let (heard, mut hand) = (Heard::now(), None::<Hand>);
    while let Some(text) = visitor.hear() {
        let asked = Ask::read(&text);
        if asked.is_ok() {
            heard.again();
        }
        let refuse = |message: &str| {
            let told = json!({ "event": "refused", "name": "Usage", "message": message });
            outbox.put_json(&told);
        };
        match asked {
            Err(why) => {
                refuse(&why);
                if let Some(hand) = &hand {
                    hand.order(Ask::Unreadable);
                }
            }
            Ok(Ask::Seen { tick }) => hub.has_drawn(seat, tick),
            Ok(Ask::Here) => {}
            Ok(_) if visitor.grant == Grant::Read => {
                refuse("this page may read, not command: open the page of `mgw serve` itself");
            }
            Ok(Ask::Stop) => brake::stop_for(reach, &outbox),
            Ok(Ask::Take) => {
                if !hand.as_ref().is_some_and(|hand| hand.order(Ask::Here)) {
                    hand = Some(Hand::take(reach, &outbox, &heard));
                }
            }
            Ok(ask) => match &hand {
                Some(hand) if hand.order(ask) => {}
                // What is no longer held needs no release.
                _ if matches!(ask, Ask::Rest { .. } | Ask::Release) => {}
                _ => refuse("this page does not command: take command first"),
            },
        }
    }
    hub.leave(seat);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_has_no_path() {
        for good in ["https://app.foxglove.dev", "http://localhost:8080", "foxglove://app"] {
            assert_eq!(origin(good), Ok(good.to_owned()));
        }
        for bad in ["", "*", "app.foxglove.dev", "https://", "https://a/", "https://*.a", "null"] {
            assert!(origin(bad).unwrap_err().contains("SCHEME://HOST"), "{bad}");
        }
    }

    #[test]
    fn a_token_is_escaped_in_the_address() {
        assert_eq!(escaped("a-1 #é"), "a-1%20%23%C3%A9");
    }
}
