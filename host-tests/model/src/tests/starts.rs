//! What a reset must leave, and a loss of power must not.

use super::*;

const LIST: u16 = 0x22;
const STATUS: u16 = 0x13;
/// Axis 0 on bus 0, protocol 1, node 1; its state follows, and that nothing is missing.
const LISTED: &[u8] = &[1, 0, 1, 0, 1, 1, 1, 1];

impl Trace {
    pub(super) fn reset(&mut self, interrupted: bool) {
        self.now += 1_000;
        self.oracle.reset(self.now, interrupted);
    }

    /// The first list after a start says so of axis 0.
    pub(super) fn listed(&mut self, state: &[u8]) {
        let sequence = self.ask(2, LIST, &[0]);
        self.answer(2, sequence, 2, LIST, &[LISTED, state, &[0, 0]].concat());
    }

    pub(super) fn status(&mut self, starts: u8, e_stopped: u8) {
        let sequence = self.ask(2, STATUS, &[]);
        self.answer(2, sequence, 2, STATUS, &[0, starts, 0, e_stopped, 1, 0, 1, 1]);
    }
}

#[test]
fn a_reset_in_motion_that_is_stopped_and_told_breaks_nothing() {
    let mut trace = Trace::active();
    trace.send(VELOCITY);
    trace.reset(false);
    trace.exchange(STOP, STOP);
    trace.status(2, 0);
    trace.listed(&[6, 0]);
    trace.exchange(STOP, STOP);
    trace.exchange(READ_SPEED, STILL);
    trace.exchange(READ_SPEED, STILL);
    trace.event(0x8003, &[0, 6, 1]);
    trace.breaks_nothing();
}

#[test]
fn a_reset_after_which_what_moved_is_idle() {
    let mut trace = Trace::active();
    trace.reset(false);
    trace.send(STOP);
    trace.listed(&[5]);
    trace.breaks(Check::ResetForgot);
}

#[test]
fn a_reset_after_which_an_axis_is_armed() {
    let mut trace = Trace::armed();
    trace.reset(false);
    trace.send(STOP);
    trace.listed(&[3]);
    trace.breaks(Check::ResetForgot);
}

#[test]
pub fn a_reset_that_loses_an_axis() {
    let mut trace = Trace::new(HOLD);
    trace.reset(false);
    trace.send(STOP);
    let sequence = trace.ask(2, LIST, &[0]);
    trace.answer(2, sequence, 2, LIST, &[0, 0]);
    trace.breaks(Check::ResetForgot);
}

#[test]
fn a_reset_that_forgets_the_e_stop() {
    let mut trace = Trace::new(HOLD);
    trace.done(1, 0x33, &[]);
    trace.exchange(STOP, STOP);
    trace.reset(false);
    trace.send(STOP);
    trace.status(2, 0);
    trace.breaks(Check::ResetForgot);
}

#[test]
fn a_start_that_is_not_counted() {
    let mut trace = Trace::new(HOLD);
    trace.reset(false);
    trace.send(STOP);
    trace.status(1, 0);
    trace.breaks(Check::ResetForgot);
}

#[test]
fn what_a_reset_interrupts_may_be_lost_and_nothing_else() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.to_gateway(trace.now, 0, &frame(1, 9, 0x33, &[]));
    trace.oracle.reset(trace.now, true);
    trace.send(STOP);
    trace.status(2, 0);
    trace.breaks_nothing();
    trace.done(0, 0x33, &[]);
    trace.reset(true);
    trace.send(STOP);
    trace.status(3, 0);
    trace.breaks(Check::ResetForgot);
}

#[test]
fn a_poll_before_the_stop_after_a_reset() {
    let mut trace = Trace::new(HOLD);
    trace.reset(false);
    trace.hand(READ_SPEED);
    trace.breaks(Check::StopNotFirst);
}

#[test]
fn no_stop_after_a_reset() {
    let mut trace = Trace::new(HOLD);
    trace.reset(false);
    trace.wait(371); // g and two frames are 370 µs
    trace.breaks(Check::StopLate);
}

#[test]
fn an_answer_to_what_was_asked_before_a_reset() {
    let mut trace = Trace::new(HOLD);
    let sequence = trace.ask(0, 0x03, &[]);
    trace.reset(false);
    trace.send(STOP);
    trace.answer(0, sequence, 2, 0x03, DONE);
    trace.breaks(Check::ResultUnasked);
}

#[test]
pub fn a_loss_of_power_after_which_an_axis_is_configured() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.power_lost(trace.now);
    trace.status(1, 0);
    trace.breaks_nothing();
    trace.listed(&[1]);
    trace.breaks(Check::PowerLossKept);
}
