//! Runs `host-tests/vectors/rmd-misprints.txt`: what must happen where the manual contradicts
//! itself.

use crate::vector::{Vector, vectors};

const MISPRINTS: &str = include_str!("../../../../host-tests/vectors/rmd-misprints.txt");
/// Changes with every line added or removed, so that none goes missing unseen.
const COUNT: usize = 23;

#[test]
fn misprints() {
    let outcomes = vectors(MISPRINTS).map(|vector| check(&vector));
    assert_eq!(outcomes.count(), COUNT);
}

fn check(vector: &Vector) {
    let label = vector.label;
    let outcome = vector.meaning;
    if outcome == "is no frame" {
        assert!(vector.frames().is_empty(), "{label}");
    } else if let Some(error) = outcome.strip_prefix("is refused as ") {
        let refused = vector.decode().map(|decoded| decoded.debug).expect_err(label);
        assert_eq!(format!("{refused:?}"), error, "{label}");
    } else {
        let value = outcome.strip_prefix("is ").unwrap_or_else(|| panic!("{label}: no outcome"));
        let decoded = vector.decode().unwrap_or_else(|error| panic!("{label}: {error}"));
        if let Some((value, hex)) = value.split_once(" and becomes ") {
            assert_eq!(
                (decoded.debug.as_str(), decoded.encoded.as_deref()),
                (value, Ok(hex)),
                "{label}"
            );
        } else if let Some((value, error)) = value.split_once(" and refused as ") {
            let refused = decoded.encoded.expect_err(label);
            assert_eq!(
                (decoded.debug.as_str(), format!("{refused:?}").as_str()),
                (value, error),
                "{label}"
            );
        } else {
            assert_eq!(
                (decoded.debug.as_str(), decoded.encoded.as_deref()),
                (value, Ok(vector.hex)),
                "{label}"
            );
        }
    }
}
