//! Why the client could not do what it was asked for.

use std::fmt;
use std::io;
use std::time::Duration;

use crate::cycle::LAST_AXIS;
use crate::port::ConnectError;

/// Why a request has no result.
#[derive(Debug)]
pub enum ClientError {
    /// The gateway refused it, or could not do it; the error names the cause and what to do.
    Gateway(host_protocol::Error),
    /// No reply came in time, though the request was repeated. Whether it was executed is not
    /// known.
    NoAnswer {
        /// Name of the request.
        request: &'static str,
        /// How long a reply was awaited.
        after: Duration,
    },
    /// A stop was written again and again, and nothing answered. The gateway may have stopped all
    /// the same.
    StopUnanswered {
        /// How long an answer was awaited.
        after: Duration,
    },
    /// The caller wanted it to end: nothing that moves is sent any more, and the axes that were
    /// armed here have been stopped.
    Interrupted {
        /// Whether an axis was armed here.
        armed: bool,
    },
    /// The gateway and this library speak different major versions of the host protocol.
    Incompatible {
        /// Major version of the gateway.
        gateway: u16,
        /// Major version of this library.
        host: u16,
    },
    /// A reply with a right checksum that is none to this request: one side does not keep to the
    /// protocol.
    UnreadableReply {
        /// Name of the request.
        request: &'static str,
        /// Number of the reply.
        number: u16,
    },
    /// An axis is named twice where each can be named once.
    NamedTwice {
        /// Which.
        axis: u8,
    },
    /// The number of an axis is above [`LAST_AXIS`].
    NoSuchAxis {
        /// The number.
        axis: u8,
    },
    /// The request is longer than a message may be.
    TooLong {
        /// Name of the request.
        request: &'static str,
    },
    /// The gateway was not heard at another rate of the line, or the port cannot run at it. The
    /// line runs at the default.
    BaudFailed {
        /// The rate.
        baud: u32,
        /// What the system says of it.
        source: Option<io::Error>,
    },
    /// The gateway is there and closes the connection at once: other programs have all its host
    /// links.
    LinksTaken,
    /// The port could not be opened.
    Connect(ConnectError),
    /// The connection failed.
    Transport(io::Error),
}

impl fmt::Display for ClientError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gateway(error) => error.fmt(f),
            Self::NoAnswer { request: "Hello", after } => write!(
                f,
                "no gateway answered within {} ms. Check that the port leads to a gateway, that it \
                    has power, and its bit rate",
                after.as_millis()
            ),
            Self::NoAnswer { request, after } => write!(
                f,
                "the gateway did not answer a request ({}) within {} ms; it may have been executed. \
                    Check the cable, then read the state",
                in_words(request),
                after.as_millis()
            ),
            Self::NoSuchAxis { axis } => {
                write!(f, "there is no axis {axis}: the axes of a request are 0 to {LAST_AXIS}")
            }
            Self::NamedTwice { axis } => {
                write!(f, "axis {axis} is named twice: name each axis of a request once")
            }
            Self::StopUnanswered { after } => write!(
                f,
                "the stop was sent, not confirmed: nothing answered within {} ms. The gateway may \
                    have stopped the motors all the same, and does when it no longer hears this \
                    host. Cut their power if they turn",
                after.as_millis()
            ),
            Self::Interrupted { armed: true } => {
                f.write_str("interrupted. What was armed here has been stopped")
            }
            Self::Interrupted { armed: false } => f.write_str("interrupted; nothing was armed"),
            Self::Incompatible { gateway, host } => {
                write!(
                    f,
                    "the gateway speaks version {gateway} of the host protocol, this program \
                        version {host}. "
                )?;
                if gateway > host {
                    write!(f, "Update this program")
                } else {
                    write!(f, "Update the gateway's firmware")
                }
            }
            Self::UnreadableReply { request, number } => write!(
                f,
                "the gateway answered a request ({}) with a message {number:#06x} that does not \
                    belong to it. Update this program and the firmware to the same version",
                in_words(request)
            ),
            Self::TooLong { request } => write!(
                f,
                "a request ({}) is longer than the {} bytes of a message. Send less at once",
                in_words(request),
                host_protocol::MAX_MESSAGE
            ),
            Self::BaudFailed { baud, source: Some(source) } => {
                write!(f, "this port cannot run at {baud} baud ({source}). Leave the rate out")
            }
            Self::BaudFailed { baud, source: None } => write!(
                f,
                "the gateway was not heard at {baud} baud, though it offers that. Check the cable \
                    and what its adapter can do, or leave the rate out"
            ),
            Self::LinksTaken => write!(
                f,
                "the gateway refuses the connection: all host links are taken. End another program \
                    that is connected to it, then try again"
            ),
            Self::Connect(error) => error.fmt(f),
            Self::Transport(error) => {
                write!(
                    f,
                    "the connection to the gateway failed ({error}). Check the cable or the \
                        server, then connect again"
                )
            }
        }
    }
}

/// `ReadState` as `read state`.
fn in_words(request: &str) -> String {
    let capitals = request.char_indices().filter(|(_, letter)| letter.is_uppercase());
    let starts: Vec<usize> = capitals.map(|(place, _)| place).collect();
    let ends = starts.iter().skip(1).copied().chain([request.len()]);
    let words = starts.iter().zip(ends).filter_map(|(start, end)| request.get(*start..end));
    words.collect::<Vec<_>>().join(" ").to_lowercase()
}

impl std::error::Error for ClientError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Gateway(error) => Some(error),
            Self::Connect(error) => Some(error),
            Self::Transport(error) => Some(error),
            Self::BaudFailed { source, .. } => source.as_ref().map(|source| source as _),
            _ => None,
        }
    }
}

impl From<host_protocol::Error> for ClientError {
    fn from(error: host_protocol::Error) -> Self {
        Self::Gateway(error)
    }
}

impl From<ConnectError> for ClientError {
    fn from(error: ConnectError) -> Self {
        Self::Connect(error)
    }
}

impl From<io::Error> for ClientError {
    fn from(error: io::Error) -> Self {
        Self::Transport(error)
    }
}
