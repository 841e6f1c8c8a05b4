//! Names of the gateway, its buses and its axes: people and files use them, requests use numbers.

use core::fmt;

use crate::size::wire;
use crate::text::Text;

/// Longest name, bytes.
pub const MAX_NAME: usize = 16;

wire! {
    /// What has a name. In this order: the gateway, its buses, its axes.
    #[derive(Copy, Eq, PartialOrd, Ord)]
    pub enum Subject {
        /// The gateway.
        Gateway,
        /// The bus with this number.
        Bus(u8),
        /// The axis with this number.
        Axis(u8),
    }

    /// A name, and whose it is.
    #[derive(Eq)]
    pub struct Named {
        /// Whose it is.
        pub of: Subject,
        pub name: Text<MAX_NAME>,
    }
}

/// Whether a text can be a name: 1 to [`MAX_NAME`] letters, digits, `-` and `_` of ASCII, a letter
/// first, so that it is no number and no address; and none of the words that stand where a name
/// can: `all` and `gateway`.
#[must_use]
pub fn is_name(text: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
    (1..=MAX_NAME).contains(&text.len())
        && text.starts_with(|first: char| first.is_ascii_alphabetic())
        && text.bytes().all(allowed)
        && !matches!(text, "all" | "gateway")
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gateway => f.write_str("the gateway"),
            Self::Bus(bus) => write!(f, "bus {bus}"),
            Self::Axis(axis) => write!(f, "axis {axis}"),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;

    use super::*;

    #[test]
    fn a_name_is_no_number_no_address_and_no_word_of_the_command_line() {
        for name in ["a", "left", "arm_bus", "Arm-2_B", "abcdefghijklmnop", "allx"] {
            assert!(is_name(name), "{name}");
        }
        let none = [
            "",
            "0",
            "0x1",
            "2nd",
            "-a",
            "_a",
            "0:1",
            "a:1",
            "a b",
            "a.b",
            "é",
            "aé",
            "a\0",
            "all",
            "gateway",
            "abcdefghijklmnopq",
        ];
        for text in none {
            assert!(!is_name(text), "{text}");
        }
    }

    #[test]
    fn subjects_have_the_order_in_which_they_are_listed() {
        let order = [Subject::Gateway, Subject::Bus(0), Subject::Bus(3), Subject::Axis(0)];
        assert!(order.is_sorted_by(|a, b| a < b));
        assert_eq!(order.map(|of| of.to_string()), ["the gateway", "bus 0", "bus 3", "axis 0"]);
    }
}
