//! The frames that a motor sends by itself, as its SR is set (Thruster manual §2.5). It keeps that
//! without power, so the axis says it.

use crate::time::Duration;

/// So many frames in each of these times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stream {
    pub frames: u64,
    pub interval: Duration,
}

impl Stream {
    /// What bytes 5 to 7 of SR set: a bit for each frame, and the milliseconds between them. Of a
    /// bit without a meaning a frame is expected as well, and without an interval as many as
    /// the bus carries.
    pub fn of_word(word: u32) -> Option<Self> {
        let [_, frames, high, low] = word.to_be_bytes();
        let interval_ms = u16::from_be_bytes([high, low]);
        let interval = Duration::from_millis(interval_ms.into()).max(Duration::from_micros(1));
        (frames != 0).then_some(Self { frames: frames.count_ones().into(), interval })
    }

    /// Whether it takes more of the bus than another.
    pub fn is_heavier_than(self, other: Option<Self>) -> bool {
        other.is_none_or(|other| {
            self.frames * other.interval.as_micros() > other.frames * self.interval.as_micros()
        })
    }
}
