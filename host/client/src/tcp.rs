//! A gateway behind a TCP port, as `mgw sim` serves one.

use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use crate::transport::Transport;

/// How long opening a connection may take, for each address that a name stands for.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);
/// How long the peer may refuse to take bytes before the connection counts as gone.
pub(crate) const SEND_TIMEOUT: Duration = Duration::from_secs(1);
/// Longest wait of a read, where nobody sets another.
pub(crate) const READ_WAIT: Duration = Duration::from_millis(100);
/// Shortest read timeout that the operating system is asked for; it takes zero for "for ever".
const SHORTEST_WAIT: Duration = Duration::from_micros(100);

/// A TCP connection in wall-clock time.
#[derive(Debug)]
pub struct TcpTransport {
    address: String,
    /// Shown to a server that wants one.
    token: Option<String>,
    stream: Option<TcpStream>,
    /// Something has come since it was opened.
    heard: bool,
    start: Instant,
}

impl TcpTransport {
    /// Connects to `address`, `HOST:PORT`.
    ///
    /// # Errors
    /// When the name cannot be resolved or nothing there takes the connection within 3 s.
    pub fn connect(address: &str) -> io::Result<Self> {
        Self::connect_showing(address, None)
    }

    /// As [`connect`](Self::connect), and shows the server there a token.
    ///
    /// # Errors
    /// As [`connect`](Self::connect).
    pub fn connect_showing(address: &str, token: Option<String>) -> io::Result<Self> {
        let stream = open(address, token.as_deref())?;
        Ok(Self {
            address: address.to_owned(),
            token,
            stream: Some(stream),
            heard: false,
            start: Instant::now(),
        })
    }

    /// The connection failed: refused, if nothing had come over it.
    fn lost(&self, error: io::Error) -> io::Error {
        use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset, UnexpectedEof};
        match error.kind() {
            UnexpectedEof | ConnectionReset | ConnectionAborted | BrokenPipe if !self.heard => {
                io::Error::new(io::ErrorKind::ConnectionRefused, error)
            }
            _ => error,
        }
    }

    fn stream(&mut self) -> io::Result<&mut TcpStream> {
        self.stream.as_mut().ok_or_else(|| {
            io::Error::new(io::ErrorKind::NotConnected, "the connection is not open")
        })
    }
}

impl Transport for TcpTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let sent = self.stream()?.write_all(bytes);
        sent.map_err(|error| self.lost(error))
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let stream = self.stream()?;
        let (nonblocking, waits) = (TcpStream::set_nonblocking, TcpStream::set_read_timeout);
        match read_within(stream, buffer, timeout, nonblocking, waits) {
            Ok(0) if !buffer.is_empty() => {
                let closed = "the other side closed the connection";
                Err(self.lost(io::Error::new(io::ErrorKind::UnexpectedEof, closed)))
            }
            Ok(count) => {
                self.heard = true;
                Ok(count)
            }
            Err(error) if nothing_came(&error) => Ok(0),
            Err(error) => Err(self.lost(error)),
        }
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn sleep(&mut self, duration: Duration) {
        std::thread::sleep(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        (self.stream, self.heard) = (None, false);
        self.stream = Some(open(&self.address, self.token.as_deref())?);
        Ok(())
    }
}

/// Opens a connection, whose first bytes are the token (PROTOCOL.md, A server).
pub(crate) fn open(address: &str, token: Option<&str>) -> io::Result<TcpStream> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "the name stands for no address");
    for candidate in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&candidate, CONNECT_TIMEOUT) {
            Ok(mut stream) => {
                // Requests are small and each is waited for: gathering them into larger segments
                // only delays them.
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(SEND_TIMEOUT))?;
                stream.set_read_timeout(Some(READ_WAIT))?;
                if let Some(token) = token {
                    stream.write_all(format!("token={token}\0").as_bytes())?;
                }
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Reads what arrives on a socket within `timeout`; without time, what is there.
pub(crate) fn read_within<S: Read>(
    socket: &mut S,
    buffer: &mut [u8],
    timeout: Duration,
    set_nonblocking: impl Fn(&S, bool) -> io::Result<()>,
    set_read_timeout: impl Fn(&S, Option<Duration>) -> io::Result<()>,
) -> io::Result<usize> {
    if !timeout.is_zero() {
        set_read_timeout(socket, Some(timeout.max(SHORTEST_WAIT)))?;
        return socket.read(buffer);
    }
    // The shortest wait of the operating system is a tick of its clock: some milliseconds.
    set_nonblocking(socket, true)?;
    let read = socket.read(buffer);
    set_nonblocking(socket, false)?;
    read
}

/// Whether a read failed only because its time ran out (the two kinds are two systems' names for
/// it) or a signal came.
pub(crate) fn nothing_came(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Client, ClientError};
    use std::net::TcpListener;

    /// Nor does it make the next write or wait one that waits for nothing.
    #[test]
    fn a_read_without_time_takes_what_is_there() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let mut transport = TcpTransport::connect(&address).unwrap();
        let mut other = listener.accept().unwrap().0;
        let mut buffer = [0; 8];
        assert_eq!(transport.receive(&mut buffer, Duration::ZERO).unwrap(), 0);
        transport.send(b"x").unwrap();
        assert_eq!(other.read(&mut buffer).unwrap(), 1);
        other.write_all(b"ab").unwrap();
        assert_eq!(transport.receive(&mut buffer[..1], Duration::from_secs(60)).unwrap(), 1);
        assert_eq!(transport.receive(&mut buffer, Duration::ZERO).unwrap(), 1);
        let begin = transport.now();
        assert_eq!(transport.receive(&mut buffer, Duration::from_millis(20)).unwrap(), 0);
        assert!(transport.now() - begin >= Duration::from_millis(10));
    }

    #[test]
    fn a_server_that_closes_before_it_has_said_anything_has_no_link_left() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let transport = TcpTransport::connect(&listener.local_addr().unwrap().to_string()).unwrap();
        drop(listener.accept().unwrap());
        let error = Client::connect(transport).err().unwrap();
        assert!(matches!(error, ClientError::LinksTaken), "{error:?}");
        assert!(error.to_string().contains("all host links are taken"), "{error}");
    }

    #[test]
    fn a_server_that_closes_later_is_a_connection_that_failed() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut transport =
            TcpTransport::connect(&listener.local_addr().unwrap().to_string()).unwrap();
        let (mut stream, _) = listener.accept().unwrap();
        stream.write_all(&[0]).unwrap();
        let mut buffer = [0; 8];
        assert_eq!(transport.receive(&mut buffer, CONNECT_TIMEOUT).unwrap(), 1);
        drop(stream);
        let error = transport.receive(&mut buffer, CONNECT_TIMEOUT).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof);
    }
}
