//! Several D5 motors that are set in motion by one frame, and what they say to requests that are
//! for others (D5 manual, quick start 3, 4 and 7, table row 5). Axes 1 to 3 have the nodes 0x0A,
//! 0x0B and 0x0C.

use super::*;
use crate::wire::Told;

const START: u16 = 0x45;
const EXECUTE: &[u8] = &[0xD5, 0xFE, 5, 5, 0, 0, 0, 8];
/// 1 rad/s as a velocity of a request.
const VELOCITY_RAD_S: [u8; 4] = [0, 0, 0x80, 0x3F];
/// 57 and 58 degrees a second.
const SPEED: u8 = 57;
const OTHER_SPEED: u8 = 58;

fn d5(node: u8, command: u8, address: u8, value: u8) -> Vec<u8> {
    let body = [node, 5, command, address, value, 0];
    let sum = body.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
    std::iter::once(0xD5).chain(body).chain([sum]).collect()
}

impl Trace {
    /// D5 motors alone on bus 0, at 210 526 bit/s: axes 1 and 2 are armed, axis 3 is at rest.
    fn of_d5(exclusive: u8) -> Self {
        let mut trace = Self::new(HOLD);
        trace.done(0, 0x23, &[0]);
        trace.done(0, 0x11, &[0, 0xDE, 0xEC, 0x0C, 0b100, exclusive, 0xB8, 0x17]);
        for (axis, node) in [(1, 0x0A), (2, 0x0B), (3, 0x0C)] {
            for (parameter, value) in [(1, 0), (2, 3), (3, node), (5, HOLD)] {
                trace.done(0, 0x20, &[axis, parameter, 1, value]);
            }
            trace.event(0x8003, &[axis, 1]);
        }
        for axis in [1, 2] {
            let axis = &mut trace.oracle.axes[axis];
            (axis.told, axis.armed, axis.epoch) = (Told::Armed, true, Some(EPOCH.into()));
            (axis.heard, axis.faults_asked) = ((trace.now, 0), (trace.now, 0));
        }
        trace
    }

    fn start(&mut self) -> u16 {
        let expiry = self.moves(EPOCH, 48_000, &[])[2..].to_vec();
        let member = |axis: u8| [&[axis, EPOCH], &VELOCITY_RAD_S[..]].concat();
        let body = [expiry, vec![2], member(1), member(2)].concat();
        self.ask(0, START, &body)
    }

    fn to(&mut self, node: u8, data: &[u8]) {
        self.oracle.handed(self.now, 0, 0, Frame::Can(node.into(), data));
        self.now += 641;
        self.oracle.left(self.now, 0, 0);
    }

    /// A request, and its echo with this value.
    fn asks(&mut self, request: &[u8], value: u8) {
        self.to(request[1], request);
        let mut reply = d5(request[1], request[3], request[4], value);
        reply[0] = 0x5D;
        self.now += 641;
        self.oracle.received(self.now, 0, Frame::Can(request[1].into(), &reply));
    }

    /// A speed waits in the motor of a node, and it says so.
    fn has_wait(&mut self, node: u8, speed: u8) {
        self.asks(&d5(node, 4, 0x20, speed), speed);
        self.asks(&d5(node, 2, 0x2C, 0), 1);
    }

    /// Nothing does.
    fn has_nothing_wait(&mut self, node: u8) {
        self.asks(&d5(node, 2, 0x2C, 0), 0);
    }

    fn prepared(&mut self) -> u16 {
        let sequence = self.start();
        self.has_wait(0x0A, SPEED);
        self.has_wait(0x0B, SPEED);
        self.has_nothing_wait(0x0C);
        sequence
    }

    fn done_at_last(&mut self, sequence: u16) {
        self.answer(0, sequence, 2, START, DONE);
        self.settle();
    }
}

#[test]
fn a_start_of_two_beside_a_third_that_stands_breaks_nothing() {
    let mut trace = Trace::of_d5(1);
    let sequence = trace.prepared();
    trace.to(0xFE, EXECUTE);
    trace.done_at_last(sequence);
    for node in [0x0A, 0x0B] {
        trace.asks(&d5(node, 3, 0x20, SPEED), SPEED);
    }
    trace.settle();
    trace.breaks_nothing();
    assert_eq!(trace.oracle.started_together(), 1);
}

#[test]
pub fn each_thing_that_is_missing_before_a_start() {
    let missing: [fn(&mut Trace) -> u16; 5] = [
        // The second was not told its speed.
        |trace| {
            let sequence = trace.start();
            trace.has_wait(0x0A, SPEED);
            trace.has_nothing_wait(0x0C);
            sequence
        },
        // It was, and nothing waits in it.
        |trace| {
            let sequence = trace.start();
            trace.has_wait(0x0A, SPEED);
            trace.asks(&d5(0x0B, 4, 0x20, SPEED), SPEED);
            trace.has_nothing_wait(0x0B);
            trace.has_nothing_wait(0x0C);
            sequence
        },
        // The third was not asked since.
        |trace| {
            trace.has_nothing_wait(0x0C);
            let sequence = trace.start();
            trace.has_wait(0x0A, SPEED);
            trace.has_wait(0x0B, SPEED);
            sequence
        },
        // A speed waits in it.
        |trace| {
            let sequence = trace.prepared();
            trace.asks(&d5(0x0C, 2, 0x2C, 0), 1);
            sequence
        },
        // One of them has tripped.
        |trace| {
            let sequence = trace.prepared();
            trace.event(0x8001, &[2, 0]);
            trace.to(0x0B, &d5(0x0B, 3, 0x20, 0));
            sequence
        },
    ];
    for prepare in missing {
        let mut trace = Trace::of_d5(1);
        prepare(&mut trace);
        trace.breaks_nothing();
        trace.to(0xFE, EXECUTE);
        trace.breaks(Check::StartUnproved);
    }
    let mut trace = Trace::of_d5(0);
    trace.prepared();
    trace.to(0xFE, EXECUTE);
    trace.breaks(Check::StartUnproved);
}

#[test]
fn a_start_that_is_reported_and_has_not_come_or_the_reverse() {
    let mut trace = Trace::of_d5(1);
    let sequence = trace.prepared();
    trace.done_at_last(sequence);
    trace.breaks(Check::StartUnproved);
    let mut trace = Trace::of_d5(1);
    let sequence = trace.prepared();
    trace.to(0xFE, EXECUTE);
    trace.answer(0, sequence, 3, ERROR_NOT_ARMED, &[1, 1]);
    trace.breaks(Check::StartUnproved);
}

#[test]
fn a_trip_by_time_at_the_instant_of_the_start_and_one_behind_it() {
    for (later_us, breaks) in [(0, false), (1, true)] {
        let mut trace = Trace::of_d5(1);
        let sequence = trace.prepared();
        trace.to(0xFE, EXECUTE);
        trace.now += later_us;
        trace.answer(0, sequence, 3, ERROR_TRIPPED, &[2, 0]);
        if breaks {
            trace.breaks(Check::StartUnproved);
        } else {
            trace.breaks_nothing();
        }
    }
}

#[test]
fn a_start_that_goes_out_twice_or_too_late() {
    let mut trace = Trace::of_d5(1);
    trace.prepared();
    trace.to(0xFE, EXECUTE);
    trace.to(0xFE, EXECUTE);
    trace.breaks(Check::Broadcast);
    let mut trace = Trace::of_d5(1);
    trace.prepared();
    trace.now += 48_000;
    trace.to(0xFE, EXECUTE);
    trace.breaks(Check::Broadcast);
}

#[test]
fn another_speed_than_the_one_that_waited() {
    let mut trace = Trace::of_d5(1);
    trace.prepared();
    trace.to(0xFE, EXECUTE);
    trace.to(0x0A, &d5(0x0A, 3, 0x20, OTHER_SPEED));
    trace.breaks(Check::MotionStale);
    let mut trace = Trace::of_d5(1);
    trace.start();
    trace.has_wait(0x0A, SPEED);
    trace.to(0x0A, &d5(0x0A, 4, 0x20, OTHER_SPEED));
    trace.breaks(Check::MotionStale);
}

#[test]
fn a_start_that_waits_in_the_controller_when_one_of_them_is_stopped() {
    let mut trace = Trace::of_d5(1);
    trace.prepared();
    trace.oracle.handed(trace.now, 0, 1, Frame::Can(0xFE, EXECUTE));
    trace.done(0, 0x32, &[0, 2]);
    trace.event(0x8003, &[2, 5]);
    trace.wait(101);
    trace.breaks(Check::MotionKept);
}

/// One that stands is set to a speed of 0, and so is what waits in it; that may be started, and
/// nothing else.
#[test]
fn what_starts_in_a_motor_that_is_at_rest() {
    let mut trace = Trace::of_d5(1);
    trace.start();
    trace.asks(&d5(0x0C, 4, 0x20, 0), 0);
    trace.asks(&d5(0x0C, 5, 0, 0), 0);
    trace.breaks_nothing();
    let mut trace = Trace::of_d5(1);
    trace.start();
    trace.to(0x0C, &d5(0x0C, 4, 0x20, 0));
    trace.to(0x0C, &d5(0x0C, 5, 0, 0));
    trace.breaks(Check::MotionUnarmed);
}

#[test]
fn a_stop_that_leaves_a_speed_waiting() {
    for (waits, overwritten, proved) in [(0, false, true), (1, false, false), (1, true, true)] {
        let mut trace = Trace::of_d5(1);
        trace.start();
        trace.has_wait(0x0A, SPEED);
        trace.done(0, 0x32, &[0, 1]);
        trace.event(0x8003, &[1, 5]);
        for _ in 0..2 {
            trace.asks(&d5(0x0A, 3, 0x20, 0), 0);
        }
        trace.asks(&d5(0x0A, 2, 0x2C, 0), waits);
        if overwritten {
            trace.asks(&d5(0x0A, 4, 0x20, 0), 0);
        }
        for _ in 0..2 {
            trace.asks(&d5(0x0A, 2, 0x26, 0), 0);
        }
        trace.event(0x8003, &[1, 7]);
        let broken: Vec<Check> =
            trace.oracle.violations().iter().map(|violation| violation.check).collect();
        assert_eq!(broken, if proved { vec![] } else { vec![Check::ConfirmedUnproved] });
    }
}
