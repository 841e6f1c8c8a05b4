//! Motion that should not be on a bus.

use super::*;

#[test]
pub fn motion_of_an_axis_that_was_never_armed() {
    let mut trace = Trace::new(HOLD);
    trace.send(VELOCITY);
    trace.breaks(Check::MotionUnarmed);
}

#[test]
fn raw_motion_to_an_axis_that_is_not_armed() {
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x50, &[0, 0]);
    trace.done(0, 0x51, &[[0, 0, 0xC1, 0x02, 8].as_slice(), VELOCITY].concat());
    trace.send(VELOCITY);
    trace.breaks(Check::RawHarmful);
}

#[test]
pub fn a_refresh_after_the_expiry() {
    let mut trace = Trace::active();
    trace.send(VELOCITY);
    trace.now += 50_000;
    trace.send(VELOCITY);
    assert_eq!(trace.oracle.violations()[0].check, Check::MotionExpired);
}

#[test]
pub fn motion_after_a_stop() {
    let mut trace = Trace::active();
    trace.stop();
    trace.exchange(STOP, STOP);
    trace.hand(VELOCITY);
    trace.breaks(Check::MotionAfterStop);
}

#[test]
pub fn a_refresh_of_another_setpoint_than_the_newest() {
    let mut trace = Trace::active();
    trace.send(VELOCITY);
    trace.send(OTHER_VELOCITY);
    trace.breaks(Check::MotionStale);
}

#[test]
pub fn a_distance_that_is_sent_twice() {
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
pub fn motion_that_waits_in_the_controller_and_is_not_asked_back() {
    let mut trace = Trace::active();
    trace.hand(VELOCITY);
    trace.stop();
    trace.wait(101);
    trace.breaks(Check::MotionKept);
}

#[test]
pub fn broadcast_motion() {
    let mut trace = Trace::active();
    trace.oracle.handed(trace.now, 0, 0, Frame::Can(0x280, VELOCITY));
    trace.breaks(Check::Broadcast);
}

#[test]
pub fn a_raw_frame_on_a_bus_that_is_not_open() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.handed(trace.now, 0, 0, Frame::Can(0x700, &[1, 2]));
    trace.breaks(Check::RawUnopened);
}

#[test]
pub fn a_change_of_the_motor_while_its_axis_is_armed() {
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

#[test]
pub fn what_the_dialect_of_an_axis_lacks() {
    let rows: [(u8, &[u8], bool); 16] = [
        (1, &[0x32, 4, 0, 0, 0, 0, 0, 0x3F], true),
        (4, &[0x32, 4, 0, 0, 0, 0, 0, 0x3F], false),
        (4, &[0x32, 0, 0x55, 0x19, 0x55, 0x19, 0x55, 0x19], true),
        (3, &[0x32, 0, 0x55, 0x19, 0x55, 0x19, 0x55, 0x19], false),
        (0, &[0xB4, 0, 0, 0, 0, 0, 0, 1], true),
        (6, &[0xB4, 0, 0, 0, 0, 0, 0, 1], false),
        (6, &[0x43, 0, 0, 0, 0, 0, 0, 0], true),
        (6, &[0x20, 5, 0, 0, 2, 0, 0, 0], true),
        (5, &[0x20, 8, 0, 0, 1, 0, 0, 0], true),
        (6, &[0x20, 8, 0, 0, 1, 0, 0, 0], false),
        (1, &[0x94, 0, 0, 0, 0, 0, 0, 0], true),
        (2, &[0x94, 0, 0, 0, 0, 0, 0, 0], false),
        (4, &[0x71, 0, 0, 0, 0, 0, 0, 0], true),
        (6, &[0x90, 0, 0, 0, 0, 0, 0, 0], true),
        (0, &[0x30, 1, 0, 0, 0, 0, 0, 0], false),
        (6, &[0xC0, 0, 1, 1, 0, 0, 0, 0], true),
    ];
    for (dialect, data, lacks) in rows {
        let mut trace = Trace::new(COAST);
        trace.done(0, 0x20, &[0, 46, 1, dialect]);
        trace.hand(data);
        let violations = trace.oracle.violations();
        let found = violations.iter().any(|violation| violation.check == Check::NotInDialect);
        assert_eq!(found, lacks, "{dialect}: {data:02X?}");
    }
    for (dialect, data, lacks) in [
        (4, [0xA2, 50, 0, 0, 0x10, 0x27, 0, 0], true),
        (5, [0xA2, 50, 0, 0, 0x10, 0x27, 0, 0], false),
        (5, [0xA9, 0, 0xF4, 1, 0, 0, 0, 0], true),
        (2, [0xA5, 0, 0xF4, 1, 0, 0, 0, 0], true),
        (6, [0xA4, 0, 0, 0, 0, 0, 0, 0], true),
    ] {
        let mut trace = Trace::active();
        trace.done(0, 0x20, &[0, 46, 1, dialect]);
        trace.hand(&data);
        let violations = trace.oracle.violations();
        let found = violations.iter().any(|violation| violation.check == Check::NotInDialect);
        assert_eq!(found, lacks, "{dialect}: {data:02X?}");
    }
}
