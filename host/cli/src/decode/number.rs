//! Numbers and bytes as text, appended to a buffer.

use std::io::Write;

/// Fast path of physical values: whole hundredths, which are most of the quantities of the three
/// protocols.
const HUNDREDTHS: f64 = 100.0;
/// Up to here a count of hundredths and its decimal text mean the same `f64`.
const EXACT: f64 = 1e15;

const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
/// Digits of the longest `u64`.
const MOST_DIGITS: usize = 20;

/// Appends a whole number.
pub fn push_integer(line: &mut Vec<u8>, value: i64) {
    if value < 0 {
        line.push(b'-');
    }
    push_unsigned(line, value.unsigned_abs());
}

fn push_unsigned(line: &mut Vec<u8>, value: u64) {
    let mut digits = [0; MOST_DIGITS];
    let (mut rest, mut used) = (value, 0);
    for place in digits.iter_mut().rev() {
        *place = digit(rest % 10);
        rest /= 10;
        used += 1;
        if rest == 0 {
            break;
        }
    }
    line.extend_from_slice(digits.get(MOST_DIGITS - used..).unwrap_or_default());
}

fn digit(value: u64) -> u8 {
    usize::try_from(value).ok().and_then(|value| DIGITS.get(value)).copied().unwrap_or_default()
}

/// Appends the shortest decimal text that means this number, or `null` for what JSON has no number
/// for.
pub fn push_physical(line: &mut Vec<u8>, value: f64) {
    if !value.is_finite() {
        line.extend_from_slice(b"null");
        return;
    }
    let count = (value * HUNDREDTHS).round();
    if count.abs() > EXACT || count / HUNDREDTHS != value {
        // Writing to a vector does not fail.
        let _ = write!(line, "{value}");
        return;
    }
    if count < 0.0 {
        line.push(b'-');
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole, positive, below 1e15"
    )]
    let count = count.abs() as u64;
    push_unsigned(line, count / 100);
    let (tenths, hundredths) = (count / 10 % 10, count % 10);
    if (tenths, hundredths) != (0, 0) {
        line.extend_from_slice(&[b'.', digit(tenths)]);
    }
    if hundredths != 0 {
        line.push(digit(hundredths));
    }
}

/// Appends bytes in hexadecimal, upper case.
pub fn push_hex(line: &mut Vec<u8>, bytes: &[u8]) {
    for byte in bytes {
        line.extend_from_slice(&[digit(u64::from(byte >> 4)), digit(u64::from(byte & 0x0F))]);
    }
}

/// Appends a CAN id in hexadecimal: 3 digits or, extended, 8.
pub fn push_id(line: &mut Vec<u8>, id: u32, digits: u32) {
    line.extend((0..digits).rev().map(|place| digit(u64::from(id >> (4 * place) & 0x0F))));
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
