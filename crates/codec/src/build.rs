//! Requests from names and numbers.

use core::fmt;

use crate::count::nearest_count;
use crate::error::EncodeError;
use crate::field::{FieldInfo, FieldKind};

/// Why names and numbers make no request.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BuildError {
    /// No command that can be sent has this name.
    UnknownCommand,
    /// The command needs this field.
    MissingField {
        /// Name of the field.
        field: &'static str,
    },
    /// The value lies outside the field's range.
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// The refused value, in the unit of the field's name.
        value: f64,
        /// Lowest allowed value.
        min: f64,
        /// Highest allowed value.
        max: f64,
    },
    /// The field holds whole numbers only.
    NotAnInteger {
        /// Name of the field.
        field: &'static str,
        /// The refused value.
        value: f64,
    },
    /// The codec refuses the values.
    Encode(EncodeError),
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BuildError::UnknownCommand => write!(f, "no command that can be sent has this name"),
            BuildError::MissingField { field } => write!(f, "{field} is missing"),
            BuildError::OutOfRange { field, value, min, max } => {
                write!(f, "{field} {value} is outside {min}..={max}")
            }
            BuildError::NotAnInteger { field, value } => {
                write!(f, "{field} {value} is not a whole number")
            }
            BuildError::Encode(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for BuildError {}

impl From<EncodeError> for BuildError {
    fn from(error: EncodeError) -> BuildError {
        BuildError::Encode(error)
    }
}

/// The numbers a caller gives for fields, in the units of the fields' names.
pub struct Fields<'a>(pub &'a dyn Fn(&str) -> Option<f64>);

impl Fields<'_> {
    /// The value of a field, whatever it is.
    pub fn any(&self, field: &FieldInfo) -> Result<f64, BuildError> {
        (self.0)(field.name).ok_or(BuildError::MissingField { field: field.name })
    }

    /// The field's count on the wire; a physical value is rounded to the nearest one. Refused is a
    /// value outside the field's range or, where the field is not physical, between two counts.
    pub fn count<T: TryFrom<i64>>(&self, field: &FieldInfo) -> Result<T, BuildError> {
        let value = self.value(field)?;
        let counts = nearest_count(value * field.counts_per_unit);
        if field.kind != FieldKind::Physical && counts as f64 != value {
            return Err(BuildError::NotAnInteger { field: field.name, value });
        }
        T::try_from(counts).map_err(|_| out_of_range(field, value))
    }

    /// A field of 0 or 1.
    pub fn boolean(&self, field: &FieldInfo) -> Result<bool, BuildError> {
        Ok(self.count::<u8>(field)? != 0)
    }

    /// The value of a field, checked against its range.
    fn value(&self, field: &FieldInfo) -> Result<f64, BuildError> {
        let value = self.any(field)?;
        // NaN lies in no range.
        if !(field.min..=field.max).contains(&value) {
            return Err(out_of_range(field, value));
        }
        Ok(value)
    }
}

fn out_of_range(field: &FieldInfo, value: f64) -> BuildError {
    BuildError::OutOfRange { field: field.name, value, min: field.min, max: field.max }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;

    use super::*;

    const CURRENT: FieldInfo = FieldInfo::physical("current_a", "A", (-32_768, 32_767), 100.0);
    const ID: FieldInfo = FieldInfo::integer("id", "", 1, 32);
    const FRAMES: FieldInfo = FieldInfo::flags("frames", 0x07);
    const ENABLED: FieldInfo = FieldInfo::boolean("enabled");

    #[test]
    fn quantities_are_rounded_to_the_nearest_count() {
        for (value, count) in
            [(0.014, 1), (0.016, 2), (-0.016, -2), (327.67, i16::MAX), (-327.68, i16::MIN)]
        {
            assert_eq!(Fields(&|_| Some(value)).count(&CURRENT), Ok(count), "{value}");
        }
    }

    #[test]
    fn other_numbers_must_be_whole() {
        assert_eq!(Fields(&|_| Some(32.0)).count(&ID), Ok(32_u8));
        assert_eq!(Fields(&|_| Some(5.0)).count(&FRAMES), Ok(5_u8));
        for field in [ID, FRAMES] {
            let refused = BuildError::NotAnInteger { field: field.name, value: 1.5 };
            assert_eq!(Fields(&|_| Some(1.5)).count::<u8>(&field), Err(refused));
        }
    }

    #[test]
    fn values_outside_the_range_are_refused() {
        for value in [0.0, 33.0, f64::INFINITY] {
            let refused = BuildError::OutOfRange { field: "id", value, min: 1.0, max: 32.0 };
            assert_eq!(Fields(&|_| Some(value)).count::<u8>(&ID), Err(refused));
        }
        let not_a_number = Fields(&|_| Some(f64::NAN)).count::<u8>(&ID);
        assert!(matches!(not_a_number, Err(BuildError::OutOfRange { field: "id", .. })));
    }

    /// The range of the table may be wider than the integer that holds the count.
    #[test]
    fn counts_that_do_not_fit_are_refused() {
        let refused =
            BuildError::OutOfRange { field: "current_a", value: 2.0, min: -327.68, max: 327.67 };
        assert_eq!(Fields(&|_| Some(2.0)).count::<i8>(&CURRENT), Err(refused));
    }

    #[test]
    fn booleans_are_0_or_1() {
        assert_eq!(Fields(&|_| Some(0.0)).boolean(&ENABLED), Ok(false));
        assert_eq!(Fields(&|_| Some(1.0)).boolean(&ENABLED), Ok(true));
        let refused = BuildError::OutOfRange { field: "enabled", value: 2.0, min: 0.0, max: 1.0 };
        assert_eq!(Fields(&|_| Some(2.0)).boolean(&ENABLED), Err(refused));
    }

    #[test]
    fn a_field_is_asked_for_by_its_name() {
        let given = |name: &str| (name == "current_a").then_some(1e6);
        assert_eq!(Fields(&given).any(&CURRENT), Ok(1e6));
        let missing = BuildError::MissingField { field: "id" };
        assert_eq!(Fields(&given).any(&ID), Err(missing));
        assert_eq!(Fields(&given).count::<u8>(&ID), Err(missing));
    }

    #[test]
    fn errors_name_field_and_value() {
        let refused = EncodeError::OutOfRange { field: "id", value: 33, min: 1, max: 32 };
        for (error, text) in [
            (BuildError::UnknownCommand, "no command that can be sent has this name"),
            (BuildError::MissingField { field: "id" }, "id is missing"),
            (
                BuildError::OutOfRange { field: "kp", value: 0.5, min: 1.0, max: 2.5 },
                "kp 0.5 is outside 1..=2.5",
            ),
            (BuildError::NotAnInteger { field: "id", value: 1.5 }, "id 1.5 is not a whole number"),
            (BuildError::from(refused), "id 33 is outside 1..=32"),
        ] {
            assert_eq!(error.to_string(), text);
        }
    }
}
