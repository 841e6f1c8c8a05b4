//! What waits to be written to one visitor: bounded, and what finds no room is counted.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use tungstenite::Message;

/// What waits at most. Beyond that the oldest that may be lost is, else the oldest.
pub const WAITING: usize = 256;

/// One thing to write.
#[derive(Debug, Clone)]
pub(crate) enum Out {
    /// A message.
    Message(Message),
    /// Frames as they are: what the reading side answers by itself, such as a pong.
    Frames(Vec<u8>),
}

#[derive(Debug, Default)]
struct Inner {
    /// Each with whether it may be lost.
    waiting: VecDeque<(Out, bool)>,
    dropped: u64,
    closed: bool,
}

/// The way to one visitor. Putting something in never waits.
#[derive(Debug, Clone, Default)]
pub struct Outbox(Arc<(Mutex<Inner>, Condvar)>);

impl Outbox {
    /// Something that must arrive, if anything does.
    pub fn put(&self, message: Message) {
        self.push(Out::Message(message), false);
    }

    /// Something that a newer one replaces: the first to be lost.
    pub fn put_sample(&self, message: Message) {
        self.push(Out::Message(message), true);
    }

    /// The same of JSON.
    pub fn put_json(&self, value: &serde_json::Value) {
        self.put(Message::text(value.to_string()));
    }

    pub(crate) fn put_frames(&self, frames: &[u8]) {
        self.push(Out::Frames(frames.to_vec()), false);
    }

    fn push(&self, out: Out, may_be_lost: bool) {
        let mut inner = self.inner();
        if inner.closed {
            return;
        }
        if inner.waiting.len() >= WAITING {
            let first = inner.waiting.iter().position(|(_, may_be_lost)| *may_be_lost);
            inner.waiting.remove(first.unwrap_or(0));
            inner.dropped += 1;
        }
        inner.waiting.push_back((out, may_be_lost));
        drop(inner);
        self.0.1.notify_one();
    }

    /// How many were lost so far.
    pub fn dropped(&self) -> u64 {
        self.inner().dropped
    }

    /// Counts one that was not even put in.
    pub fn count_dropped(&self) {
        self.inner().dropped += 1;
    }

    /// Nothing is written any more; the writer ends.
    pub fn close(&self) {
        self.inner().closed = true;
        self.0.1.notify_all();
    }

    /// Whether it is closed.
    pub fn is_closed(&self) -> bool {
        self.inner().closed
    }

    /// The next to write; waits for it. Nothing once it is closed.
    pub(crate) fn take(&self) -> Option<Out> {
        let mut inner = self.inner();
        loop {
            if let Some((out, _)) = inner.waiting.pop_front() {
                return Some(out);
            }
            if inner.closed {
                return None;
            }
            inner = self.0.1.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(outbox: &Outbox) -> Vec<String> {
        outbox.close();
        let out = std::iter::from_fn(|| outbox.take());
        out.filter_map(|out| match out {
            Out::Message(message) => Some(message.to_string()),
            Out::Frames(_) => None,
        })
        .collect()
    }

    #[test]
    fn a_visitor_that_does_not_read_loses_samples_first_and_they_are_counted() {
        let outbox = Outbox::default();
        outbox.put(Message::text("trip"));
        for number in 0..10_000 {
            outbox.put_sample(Message::text(number.to_string()));
        }
        assert_eq!(outbox.dropped(), 10_001 - 256);
        let left = texts(&outbox);
        assert_eq!(left.len(), 256);
        assert_eq!((left[0].as_str(), left[255].as_str()), ("trip", "9999"));
    }

    #[test]
    fn also_what_must_arrive_is_bounded() {
        let outbox = Outbox::default();
        for number in 0..300 {
            outbox.put(Message::text(number.to_string()));
        }
        assert_eq!(outbox.dropped(), 300 - 256);
        assert_eq!(texts(&outbox)[0], "44");
    }
}
