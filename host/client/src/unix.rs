//! A server on this computer, behind its Unix socket.

use std::io::{self, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use socket2::{Domain, SockAddr, Socket, Type};

use crate::tcp::{READ_WAIT, SEND_TIMEOUT, nothing_came, read_within};
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

/// Opens a connection. A server that hangs takes none, and its queue fills up, also with those who
/// have gone: the time for writing is that for connecting, too.
pub(crate) fn open(path: &Path) -> io::Result<UnixStream> {
    let socket = Socket::new(Domain::UNIX, Type::STREAM, None)?;
    socket.set_write_timeout(Some(SEND_TIMEOUT))?;
    socket.set_read_timeout(Some(READ_WAIT))?;
    socket.connect(&SockAddr::unix(path)?).map_err(|error| match error.kind() {
        io::ErrorKind::WouldBlock => {
            io::Error::new(io::ErrorKind::TimedOut, "it hangs and takes no connection")
        }
        _ => error,
    })?;
    Ok(OwnedFd::from(socket).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    #[test]
    fn a_server_that_takes_no_connection_is_waited_for_a_second_and_not_for_ever() {
        let path = std::env::temp_dir().join(format!("mgw-hangs-{}", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let listener = Socket::new(Domain::UNIX, Type::STREAM, None).unwrap();
        listener.bind(&SockAddr::unix(&path).unwrap()).unwrap();
        listener.listen(0).unwrap();
        let (told, hears) = mpsc::channel();
        let place = path.clone();
        // The first ones fill its queue, though they go at once.
        std::thread::spawn(move || told.send((0..8).find_map(|_| open(&place).err())));
        let refused = hears.recv_timeout(Duration::from_secs(60));
        let _ = std::fs::remove_file(&path);
        assert_eq!(refused.unwrap().unwrap().kind(), io::ErrorKind::TimedOut);
    }
}
