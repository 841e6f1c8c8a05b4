//! Standard output and standard error. A thread of its own writes each, so a reader that takes
//! nothing does not hold up the stop that an interrupt asks for.

use std::io::{self, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use crate::interrupt;

/// Between two looks at the interrupt while a text is written: a stop waits no longer for it.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// How long the last texts may take once the interrupt is raised.
const LAST_PATIENCE: Duration = Duration::from_secs(1);

/// Where people and programs read.
pub static OUT: Stream = Stream::new(|text| write(io::stdout().lock(), text));
/// Where they read what went wrong.
pub static ERR: Stream = Stream::new(|text| write(io::stderr().lock(), text));

type Written = io::Result<()>;

/// One of the two, and the thread that writes it.
pub struct Stream {
    write: fn(&str) -> Written,
    texts: OnceLock<Sender<(String, Sender<Written>)>>,
    /// Whether nobody has taken a text, and the interrupt was raised.
    is_stuck: AtomicBool,
}

impl Stream {
    const fn new(write: fn(&str) -> Written) -> Self {
        Self { write, texts: OnceLock::new(), is_stuck: AtomicBool::new(false) }
    }

    /// Writes a text and waits until it is written, or until the interrupt is raised.
    pub fn print(&'static self, text: String) -> Written {
        let written = self.send(text);
        while !self.is_stuck.load(Ordering::Relaxed) {
            match written.recv_timeout(LOOK_EVERY) {
                Ok(written) => return written,
                Err(RecvTimeoutError::Timeout) if !interrupt::is_raised() => {}
                Err(_) => self.is_stuck.store(true, Ordering::Relaxed),
            }
        }
        Ok(())
    }

    /// Has a text written, and waits for nothing.
    pub fn send(&'static self, text: String) -> Receiver<Written> {
        let (told, written) = channel();
        let texts = self.texts.get_or_init(|| {
            let (texts, waiting) = channel::<(String, Sender<Written>)>();
            thread::spawn(move || {
                for (text, told) in waiting {
                    // Who no longer waits is not told.
                    let _ = told.send((self.write)(&text));
                }
            });
            texts
        });
        // The thread ends with the process.
        let _ = texts.send((text, told));
        written
    }

    /// Before the process ends: gives a reader that was late a last chance.
    pub fn end(&'static self) {
        if self.is_stuck.load(Ordering::Relaxed) {
            let _ = self.send(String::new()).recv_timeout(LAST_PATIENCE);
        }
    }
}

/// Flushed each time: a reader of a stream wants each line when it is printed.
fn write(mut to: impl Write, text: &str) -> Written {
    to.write_all(text.as_bytes()).and_then(|()| to.flush())
}
