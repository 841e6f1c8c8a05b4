//! Ctrl-C, and the signals that ask a process to end: noted, so that a command can stop its motors
//! before it does.

use std::sync::OnceLock;

use mgw_client::Interrupt;
use signal_hook::consts::TERM_SIGNALS;
use signal_hook::flag;

/// The first that was noted.
static NOTED: OnceLock<Interrupt> = OnceLock::new();

/// From here on SIGINT, SIGTERM, SIGQUIT and SIGHUP raise the interrupt instead of ending the
/// process: the signal handler itself does, so no thread has to run first. If that cannot be
/// arranged a signal goes on ending the process: the gateway then stops the motors by itself.
pub fn note() -> Interrupt {
    let interrupt = Interrupt::default();
    if NOTED.set(interrupt.clone()).is_ok() {
        #[cfg(unix)]
        // Without it a further signal is as good as the first.
        let _ = second::ends();
    }
    for signal in TERM_SIGNALS {
        let _ = flag::register(*signal, interrupt.flag());
    }
    #[cfg(unix)]
    let _ = flag::register(signal_hook::consts::SIGHUP, interrupt.flag());
    interrupt
}

/// Whether a signal has been noted, and nobody has gone on since.
pub fn is_raised() -> bool {
    NOTED.get().is_some_and(Interrupt::is_raised)
}

/// The second signal ends the process, whatever it waits for.
#[cfg(unix)]
mod second {
    use std::io::{self, Read};
    use std::os::unix::net::UnixStream;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;
    use std::time::Duration;

    use signal_hook::consts::TERM_SIGNALS;
    use signal_hook::flag;
    use signal_hook::low_level::pipe;

    /// Signals that come sooner after the first are part of it: a terminal and a parent process
    /// may both send one. The stop is written meanwhile.
    const FIRST_LASTS: Duration = Duration::from_millis(500);

    pub fn ends() -> io::Result<()> {
        let is_over = Arc::new(AtomicBool::new(false));
        let (mut first, raised) = UnixStream::pair()?;
        for signal in TERM_SIGNALS {
            flag::register_conditional_default(*signal, is_over.clone())?;
            pipe::register(*signal, raised.try_clone()?)?;
        }
        thread::spawn(move || {
            if first.read_exact(&mut [0]).is_ok() {
                thread::sleep(FIRST_LASTS);
                is_over.store(true, Ordering::Relaxed);
            }
        });
        Ok(())
    }
}
