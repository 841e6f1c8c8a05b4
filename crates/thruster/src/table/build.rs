//! Requests from names and numbers.

use core::fmt;

use super::{FieldInfo, FieldKind, count};
use crate::error::EncodeError;

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
            BuildError::NotAnInteger { field, value } => write!(f, "{field} {value} is not a whole number"),
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
pub(crate) struct Fields<'a>(pub(crate) &'a dyn Fn(&str) -> Option<f64>);

impl Fields<'_> {
    /// The value of a field, checked against its range.
    fn value(&self, field: &FieldInfo) -> Result<f64, BuildError> {
        let value = (self.0)(field.name).ok_or(BuildError::MissingField { field: field.name })?;
        // NaN lies in no range.
        if !(field.min..=field.max).contains(&value) {
            return Err(out_of_range(field, value));
        }
        Ok(value)
    }

    /// The field's count on the wire; a physical value is rounded to the nearest one.
    pub(crate) fn count<T: TryFrom<i64>>(&self, field: &FieldInfo) -> Result<T, BuildError> {
        let value = self.value(field)?;
        let counts = count(value * field.counts_per_unit);
        if field.kind != FieldKind::Physical && counts as f64 != value {
            return Err(BuildError::NotAnInteger { field: field.name, value });
        }
        T::try_from(counts).map_err(|_| out_of_range(field, value))
    }
}

fn out_of_range(field: &FieldInfo, value: f64) -> BuildError {
    BuildError::OutOfRange { field: field.name, value, min: field.min, max: field.max }
}
