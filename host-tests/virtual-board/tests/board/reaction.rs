//! From a cause to the first bit of the stop, in virtual microseconds.

use std::fmt;
use std::time::Duration;

use crate::lab::{D5, RMD, THRUSTER};
use crate::wire::OnWire;

/// Our software (GUARANTEES G5: g).
const SOFTWARE: Duration = Duration::from_micros(100);
/// The longest standard frame at 1 Mbit/s and at 210526 bit/s (F).
pub const FRAME_1M: Duration = Duration::from_micros(135);
pub const FRAME_210K: Duration = Duration::from_micros(641);
/// 13 bytes at 115200 baud (C), and 20 bits.
const MESSAGE: Duration = Duration::from_micros(1_129);
const IDLE: Duration = Duration::from_micros(174);
/// What a stop waits of a reply window (W), at most.
const WINDOW: Duration = Duration::from_millis(1);

/// From the decision to stop all four axes to the first bit of the stop of this one, while the
/// buses carry their ordinary traffic (GUARANTEES G5).
pub fn stop_within(axis: u8) -> Duration {
    match axis {
        // Its bus has two, whose turn it may be; no reply outranks it: g + F(2k − 1), k = 2.
        RMD => SOFTWARE + FRAME_1M * 3,
        // The second, and the reply of the RMD outranks it: g + F(2k − 1 + m), k = 2, m = 1.
        THRUSTER => SOFTWARE + FRAME_1M * 4,
        // A reply that is due has its id, so it waits for that: g + W + F(2k − 1), k = 1. G5 allows
        // another F for a reply that begins at the end of W; the motors here begin within
        // 0.4 ms, and what is later is our own delay.
        D5 => SOFTWARE + WINDOW + FRAME_210K,
        // g + 2C + W + 20 / baud.
        _ => SOFTWARE + MESSAGE * 2 + WINDOW + IDLE,
    }
}

/// One line of the table of reaction times.
#[derive(Debug, Clone)]
pub struct Reaction {
    /// What happened.
    pub cause: &'static str,
    /// Whose stop it is.
    pub motor: &'static str,
    /// The stop.
    pub stop: String,
    /// From the cause to its first bit.
    pub took: Duration,
    /// What that may take (GUARANTEES).
    pub limit: Duration,
}

impl Reaction {
    /// From `at` to the first bit of `stop`.
    ///
    /// # Panics
    ///
    /// If it took longer than `limit`.
    #[track_caller]
    pub fn new(
        cause: &'static str,
        motor: &'static str,
        at: Duration,
        stop: &OnWire,
        limit: Duration,
    ) -> Self {
        let took = stop.first_bit.checked_sub(at).expect("a stop after its cause");
        let reaction = Self { cause, motor, stop: stop.text.clone(), took, limit };
        assert!(took <= limit, "too late: {reaction}");
        reaction
    }
}

impl fmt::Display for Reaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { cause, motor, stop, took, limit } = self;
        let (took, limit) = (took.as_secs_f64() * 1e6, limit.as_secs_f64() * 1e6);
        write!(f, "{cause:<58} {motor:<13} {stop:<26} {took:>10.1} {limit:>9.0}")
    }
}

/// The head of the table.
pub fn head() -> String {
    let (took, limit) = ("took µs", "limit µs");
    format!(
        "{:<58} {:<13} {:<26} {took:>10} {limit:>9}",
        "from the cause to the stop's first bit", "motor", "stop"
    )
}
