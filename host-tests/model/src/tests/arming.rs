//! Axes that are armed though their motors were not asked, or did not answer well.

use super::*;

type Exchange = (&'static [u8], &'static [u8]);

const ASKED: [Exchange; 4] =
    [(STOP, STOP), (STOP, STOP), (READ_SPEED, STILL), (READ_FAULTS, FAULTLESS)];
/// 10 degrees a second; 0.1 rad/s are 5.7.
const TURNS: &[u8] = &[0x9C, 30, 0, 0, 10, 0, 0, 0];
const FAULT: &[u8] = &[0x9A, 30, 0, 1, 0xE5, 1, 4, 0];

fn armed_after(mut trace: Trace, exchanges: &[Exchange]) -> Trace {
    let sequence = trace.begin_to_arm(0);
    exchanges.iter().for_each(|(request, reply)| trace.exchange(request, reply));
    trace.is_armed(0, sequence);
    trace
}

#[test]
fn a_motor_that_was_asked_everything_and_answers_well() {
    armed_after(Trace::new(HOLD), &ASKED).breaks_nothing();
}

#[test]
pub fn each_question_left_out() {
    for left_out in 0..ASKED.len() {
        let mut asked = ASKED.to_vec();
        asked.remove(left_out);
        armed_after(Trace::new(HOLD), &asked).breaks(Check::ArmedUnproved);
    }
}

#[test]
fn a_motor_that_turns_or_has_a_fault() {
    let [first, second, speed, faults] = ASKED;
    armed_after(Trace::new(HOLD), &[first, second, (READ_SPEED, TURNS), faults])
        .breaks(Check::ArmedUnproved);
    armed_after(Trace::new(HOLD), &[first, second, speed, (READ_FAULTS, FAULT)])
        .breaks(Check::ArmedUnproved);
}

#[test]
fn standstill_that_was_read_before_the_stop() {
    let [first, second, speed, faults] = ASKED;
    armed_after(Trace::new(HOLD), &[first, speed, second, faults]).breaks(Check::ArmedUnproved);
}

#[test]
fn a_stop_that_was_not_answered() {
    let mut trace = Trace::new(HOLD);
    let sequence = trace.begin_to_arm(0);
    trace.send(STOP);
    ASKED[1..].iter().for_each(|(request, reply)| trace.exchange(request, reply));
    trace.is_armed(0, sequence);
    trace.breaks(Check::ArmedUnproved);
}

#[test]
fn a_motor_whose_timeout_nobody_knows() {
    let mut trace = Trace::new(HOLD);
    trace.allow_unknown_timeout(0);
    armed_after(trace, &ASKED).breaks(Check::ArmedUnproved);
    let mut trace = Trace::new(HOLD);
    trace.allow_unknown_timeout(0);
    let timeout: &[u8] = &[0xB3, 0, 0, 0, 0xF4, 1, 0, 0];
    trace.exchange(timeout, timeout);
    armed_after(trace, &ASKED).breaks_nothing();
    let mut trace = Trace::new(HOLD);
    trace.allow_unknown_timeout(0);
    trace.exchange(timeout, timeout);
    trace.send(&[0xB4, 0, 0, 0, 0, 0, 0, 1]);
    armed_after(trace, &ASKED).breaks(Check::ArmedUnproved);
}

/// Byte 3 of 0x9A is 0 (§2.12).
const LOCKED: &[u8] = &[0x9A, 30, 0, 0, 0xE5, 1, 0, 0];

#[test]
fn a_motor_whose_brake_is_locked() {
    let [first, second, speed, faults] = ASKED;
    let locked = [first, second, speed, (READ_FAULTS, LOCKED)];
    armed_after(Trace::new(HOLD), &locked).breaks_nothing();
    armed_after(Trace::new(BRAKE), &locked).breaks(Check::ArmedUnproved);
    armed_after(Trace::new(BRAKE), &[first, second, speed, faults]).breaks_nothing();
}

/// The answers of motors of V3.6, and of V4.4 (docs/rmd-dialects.md).
const OLD: [Exchange; 3] = [
    (&[0x30, 1, 0, 0, 0, 0, 0, 0], &[0x30, 0, 0x55, 0x19, 0x55, 0x19, 0x55, 0x19]),
    (&[0xB5, 1, 1, 0, 0, 0, 0, 0], b"\xB5X8S2V10"),
    (&[0x42, 3, 0, 0, 0, 0, 0, 0], &[0x42, 0, 0, 0, 0x10, 0x27, 0, 0]),
];
const NEW: [Exchange; 3] = [
    (&[0x30, 1, 0, 0, 0, 0, 0, 0], &[0x30, 1, 0, 0, 0, 0, 0, 0x3F]),
    (&[0xB5, 1, 1, 0, 0, 0, 0, 0], b"\xB5\x01\x01RMD-X"),
    (&[0x42, 3, 0, 0, 0, 0, 0, 0], &[0x42, 3, 0, 0, 0x10, 0x27, 0, 0]),
];

#[test]
fn a_motor_that_contradicts_the_dialect_of_its_axis() {
    let [first, second, speed, faults] = ASKED;
    let states = |dialect: u8| {
        let mut trace = Trace::new(HOLD);
        trace.done(0, 0x20, &[0, 46, 1, dialect]);
        trace
    };
    let around = |reads: &[Exchange]| [&[first, second], reads, &[speed, faults]].concat();
    for read in 0..3 {
        let (old, new) = (OLD[read], NEW[read]);
        // V3.6 is also the default.
        armed_after(Trace::new(HOLD), &around(&[old, old])).breaks_nothing();
        armed_after(Trace::new(HOLD), &around(&[new, new])).breaks(Check::ArmedUnproved);
        armed_after(Trace::new(HOLD), &around(&[new])).breaks_nothing();
        armed_after(states(6), &around(&[old, old])).breaks(Check::ArmedUnproved);
        armed_after(states(6), &around(&[new, new])).breaks_nothing();
        // Answered in two ways it is none, and unknown is never wrong.
        armed_after(states(6), &around(&[new, old])).breaks(Check::ArmedUnproved);
        armed_after(states(0), &around(&[new, old])).breaks_nothing();
    }
}

#[test]
fn arming_that_frees_a_brake_unasked() {
    let mut trace = Trace::new(HOLD);
    trace.begin_to_arm(0);
    trace.hand(&[0x77, 0, 0, 0, 0, 0, 0, 0]);
    trace.breaks(Check::ChangedWhileArmed);
}

/// Axis 0 is a thruster with id 14.
fn thruster() -> Trace {
    let mut trace = Trace::new(COAST);
    trace.done(0, 0x20, &[0, 2, 1, 2]);
    trace.done(0, 0x20, &[0, 3, 1, 14]);
    trace.address = (0x30E, 0x28E);
    trace
}

/// The result of the provisioning was for a session that is over.
#[test]
fn a_thruster_is_told_again_a_timeout_whose_provisioning_nobody_saw_end() {
    for (ms, is_broken) in [(200_u8, false), (201, true)] {
        let mut trace = thruster();
        trace.ask(0, 0x24, &[0, 0xC8, 1]);
        trace.ask(0, 0x01, &[1, 0, 1]);
        trace.begin_to_arm(0);
        trace.hand(&[b'S', b'T', 0, 0, 0, 0, 0, ms]);
        let broken: Vec<Check> =
            trace.oracle.violations().iter().map(|violation| violation.check).collect();
        assert_eq!(broken, if is_broken { vec![Check::ChangedWhileArmed] } else { vec![] });
    }
}

#[test]
fn a_thruster_each_of_whose_questions_is_left_out() {
    let faults: Exchange = (b"EF\0\0", &[0x45, 0x46, 0, 0, 0, 0, 0, 0]);
    let record: Exchange = (b"FR\0\0", &[0x46, 0x52, 0, 0, 0, 0, 0, 2]);
    let stop: Exchange = (&[0x54, 0x43, 0, 0, 0, 0, 0, 0], &[0x54, 0x43, 0, 0, 0, 0, 0, 0]);
    let speed: Exchange = (b"QV\0\0", &[0x51, 0x56, 0, 0, 0, 0, 0, 0]);
    armed_after(thruster(), &[faults, record, stop, faults, speed]).breaks_nothing();
    let warns: Exchange = (b"EF\0\0", &[0x45, 0x46, 0, 0, 0, 0, 0x30, 0x18]);
    let fault: Exchange = (b"EF\0\0", &[0x45, 0x46, 0, 0, 0, 0, 0x10, 0x40]);
    armed_after(thruster(), &[warns, record, stop, warns, speed]).breaks_nothing();
    armed_after(thruster(), &[fault, record, stop, fault, speed]).breaks(Check::ArmedUnproved);
    for left_out in [
        &[record, stop, speed][..],
        &[faults, stop, faults, speed],
        &[faults, record, faults, speed],
    ] {
        armed_after(thruster(), left_out).breaks(Check::ArmedUnproved);
    }
    armed_after(thruster(), &[faults, record, stop, speed]).breaks(Check::ArmedUnproved);
    armed_after(thruster(), &[faults, record, stop, faults]).breaks(Check::ArmedUnproved);
}

/// Axis 0 is a D5 motor with id 11.
fn d5() -> Trace {
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x20, &[0, 2, 1, 3]);
    trace.done(0, 0x20, &[0, 3, 1, 11]);
    trace.allow_unknown_timeout(0);
    trace.address = (0x00B, 0x00B);
    trace
}

const D5_ASKED: [Exchange; 7] = [
    (&[0xD5, 11, 4, 2, 0x10, 0, 0, 0x21], &[0x5D, 11, 4, 2, 0x10, 2, 0, 0x23]),
    (&[0xD5, 11, 4, 2, 0x11, 0, 0, 0x22], &[0x5D, 11, 4, 2, 0x11, 1, 0, 0x23]),
    (&[0xD5, 11, 4, 2, 0x12, 0, 0, 0x23], &[0x5D, 11, 4, 2, 0x12, 0, 0, 0x23]),
    (&[0xD5, 11, 4, 2, 0x2C, 0, 0, 0x3D], &[0x5D, 11, 4, 2, 0x2C, 0, 0, 0x3D]),
    (&[0xD5, 11, 5, 3, 0x20, 0, 0, 0x33], &[0x5D, 11, 5, 3, 0x20, 0, 0, 0x33]),
    (&[0xD5, 11, 4, 2, 0x2B, 0, 0, 0x3C], &[0x5D, 11, 4, 2, 0x2B, 0, 0, 0x3C]),
    (&[0xD5, 11, 5, 2, 0x26, 0, 0, 0x38], &[0x5D, 11, 5, 2, 0x26, 0, 0, 0x38]),
];

#[test]
fn a_d5_motor_each_of_whose_questions_is_left_out() {
    armed_after(d5(), &D5_ASKED).breaks_nothing();
    for left_out in 0..D5_ASKED.len() {
        let mut asked = D5_ASKED.to_vec();
        asked.remove(left_out);
        armed_after(d5(), &asked).breaks(Check::ArmedUnproved);
    }
}

#[test]
fn a_d5_motor_whose_timeout_is_off_or_brake_on_or_in_which_a_speed_waits() {
    let mut asked = D5_ASKED;
    asked[1].1 = &[0x5D, 11, 4, 2, 0x11, 0, 0, 0x22];
    armed_after(d5(), &asked).breaks(Check::ArmedUnproved);
    let mut asked = D5_ASKED;
    asked[5].1 = &[0x5D, 11, 4, 2, 0x2B, 1, 0, 0x3D];
    armed_after(d5(), &asked).breaks(Check::ArmedUnproved);
    let mut asked = D5_ASKED.to_vec();
    asked[3].1 = &[0x5D, 11, 4, 2, 0x2C, 1, 0, 0x3E];
    armed_after(d5(), &asked).breaks(Check::ArmedUnproved);
    asked.insert(5, (&[0xD5, 11, 5, 4, 0x20, 0, 0, 0x34], &[0x5D, 11, 5, 4, 0x20, 0, 0, 0x34]));
    armed_after(d5(), &asked).breaks_nothing();
}
