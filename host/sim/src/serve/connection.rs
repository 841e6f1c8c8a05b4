//! One TCP connection that holds a host link.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use super::requests::Requests;

/// Bytes taken from a connection at once.
const READ: usize = 4_096;
/// Bytes kept for a client that does not read; what comes then is lost.
const BUFFER: usize = 1 << 20;

pub(super) struct Connection {
    stream: TcpStream,
    pub(super) peer: SocketAddr,
    pub(super) link: u8,
    /// When it came.
    pub(super) since: Duration,
    /// What it has asked for.
    pub(super) requests: Requests,
    unsent: VecDeque<u8>,
    /// The client has been told of as not reading.
    pub(super) overflowed: bool,
}

impl Connection {
    pub(super) fn new(
        stream: TcpStream,
        peer: SocketAddr,
        link: u8,
        since: Duration,
    ) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let requests = Requests::new();
        Ok(Self { stream, peer, link, since, requests, unsent: VecDeque::new(), overflowed: false })
    }

    /// What the client has sent by now.
    ///
    /// # Errors
    /// When the connection is gone.
    pub(super) fn read(&mut self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; READ];
        match self.stream.read(&mut bytes) {
            Ok(0) => Err(ErrorKind::ConnectionAborted.into()),
            Ok(len) => {
                bytes.truncate(len);
                Ok(bytes)
            }
            Err(error) if is_temporary(&error) => Ok(Vec::new()),
            Err(error) => Err(error),
        }
    }

    /// Sends as much as the client takes and keeps the rest; whether bytes were lost because it
    /// does not read.
    ///
    /// # Errors
    /// When the connection is gone.
    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<bool> {
        let lost = self.unsent.len() + bytes.len() > BUFFER;
        if !lost {
            self.unsent.extend(bytes);
        }
        while !self.unsent.is_empty() {
            let (front, _) = self.unsent.as_slices();
            match self.stream.write(front) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(len) => drop(self.unsent.drain(..len)),
                Err(error) if is_temporary(&error) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(lost)
    }
}

fn is_temporary(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn what_a_client_does_not_read_is_kept_up_to_a_bound_and_then_lost() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (stream, peer) = listener.accept().unwrap();
        let mut connection = Connection::new(stream, peer, 0, Duration::ZERO).unwrap();
        // The system's own buffers take some megabytes before ours fills.
        let written = (0..1_000).take_while(|_| !connection.write(&[7; 100_000]).unwrap()).count();
        assert!((10..1_000).contains(&written), "{written}");
        assert!(connection.unsent.len() <= BUFFER);

        drop(client);
        assert!((0..1_000).any(|_| connection.write(&[]).is_err()), "it has gone");
    }
}
