//! Ctrl-C, and the signals that ask a process to end: noted, so that a command can stop its motors before it does.

use mgw_client::Interrupt;

/// From here on a signal raises `interrupt` instead of ending the process. If that cannot be arranged it goes on ending it:
/// the gateway then stops the motors by itself.
pub fn note(interrupt: Interrupt) {
    let _ = ctrlc::set_handler(move || interrupt.raise());
}
