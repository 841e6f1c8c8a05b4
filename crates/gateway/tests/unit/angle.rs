//! Where an angle that starts again puts a motor.

use super::*;

const FORM: AngleForm = AngleForm { step: 100, span: 6_553_600, acceleration_rad_s2: 0.0 };

fn placed(at: i32, angle: i32) -> Option<i32> {
    Angle { place: (Instant::from_micros(0), at), ..Angle::UNKNOWN }.placed(angle, FORM)
}

#[test]
fn an_angle_is_placed_next_to_where_the_motor_was() {
    for (at, angle, placed_at) in [
        (0, 9_000, 9_000),
        (0, -9_000, -9_000),
        // 32 700° and on to 32 800°, which 16 bits tell as −32 736°.
        (3_270_000, -3_273_600, 3_280_000),
        (3_280_000, 3_270_000, 3_270_000),
        (-3_270_000, 3_273_600, -3_280_000),
        // Ten times round.
        (65_536_000, 9_000, 65_545_000),
        (-65_536_000, 9_000, -65_527_000),
        (65_536_000, -9_000, 65_527_000),
    ] {
        let way = way(at, angle, FORM);
        assert!(way.abs() <= FORM.span / 2, "{at} {angle}: {way}");
        assert_eq!(placed(at, angle), Some(placed_at), "{at} {angle}");
    }
}

#[test]
fn what_is_finer_than_a_step_stays() {
    assert_eq!(placed(9_042, 9_000), Some(9_042));
    assert_eq!(placed(9_042, 9_100), Some(9_042));
    assert_eq!(placed(9_042, 9_200), Some(9_200));
    assert_eq!(placed(6_553_642, 0), Some(6_553_642));
}

#[test]
fn nothing_is_placed_beyond_what_the_motor_can_count() {
    // The way from the highest count to its own angle is short, to one 2° further it leads out.
    let own = i32::MAX % FORM.span - FORM.span;
    assert_eq!(placed(i32::MAX, own), Some(i32::MAX));
    assert_eq!(placed(i32::MAX, own + 200), None);
    assert_eq!(placed(i32::MIN, i32::MIN % FORM.span - 200), None);
}
