//! What hosts are granted and told.

use super::*;

#[test]
pub fn an_axis_that_is_armed_unasked() {
    let mut trace = Trace::new(HOLD);
    trace.state(2);
    trace.asks_to_arm();
    trace.state(3);
    trace.breaks(Check::ArmedUnasked);
}

#[test]
pub fn arming_while_the_e_stop_is_latched() {
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
pub fn the_epoch_of_an_earlier_arming() {
    let mut trace = Trace::armed();
    trace.setpoint(EPOCH - 1, 50_000);
    trace.breaks(Check::EpochIgnored);
}

#[test]
pub fn a_setpoint_that_expires_later_than_the_axis_allows() {
    let mut trace = Trace::armed();
    trace.setpoint(EPOCH, 100_001);
    trace.breaks(Check::ExpiryIgnored);
}

#[test]
pub fn a_link_that_is_not_in_command_is_obeyed() {
    let mut trace = Trace::armed();
    trace.done(1, 0x50, &[0, 0]);
    assert_eq!(trace.oracle.violations()[0].check, Check::AuthorityIgnored);
}

/// A request of a watcher, and what it is answered.
fn watched(trace: &mut Trace, number: u16, body: &[u8], kind: u8, answer: u16) {
    trace.now += 10;
    trace.sequence += 1;
    let (now, sequence) = (trace.now, trace.sequence);
    trace.oracle.to_gateway(now, 0, &frame(5, sequence, number, body));
    trace.answer(0, sequence, kind, answer, DONE);
}

#[test]
pub fn a_watcher_that_is_obeyed_on_the_link_in_command() {
    let mut trace = Trace::armed();
    watched(&mut trace, 0x50, &[0, 0], 2, 0x50);
    assert_eq!(trace.oracle.violations()[0].check, Check::AuthorityIgnored);
    let mut trace = Trace::armed();
    watched(&mut trace, 0x50, &[0, 0], 3, 4);
    trace.breaks_nothing();
}

#[test]
pub fn a_watcher_that_keeps_a_silent_host_in_command() {
    let mut trace = Trace::active();
    for _ in 0..40 {
        watched(&mut trace, 0x02, &[], 2, 0x02);
        trace.wait(10_000);
    }
    assert!(trace.oracle.violations().iter().any(|broken| broken.check == Check::StopLate));
}

#[test]
pub fn a_second_result() {
    let mut trace = Trace::new(HOLD);
    let sequence = trace.done(0, 0x03, &[]);
    trace.answer(0, sequence, 2, 0x03, DONE);
    trace.breaks(Check::ResultUnasked);
}

#[test]
pub fn half_a_frame_and_an_event_that_is_lost() {
    let latched = |lost| frame(4, 0, 0x8005, &[lost, 0]);
    for said in [&latched(0)[..5], &latched(1)] {
        let mut trace = Trace::new(HOLD);
        trace.oracle.from_gateway(trace.now, 2, said);
        trace.breaks(Check::ToldInPart);
    }
}

#[test]
pub fn a_request_without_a_result() {
    let mut trace = Trace::new(HOLD);
    trace.ask(0, 0x41, &[0]);
    for _ in 0..5 {
        trace.wait(1_000_000);
    }
    trace.breaks(Check::ResultMissing);
}

#[test]
fn a_sequence_that_is_used_twice_leaves_both_their_results() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.to_gateway(trace.now, 0, &frame(1, 500, 0x41, &[0]));
    trace.settle();
    trace.now += 10;
    let unreadable = frame(1, 500, 0x53, &[1, 2, 3]);
    for _ in 0..2 {
        trace.oracle.to_gateway(trace.now, 0, &unreadable);
        trace.answer(0, 500, 3, 2, &[0x53]);
        trace.now += 10;
    }
    for _ in 0..40 {
        trace.done(0, 0x03, &[]);
    }
    trace.answer(0, 500, 2, 0x41, &[0]);
    trace.breaks_nothing();
}

#[test]
pub fn a_repeated_request_that_gets_other_bytes() {
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
