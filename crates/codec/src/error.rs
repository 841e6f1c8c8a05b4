//! Why a value cannot be encoded. Why bytes cannot be decoded is each codec's own.

use crate::shown::Number;

/// Defines an enum of errors, each with its fields and its text.
#[macro_export]
macro_rules! errors {
    (
        $(#[$meta:meta])* enum $Error:ident;
        $(
            $(#[$doc:meta])*
            $V:ident $({ $($(#[$field_doc:meta])* $f:ident: $t:ty),* $(,)? })? = $text:literal;
        )*
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum $Error {
            $($(#[$doc])* $V $({ $($(#[$field_doc])* $f: $t),* })?,)*
        }

        impl core::fmt::Display for $Error {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                match self {
                    $($Error::$V $({ $($f),* })? => write!(f, $text),)*
                }
            }
        }

        impl core::error::Error for $Error {}
    };
}

errors! {
    /// A value the manual gives no bytes for.
    enum EncodeError;

    /// The value lies outside the range the manual gives.
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// The refused value, in the field's raw unit.
        value: i64,
        /// Lowest allowed value.
        min: i64,
        /// Highest allowed value.
        max: i64,
    } = "{field} {value} is outside {min}..={max}";
    /// The value lies within the range and is refused all the same.
    Forbidden {
        /// Name of the field.
        field: &'static str,
        /// The refused value, in the field's raw unit.
        value: i64,
        /// Why it is refused.
        reason: &'static str,
    } = "{field} {value} is refused: {reason}";
    /// The CAN frame type took neither the id nor the data.
    Frame = "the CAN frame type refused the frame";
}

/// Refuses a value outside `min..=max`.
#[inline]
pub const fn check_range(
    field: &'static str,
    value: i64,
    min: i64,
    max: i64,
) -> Result<(), EncodeError> {
    if min <= value && value <= max {
        Ok(())
    } else {
        Err(EncodeError::OutOfRange { field, value, min, max })
    }
}

/// Refuses a count outside `min..=max`.
#[inline]
pub fn check_number(
    field: &'static str,
    number: impl Number,
    min: i64,
    max: i64,
) -> Result<(), EncodeError> {
    check_range(field, number.raw().into(), min, max)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;

    #[test]
    fn the_ends_of_a_range_are_in_it() {
        for value in [-3, 0, 5] {
            assert_eq!(check_range("signal", value, -3, 5), Ok(()));
        }
        for value in [-4, 6, i64::MIN, i64::MAX] {
            let refused = EncodeError::OutOfRange { field: "signal", value, min: -3, max: 5 };
            assert_eq!(check_range("signal", value, -3, 5), Err(refused));
        }
    }

    #[test]
    fn errors_name_field_and_value() {
        let error = EncodeError::OutOfRange { field: "id", value: 33, min: 1, max: 32 };
        assert_eq!(error.to_string(), "id 33 is outside 1..=32");
        let error = EncodeError::Forbidden { field: "command", value: 6, reason: "for CAN only" };
        assert_eq!(error.to_string(), "command 6 is refused: for CAN only");
        assert_eq!(EncodeError::Frame.to_string(), "the CAN frame type refused the frame");
    }
}
