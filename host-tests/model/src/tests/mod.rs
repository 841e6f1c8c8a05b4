//! Each promise, broken once on purpose: traces written by hand, with literal bytes.
//!
//! The gateway has an RMD motor, node 1, on CAN bus 0 at 1 Mbit/s, as axis 0 with stop action hold.
//! Host 0 commands, host 1 is another, host 2 listens.

mod arming;
mod counts;
mod history;
mod hosts;
mod limits;
mod motion;
mod others;
mod planted;
mod returned;
mod starts;
mod stops;
mod stored;
mod together;

use super::*;
use std::cell::RefCell;

thread_local! {
    /// What was broken in this thread.
    pub static BROKEN: RefCell<Vec<Check>> = const { RefCell::new(Vec::new()) };
}

const HOLD: u8 = 2;
const COAST: u8 = 1;
const BRAKE: u8 = 3;
const VELOCITY: &[u8] = &[0xA2, 0, 0, 0, 0x10, 0x27, 0, 0];
const OTHER_VELOCITY: &[u8] = &[0xA2, 0, 0, 0, 0x20, 0x27, 0, 0];
const DISTANCE: &[u8] = &[0xA8, 0, 0xF4, 1, 0xA0, 0x8C, 0, 0];
const STOP: &[u8] = &[0x81, 0, 0, 0, 0, 0, 0, 0];
const OFF: &[u8] = &[0x80, 0, 0, 0, 0, 0, 0, 0];
const READ_SPEED: &[u8] = &[0x9C, 0, 0, 0, 0, 0, 0, 0];
const STILL: &[u8] = &[0x9C, 30, 0, 0, 0, 0, 0, 0];
const READ_FAULTS: &[u8] = &[0x9A, 0, 0, 0, 0, 0, 0, 0];
const FAULTLESS: &[u8] = &[0x9A, 30, 0, 1, 0xE5, 1, 0, 0];
const SET_ZERO: &[u8] = &[0x64, 0, 0, 0, 0, 0, 0, 0];
const EPOCH: u8 = 7;
/// Done has no fields.
const DONE: &[u8] = &[];
const ERROR_NOT_ARMED: u16 = 12;
const ERROR_TRIPPED: u16 = 13;

struct Trace {
    oracle: Oracle,
    now: u64,
    sequence: u16,
    action: u8,
    /// Id of requests to the motor, and of its replies.
    address: (u32, u32),
}

impl Trace {
    fn new(action: u8) -> Self {
        let mut trace = Self {
            oracle: Oracle::new(&[BusKind::Can], 3, 2, 4),
            now: 1_000,
            sequence: 0,
            action,
            address: (0x141, 0x241),
        };
        // 1 000 000 bit/s, RMD, not exclusive, 3000 µs
        trace.done(0, 0x11, &[0, 0xC0, 0x84, 0x3D, 1, 0, 0xB8, 0x17]);
        // bus 0, protocol 1, node 1, the stop action
        for (parameter, value) in [(1, 0), (2, 1), (3, 1), (5, action)] {
            trace.done(0, 0x20, &[0, parameter, 1, value]);
        }
        trace.allow_unknown_timeout(1);
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

    fn allow_unknown_timeout(&mut self, allowed: u8) {
        self.done(0, 0x20, &[0, 21, 0, allowed]);
    }

    fn arm(&mut self, link: u8) {
        let sequence = self.begin_to_arm(link);
        self.asks_to_arm();
        self.is_armed(link, sequence);
    }

    /// What an RMD motor is asked before motion is allowed.
    fn asks_to_arm(&mut self) {
        let stop = if self.action == COAST { OFF } else { STOP };
        for (request, reply) in
            [(stop, stop), (stop, stop), (READ_SPEED, STILL), (READ_FAULTS, FAULTLESS)]
        {
            self.exchange(request, reply);
        }
    }

    fn begin_to_arm(&mut self, link: u8) -> u16 {
        let sequence = self.ask(link, 0x30, &[0]);
        self.state(2);
        sequence
    }

    fn is_armed(&mut self, link: u8, sequence: u16) {
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
        self.oracle.handed(self.now, 0, 0, Frame::Can(self.address.0, data));
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
        self.oracle.received(self.now, 0, Frame::Can(self.address.1, data));
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
        let broken: Vec<Check> =
            self.oracle.violations().iter().map(|violation| violation.check).collect();
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
