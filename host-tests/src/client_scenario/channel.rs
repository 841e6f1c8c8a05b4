//! One direction of a host link, and what is wrong with it.

use std::collections::VecDeque;
use std::time::Duration;

/// What happens to the frames of one direction.
#[derive(Debug, Clone, Default)]
pub struct Faults {
    /// Nothing passes.
    pub cut: bool,
    /// So many of the next frames get lost.
    pub lose_next: u32,
    /// The part of the frames that gets lost, 0 to 1.
    pub loss: f64,
    /// The part of the frames that comes twice.
    pub duplicates: f64,
    /// The part of the bytes that arrives changed.
    pub byte_errors: f64,
    /// How long a frame takes.
    pub delay: Duration,
    /// It takes up to this much longer.
    pub jitter: Duration,
    /// What is written meanwhile arrives only then.
    pub held_until: Duration,
}

/// Frames on their way, in the order in which they were written.
#[derive(Debug, Default)]
pub struct Channel {
    pub faults: Faults,
    under_way: VecDeque<(Duration, Vec<u8>)>,
}

impl Channel {
    /// A frame is written.
    pub fn push(&mut self, now: Duration, frame: &[u8], random: &mut fastrand::Rng) {
        let faults = &mut self.faults;
        if faults.cut {
            return;
        }
        if faults.lose_next > 0 {
            faults.lose_next -= 1;
            return;
        }
        if random.f64() < faults.loss {
            return;
        }
        let copies = if random.f64() < faults.duplicates { 2 } else { 1 };
        for _ in 0..copies {
            let mut bytes = frame.to_vec();
            for byte in &mut bytes {
                if random.f64() < self.faults.byte_errors {
                    *byte ^= random.u8(1..);
                }
            }
            let at = now + self.faults.delay + self.faults.jitter.mul_f64(random.f64());
            // A stream of bytes keeps their order.
            let after = self.under_way.back().map_or(Duration::ZERO, |(last, _)| *last);
            self.under_way.push_back((at.max(after).max(self.faults.held_until), bytes));
        }
    }

    /// Frames that are under way are held up, too.
    pub fn hold(&mut self, until: Duration) {
        self.faults.held_until = until;
        self.under_way.iter_mut().for_each(|(at, _)| *at = (*at).max(until));
    }

    /// When the next frame arrives.
    pub fn next(&self) -> Option<Duration> {
        self.under_way.front().map(|(at, _)| *at)
    }

    /// The next frame that has arrived.
    pub fn pop(&mut self, now: Duration) -> Option<Vec<u8>> {
        let arrived = self.next().is_some_and(|at| at <= now);
        arrived.then(|| self.under_way.pop_front()).flatten().map(|(_, bytes)| bytes)
    }

    /// Forgets what is under way.
    pub fn clear(&mut self) {
        self.under_way.clear();
    }
}
