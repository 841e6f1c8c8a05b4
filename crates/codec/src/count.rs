//! From a value to a count on the wire.

/// The count nearest to a value, halves away from zero. What no count can express becomes the
/// nearest `i64`, NaN 0: callers check ranges before.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the fraction is what is to be cut off; `as` saturates"
)]
pub fn nearest_count(value: f64) -> i64 {
    let whole = value as i64;
    let rest = value - whole as f64;
    if rest >= 0.5 {
        whole.saturating_add(1)
    } else if rest <= -0.5 {
        whole.saturating_sub(1)
    } else {
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_go_away_from_zero() {
        for (value, count) in
            [(0.0, 0), (0.49, 0), (0.5, 1), (1.5, 2), (2.4, 2), (-0.49, 0), (-0.5, -1), (-2.5, -3)]
        {
            assert_eq!(nearest_count(value), count, "{value}");
        }
    }

    #[test]
    fn what_no_count_can_express_saturates() {
        assert_eq!(nearest_count(f64::NAN), 0);
        assert_eq!(nearest_count(f64::INFINITY), i64::MAX);
        assert_eq!(nearest_count(1e300), i64::MAX);
        assert_eq!(nearest_count(f64::NEG_INFINITY), i64::MIN);
    }
}
