//! Rounding, limits and the ends of the wire.

use super::*;

const UNLIMITED: (f32, f32) = (f32::NEG_INFINITY, f32::INFINITY);

#[test]
fn rounds_to_the_nearest_wire_unit() {
    assert_eq!(HUNDREDTHS.nearest(1.0), Some(100));
    assert_eq!(HUNDREDTHS.nearest(0.014_9), Some(1));
    assert_eq!(HUNDREDTHS.nearest(0.015_1), Some(2));
    assert_eq!(HUNDREDTHS.nearest(-0.05), Some(-5));
    assert_eq!(HUNDREDTHS.nearest(-0.004), Some(0));
    assert_eq!(CENTIDEGREES.nearest(core::f32::consts::PI), Some(18_000));
    assert_eq!(DEGREES.nearest(10.471_976), Some(600));
    assert_eq!(RPM.nearest(core::f32::consts::PI), Some(30));
    assert_eq!(DECIDEGREES.nearest(-core::f32::consts::FRAC_PI_2), Some(-900));
}

#[test]
fn what_the_wire_cannot_carry_is_refused_not_clamped() {
    assert_eq!(HUNDREDTHS.nearest(f32::NAN), None);
    assert_eq!(HUNDREDTHS.nearest(f32::INFINITY), None);
    assert_eq!(HUNDREDTHS.nearest(f32::NEG_INFINITY), None);
    assert_eq!(CENTIDEGREES.nearest(4.0e5), None); // 2.29e9 hundredths of a degree: beyond i32
    assert_eq!(CENTIDEGREES.nearest(-3.7e5), Some(-2_119_943_842));
}

#[test]
fn the_ends_of_the_wire_and_of_f32_are_exact() {
    assert_eq!(HUNDREDTHS.nearest(f32::MIN_POSITIVE / 2.0), Some(0));
    assert_eq!(HUNDREDTHS.nearest(f32::MAX), None);
    assert_eq!(HUNDREDTHS.nearest(-0.0), Some(0));
    assert_eq!(HUNDREDTHS.nearest(0.005), Some(0)); // the f32 lies below the tie
    assert_eq!(HUNDREDTHS.nearest(21_474_836.0), Some(2_147_483_600));
    assert_eq!(HUNDREDTHS.nearest(21_474_838.0), None);
    assert_eq!(HUNDREDTHS.nearest(-21_474_836.0), Some(-2_147_483_600));
    assert_eq!(Scale::new(1.0).nearest(0.5), Some(1)); // ties go away from zero
    assert_eq!(Scale::new(1.0).nearest(-0.5), Some(-1));
    assert_eq!(Scale::new(1.0).nearest(-2_147_483_648.0), Some(i32::MIN));
    assert_eq!(Scale::new(1.0).nearest(2_147_483_648.0), None);
}

#[test]
fn agrees_with_f64_over_the_whole_range() {
    let mut random = fastrand::Rng::with_seed(0x9E37_79B9);
    for _ in 0..200_000 {
        let count = random.i32(..);
        #[allow(clippy::cast_possible_truncation)]
        let expected = (f64::from(count) / (DEGREES_PER_RAD * 100.0)) as f32;
        let rad = CENTIDEGREES.to_si(count);
        assert!(
            (rad - expected).abs() <= expected.abs() * f32::EPSILON,
            "{count}: {rad} {expected}"
        );
        let exact = f64::from(rad) * (DEGREES_PER_RAD * 100.0);
        match CENTIDEGREES.nearest(rad) {
            Some(back) => {
                assert!((f64::from(back) - exact).abs() <= 0.505, "{rad}: {back} {exact}")
            }
            None => assert!(exact.abs() >= f64::from(i32::MAX), "{rad}: {exact}"),
        }
    }
}

#[test]
fn what_rounding_pushes_beyond_a_limit_stays_on_its_inner_side() {
    assert_eq!(DEGREES.within(0.009, (-0.009, 0.009)), Some(0));
    assert_eq!(DEGREES.within(-0.009, (-0.009, 0.009)), Some(0));
    assert_eq!(DEGREES.within(0.009, (-1.0, 1.0)), Some(1));
    assert_eq!(HUNDREDTHS.within(0.7, (-0.7, 0.7)), Some(70)); // the f32 lies below 0.7
    assert_eq!(HUNDREDTHS.within(0.128, (0.128, 1.0)), Some(13));
    assert_eq!(HUNDREDTHS.within(0.124, (0.124, 1.0)), Some(13));
    assert_eq!(HUNDREDTHS.within(-0.124, (-1.0, -0.124)), Some(-13));
    assert_eq!(HUNDREDTHS.within(0.124, (0.123, 0.126)), None); // no unit lies between
    assert_eq!(HUNDREDTHS.within(3.0, (-1.0, 1.0)), Some(300)); // not for this to refuse
    assert_eq!(to_span(10.0, (-24.0, 24.0), 12, (-10.0, 10.0)), Some(0xB55));
    assert_eq!(to_span(10.007, (-24.0, 24.0), 12, (-10.007, 10.007)), Some(0xB55));
    assert_eq!(to_span(10.007, (-24.0, 24.0), 12, UNLIMITED), Some(0xB56));
    assert_eq!(to_span(-10.007, (-24.0, 24.0), 12, (-10.007, 10.007)), Some(0x4AB));
    assert_eq!(to_span(-10.007, (-24.0, 24.0), 12, UNLIMITED), Some(0x4AA));
}

#[test]
fn a_span_reaches_from_the_first_word_to_the_last() {
    assert_eq!(to_span(-24.0, (-24.0, 24.0), 12, UNLIMITED), Some(0));
    assert_eq!(to_span(0.0, (-24.0, 24.0), 12, UNLIMITED), Some(0x800));
    assert_eq!(to_span(24.0, (-24.0, 24.0), 12, UNLIMITED), Some(0xFFF));
    assert_eq!(to_span(12.5, (-12.5, 12.5), 16, UNLIMITED), Some(0xFFFF));
    assert_eq!(to_span(24.01, (-24.0, 24.0), 12, UNLIMITED), None);
    assert_eq!(to_span(f32::NAN, (-24.0, 24.0), 12, UNLIMITED), None);
    assert_eq!(from_span(0, (-24.0, 24.0), 4095.0), -24.0);
    assert_eq!(from_span(0xFFF, (-24.0, 24.0), 4095.0), 24.0);
}

#[test]
fn wire_units_come_back_in_si() {
    assert_eq!(CENTIDEGREES.to_si(18_000), core::f32::consts::PI);
    assert_eq!(DEGREES.to_si(-180), -core::f32::consts::PI);
    assert_eq!(RPM.to_si(30), core::f32::consts::PI);
    assert_eq!(DECIDEGREES.to_si(900), core::f32::consts::FRAC_PI_2);
    assert_eq!(HUNDREDTHS.to_si(-150), -1.5);
    assert_eq!(TENTHS.to_si(241), 24.1);
}

#[test]
fn the_highest_bits_of_a_product_make_the_f32_that_all_of_them_make() {
    let is_same = |product: u64| {
        let (highest, places) = highest_bits(product);
        let of_all = product as f32;
        assert_eq!(highest as f32 * (places as f32).exp2(), of_all, "{product:#x}");
    };
    // Around each place where the 24 bits of an f32 end: less than a half behind them, a half, more.
    for shift in 0..40 {
        for (mantissa, behind) in
            [(0x80_0000_u64, 0), (0x80_0001, 0), (0xFF_FFFF, 1), (0xA5_5A5B, 1)]
        {
            let ends = mantissa << shift;
            let half = 1_u64 << shift >> 1;
            for near in [ends, ends + half, (ends + half).saturating_sub(1), ends + half + behind] {
                is_same(near);
            }
        }
    }
    for count in [0, 1, 2, u64::MAX >> 1, 1 << 32, (1 << 32) - 1, (1 << 32) + 1, 1 << 62] {
        is_same(count);
    }
    let mut random = fastrand::Rng::with_seed(0x9E37_79B9);
    for _ in 0..200_000 {
        is_same(random.u64(..) >> random.u32(1..64));
    }
}
