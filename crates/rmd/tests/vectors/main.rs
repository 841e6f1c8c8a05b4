//! Runs the golden vectors of `host-tests/vectors/rmd.txt`: decode, compare, encode, compare.

mod misprints;
mod vector;

use std::collections::BTreeSet;

use rmd::{COMMANDS, CommandInfo, Request};
use vector::vectors;

const VECTORS: &str = include_str!("../../../../host-tests/vectors/rmd.txt");
/// Changes with every vector added or removed, so that none goes missing unseen.
const COUNT: usize = 283;
/// The rows of bytes that the manual prints for CAN: 90 of §2 to §4 and the two frames of §5.4.
const PRINTED: usize = 92;
/// Ends the section of a printed frame that must not be sent.
const REFUSED: &str = "encoding refused";

#[test]
fn golden_vectors() {
    let (mut count, mut printed) = (0, 0);
    for vector in vectors(VECTORS) {
        let decoded = vector.decode().unwrap_or_else(|error| panic!("{}: {error}", vector.label));
        assert_eq!(decoded.debug, vector.meaning, "{}", vector.label);
        if vector.section.ends_with(REFUSED) {
            assert!(decoded.encoded.is_err(), "{}", vector.label);
        } else {
            assert_eq!(decoded.encoded.as_deref(), Ok(vector.hex), "{}", vector.label);
        }
        assert!(
            vector.section.contains("RMD V3.6") || vector.section.contains("observed"),
            "{}",
            vector.label
        );
        count += 1;
        printed += usize::from(vector.bus == "can" && !vector.section.starts_with("derived"));
    }
    assert_eq!((count, printed), (COUNT, PRINTED));
}

/// Where a command can be sent, and whether a reply belongs to it.
fn expected(info: &CommandInfo) -> BTreeSet<(&'static str, &'static str)> {
    let buses: &[&str] = match info.name {
        "read_can_id" | "set_can_id" | "motion_mode" => &["can"],
        "read_rs485_id" | "set_rs485_id" => &["rs485"],
        _ => &["can", "rs485"],
    };
    let kinds: &[&str] = match info.name {
        "timeout_notice" => &["event"],
        "reset" => &["request"],
        _ => &["request", "reply"],
    };
    kinds.iter().flat_map(|kind| buses.iter().map(|bus| (*kind, *bus))).collect()
}

#[test]
fn no_command_lacks_a_vector() {
    let mut seen = BTreeSet::new();
    for vector in vectors(VECTORS) {
        let decoded = vector.decode().unwrap_or_else(|error| panic!("{}: {error}", vector.label));
        seen.insert((decoded.name, vector.kind, vector.bus));
    }
    for info in COMMANDS {
        for (kind, bus) in expected(info) {
            assert!(seen.contains(&(info.name, kind, bus)), "no {kind} of {} on {bus}", info.name);
        }
    }
    assert!(!Request::Reset.is_answered());
}
