//! From a cause to the first bit of the stop, in virtual microseconds.

use std::fmt;
use std::time::Duration;

use virtual_board::machine::Machine;
use virtual_board::outside::Outside;

use crate::lab::{AXES, D5, Lab, NAMES, RMD, SEED, STOPS, THRUSTER, bus_of, wired};
use crate::part::part_of;
use crate::wire::{self, OnWire};

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
    pub cause: String,
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
    /// From `at` to the first bit of the `stop` of an axis. Panics if it took longer than `limit`.
    #[track_caller]
    pub fn new(cause: &str, axis: u8, at: Duration, stop: &OnWire, limit: Duration) -> Self {
        let (cause, motor) = (cause.to_owned(), NAMES[usize::from(axis)]);
        let took = stop.first_bit.checked_sub(at).expect("a stop after its cause");
        let reaction = Self { cause, motor, stop: stop.text.clone(), took, limit };
        assert!(took <= limit, "too late: {reaction}");
        reaction
    }

    /// Panics if a table names no line of this cause, motor, stop and limit.
    #[track_caller]
    pub fn check_written(&self, table: &str) {
        let line = self.to_string();
        let (ours, limit) = split(&line);
        let mut written = table.lines().filter(|line| !line.starts_with('#')).map(split);
        assert!(
            written.any(|(theirs, other)| (theirs, other) == (ours, limit)),
            "fault-times.txt has no line as this one: {line}; .ci/virtual-board faults writes it"
        );
    }

    /// Of every axis, which has so long before its stop is decided on: the first stops on its bus.
    #[track_caller]
    pub fn of_all(
        cause: &str,
        at: Duration,
        within: Duration,
        mut wire: impl FnMut(u8) -> Vec<OnWire>,
    ) -> Vec<Self> {
        let of = |axis| {
            let on_wire = wire(bus_of(axis));
            let stop = wire::find(&on_wire, STOPS[usize::from(axis)])
                .unwrap_or_else(|error| panic!("{error}"));
            Self::new(cause, axis, at, stop, within + stop_within(axis))
        };
        AXES.into_iter().map(of).collect()
    }

    /// The worst of every axis at any moment of the buses' traffic: at 12 moments from one
    /// snapshot in motion on, 1.77 ms apart, or a part of them.
    pub fn worst_of_12(lab: &Lab, act: impl Fn(&mut Machine, &Outside) -> Vec<Self>) -> Vec<Self> {
        const APART: Duration = Duration::from_micros(1_770);
        let in_motion = lab.machine.borrow_mut().snapshot();
        let moments = part_of(0..12).map(|moment| {
            let (board, outside, _) = wired(SEED);
            let mut machine = board.resume(&in_motion);
            machine.run_for(APART * moment);
            act(&mut machine, &outside)
        });
        let worse = |(one, other): (Self, Self)| if one.took < other.took { other } else { one };
        let worst = moments.reduce(|one, other| one.into_iter().zip(other).map(worse).collect());
        worst.expect("a moment")
    }
}

impl fmt::Display for Reaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { cause, motor, stop, took, limit } = self;
        let (took, limit) = (took.as_secs_f64() * 1e6, limit.as_secs_f64() * 1e6);
        write!(f, "{cause:<58} {motor:<13} {stop:<26} {took:>10.1} {limit:>9.0}")
    }
}

/// What a line says but for the time that was measured: cause, motor and stop; the limit.
fn split(line: &str) -> (&str, &str) {
    let (rest, limit) = line.rsplit_once(' ').unwrap_or((line, ""));
    let (ours, _took) = rest.trim_end().rsplit_once(' ').unwrap_or((rest, ""));
    (ours.trim_end(), limit)
}

/// The head of the table.
pub fn head() -> String {
    let (took, limit) = ("took µs", "limit µs");
    format!(
        "{:<58} {:<13} {:<26} {took:>10} {limit:>9}",
        "from the cause to the stop's first bit", "motor", "stop"
    )
}
