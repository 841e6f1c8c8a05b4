//! A node for tests: writes down what it hears, sends what it is given, and breaks frames when
//! asked to.

use std::collections::VecDeque;
use std::time::Duration;

use host_protocol::CanFrame;
use rigless::chip::Timeline;
use rigless::chip::can::{Fault, Frame, Offer, Peer};
use rigless::snapshot::store;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use super::{from_bus, instant, since_start, to_bus};

/// A frame that the probe has heard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Heard {
    /// The frame.
    pub frame: CanFrame,
    /// When it was valid at its receivers, one bit before its end, since the start of the run.
    pub valid_at: Duration,
    /// Bits from its first bit to that moment, stuff bits included.
    pub bits: u32,
}

impl Heard {
    /// When its first bit was sent, on a bus of `bitrate` bits per second.
    pub fn first_bit(&self, bitrate: f64) -> Duration {
        self.valid_at.saturating_sub(Duration::from_secs_f64(f64::from(self.bits) / bitrate))
    }
}

/// A frame that the probe will send.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Waiting {
    since: VirtualNanos,
    frame: Frame,
    damaged: bool,
}

/// A well-behaved node without a will of its own. Like every node it acknowledges frames while it
/// is not silenced.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Probe {
    heard: Vec<Heard>,
    waiting: VecDeque<Waiting>,
    delivered: usize,
    disturb: u32,
}

store!(Probe);

impl Probe {
    /// A probe that only listens, so far.
    pub fn new() -> Self {
        Self::default()
    }

    /// The frames of others, since the start or the last [`Probe::clear`].
    pub fn heard(&self) -> &[Heard] {
        &self.heard
    }

    /// Forgets what was heard.
    pub fn clear(&mut self) {
        self.heard.clear();
    }

    /// Sends a frame as soon as the bus is free after `at`, and after those that it has to send
    /// already.
    pub fn send(&mut self, at: Duration, frame: &CanFrame) {
        self.waiting.push_back(Waiting {
            since: instant(at),
            frame: to_bus(frame),
            damaged: false,
        });
    }

    /// The same with a wrong checksum, once: everybody else destroys it.
    pub fn send_damaged(&mut self, at: Duration, frame: &CanFrame) {
        self.waiting.push_back(Waiting { since: instant(at), frame: to_bus(frame), damaged: true });
    }

    /// Frames that were sent and acknowledged.
    pub fn delivered(&self) -> usize {
        self.delivered
    }

    /// Forgets the frames that still wait.
    pub fn forget_unsent(&mut self) {
        self.waiting.clear();
    }

    /// Frames that still wait.
    pub fn unsent(&self) -> usize {
        self.waiting.len()
    }

    /// Destroys the next `frames` frames of the controller with an error flag; `u32::MAX` for every
    /// one from now on.
    pub fn disturb_next(&mut self, frames: u32) {
        self.disturb = frames;
    }
}

impl Peer for Probe {
    fn receive(&mut self, frame: &Frame, timeline: &mut Timeline<'_, '_>) {
        let bits = frame.bits_until_valid();
        if let Some(frame) = from_bus(frame) {
            self.heard.push(Heard { frame, valid_at: since_start(timeline.now()), bits });
        }
    }

    fn offer(&self) -> Option<Offer> {
        let Waiting { since, frame, damaged } = *self.waiting.front()?;
        Some(Offer { since, frame, fault: damaged.then_some(Fault::Crc) })
    }

    fn sent(&mut self, acknowledged: bool, _timeline: &mut Timeline<'_, '_>) {
        self.delivered += usize::from(acknowledged);
        self.waiting.pop_front_if(|front| acknowledged || front.damaged);
    }

    fn disturbs(&mut self, _frame: &Frame) -> bool {
        let disturbs = self.disturb > 0;
        if self.disturb != u32::MAX {
            self.disturb = self.disturb.saturating_sub(1);
        }
        disturbs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nodes::test_bus::{Outcome, TestBus};

    fn us(us: u64) -> Duration {
        Duration::from_micros(us)
    }

    fn frame(id: u16, data: &[u8]) -> CanFrame {
        CanFrame::standard(id, data).unwrap()
    }

    /// 52 stuffed bits and 9 more until it is valid, counted apart from this crate: 61 µs at 1
    /// Mbit/s.
    #[test]
    fn it_knows_when_the_first_bit_of_a_frame_was_sent() {
        let mut bus = TestBus::new(1_000_000);
        let probe = bus.attach(Probe::new());
        let sent = frame(0x123, &[0xAB, 0xCD]);
        assert_eq!(bus.send(us(100), &sent), Outcome::Delivered);
        let [heard] = bus.peer::<Probe>(probe).heard() else { panic!("one frame") };
        assert_eq!((heard.frame, heard.bits, heard.valid_at), (sent, 61, us(161)));
        assert_eq!(heard.first_bit(1e6), us(100));
    }

    #[test]
    fn it_sends_in_order_and_not_too_early() {
        let mut bus = TestBus::new(1_000_000);
        let probe = bus.attach(Probe::new());
        bus.peer::<Probe>(probe).send(us(500), &frame(0x200, &[]));
        bus.peer::<Probe>(probe).send(us(0), &frame(0x100, &[]));
        bus.run_until(us(2_000));
        let sent: Vec<_> = bus.log().iter().map(|entry| (entry.start, entry.frame)).collect();
        let [(first, a), (second, b)] = sent[..] else { panic!("two frames: {sent:?}") };
        assert_eq!((first, a, b), (us(500), frame(0x200, &[]), frame(0x100, &[])));
        assert!(second > us(540), "after the first");
        assert_eq!(
            (bus.peer::<Probe>(probe).delivered(), bus.peer::<Probe>(probe).unsent()),
            (2, 0)
        );
    }

    #[test]
    fn a_damaged_frame_is_sent_once() {
        let mut bus = TestBus::new(1_000_000);
        let probe = bus.attach(Probe::new());
        bus.peer::<Probe>(probe).send_damaged(us(0), &frame(0x200, &[]));
        bus.run_until(us(5_000));
        let outcomes: Vec<_> = bus.log().iter().map(|entry| entry.outcome).collect();
        assert_eq!(outcomes, [Outcome::Damaged(Fault::Crc)]);
    }

    #[test]
    fn it_disturbs_as_many_frames_as_asked_for() {
        let mut bus = TestBus::new(1_000_000);
        let probe = bus.attach(Probe::new());
        bus.peer::<Probe>(probe).disturb_next(2);
        let outcomes: Vec<_> = (0..3).map(|ms| bus.send(us(ms * 1_000), &frame(1, &[]))).collect();
        assert_eq!(outcomes, [Outcome::Disturbed, Outcome::Disturbed, Outcome::Delivered]);
        assert_eq!(bus.peer::<Probe>(probe).heard().len(), 1);
    }
}
