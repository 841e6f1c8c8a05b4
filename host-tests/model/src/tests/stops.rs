//! Stops that are missing, late, or confirmed too early.

use super::*;

#[test]
pub fn a_stop_that_comes_late() {
    let mut trace = Trace::active();
    trace.send(VELOCITY);
    trace.stop();
    trace.wait(371); // g and two frames are 370 µs
    trace.breaks(Check::StopLate);
}

#[test]
fn the_silence_of_the_host_and_no_stop() {
    let mut trace = Trace::armed();
    for _ in 0..2 {
        trace.exchange(READ_FAULTS, FAULTLESS);
        trace.now += 120_000;
    }
    trace.exchange(READ_FAULTS, FAULTLESS);
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
    trace.event(0x8001, &[0, 6]);
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
        trace.send(READ_FAULTS);
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
pub fn a_poll_that_goes_before_a_stop() {
    let mut trace = Trace::active();
    trace.stop();
    trace.hand(READ_SPEED);
    trace.breaks(Check::StopNotFirst);
}

#[test]
pub fn a_stop_that_is_confirmed_though_it_was_sent_once() {
    let mut trace = Trace::active();
    trace.stop();
    trace.exchange(STOP, STOP);
    trace.exchange(READ_SPEED, STILL);
    trace.exchange(READ_SPEED, STILL);
    trace.state(1);
    trace.breaks(Check::StopOnce);
}

#[test]
pub fn a_tripped_axis_whose_stop_is_not_repeated() {
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
pub fn one_reading_of_standstill_is_too_little() {
    let mut trace = Trace::active();
    trace.stop();
    trace.exchange(STOP, STOP);
    trace.exchange(STOP, STOP);
    trace.exchange(READ_SPEED, STILL);
    trace.state(1);
    trace.breaks(Check::ConfirmedUnproved);
}

/// Frames of others with a lower id excuse that it is late.
fn kept_from_the_bus(trace: &mut Trace, for_us: u64) {
    if trace.oracle.buses[0].held.is_empty() {
        trace.hand(STOP);
    }
    for _ in 0..for_us / 135 {
        trace.now += 135;
        trace.oracle.received(trace.now, 0, Frame::Can(0x001, STOP));
        trace.settle();
    }
}

#[test]
pub fn a_stop_that_cannot_leave_and_nobody_is_told() {
    let mut trace = Trace::active();
    trace.stop();
    // The bound, 100 ms, and what the check allows.
    kept_from_the_bus(&mut trace, 117_000);
    trace.breaks_nothing();
    kept_from_the_bus(&mut trace, 1_000);
    trace.breaks(Check::UnsentUntold);
}

#[test]
fn a_stop_that_cannot_leave_and_is_told() {
    let mut trace = Trace::active();
    trace.stop();
    kept_from_the_bus(&mut trace, 101_000);
    trace.event(0x800A, &[0, 0]);
    kept_from_the_bus(&mut trace, 30_000);
    trace.breaks_nothing();
    // At rest it waits.
    let mut trace = Trace::new(HOLD);
    trace.stop();
    kept_from_the_bus(&mut trace, 130_000);
    trace.breaks_nothing();
}

#[test]
fn a_stop_that_is_counted_as_sent_and_has_not_left() {
    let mut trace = Trace::active();
    trace.stop();
    kept_from_the_bus(&mut trace, 101_000);
    trace.event(0x800A, &[0, 1]);
    trace.breaks(Check::UnsentUntold);
    let mut trace = Trace::active();
    trace.stop();
    trace.exchange(STOP, STOP);
    trace.event(0x800A, &[0, 0]);
    trace.breaks(Check::UnsentUntold);
}

#[test]
pub fn an_axis_that_is_to_hold_is_let_go() {
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
pub fn a_trip_that_ends_by_itself() {
    let mut trace = Trace::active();
    trace.event(0x8001, &[0, 3, 1]);
    trace.exchange(STOP, STOP);
    trace.exchange(STOP, STOP);
    trace.state(1);
    trace.breaks(Check::TripForgotten);
}

#[test]
fn no_stop_after_an_e_stop_behind_a_clearing_whose_result_is_read_late() {
    let mut trace = Trace::active();
    trace.event(0x8001, &[0, 3, 1]);
    trace.exchange(STOP, STOP);
    trace.event(0x800A, &[0, 1]);
    let sequence = trace.ask(0, 0x35, &[0]);
    trace.state(1);
    trace.done(1, 0x33, &[]);
    trace.answer(0, sequence, 2, 0x35, DONE);
    trace.wait(371);
    trace.breaks(Check::StopLate);
}
