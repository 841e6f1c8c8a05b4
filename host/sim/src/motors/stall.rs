//! Stall detection as all three makes have it: pushing for too long against a shaft that does not
//! turn.

use std::time::Duration;

/// How long a motor pushes before it calls itself stalled.
const PATIENCE: Duration = Duration::from_secs(1);

/// Watches one motor.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct StallGuard {
    since: Option<Duration>,
}

impl StallGuard {
    /// Whether the motor has been stalled for too long.
    pub(super) fn has_struck(&mut self, now: Duration, is_stalled: bool) -> bool {
        self.since = is_stalled.then(|| self.since.unwrap_or(now));
        self.strikes_at().is_some_and(|at| at <= now)
    }

    /// When it will have been.
    pub(super) fn strikes_at(&self) -> Option<Duration> {
        self.since.map(|since| since + PATIENCE)
    }
}
