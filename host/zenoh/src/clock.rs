//! The gateway's time, as the eye knows it.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What is older is known no longer: the gateway may be gone.
const VALID_FOR: Duration = Duration::from_secs(2);

/// When the gateway had which time.
#[derive(Debug, Clone, Default)]
pub struct GatewayTime(Arc<Mutex<Option<(Instant, u64)>>>);

impl GatewayTime {
    /// It is now this late there, µs since its start.
    pub fn set(&self, us: u64) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((Instant::now(), us));
    }

    /// The gateway is lost.
    pub fn forget(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// How late it is there; nothing while it is lost.
    pub fn now_us(&self) -> Option<u64> {
        let (told, us) = (*self.0.lock().unwrap_or_else(PoisonError::into_inner))?;
        let passed = told.elapsed();
        let us = us.saturating_add(u64::try_from(passed.as_micros()).unwrap_or(u64::MAX));
        (passed < VALID_FOR).then_some(us)
    }
}
