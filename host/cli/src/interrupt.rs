//! Ctrl-C, and the signals that ask a process to end: noted, so that a command can stop its motors
//! before it does.

use mgw_client::Interrupt;
use signal_hook::consts::TERM_SIGNALS;
use signal_hook::flag;

/// From here on SIGINT, SIGTERM, SIGQUIT and SIGHUP raise the interrupt instead of ending the
/// process: the signal handler itself does, so no thread has to run first. If that cannot be
/// arranged a signal goes on ending the process: the gateway then stops the motors by itself.
pub fn note() -> Interrupt {
    let interrupt = Interrupt::default();
    for signal in TERM_SIGNALS {
        let _ = flag::register(*signal, interrupt.flag());
    }
    #[cfg(unix)]
    let _ = flag::register(signal_hook::consts::SIGHUP, interrupt.flag());
    interrupt
}
