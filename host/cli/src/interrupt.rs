//! Ctrl-C, and the signals that ask a process to end: noted, so that a command can stop its motors before it does.

use std::sync::atomic::{AtomicBool, Ordering};

static CAME: AtomicBool = AtomicBool::new(false);

/// From here on an interrupt is noted instead of ending the process. If that cannot be arranged it goes on ending it:
/// the gateway then stops the motors by itself.
pub fn note() {
    let _ = ctrlc::set_handler(|| CAME.store(true, Ordering::Relaxed));
}

/// Whether one has come.
pub fn came() -> bool {
    CAME.load(Ordering::Relaxed)
}
