//! [`Interrupt`]: the caller wants it to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The caller wants it to end, by Ctrl-C for example: raised from any thread, and seen by the
/// client that heeds it, until that [resumes](crate::Client::resume).
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// From now on it is raised.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// A client goes on.
    pub(crate) fn lower(&self) {
        self.0.store(false, Ordering::Relaxed);
    }

    /// What raises it when set to `true`: for a signal handler.
    pub fn flag(&self) -> Arc<AtomicBool> {
        self.0.clone()
    }

    /// Whether it has been raised.
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
