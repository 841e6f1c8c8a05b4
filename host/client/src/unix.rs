//! A server on this computer, behind its Unix socket.

use std::io::{self, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::tcp::{SEND_TIMEOUT, nothing_came, read_within};
use crate::transport::Transport;

/// A connection to a server in wall-clock time.
#[derive(Debug)]
pub struct UnixTransport {
    path: PathBuf,
    stream: Option<UnixStream>,
    start: Instant,
}

impl UnixTransport {
    /// Connects to the socket at `path`.
    ///
    /// # Errors
    /// When there is none, or nobody serves it.
    pub fn connect(path: PathBuf) -> io::Result<Self> {
        let stream = Some(open(&path)?);
        Ok(Self { path, stream, start: Instant::now() })
    }

    fn stream(&mut self) -> io::Result<&mut UnixStream> {
        let closed = || io::Error::new(io::ErrorKind::NotConnected, "the connection is not open");
        self.stream.as_mut().ok_or_else(closed)
    }
}

impl Transport for UnixTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream()?.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let stream = self.stream()?;
        let (nonblocking, waits) = (UnixStream::set_nonblocking, UnixStream::set_read_timeout);
        match read_within(stream, buffer, timeout, nonblocking, waits) {
            Ok(0) if !buffer.is_empty() => {
                let closed = "the server closed the connection: it has lost the gateway, or ended";
                Err(io::Error::new(io::ErrorKind::UnexpectedEof, closed))
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
        self.stream = Some(open(&self.path)?);
        Ok(())
    }
}

fn open(path: &std::path::Path) -> io::Result<UnixStream> {
    let stream = UnixStream::connect(path)?;
    stream.set_write_timeout(Some(SEND_TIMEOUT))?;
    Ok(stream)
}
