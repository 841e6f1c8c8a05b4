//! Raw access to a bus: frames from and to the host as they are.

use crate::time::{Duration, Instant};
use heapless::Deque;
use host_protocol::replies::{MAX_RAW_FRAMES, RawFrames};
use host_protocol::{Bytes, RawFrame, ReceivedFrame};
use serde::{Deserialize, Serialize};

/// Frames waiting to be sent.
const SEND_QUEUE: usize = 2;
/// Frames waiting to be read by the host.
const RECEIVE_QUEUE: usize = 8;

/// An open raw access.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Raw {
    /// Frames that may do more than read a motor are sent too.
    unsafe_access: bool,
    to_send: Deque<RawFrame, SEND_QUEUE>,
    received: Deque<ReceivedFrame, RECEIVE_QUEUE>,
    dropped: u32,
    /// When the latest bytes of a serial line came.
    heard_at: Instant,
}

impl Raw {
    pub const fn new(unsafe_access: bool) -> Self {
        Self {
            unsafe_access,
            to_send: Deque::new(),
            received: Deque::new(),
            dropped: 0,
            heard_at: Instant::from_micros(0),
        }
    }

    pub fn is_unsafe(&self) -> bool {
        self.unsafe_access
    }

    /// Queues a frame; `false` if the queue is full.
    pub fn send(&mut self, frame: RawFrame) -> bool {
        self.to_send.push_back(frame).is_ok()
    }

    /// What waits to be sent is dropped.
    pub fn purge(&mut self) {
        self.to_send.clear();
    }

    pub fn next_to_send(&mut self) -> Option<RawFrame> {
        self.to_send.pop_front()
    }

    /// Keeps a received byte for the host: it joins the latest ones unless the line was idle in
    /// between.
    pub fn keep_byte(&mut self, now: Instant, byte: u8, idle: Duration) {
        let joins = self.heard_at + idle > now;
        self.heard_at = now;
        let joined = match self.received.back_mut() {
            Some(ReceivedFrame { frame: RawFrame::Serial(latest), .. }) if joins => {
                latest.push(byte).is_ok()
            }
            _ => false,
        };
        if !joined {
            let first = Bytes::from_iter([byte]);
            self.keep(ReceivedFrame { time_us: now.as_micros(), frame: RawFrame::Serial(first) });
        }
    }

    /// Keeps a received frame for the host; when the queue is full it is dropped and counted.
    pub fn keep(&mut self, frame: ReceivedFrame) {
        if self.received.push_back(frame).is_err() {
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    /// The oldest frames, as many as one reply carries, and how many were dropped since the last
    /// time.
    pub fn read(&mut self) -> RawFrames {
        let oldest = core::iter::from_fn(|| self.received.pop_front());
        let frames = oldest.take(MAX_RAW_FRAMES).collect();
        RawFrames { frames, dropped: core::mem::take(&mut self.dropped) }
    }
}
