//! Raw access to a bus: frames from and to the host as they are.

use heapless::{Deque, Vec};
use host_protocol::replies::{MAX_RAW_FRAMES, RawFrames};
use host_protocol::{RawFrame, ReceivedFrame};

/// Frames waiting to be sent.
const SEND_QUEUE: usize = 4;
/// Frames waiting to be read by the host.
const RECEIVE_QUEUE: usize = 16;

/// An open raw access.
pub(crate) struct Raw {
    to_send: Deque<RawFrame, SEND_QUEUE>,
    received: Deque<ReceivedFrame, RECEIVE_QUEUE>,
    dropped: u32,
}

impl Raw {
    pub const fn new() -> Self {
        Self { to_send: Deque::new(), received: Deque::new(), dropped: 0 }
    }

    /// Queues a frame; `false` if the queue is full.
    pub fn send(&mut self, frame: RawFrame) -> bool {
        self.to_send.push_back(frame).is_ok()
    }

    pub fn next_to_send(&mut self) -> Option<RawFrame> {
        self.to_send.pop_front()
    }

    /// Keeps a received frame for the host; when the queue is full it is dropped and counted.
    pub fn keep(&mut self, frame: ReceivedFrame) {
        if self.received.push_back(frame).is_err() {
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    /// The oldest frames, as many as one reply carries, and how many were dropped since the last time.
    pub fn read(&mut self) -> RawFrames {
        let mut frames = Vec::<ReceivedFrame, MAX_RAW_FRAMES>::new();
        while !frames.is_full()
            && let Some(frame) = self.received.pop_front()
        {
            let _ = frames.push(frame);
        }
        RawFrames { frames, dropped: core::mem::take(&mut self.dropped) }
    }
}
