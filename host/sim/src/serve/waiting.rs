//! A client that came when all host links were taken: it gets one only if the first thing it says
//! is a stop.

use std::io;
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use super::connection::Connection;
use super::requests::Purpose;

/// A client must have said something within this time.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);
/// Clients that may wait at a time.
pub(super) const PLACES: usize = 8;
/// No first request is longer, garbage before it included.
const LONGEST: usize = 2_048;

/// What to do with a client that waits.
pub(super) enum Verdict {
    /// It has not said enough.
    Waits,
    /// It has gone, or wants something that needs a free link.
    Refused,
    /// It stops something: it gets a link.
    Stops,
}

/// A client without a link.
pub(super) struct Waiting {
    connection: Connection,
    /// What it has said so far.
    said: Vec<u8>,
    until: Duration,
}

impl Waiting {
    pub(super) fn new(stream: TcpStream, peer: SocketAddr, now: Duration) -> io::Result<Self> {
        let connection = Connection::new(stream, peer, u8::MAX, now)?;
        Ok(Self { connection, said: Vec::new(), until: now + PATIENCE })
    }

    pub(super) fn peer(&self) -> SocketAddr {
        self.connection.peer
    }

    /// Listens to it.
    pub(super) fn listen(&mut self, now: Duration) -> Verdict {
        let Ok(bytes) = self.connection.read() else { return Verdict::Refused };
        let purpose = self.connection.requests.take(now, &bytes);
        self.said.extend(bytes);
        match purpose {
            Some(Purpose::Stop) => Verdict::Stops,
            Some(_) => Verdict::Refused,
            None if now >= self.until || self.said.len() > LONGEST => Verdict::Refused,
            None => Verdict::Waits,
        }
    }

    /// Gives it a link. Returns also what it has said.
    pub(super) fn on_link(mut self, link: u8) -> (Connection, Vec<u8>) {
        self.connection.link = link;
        (self.connection, self.said)
    }
}
