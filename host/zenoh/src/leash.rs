//! A connection that carries nothing for a peer that has gone: whatever the client library would
//! still send for it, a repetition of a request too, does not leave.

use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use mgw_client::Transport;

use crate::authority::Authority;
use crate::command::Lease;

/// The one authority, and its time.
#[derive(Debug, Clone)]
pub struct Court {
    authority: Arc<Mutex<Authority>>,
    start: Instant,
}

impl Default for Court {
    fn default() -> Self {
        Self { authority: Arc::default(), start: Instant::now() }
    }
}

impl Court {
    /// Who commands.
    pub fn authority(&self) -> MutexGuard<'_, Authority> {
        self.authority.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Its time.
    pub fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// Whether anything may be sent for this peer now.
    pub fn may_send(&self, lease: Lease) -> bool {
        let now = self.now();
        self.authority().may_send(now, lease)
    }
}

/// The connection of the peer in command.
pub struct Leashed<T> {
    transport: T,
    court: Court,
    lease: Lease,
}

impl<T: Transport> Leashed<T> {
    /// For as long as this lease lasts.
    pub fn new(transport: T, court: Court, lease: Lease) -> Self {
        Self { transport, court, lease }
    }

    fn check(&self) -> io::Result<()> {
        if self.court.may_send(self.lease) {
            return Ok(());
        }
        let why = "the peer that commanded is gone or silent";
        Err(io::Error::new(io::ErrorKind::BrokenPipe, why))
    }
}

impl<T: Transport> Transport for Leashed<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.check()?;
        self.transport.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.transport.receive(buffer, timeout)
    }

    fn now(&self) -> Duration {
        self.transport.now()
    }

    fn sleep(&mut self, duration: Duration) {
        self.transport.sleep(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.check()?;
        self.transport.reconnect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts what it is given.
    struct Counting(usize);

    impl Transport for Counting {
        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.0 += bytes.len();
            Ok(())
        }

        fn receive(&mut self, _: &mut [u8], _: Duration) -> io::Result<usize> {
            Ok(0)
        }

        fn now(&self) -> Duration {
            Duration::ZERO
        }

        fn sleep(&mut self, _: Duration) {}

        fn reconnect(&mut self) -> io::Result<()> {
            self.0 += 1_000;
            Ok(())
        }
    }

    #[test]
    fn nothing_leaves_for_a_peer_that_has_gone() {
        let (court, lease) = (Court::default(), Lease(7));
        court.authority().arrived("a");
        let now = court.now();
        court.authority().take(now, "a", lease, "left", "key").unwrap();
        let mut transport = Leashed::new(Counting(0), court.clone(), lease);
        transport.send(&[1, 2, 3]).unwrap();
        court.authority().left("a");
        assert!(transport.send(&[4]).is_err());
        assert!(transport.reconnect().is_err());
        assert_eq!(transport.transport.0, 3);
    }
}
