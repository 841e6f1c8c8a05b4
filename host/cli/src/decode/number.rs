//! Numbers and bytes as text, appended to a buffer. Writing to a vector does not fail.

use std::io::Write;

const DIGITS: &[u8; 16] = b"0123456789ABCDEF";

/// Appends a whole number.
pub fn push_integer(line: &mut Vec<u8>, value: i64) {
    let _ = write!(line, "{value}");
}

/// Appends the shortest decimal text that means this number, or `null` for what JSON has no number
/// for.
pub fn push_physical(line: &mut Vec<u8>, value: f64) {
    if value.is_finite() {
        // A zero has no sign.
        let _ = write!(line, "{}", value + 0.0);
    } else {
        line.extend_from_slice(b"null");
    }
}

/// Appends bytes in hexadecimal, upper case: the most that is written, so not by `write!`.
pub fn push_hex(line: &mut Vec<u8>, bytes: &[u8]) {
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 0x0F]);
    line.extend(digits.filter_map(|digit| DIGITS.get(usize::from(digit))));
}

/// Appends a CAN id in hexadecimal: 3 digits or, extended, 8.
pub fn push_id(line: &mut Vec<u8>, id: u32, digits: usize) {
    let _ = write!(line, "{id:0digits$X}");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(push: impl Fn(&mut Vec<u8>)) -> String {
        let mut line = Vec::new();
        push(&mut line);
        String::from_utf8(line).unwrap()
    }

    #[test]
    fn physical_values_are_as_short_as_they_are_exact() {
        for (value, expected) in [
            (1.0, "1"),
            (-0.01, "-0.01"),
            (0.1, "0.1"),
            (-327.68, "-327.68"),
            (0.0, "0"),
            (-0.0, "0"),
            (21_474_836.47, "21474836.47"),
            (10.004395604395604, "10.004395604395604"),
            (f64::NAN, "null"),
            (f64::INFINITY, "null"),
        ] {
            assert_eq!(text(|line| push_physical(line, value)), expected);
        }
        for count in (-3_276_800..3_276_700).step_by(77) {
            let value = f64::from(count) / 100.0;
            assert_eq!(text(|line| push_physical(line, value)), format!("{value}"));
        }
    }

    #[test]
    fn whole_numbers() {
        for value in [0, 7, -1, 10, 4_294_967_295, i64::MIN, i64::MAX] {
            assert_eq!(text(|line| push_integer(line, value)), value.to_string());
        }
    }

    #[test]
    fn ids_and_bytes() {
        assert_eq!(text(|line| push_id(line, 0x0B, 3)), "00B");
        assert_eq!(text(|line| push_id(line, 0x1FFF_FFFF, 8)), "1FFFFFFF");
        assert_eq!(text(|line| push_hex(line, &[0x00, 0x9C, 0xF2])), "009CF2");
    }
}
