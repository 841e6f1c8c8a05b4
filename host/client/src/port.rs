//! The name of a port, as a user types it, and how it is opened.

use std::fmt;
use std::io;
use std::net::IpAddr;

use host_protocol::DEFAULT_BAUD;

use crate::serial::SerialTransport;
use crate::tcp::{READ_WAIT, TcpTransport};
use crate::transport::Transport;

/// What a TCP port's name begins with.
const TCP_PREFIX: &str = "tcp:";
/// What the name of a server's socket begins with.
pub(crate) const UNIX_PREFIX: &str = "unix:";
/// Holds the token for servers that want one.
const TOKEN_VARIABLE: &str = "MGW_TOKEN";
/// What stands between a serial device and its bit rate.
const BAUD_SEPARATOR: char = '@';

/// Opens the port of that name: `tcp:HOST:PORT`, also without `tcp:`, `unix:PATH` of a server, or a
/// serial device such as `/dev/ttyACM0` or `COM5`, which runs at 921600 baud unless the name ends
/// in `@` and another rate, which a [`Client`](crate::Client) then asks the gateway for.
///
/// # Errors
/// When the name makes no sense or the port cannot be opened; the error says which and what to do.
pub fn open(port: &str) -> Result<Box<dyn Transport + Send>, ConnectError> {
    Ok(match Port::read(port)? {
        Port::Tcp(address) => {
            let transport = TcpTransport::connect_showing(address, token());
            Box::new(transport.map_err(|source| no_tcp(address, source))?)
        }
        #[cfg(unix)]
        Port::Unix(path) => {
            let transport = crate::unix::UnixTransport::connect(path.into());
            Box::new(transport.map_err(|source| no_server(path, source))?)
        }
        Port::Serial(device, baud) => {
            let transport = SerialTransport::open(device, baud);
            Box::new(transport.map_err(|source| no_serial(device, baud, source))?)
        }
    })
}

/// Whether a port can be opened as halves, by its name.
///
/// # Errors
/// What is wrong with it.
pub fn check_shared_name(port: &str) -> Result<(), ConnectError> {
    match Port::read(port)? {
        Port::Serial(device, baud) if baud != DEFAULT_BAUD => {
            Err(ConnectError::RateOfOne { device: device.to_owned() })
        }
        _ => Ok(()),
    }
}

/// A port as two halves, for who reads and writes at the same time. A read waits, or fails now and
/// then with [`io::ErrorKind::TimedOut`]; one of 0 bytes is the end.
pub struct Halves {
    /// From the gateway.
    pub reader: Box<dyn io::Read + Send>,
    /// To it.
    pub writer: Box<dyn io::Write + Send>,
}

/// As [`open`], as halves.
///
/// # Errors
/// As [`open`].
pub fn open_halves(port: &str) -> Result<Halves, ConnectError> {
    check_shared_name(port)?;
    let (reader, writer): (Box<dyn io::Read + Send>, Box<dyn io::Write + Send>) =
        match Port::read(port)? {
            Port::Tcp(address) => {
                let opened = crate::tcp::open(address, token().as_deref());
                let both = opened.and_then(|stream| Ok((stream.try_clone()?, stream)));
                let (reader, writer) = both.map_err(|source| no_tcp(address, source))?;
                (Box::new(reader), Box::new(writer))
            }
            #[cfg(unix)]
            Port::Unix(path) => {
                let opened = crate::unix::open(path.as_ref());
                let both = opened.and_then(|stream| Ok((stream.try_clone()?, stream)));
                let (reader, writer) = both.map_err(|source| no_server(path, source))?;
                (Box::new(reader), Box::new(writer))
            }
            Port::Serial(device, baud) => {
                let opened = crate::serial::open(device).and_then(|mut port| {
                    port.set_timeout(READ_WAIT)?;
                    let reader = port.try_clone()?;
                    port.set_timeout(crate::serial::WRITE_TIMEOUT)?;
                    Ok((reader, port))
                });
                let (reader, writer) = opened.map_err(|source| no_serial(device, baud, source))?;
                (Box::new(reader), Box::new(writer))
            }
        };
    Ok(Halves { reader, writer })
}

/// What the name of a port says.
enum Port<'a> {
    Tcp(&'a str),
    #[cfg(unix)]
    Unix(&'a str),
    Serial(&'a str, u32),
}

impl<'a> Port<'a> {
    fn read(port: &'a str) -> Result<Self, ConnectError> {
        #[cfg(unix)]
        if let Some(path) = behind(UNIX_PREFIX, port) {
            return if path.is_empty() { Err(ConnectError::NoPath) } else { Ok(Self::Unix(path)) };
        }
        if let Some(address) = tcp_address(port) {
            if !is_complete(address) {
                return Err(ConnectError::BadAddress { port: port.to_owned() });
            }
            return Ok(Self::Tcp(address));
        }
        let (device, baud) = match port.rsplit_once(BAUD_SEPARATOR) {
            Some((device, rate)) => match rate.parse::<u32>() {
                Ok(baud) if baud > 0 => (device, baud),
                _ => return Err(ConnectError::BadBaud { port: port.to_owned() }),
            },
            None => (port, DEFAULT_BAUD),
        };
        if device.is_empty() {
            return Err(ConnectError::NoPort);
        }
        Ok(Self::Serial(device, baud))
    }
}

/// The token of this user's environment, for servers that want one.
fn token() -> Option<String> {
    std::env::var(TOKEN_VARIABLE).ok().filter(|token| !token.is_empty())
}

fn no_tcp(address: &str, source: io::Error) -> ConnectError {
    ConnectError::Tcp { address: address.to_owned(), source }
}

#[cfg(unix)]
fn no_server(path: &str, source: io::Error) -> ConnectError {
    ConnectError::Server { path: path.to_owned(), source }
}

fn no_serial(device: &str, baud: u32, source: io::Error) -> ConnectError {
    ConnectError::Serial { device: device.to_owned(), baud, source }
}

/// What stands behind a prefix, however that is written.
fn behind<'a>(prefix: &str, port: &'a str) -> Option<&'a str> {
    let (before, behind) = port.split_at_checked(prefix.len())?;
    before.eq_ignore_ascii_case(prefix).then_some(behind)
}

/// What stands behind `tcp:`, however that is written; without it what can be no device.
fn tcp_address(port: &str) -> Option<&str> {
    if let Some(address) = behind(TCP_PREFIX, port) {
        return Some(address.strip_prefix("//").unwrap_or(address));
    }
    let is_device = port.contains(['/', '\\']);
    let is_address = !is_device && is_complete(port) || port.parse::<IpAddr>().is_ok();
    is_address.then_some(port)
}

/// Whether it is `HOST:PORT`.
fn is_complete(address: &str) -> bool {
    let (host, number) = address.rsplit_once(':').unwrap_or_default();
    let is_bare_ipv6 = host.contains(':') && !host.starts_with('[');
    !host.is_empty() && !is_bare_ipv6 && number.parse::<u16>().is_ok()
}

/// Why a port could not be opened.
#[derive(Debug)]
pub enum ConnectError {
    /// The name is empty.
    NoPort,
    /// Nothing follows `unix:`.
    NoPath,
    /// A `tcp:` name without host and port number.
    BadAddress {
        /// What was given.
        port: String,
    },
    /// What follows the `@` is no bit rate.
    BadBaud {
        /// What was given.
        port: String,
    },
    /// No TCP connection.
    Tcp {
        /// `HOST:PORT`.
        address: String,
        /// What the system says.
        source: io::Error,
    },
    /// No server behind a Unix socket.
    Server {
        /// The socket.
        path: String,
        /// What the system says.
        source: io::Error,
    },
    /// Another rate than the default for a serial device that many programs share: only a client
    /// that has it alone asks the gateway for one.
    RateOfOne {
        /// Its name.
        device: String,
    },
    /// The serial device could not be opened.
    Serial {
        /// Its name.
        device: String,
        /// Bits per second.
        baud: u32,
        /// What the system says.
        source: io::Error,
    },
}

impl fmt::Display for ConnectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoPort => {
                write!(
                    f,
                    "the port has no name. Name a serial device such as /dev/ttyACM0, or \
                        tcp:HOST:PORT"
                )
            }
            Self::BadAddress { port } => {
                write!(
                    f,
                    "`{port}` is no TCP port. Write tcp:HOST:PORT, for example tcp:127.0.0.1:7401"
                )
            }
            Self::BadBaud { port } => {
                write!(
                    f,
                    "`{port}` names no baud rate. Write DEVICE or DEVICE@RATE, for example \
                        /dev/ttyACM0@2000000"
                )
            }
            Self::Tcp { address, source } => {
                write!(f, "no gateway at tcp:{address} ({source}). ")?;
                match source.kind() {
                    io::ErrorKind::ConnectionRefused => {
                        write!(
                            f,
                            "Nothing listens there: start the gateway, or `mgw sim --listen \
                                {address}`"
                        )
                    }
                    io::ErrorKind::TimedOut => {
                        write!(f, "Check the address and that a network leads there")
                    }
                    _ => write!(f, "Check the host name and the port number"),
                }
            }
            Self::NoPath => {
                write!(
                    f,
                    "`unix:` names no socket. Write unix:PATH, the path that `mgw serve` prints"
                )
            }
            Self::Server { path, source } => {
                let start = match source.kind() {
                    io::ErrorKind::TimedOut => "End it, and start it again",
                    _ => "Start one with `mgw serve`",
                };
                write!(f, "no server at {path} ({source}). {start}")
            }
            Self::RateOfOne { device } => {
                write!(
                    f,
                    "programs that share a line run it at the default rate: only one that has it \
                        alone can ask for another. Name it {device}"
                )
            }
            Self::Serial { device, baud, source } => {
                write!(f, "cannot open {device} at {baud} bit/s ({source}). ")?;
                match source.kind() {
                    io::ErrorKind::NotFound => write!(
                        f,
                        "Check that the board is plugged in and which name it has (Linux: ls \
                            /dev/ttyACM* /dev/ttyUSB*)"
                    ),
                    io::ErrorKind::PermissionDenied => {
                        write!(
                            f,
                            "Give your user the right to open it (Linux: join the group that owns \
                                it, often dialout)"
                        )
                    }
                    _ => {
                        write!(
                            f,
                            "Check that no other program has it open and that it can run at that \
                                rate"
                        )
                    }
                }
            }
        }
    }
}

impl std::error::Error for ConnectError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Tcp { source, .. }
            | Self::Server { source, .. }
            | Self::Serial { source, .. } => Some(source),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(port: &str) -> ConnectError {
        match open(port) {
            Ok(_) => panic!("`{port}` must not open"),
            Err(error) => error,
        }
    }

    #[test]
    fn names_that_make_no_sense_are_told_apart() {
        assert!(matches!(refused(""), ConnectError::NoPort));
        assert!(matches!(refused("@9600"), ConnectError::NoPort));
        #[cfg(unix)]
        assert!(matches!(refused("unix:"), ConnectError::NoPath));
        for port in [
            "tcp:",
            "tcp:localhost",
            "tcp::7401",
            "tcp:localhost:70000",
            "tcp:localhost:x",
            "TCP:localhost",
            "127.0.0.1",
            "::1",
        ] {
            assert!(matches!(refused(port), ConnectError::BadAddress { .. }), "{port}");
        }
        for port in ["/dev/ttyACM0@", "/dev/ttyACM0@fast", "/dev/ttyACM0@0"] {
            assert!(matches!(refused(port), ConnectError::BadBaud { .. }), "{port}");
        }
    }

    #[test]
    fn an_address_is_known_however_it_is_written() {
        for port in ["tcp:[::1]:7401", "TCP:[::1]:7401", "Tcp://[::1]:7401", "[::1]:7401"] {
            assert_eq!(tcp_address(port), Some("[::1]:7401"), "{port}");
        }
        assert_eq!(tcp_address("localhost:7401"), Some("localhost:7401"));
        for port in ["/dev/ttyACM0", "/dev/serial/by-id/a:0:1", "COM5", "ttyACM0@9600", "tcp", ""] {
            assert_eq!(tcp_address(port), None, "{port}");
        }
    }

    #[test]
    fn a_device_that_does_not_exist_is_named_with_a_next_step() {
        let text = refused("/dev/no-such-gateway").to_string();
        assert!(text.contains("/dev/no-such-gateway at 921600 bit/s"), "{text}");
        assert!(text.contains("plugged in"), "{text}");
    }

    #[test]
    fn a_tcp_port_nobody_listens_on_says_how_to_start_one() {
        // A port that was just free: bound to learn its number, then closed.
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        drop(listener);
        let text = refused(&format!("tcp:{address}")).to_string();
        assert!(text.contains(&format!("`mgw sim --listen {address}`")), "{text}");
    }
}
