//! Where gateway time stands against the transport's time, as far as pings can tell.

use std::collections::VecDeque;
use std::time::Duration;

/// Pings remembered. Each one narrows the estimate; old ones are worth less and less.
const SAMPLES: usize = 8;
/// By how much the two clocks may drift apart, in millionths: ten times what two crystals do.
const DRIFT_PPM: u64 = 1_000;
/// A gateway whose clock stands further back than this part of the time since the last exchange has
/// restarted; one whose clock runs slow, by its chip's oscillator, has not.
const SLOW_PART: u64 = 16;
/// Millionths of one.
const PPM: u64 = 1_000_000;

/// One exchange: the gateway read its clock at some moment between `sent` and `received`.
#[derive(Debug, Clone, Copy)]
struct Sample {
    sent_us: u64,
    received_us: u64,
    gateway_us: u64,
}

/// The bounds on gateway time that all remembered exchanges leave.
#[derive(Debug, Clone, Default)]
pub(crate) struct Clock {
    samples: VecDeque<Sample>,
    /// The gateway has restarted since it was last greeted, or may be another one.
    has_restarted: bool,
}

impl Clock {
    /// Takes in one exchange: request sent and reply received in transport time, and the gateway
    /// time in the reply.
    pub(crate) fn measure(&mut self, sent: Duration, received: Duration, gateway_us: u64) {
        let sample = Sample { sent_us: micros(sent), received_us: micros(received), gateway_us };
        // The gateway's clock never jumps: an exchange that contradicts the others comes from a
        // gateway that restarted.
        let round_trip = sample.received_us.saturating_sub(sample.sent_us);
        let back = self.earliest_us(received).saturating_sub(gateway_us.saturating_add(round_trip));
        let slow = self.samples.back().map_or(0, |_| micros(self.age(received)) / SLOW_PART);
        self.has_restarted |= back > slow;
        if back > 0 || self.latest_us(received).is_some_and(|latest| gateway_us > latest) {
            self.samples.clear();
        }
        if self.samples.len() == SAMPLES {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
    }

    /// Whether the gateway has restarted since it was last greeted, its clock standing before what
    /// it was, or may be another one.
    pub(crate) fn has_restarted(&self) -> bool {
        self.has_restarted
    }

    /// The next one that is heard may be another one, and is to be greeted.
    pub(crate) fn expect_another(&mut self) {
        self.has_restarted = true;
    }

    /// The gateway has been greeted.
    pub(crate) fn greeted(&mut self) {
        self.has_restarted = false;
    }

    /// Forgets everything: the next exchange may be with another gateway.
    pub(crate) fn reset(&mut self) {
        *self = Self::default();
    }

    /// How long the last exchange is ago; for ever before the first.
    pub(crate) fn age(&self, now: Duration) -> Duration {
        let last = self.samples.back().map(|sample| Duration::from_micros(sample.received_us));
        last.map_or(Duration::MAX, |last| now.saturating_sub(last))
    }

    /// The gateway's time is at least this, in µs; 0 before the first exchange.
    pub(crate) fn earliest_us(&self, now: Duration) -> u64 {
        let now = micros(now);
        let bound = |sample: &Sample| {
            let age = now.saturating_sub(sample.received_us);
            sample.gateway_us.saturating_add(age - drift(age))
        };
        self.samples.iter().map(bound).max().unwrap_or(0)
    }

    /// The gateway's time is at most this, in µs; `None` before the first exchange.
    pub(crate) fn latest_us(&self, now: Duration) -> Option<u64> {
        let now = micros(now);
        let bound = |sample: &Sample| {
            let age = now.saturating_sub(sample.sent_us);
            sample.gateway_us.saturating_add(age.saturating_add(drift(age)))
        };
        self.samples.iter().map(bound).min()
    }

    /// How far apart the bounds are, in µs; `None` before the first exchange.
    pub(crate) fn width_us(&self, now: Duration) -> Option<u64> {
        self.latest_us(now).map(|latest| latest.saturating_sub(self.earliest_us(now)))
    }

    /// The best guess of the gateway's time, in µs.
    pub(crate) fn estimate_us(&self, now: Duration) -> u64 {
        let earliest = self.earliest_us(now);
        let latest = self.latest_us(now).unwrap_or(earliest).max(earliest);
        earliest + (latest - earliest) / 2
    }
}

fn drift(age_us: u64) -> u64 {
    age_us / (PPM / DRIFT_PPM)
}

fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(us: u64) -> Duration {
        Duration::from_micros(us)
    }

    #[test]
    fn one_exchange_bounds_the_gateway_time_by_its_round_trip() {
        let mut clock = Clock::default();
        clock.measure(at(1_000), at(3_000), 50_000);
        assert_eq!(clock.earliest_us(at(3_000)), 50_000);
        // 2000 µs since the request left, and 2 µs of drift.
        assert_eq!(clock.latest_us(at(3_000)), Some(52_002));
        assert_eq!(clock.estimate_us(at(3_000)), 51_001);
    }

    #[test]
    fn the_quickest_exchange_decides() {
        let mut clock = Clock::default();
        clock.measure(at(0), at(20_000), 1_010_000);
        clock.measure(at(30_000), at(30_200), 1_030_100);
        clock.measure(at(40_000), at(70_000), 1_045_000);
        // The second one says 1 030 100 at 30 200: 39 800 µs later less 39 µs of drift.
        assert_eq!(clock.earliest_us(at(70_000)), 1_030_100 + 39_800 - 39);
    }

    #[test]
    fn the_bounds_are_as_far_apart_as_the_quickest_exchange_took() {
        let mut clock = Clock::default();
        assert_eq!(clock.width_us(at(0)), None);
        clock.measure(at(0), at(160_000), 1_100_000);
        assert_eq!(clock.width_us(at(160_000)), Some(160_160));
        clock.measure(at(170_000), at(170_300), 1_170_200);
        assert_eq!(clock.width_us(at(170_300)), Some(300));
    }

    #[test]
    fn an_old_exchange_gives_way_to_a_young_one() {
        let mut clock = Clock::default();
        clock.measure(at(0), at(100), 50);
        // A gateway clock that runs slow by 900 ppm.
        clock.measure(at(10_000_000), at(10_000_100), 9_991_050);
        assert_eq!(clock.earliest_us(at(10_000_100)), 9_991_050);
        assert_eq!(clock.latest_us(at(10_000_100)), Some(9_991_150));
    }

    /// A session that it began anew would end what it moves.
    #[test]
    fn a_gateway_whose_clock_runs_slow_has_not_restarted() {
        let mut clock = Clock::default();
        for second in 0..100 {
            clock.measure(at(second * 1_000_000), at(second * 1_000_000 + 100), second * 950_000);
        }
        assert!(!clock.has_restarted());
        clock.greeted();
        clock.measure(at(100_000_000), at(100_000_100), 300_000);
        assert!(clock.has_restarted());
    }
}
