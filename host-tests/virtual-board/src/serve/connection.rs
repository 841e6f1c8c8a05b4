//! One TCP connection to a host UART.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};

/// Bytes taken from a connection at once.
const READ: usize = 4_096;
/// Bytes kept for a client that does not read; what comes then is lost.
const KEPT: usize = 1 << 20;

pub(super) struct Connection {
    stream: TcpStream,
    pub(super) peer: SocketAddr,
    unsent: VecDeque<u8>,
}

impl Connection {
    pub(super) fn new(stream: TcpStream, peer: SocketAddr) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        Ok(Self { stream, peer, unsent: VecDeque::new() })
    }

    /// What the client has sent by now.
    ///
    /// # Errors
    /// When the connection is gone.
    pub(super) fn read(&mut self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; READ];
        match self.stream.read(&mut bytes) {
            Ok(0) => Err(ErrorKind::ConnectionAborted.into()),
            Ok(length) => {
                bytes.truncate(length);
                Ok(bytes)
            }
            Err(error) if may_pass(&error) => Ok(Vec::new()),
            Err(error) => Err(error),
        }
    }

    /// Sends as much as the client takes and keeps the rest, up to a bound.
    ///
    /// # Errors
    /// When the connection is gone.
    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let room = KEPT.saturating_sub(self.unsent.len());
        self.unsent.extend(bytes.iter().take(room));
        while !self.unsent.is_empty() {
            let (front, _) = self.unsent.as_slices();
            match self.stream.write(front) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(length) => drop(self.unsent.drain(..length)),
                Err(error) if may_pass(&error) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// Whether it is worth trying again.
pub(super) fn may_pass(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn what_a_client_does_not_read_is_kept_up_to_a_bound() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (stream, peer) = listener.accept().unwrap();
        let mut connection = Connection::new(stream, peer).unwrap();
        // The system's own buffers take some megabytes before ours fills.
        let full = (0..1_000).any(|_| {
            connection.write(&[7; 100_000]).unwrap();
            connection.unsent.len() == KEPT
        });
        assert!(full);
        drop(client);
        assert!((0..1_000).any(|_| connection.write(&[]).is_err()), "it has gone");
    }
}
