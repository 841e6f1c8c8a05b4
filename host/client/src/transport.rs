//! What carries bytes to a gateway and back, and what time is while it does.

use std::io;
use std::time::Duration;

/// A byte stream to one gateway, together with the clock that its user lives by.
///
/// The client reads no clock and sleeps nowhere else, so a transport with a clock of its own (a
/// simulation in virtual time, a script in a test) runs the same client at any speed.
///
/// Bytes may be lost, changed or split at any place; frames and their checksums are the client's
/// concern.
pub trait Transport {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// When the connection is gone, or takes no bytes for so long that it must be taken for gone.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits at most `timeout`, in the transport's own time, for bytes and returns how many it
    /// wrote to the start of `buffer`. `Ok(0)` means that none came in that time. It returns as
    /// soon as there is at least one.
    ///
    /// # Errors
    /// When the connection is gone. A peer that closed it is an error, not `Ok(0)`; one that closed
    /// it before it had sent anything, because it has no place for this client, is
    /// [`io::ErrorKind::ConnectionRefused`].
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Time since some fixed moment of the transport's own. Never goes backwards.
    fn now(&self) -> Duration;

    /// Lets `duration` of the transport's time pass.
    fn sleep(&mut self, duration: Duration);

    /// Drops the connection, if there still is one, and opens it again to the same gateway. Bytes
    /// not yet received are lost.
    ///
    /// # Errors
    /// When it cannot be opened now; it may be tried again later.
    fn reconnect(&mut self) -> io::Result<()>;

    /// Runs at another rate from now on, baud. It starts at
    /// [`DEFAULT_BAUD`](host_protocol::DEFAULT_BAUD), also after [`reconnect`](Self::reconnect).
    ///
    /// # Errors
    /// When it has no rate, or cannot run at this one.
    fn set_baud(&mut self, _baud: u32) -> io::Result<()> {
        Err(io::Error::new(io::ErrorKind::Unsupported, "this port has no baud rate"))
    }

    /// The rate that its user wants, if it is not the default: a client asks the gateway for it.
    fn wanted_baud(&self) -> Option<u32> {
        None
    }
}

impl<T: Transport + ?Sized> Transport for Box<T> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        (**self).receive(buffer, timeout)
    }

    fn now(&self) -> Duration {
        (**self).now()
    }

    fn sleep(&mut self, duration: Duration) {
        (**self).sleep(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        (**self).reconnect()
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        (**self).set_baud(baud)
    }

    fn wanted_baud(&self) -> Option<u32> {
        (**self).wanted_baud()
    }
}
