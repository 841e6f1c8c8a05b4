//! What carries the bytes of a session, with a look at Python's signals while it waits.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use mgw_client::{Interrupt, Transport};
use parking_lot::Mutex;
use pyo3::prelude::*;

/// Between two looks at the signals: each takes the interpreter's lock.
pub const LOOK_EVERY: Duration = Duration::from_millis(20);

/// An exception that a signal handler has raised, and what it ends.
#[derive(Default)]
pub struct Signals {
    /// Ends the call under way, with a stop of what is armed.
    pub interrupt: Interrupt,
    /// Whether the call under way is one of Python's main thread: no other runs signal handlers.
    pub looks: AtomicBool,
    raised: Mutex<Option<PyErr>>,
}

impl Signals {
    /// The exception, once.
    pub fn take(&self) -> Option<PyErr> {
        self.raised.lock().take()
    }

    fn look(&self) {
        if let Err(error) = Python::attach(|py| py.check_signals()) {
            *self.raised.lock() = Some(error);
            self.interrupt.raise();
        }
    }
}

/// Any transport. It looks for signals now and then in wall-clock time, whatever its own time is.
pub struct Carrier {
    inner: Box<dyn Transport + Send>,
    signals: Arc<Signals>,
    looked: Instant,
}

impl Carrier {
    /// A transport whose waits signals end.
    pub fn new(inner: Box<dyn Transport + Send>, signals: Arc<Signals>) -> Self {
        Self { inner, signals, looked: Instant::now() }
    }

    /// A call begins: Python has just looked for signals itself.
    pub fn begin(&mut self, looks: bool) {
        self.signals.looks.store(looks, Ordering::Relaxed);
        self.looked = Instant::now();
    }
}

impl Transport for Carrier {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let count = self.inner.receive(buffer, timeout)?;
        if self.signals.looks.load(Ordering::Relaxed) && self.looked.elapsed() >= LOOK_EVERY {
            self.signals.look();
            self.looked = Instant::now();
        }
        Ok(count)
    }

    fn now(&self) -> Duration {
        self.inner.now()
    }

    fn sleep(&mut self, duration: Duration) {
        self.inner.sleep(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.inner.reconnect()
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        self.inner.set_baud(baud)
    }

    fn wanted_baud(&self) -> Option<u32> {
        self.inner.wanted_baud()
    }
}
