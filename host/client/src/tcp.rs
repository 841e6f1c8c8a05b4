//! A gateway behind a TCP port, as `mgw sim` serves one.

use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use crate::transport::Transport;

/// How long opening a connection may take, for each address that a name stands for.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);
/// How long the peer may refuse to take bytes before the connection counts as gone.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);
/// Shortest read timeout that the operating system is asked for; it takes zero for "for ever".
const SHORTEST_WAIT: Duration = Duration::from_micros(100);

/// A TCP connection in wall-clock time.
#[derive(Debug)]
pub struct TcpTransport {
    address: String,
    stream: Option<TcpStream>,
    start: Instant,
}

impl TcpTransport {
    /// Connects to `address`, `HOST:PORT`.
    ///
    /// # Errors
    /// When the name cannot be resolved or nothing there takes the connection within 3 s.
    pub fn connect(address: &str) -> io::Result<Self> {
        let stream = open(address)?;
        Ok(Self { address: address.to_owned(), stream: Some(stream), start: Instant::now() })
    }

    fn stream(&mut self) -> io::Result<&mut TcpStream> {
        self.stream
            .as_mut()
            .ok_or_else(|| io::Error::new(io::ErrorKind::NotConnected, "the connection is not open"))
    }
}

impl Transport for TcpTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream()?.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let stream = self.stream()?;
        stream.set_read_timeout(Some(timeout.max(SHORTEST_WAIT)))?;
        match stream.read(buffer) {
            Ok(0) if !buffer.is_empty() => {
                Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the other side closed the connection"))
            }
            Ok(count) => Ok(count),
            Err(error) if nothing_came(&error) => Ok(0),
            Err(error) => Err(error),
        }
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn sleep(&mut self, duration: Duration) {
        std::thread::sleep(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.stream = None;
        self.stream = Some(open(&self.address)?);
        Ok(())
    }
}

fn open(address: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "the name stands for no address");
    for candidate in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&candidate, CONNECT_TIMEOUT) {
            Ok(stream) => {
                // Requests are small and each is waited for: gathering them into larger segments only delays them.
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(SEND_TIMEOUT))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Whether a read failed only because its time ran out (the two kinds are two systems' names for it) or a signal came.
pub(crate) fn nothing_came(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}
