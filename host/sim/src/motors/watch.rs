//! A motor's own communication timeout: when it was heard last, and whether the timeout has struck
//! since.

use std::time::Duration;

use super::log::MotorEvent;
use super::model::Context;

/// It runs from the first command on.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Watch {
    last_heard: Option<Duration>,
    struck: bool,
}

impl Watch {
    /// The motor has been addressed. Returns whether the timeout had struck.
    pub(super) fn hear(&mut self, now: Duration) -> bool {
        self.last_heard = Some(now);
        std::mem::take(&mut self.struck)
    }

    /// When the timeout strikes; `after`: its length, `None` while it is off.
    pub(super) fn strikes_at(&self, after: Option<Duration>) -> Option<Duration> {
        after.filter(|_| !self.struck).and_then(|after| Some(self.last_heard? + after))
    }

    /// Whether it is due. From then on it has struck, which is logged.
    pub(super) fn strikes(&mut self, after: Option<Duration>, cx: &mut Context<'_>) -> bool {
        let (Some(at), Some(after)) = (self.strikes_at(after), after) else { return false };
        if at > cx.now {
            return false;
        }
        self.struck = true;
        cx.log(MotorEvent::Timeout {
            after_ms: u32::try_from(after.as_millis()).unwrap_or(u32::MAX),
        });
        true
    }

    /// Whether it has struck, and nothing has been heard since.
    pub(super) fn has_struck(&self) -> bool {
        self.struck
    }
}
