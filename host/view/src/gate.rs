//! Who may open the page, read or command: decided from the head of a request, before anything is
//! done with it.

use std::fmt;
use std::net::{IpAddr, SocketAddr};

use subtle::ConstantTimeEq;

/// What an admitted connection may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grant {
    /// Everything that the page does.
    Command,
    /// Reading: a page of another origin that was allowed, or a program that reads by Foxglove's
    /// protocol.
    Read,
}

/// What the head of a request says of who asks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Asker<'a> {
    /// The name under which the browser knows us.
    pub host: Option<&'a str>,
    /// The page that asks; browsers always say it with a WebSocket and a POST.
    pub origin: Option<&'a str>,
    /// The token that is shown.
    pub token: Option<&'a [u8]>,
}

/// Why a request is refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Refusal {
    /// The name is none of ours: another page may have had it point here.
    WrongHost {
        /// Names that are ours.
        allowed: String,
    },
    /// The page that asks is not ours and was not allowed.
    ForeignOrigin {
        /// Who asks.
        origin: String,
    },
    /// It may read, and this is no reading.
    ReadsOnly,
    /// The token is missing.
    NoToken,
    /// It is another one.
    WrongToken,
}

impl Refusal {
    /// The status of HTTP.
    pub fn status(&self) -> u16 {
        match self {
            Self::WrongHost { .. } => 421,
            Self::ForeignOrigin { .. } | Self::ReadsOnly => 403,
            Self::NoToken | Self::WrongToken => 401,
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WrongHost { allowed } => {
                write!(out, "the Host of this request is not this server's: use {allowed}")
            }
            Self::ForeignOrigin { origin } => write!(
                out,
                "a page of {origin:?} may neither read nor command: only this server's own page \
                 may, and for reading what `mgw serve --allow-origin` names"
            ),
            Self::ReadsOnly => write!(
                out,
                "this origin may read, not command: only this server's own page commands"
            ),
            Self::NoToken => write!(
                out,
                "the token is missing: open the address that `mgw serve --view` has printed"
            ),
            Self::WrongToken => write!(
                out,
                "the token is not the one of this server, which may have been started again: open \
                 the address that it has printed last"
            ),
        }
    }
}

/// The check itself.
#[derive(Debug, Clone)]
pub struct Gate {
    address: SocketAddr,
    token: String,
    readers: Vec<String>,
}

/// The name of this computer for itself, which no name server is asked for.
const LOCALHOST: &str = "localhost";
/// The port that a Host without one means.
const HTTP_PORT: u16 = 80;

impl Gate {
    /// For a server at this address; pages of `readers`, origins such as `https://example.org`, may
    /// read.
    pub fn new(address: SocketAddr, token: String, readers: Vec<String>) -> Self {
        Self { address, token, readers }
    }

    /// The token.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// What every request must pass: its Host is ours. A name that another page has pointed at this
    /// computer is refused, so addresses are numbers, or localhost. `local`: the end of the
    /// connection here.
    ///
    /// # Errors
    /// [`Refusal::WrongHost`].
    pub fn check_host(&self, host: Option<&str>, local: IpAddr) -> Result<(), Refusal> {
        let local = SocketAddr::new(local.to_canonical(), self.address.port());
        let is_ours = host.is_some_and(|host| is_of(host, local));
        if is_ours { Ok(()) } else { Err(Refusal::WrongHost { allowed: names(local) }) }
    }

    /// What a request that commands must pass: it is our own page, which has the token.
    ///
    /// # Errors
    /// The [`Refusal`].
    pub fn check_command(&self, asker: &Asker<'_>, local: IpAddr) -> Result<(), Refusal> {
        match self.check(asker, local)? {
            Grant::Command => Ok(()),
            Grant::Read => Err(Refusal::ReadsOnly),
        }
    }

    /// What a WebSocket may do.
    ///
    /// # Errors
    /// The [`Refusal`].
    pub fn check(&self, asker: &Asker<'_>, local: IpAddr) -> Result<Grant, Refusal> {
        self.check_host(asker.host, local)?;
        let own = asker.host.map(|host| format!("http://{host}"));
        let grant = match asker.origin {
            // No page: browsers say the origin. Programs that are none read.
            None => Grant::Read,
            Some(origin) if own.as_deref().is_some_and(|own| same(own, origin)) => Grant::Command,
            Some(origin) if self.readers.iter().any(|reader| same(reader, origin)) => Grant::Read,
            Some(origin) => {
                return Err(Refusal::ForeignOrigin { origin: origin.to_owned() });
            }
        };
        let Some(token) = asker.token else { return Err(Refusal::NoToken) };
        if bool::from(token.ct_eq(self.token.as_bytes())) {
            Ok(grant)
        } else {
            Err(Refusal::WrongToken)
        }
    }
}

/// Whether a Host names this end of a connection.
fn is_of(host: &str, local: SocketAddr) -> bool {
    let Some((name, port)) = split(host) else { return false };
    let is_here = match name.parse::<IpAddr>() {
        Ok(ip) => ip == local.ip(),
        Err(_) => local.ip().is_loopback() && name.eq_ignore_ascii_case(LOCALHOST),
    };
    is_here && port == local.port()
}

/// The Hosts that do.
fn names(local: SocketAddr) -> String {
    if local.ip().is_loopback() {
        format!("{local} or {LOCALHOST}:{}", local.port())
    } else {
        local.to_string()
    }
}

fn same(one: &str, other: &str) -> bool {
    one.eq_ignore_ascii_case(other)
}

/// Name and port of a Host: `127.0.0.1:7480`, `[::1]:7480`.
fn split(host: &str) -> Option<(&str, u16)> {
    let (name, port) = match host.strip_prefix('[') {
        Some(rest) => {
            let (name, port) = rest.split_once(']')?;
            (name, if port.is_empty() { None } else { Some(port.strip_prefix(':')?) })
        }
        None => match host.split_once(':') {
            Some((name, port)) => (name, Some(port)),
            None => (host, None),
        },
    };
    let digits = |port: &str| port.bytes().all(|digit| digit.is_ascii_digit());
    match port {
        Some(port) if digits(port) => Some((name, port.parse().ok()?)),
        Some(_) => None,
        None => Some((name, HTTP_PORT)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    const TOKEN: &[u8] = b"0123456789abcdef";

    fn gate(address: &str) -> Gate {
        let token = String::from_utf8(TOKEN.to_vec()).unwrap();
        let readers = vec!["https://app.foxglove.dev".to_owned()];
        Gate::new(address.parse().unwrap(), token, readers)
    }

    fn asker<'a>(host: &'a str, origin: &'a str) -> Asker<'a> {
        Asker { host: Some(host), origin: Some(origin), token: Some(TOKEN) }
    }

    const LOOPBACK: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

    #[test]
    fn names_that_another_page_can_point_here_are_refused() {
        let gate = gate("127.0.0.1:7480");
        for ours in ["127.0.0.1:7480", "localhost:7480", "LOCALHOST:7480"] {
            assert_eq!(gate.check_host(Some(ours), LOOPBACK), Ok(()), "{ours}");
        }
        for foreign in [
            "evil.example:7480",
            "127.0.0.1",
            "127.0.0.1:7481",
            "localhost",
            "[::1]:7480",
            "127.0.0.1:7480:1",
            "127.0.0.1:+7480",
            "",
            "127.0.0.1.evil.example:7480",
            "[",
            "a:b",
            "localhost.:7480",
            "0.0.0.0:7480",
            "2130706433:7480",
        ] {
            let refused = gate.check_host(Some(foreign), LOOPBACK).unwrap_err();
            assert_eq!(refused.status(), 421, "{foreign}");
        }
        assert_eq!(gate.check_host(None, LOOPBACK).unwrap_err().status(), 421);
    }

    #[test]
    fn a_server_of_all_addresses_takes_numbers_and_no_names() {
        let gate = gate("0.0.0.0:7480");
        let [wired, mapped] =
            ["192.168.1.4", "::ffff:192.168.1.4"].map(|ip| ip.parse::<IpAddr>().unwrap());
        for local in [wired, mapped] {
            assert_eq!(gate.check_host(Some("192.168.1.4:7480"), local), Ok(()));
            for foreign in [
                "robot.local:7480",
                "localhost:7480",
                "192.168.1.4:80",
                "8.8.8.8:7480",
                "0.0.0.0:7480",
                "[fe80::1]:7480",
            ] {
                assert!(gate.check_host(Some(foreign), local).is_err(), "{foreign}");
            }
        }
        let here = "[fe80::1]:7480";
        assert_eq!(gate.check_host(Some(here), "fe80::1".parse().unwrap()), Ok(()));
        assert_eq!(gate.check_host(Some("localhost:7480"), LOOPBACK), Ok(()));
    }

    #[test]
    fn only_the_own_page_commands() {
        let gate = gate("127.0.0.1:7480");
        let own = asker("localhost:7480", "http://localhost:7480");
        assert_eq!(gate.check(&own, LOOPBACK), Ok(Grant::Command));
        assert_eq!(gate.check_command(&own, LOOPBACK), Ok(()));
        let reader = asker("127.0.0.1:7480", "https://app.foxglove.dev");
        assert_eq!(gate.check(&reader, LOOPBACK), Ok(Grant::Read));
        assert_eq!(gate.check_command(&reader, LOOPBACK), Err(Refusal::ReadsOnly));
        let program = Asker { origin: None, ..own };
        assert_eq!(gate.check(&program, LOOPBACK), Ok(Grant::Read));
        for foreign in [
            "http://evil.example",
            "null",
            "http://127.0.0.1:7480",
            "https://localhost:7480",
            "http://localhost",
            "https://app.foxglove.dev.evil.example",
            "",
            "file://",
        ] {
            let refused = gate.check(&asker("localhost:7480", foreign), LOOPBACK).unwrap_err();
            assert_eq!(refused, Refusal::ForeignOrigin { origin: foreign.to_owned() });
        }
    }

    #[test]
    fn the_token_is_wanted_of_all() {
        let gate = gate("127.0.0.1:7480");
        for origin in ["http://localhost:7480", "https://app.foxglove.dev"] {
            let own = asker("localhost:7480", origin);
            let without = Asker { token: None, ..own };
            assert_eq!(gate.check(&without, LOOPBACK), Err(Refusal::NoToken));
            let tokens: [&[u8]; 4] = [b"", b"0123456789abcde", b"0123456789abcdeF", b"x"];
            for wrong in tokens {
                let wrong = Asker { token: Some(wrong), ..own };
                assert_eq!(gate.check(&wrong, LOOPBACK), Err(Refusal::WrongToken));
            }
        }
    }
}
