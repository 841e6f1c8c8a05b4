//! Stops that are missing, late, or confirmed too early.

use super::*;

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
