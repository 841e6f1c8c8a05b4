//! The frame that a serial port keeps until the reply to the one before has come.

use std::time::Duration;

#[derive(Debug, Default)]
pub(super) struct BehindReply {
    /// It, and the slot of the gateway.
    frame: Option<(u8, Vec<u8>)>,
    /// When it begins, once the reply has come.
    begins_at: Option<Duration>,
    /// Bytes of the latest frame on the line.
    own: usize,
    /// Bytes that have been heard since that began, its echo too.
    heard: usize,
}

impl BehindReply {
    pub(super) fn keep(&mut self, slot: u8, bytes: Vec<u8>) {
        self.frame = Some((slot, bytes));
    }

    /// The gateway begins a frame of so many bytes.
    pub(super) fn began(&mut self, bytes: usize) {
        (self.own, self.heard) = (bytes, 0);
    }

    /// The gateway hears a byte. Returns whether it ends the reply: the frame begins behind the
    /// pause.
    pub(super) fn hears(&mut self, now: Duration, pause: Duration) -> bool {
        self.heard += 1;
        let ends = |(_, next): &(u8, Vec<u8>)| self.heard == self.own + next.len();
        let has_come = self.begins_at.is_none() && self.frame.as_ref().is_some_and(ends);
        if has_come {
            self.begins_at = Some(now + pause);
        }
        has_come
    }

    /// Gives the frame in a slot back, unless its reply has come. Returns whether it did.
    pub(super) fn give_back(&mut self, slot: u8) -> bool {
        let waits = self.begins_at.is_none();
        self.frame.take_if(|(of, _)| waits && *of == slot).is_some()
    }

    /// When it begins, once that is known.
    pub(super) fn begins_at(&self) -> Option<Duration> {
        self.begins_at
    }

    /// The frame, if it begins now.
    pub(super) fn take_due(&mut self, now: Duration) -> Option<(u8, Vec<u8>)> {
        self.begins_at.take_if(|at| *at <= now)?;
        self.frame.take()
    }
}
