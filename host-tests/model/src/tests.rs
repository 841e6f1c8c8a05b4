//! Each promise, broken once on purpose: traces written by hand, with literal bytes.
//!
//! The gateway has an RMD motor, node 1, on CAN bus 0 at 1 Mbit/s, as axis 0 with stop action hold. Host 0 commands, host 1
//! is another, host 2 listens.

use super::*;

const HOLD: u8 = 2;
const COAST: u8 = 1;
const VELOCITY: &[u8] = &[0xA2, 0, 0, 0, 0x10, 0x27, 0, 0];
const OTHER_VELOCITY: &[u8] = &[0xA2, 0, 0, 0, 0x20, 0x27, 0, 0];
const DISTANCE: &[u8] = &[0xA8, 0, 0xF4, 1, 0xA0, 0x8C, 0, 0];
const STOP: &[u8] = &[0x81, 0, 0, 0, 0, 0, 0, 0];
const OFF: &[u8] = &[0x80, 0, 0, 0, 0, 0, 0, 0];
const READ_SPEED: &[u8] = &[0x9C, 0, 0, 0, 0, 0, 0, 0];
const STILL: &[u8] = &[0x9C, 30, 0, 0, 0, 0, 0, 0];
const READ_FAULTS: &[u8] = &[0x9A, 0, 0, 0, 0, 0, 0, 0];
const SET_ZERO: &[u8] = &[0x64, 0, 0, 0, 0, 0, 0, 0];
const EPOCH: u8 = 7;
/// Done has no fields.
const DONE: &[u8] = &[];
const ERROR_NOT_ARMED: u16 = 12;

struct Trace {
    oracle: Oracle,
    now: u64,
    sequence: u16,
}

impl Trace {
    fn new(action: u8) -> Self {
        let mut trace = Self { oracle: Oracle::new(&[BusKind::Can], 3, 2, 4), now: 1_000, sequence: 0 };
        // 1 000 000 bit/s, RMD, not wholly ours, 3000 µs
        trace.done(0, 0x11, &[0, 0xC0, 0x84, 0x3D, 1, 0, 0xB8, 0x17]);
        // bus 0, protocol 1, node 1, the stop action
        for (parameter, value) in [(1, 0), (2, 1), (3, 1), (5, action)] {
            trace.done(0, 0x20, &[0, parameter, 1, value]);
        }
        trace.state(1);
        trace
    }

    fn armed() -> Self {
        let mut trace = Self::new(HOLD);
        trace.arm(0);
        trace
    }

    fn active() -> Self {
        let mut trace = Self::armed();
        trace.setpoint(EPOCH, 50_000);
        trace
    }

    fn arm(&mut self, link: u8) {
        let sequence = self.ask(link, 0x30, &[0]);
        self.answer(link, sequence, 2, 0x30, &[EPOCH, 0]);
        self.state(3);
        self.settle();
    }

    fn ask(&mut self, link: u8, number: u16, body: &[u8]) -> u16 {
        self.now += 10;
        self.sequence += 1;
        self.oracle.to_gateway(self.now, link, &frame(1, self.sequence, number, body));
        self.sequence
    }

    fn answer(&mut self, link: u8, sequence: u16, kind: u8, number: u16, body: &[u8]) {
        self.oracle.from_gateway(self.now, link, &frame(kind, sequence, number, body));
        self.oracle.drained(self.now, link);
    }

    fn done(&mut self, link: u8, number: u16, body: &[u8]) -> u16 {
        let sequence = self.ask(link, number, body);
        self.answer(link, sequence, 2, number, DONE);
        self.settle();
        sequence
    }

    fn event(&mut self, number: u16, fields: &[u8]) {
        let body = [&[0, 0], fields].concat();
        self.oracle.from_gateway(self.now, 2, &frame(4, 0, number, &body));
        self.oracle.drained(self.now, 2);
    }

    /// Axis 0 is in this state: 1 idle, 3 armed, 4 active, 5 stopping.
    fn state(&mut self, state: u8) {
        self.event(0x8003, &[0, state]);
    }

    /// A setpoint of axis 0 that expires so much later.
    fn setpoint(&mut self, epoch: u8, lead: u32) -> u16 {
        let body = self.moves(epoch, lead, &[2, 0, 0, 0x80, 0x3F]);
        self.done(0, 0x40, &body)
    }

    fn moves(&self, epoch: u8, lead: u32, rest: &[u8]) -> Vec<u8> {
        let mut body = vec![0, epoch];
        let mut expiry = u32::try_from(self.now + 10).unwrap() + lead;
        while expiry >= 0x80 {
            body.push(u8::try_from(expiry & 0x7F).unwrap() | 0x80);
            expiry >>= 7;
        }
        body.push(u8::try_from(expiry).unwrap());
        body.extend(rest);
        body
    }

    fn wait(&mut self, us: u64) {
        self.now += us;
        self.settle();
    }

    fn settle(&mut self) {
        self.oracle.drained(self.now, 0);
        self.oracle.drained(self.now, 1);
        self.oracle.settle(self.now);
    }

    fn hand(&mut self, data: &[u8]) {
        self.oracle.handed(self.now, 0, 0, Frame::Can(0x141, data));
    }

    /// A frame to the motor, from the controller to the end of its time on the bus.
    fn send(&mut self, data: &[u8]) {
        self.hand(data);
        self.now += 135;
        self.oracle.left(self.now, 0, 0);
        self.settle();
    }

    fn reply(&mut self, data: &[u8]) {
        self.now += 200;
        self.oracle.received(self.now, 0, Frame::Can(0x241, data));
        self.settle();
    }

    fn exchange(&mut self, data: &[u8], reply: &[u8]) {
        self.send(data);
        self.reply(reply);
    }

    fn stop(&mut self) {
        self.done(0, 0x32, &[0, 0]);
        self.state(5);
    }

    #[track_caller]
    fn breaks(&self, check: Check) {
        let broken: Vec<Check> = self.oracle.violations().iter().map(|violation| violation.check).collect();
        assert_eq!(broken, [check], "{:?}", self.oracle.violations());
    }

    #[track_caller]
    fn breaks_nothing(&self) {
        assert_eq!(self.oracle.violations(), []);
    }
}

#[test]
fn a_life_without_fault_breaks_nothing() {
    let mut trace = Trace::active();
    trace.exchange(VELOCITY, &[0xA2, 30, 0, 0, 0, 0, 0, 0]);
    trace.wait(20_000);
    trace.exchange(VELOCITY, &[0xA2, 30, 0, 0, 0, 0, 0, 0]);
    trace.stop();
    trace.exchange(STOP, STOP);
    trace.exchange(STOP, STOP);
    trace.exchange(READ_SPEED, STILL);
    trace.exchange(READ_SPEED, STILL);
    trace.state(1);
    trace.breaks_nothing();
    assert_eq!(trace.oracle.motions(), 2);
}

#[test]
fn motion_of_an_axis_that_was_never_armed() {
    let mut trace = Trace::new(HOLD);
    trace.send(VELOCITY);
    trace.breaks(Check::MotionUnarmed);
}

#[test]
fn raw_motion_to_an_axis_that_is_not_armed() {
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x50, &[0]);
    trace.done(0, 0x51, &[[0, 0, 0xC1, 0x02, 8].as_slice(), VELOCITY].concat());
    trace.send(VELOCITY);
    trace.breaks(Check::MotionUnarmed);
}

#[test]
fn a_refresh_after_the_expiry() {
    let mut trace = Trace::active();
    trace.send(VELOCITY);
    trace.now += 50_000;
    trace.send(VELOCITY);
    assert_eq!(trace.oracle.violations()[0].check, Check::MotionExpired);
}

#[test]
fn motion_after_a_stop() {
    let mut trace = Trace::active();
    trace.stop();
    trace.exchange(STOP, STOP);
    trace.hand(VELOCITY);
    trace.breaks(Check::MotionAfterStop);
}

#[test]
fn a_refresh_of_another_setpoint_than_the_newest() {
    let mut trace = Trace::active();
    trace.send(VELOCITY);
    trace.send(OTHER_VELOCITY);
    trace.breaks(Check::MotionStale);
}

#[test]
fn a_distance_that_is_sent_twice() {
    let mut trace = Trace::armed();
    let body = trace.moves(EPOCH, 50_000, &[&[8], DISTANCE].concat());
    trace.ask(0, 0x43, &body);
    trace.settle();
    trace.send(DISTANCE);
    trace.breaks_nothing();
    trace.send(DISTANCE);
    trace.breaks(Check::MotionTwice);
}

#[test]
fn motion_that_waits_in_the_controller_and_is_not_asked_back() {
    let mut trace = Trace::active();
    trace.hand(VELOCITY);
    trace.stop();
    trace.wait(101);
    trace.breaks(Check::MotionKept);
}

#[test]
fn broadcast_motion() {
    let mut trace = Trace::active();
    trace.oracle.handed(trace.now, 0, 0, Frame::Can(0x280, VELOCITY));
    trace.breaks(Check::Broadcast);
}

#[test]
fn a_stop_that_comes_late() {
    let mut trace = Trace::active();
    trace.send(VELOCITY);
    trace.stop();
    trace.wait(371); // g and two frames are 370 µs
    trace.breaks(Check::StopLate);
}

#[test]
fn the_silence_of_the_host_and_no_stop() {
    let mut trace = Trace::armed();
    trace.exchange(READ_SPEED, STILL);
    trace.now += 240_000;
    trace.exchange(READ_SPEED, STILL);
    trace.breaks_nothing();
    trace.wait(10_000);
    trace.breaks(Check::StopLate);
}

#[test]
fn a_fault_and_no_stop() {
    let mut trace = Trace::active();
    trace.exchange(READ_FAULTS, &[0x9A, 30, 0, 1, 0xE5, 1, 4, 0]);
    trace.wait(371);
    trace.breaks(Check::StopLate);
}

#[test]
fn motion_that_nobody_acknowledges_and_no_stop() {
    let mut trace = Trace::active();
    trace.hand(VELOCITY);
    trace.now += 20_541; // 20 ms and four frames
    trace.settle();
    trace.breaks_nothing();
    trace.oracle.withdrawn(trace.now, 0, 0);
    trace.wait(600);
    trace.breaks(Check::StopLate);
}

#[test]
fn a_bus_that_goes_off_and_no_stop_when_it_is_back() {
    let mut trace = Trace::active();
    trace.oracle.bus_state(trace.now, 0, true);
    trace.wait(100_000);
    trace.breaks_nothing();
    trace.oracle.bus_state(trace.now, 0, false);
    trace.wait(371);
    trace.breaks(Check::StopLate);
}

#[test]
fn a_mute_motor_and_no_stop() {
    let mut trace = Trace::armed();
    for _ in 0..40 {
        trace.send(READ_SPEED);
        trace.now += 20_000;
        trace.done(0, 0x03, &[]);
    }
    assert_eq!(trace.oracle.violations()[0].check, Check::StopNotFirst);
}

#[test]
fn the_e_stop_input_and_no_stop() {
    let mut trace = Trace::active();
    trace.oracle.e_stop_input(trace.now, true);
    trace.wait(371);
    trace.breaks(Check::StopLate);
}

#[test]
fn a_poll_that_goes_before_a_stop() {
    let mut trace = Trace::active();
    trace.stop();
    trace.hand(READ_SPEED);
    trace.breaks(Check::StopNotFirst);
}

#[test]
fn a_stop_that_is_confirmed_though_it_was_sent_once() {
    let mut trace = Trace::active();
    trace.stop();
    trace.exchange(STOP, STOP);
    trace.exchange(READ_SPEED, STILL);
    trace.exchange(READ_SPEED, STILL);
    trace.state(1);
    trace.breaks(Check::StopOnce);
}

#[test]
fn a_tripped_axis_whose_stop_is_not_repeated() {
    let mut trace = Trace::active();
    trace.event(0x8001, &[0, 3, 1]);
    trace.exchange(STOP, STOP);
    trace.exchange(STOP, STOP);
    trace.wait(900_000);
    trace.breaks_nothing();
    trace.wait(100_000);
    trace.breaks(Check::StopForgotten);
}

#[test]
fn an_old_echo_and_one_reading_are_no_confirmation() {
    let mut trace = Trace::active();
    trace.send(STOP);
    trace.stop();
    trace.reply(STOP); // of the stop before
    trace.send(STOP);
    trace.send(STOP);
    trace.exchange(READ_SPEED, STILL);
    trace.exchange(READ_SPEED, STILL);
    trace.state(1);
    trace.breaks(Check::ConfirmedUnproved);
}

#[test]
fn one_reading_of_standstill_is_too_little() {
    let mut trace = Trace::active();
    trace.stop();
    trace.exchange(STOP, STOP);
    trace.exchange(STOP, STOP);
    trace.exchange(READ_SPEED, STILL);
    trace.state(1);
    trace.breaks(Check::ConfirmedUnproved);
}

#[test]
fn an_axis_that_is_to_hold_is_let_go() {
    let mut trace = Trace::active();
    trace.stop();
    trace.hand(OFF);
    trace.breaks(Check::WrongStopAction);
    let mut trace = Trace::new(COAST);
    trace.arm(0);
    trace.stop();
    trace.hand(OFF);
    trace.breaks_nothing();
}

#[test]
fn a_trip_that_ends_by_itself() {
    let mut trace = Trace::active();
    trace.event(0x8001, &[0, 3, 1]);
    trace.exchange(STOP, STOP);
    trace.exchange(STOP, STOP);
    trace.state(1);
    trace.breaks(Check::TripForgotten);
}

#[test]
fn an_axis_that_is_armed_unasked() {
    let mut trace = Trace::new(HOLD);
    trace.state(3);
    trace.breaks(Check::ArmedUnasked);
}

#[test]
fn arming_while_the_e_stop_is_latched() {
    let mut trace = Trace::new(COAST);
    trace.done(1, 0x33, &[]);
    trace.state(5);
    trace.exchange(OFF, OFF);
    trace.exchange(OFF, OFF);
    trace.state(1);
    trace.arm(0);
    trace.breaks(Check::EStopIgnored);
}

#[test]
fn the_epoch_of_an_earlier_arming() {
    let mut trace = Trace::armed();
    trace.setpoint(EPOCH - 1, 50_000);
    trace.breaks(Check::EpochIgnored);
}

#[test]
fn a_setpoint_that_expires_later_than_the_axis_allows() {
    let mut trace = Trace::armed();
    trace.setpoint(EPOCH, 100_001);
    trace.breaks(Check::ExpiryIgnored);
}

#[test]
fn a_link_that_is_not_in_command_is_obeyed() {
    let mut trace = Trace::armed();
    trace.done(1, 0x50, &[0]);
    assert_eq!(trace.oracle.violations()[0].check, Check::AuthorityIgnored);
}

#[test]
fn a_second_result() {
    let mut trace = Trace::new(HOLD);
    let sequence = trace.done(0, 0x03, &[]);
    trace.answer(0, sequence, 2, 0x03, DONE);
    trace.breaks(Check::ResultUnasked);
}

#[test]
fn a_request_without_a_result() {
    let mut trace = Trace::new(HOLD);
    trace.ask(0, 0x41, &[0]);
    for _ in 0..5 {
        trace.wait(1_000_000);
    }
    trace.breaks(Check::ResultMissing);
}

#[test]
fn a_repeated_request_that_gets_other_bytes() {
    let mut trace = Trace::new(HOLD);
    let sequence = trace.ask(0, 0x02, &[]);
    trace.answer(0, sequence, 2, 0x02, &[1]);
    trace.oracle.to_gateway(trace.now, 0, &frame(1, sequence, 0x02, &[]));
    trace.answer(0, sequence, 2, 0x02, &[1]);
    trace.breaks_nothing();
    trace.oracle.to_gateway(trace.now, 0, &frame(1, sequence, 0x02, &[]));
    trace.answer(0, sequence, 2, 0x02, &[2]);
    trace.breaks(Check::ResultChanged);
}

#[test]
fn a_raw_frame_on_a_bus_that_is_not_open() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.handed(trace.now, 0, 0, Frame::Can(0x700, &[1, 2]));
    trace.breaks(Check::RawUnopened);
}

#[test]
fn a_change_of_the_motor_while_its_axis_is_armed() {
    let mut trace = Trace::active();
    trace.hand(SET_ZERO);
    trace.breaks(Check::ChangedWhileArmed);
}

#[test]
fn a_setpoint_that_was_refused_moves_nothing() {
    let mut trace = Trace::armed();
    let body = trace.moves(EPOCH, 50_000, &[2, 0, 0, 0x80, 0x3F]);
    let sequence = trace.ask(0, 0x40, &body);
    trace.answer(0, sequence, 3, ERROR_NOT_ARMED, &[0, 1]);
    trace.send(VELOCITY);
    trace.breaks(Check::MotionExpired);
}
