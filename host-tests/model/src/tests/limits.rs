//! Measured values beyond a limit, and no stop.

use super::*;

const VELOCITY_LIMIT: u8 = 14;
const CURRENT_LIMIT: u8 = 15;
const POSITION_MIN: u8 = 16;
const POSITION_MAX: u8 = 17;
const TEMPERATURE_LIMIT: u8 = 19;
const READ_POSITION: &[u8] = &[0x92, 0, 0, 0, 0, 0, 0, 0];

/// An axis that moves, with this limit; `turned` around.
fn limited(parameter: u8, limit: f32, turned: bool) -> Trace {
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x20, &[[0, parameter, 3].as_slice(), &limit.to_le_bytes()].concat());
    if turned {
        trace.done(0, 0x20, &[0, 4, 2, 1]);
    }
    trace.arm(0);
    trace.setpoint(EPOCH, 50_000);
    trace
}

#[track_caller]
fn trips(mut trace: Trace, request: &[u8], reply: &[u8]) {
    trace.exchange(request, reply);
    trace.wait(371);
    trace.breaks(Check::StopLate);
}

#[track_caller]
fn does_not(mut trace: Trace, request: &[u8], reply: &[u8]) {
    trace.exchange(request, reply);
    trace.wait(371);
    trace.breaks_nothing();
}

#[test]
fn a_speed_beyond_its_limit_and_the_margin() {
    // 3 rad/s and a tenth are 189.08 degrees a second.
    trips(limited(VELOCITY_LIMIT, 3.0, false), READ_SPEED, &[0x9C, 30, 0, 0, 190, 0, 0, 0]);
    trips(limited(VELOCITY_LIMIT, 3.0, false), READ_SPEED, &[0x9C, 30, 0, 0, 0x42, 0xFF, 0, 0]);
    trips(limited(VELOCITY_LIMIT, 3.0, false), VELOCITY, &[0xA2, 30, 0, 0, 190, 0, 0, 0]);
    does_not(limited(VELOCITY_LIMIT, 3.0, false), READ_SPEED, &[0x9C, 30, 0, 0, 189, 0, 0, 0]);
}

#[test]
fn a_motion_that_is_thrown_back_is_no_reading() {
    let fast: &[u8] = &[0xA2, 0, 0, 0, 0x10, 0x27, 0, 0];
    does_not(limited(VELOCITY_LIMIT, 3.0, false), VELOCITY, fast);
}

#[test]
fn a_current_beyond_its_limit() {
    trips(limited(CURRENT_LIMIT, 5.0, false), READ_SPEED, &[0x9C, 30, 0x27, 2, 0, 0, 0, 0]); // 5.51 A
    does_not(limited(CURRENT_LIMIT, 5.0, false), READ_SPEED, &[0x9C, 30, 0x25, 2, 0, 0, 0, 0]);
}

#[test]
fn a_position_beyond_its_limits_in_the_sense_of_the_axis() {
    // 2 rad and a tenth are 126.05 degrees.
    let (beyond, minus_beyond): (&[u8], &[u8]) =
        (&[0x92, 0, 0, 0, 0x48, 0x31, 0, 0], &[0x92, 0, 0, 0, 0xB8, 0xCE, 0xFF, 0xFF]);
    trips(limited(POSITION_MAX, 2.0, false), READ_POSITION, beyond);
    trips(limited(POSITION_MIN, -2.0, false), READ_POSITION, minus_beyond);
    trips(limited(POSITION_MAX, 2.0, true), READ_POSITION, minus_beyond);
    does_not(limited(POSITION_MAX, 2.0, true), READ_POSITION, beyond);
    does_not(limited(POSITION_MAX, 2.0, false), READ_POSITION, &[0x92, 0, 0, 0, 0x30, 0x31, 0, 0]);
}

#[test]
fn a_temperature_above_its_limit() {
    trips(limited(TEMPERATURE_LIMIT, 60.0, false), READ_FAULTS, &[0x9A, 61, 0, 1, 0xE5, 1, 0, 0]);
    does_not(
        limited(TEMPERATURE_LIMIT, 60.0, false),
        READ_FAULTS,
        &[0x9A, 60, 0, 1, 0xE5, 1, 0, 0],
    );
}
