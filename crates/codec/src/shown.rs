//! Values as tools see them: under a name, built from a number.

use crate::build::{BuildError, Fields};
use crate::field::{FieldInfo, FieldKind};
use crate::value::Visit;

/// A value that is one field of a command.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not shown as one field",
    note = "a type of several fields gets no name in the table: leave out its `as \"…\"`"
)]
pub trait Shown {
    /// The field; the table of commands gives it its name.
    const INFO: FieldInfo;

    /// Hands on the value.
    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>);
}

/// A value that is built from one number.
#[diagnostic::on_unimplemented(
    message = "no request can carry `{Self}`: nothing builds it from a number"
)]
pub trait Built: Shown + Sized {
    /// The value that the caller gives for the field.
    fn build(field: &FieldInfo, fields: &Fields<'_>) -> Result<Self, BuildError>;
}

/// A value that is a count on the wire: an integer or a unit over one.
pub trait Number: Copy {
    /// The integer on the wire.
    type Raw: TryFrom<i64> + Into<i64>;
    /// The field; the table of commands gives it its name.
    const INFO: FieldInfo;

    /// The value of a count.
    fn from_raw(raw: Self::Raw) -> Self;

    /// The count.
    fn raw(self) -> Self::Raw;
}

impl<T: Number> Shown for T {
    const INFO: FieldInfo = <T as Number>::INFO;

    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
        match field.kind {
            FieldKind::Physical => field.visit_count(visit, self.raw()),
            _ => field.visit_integer(visit, self.raw()),
        }
    }
}

impl<T: Number> Built for T {
    fn build(field: &FieldInfo, fields: &Fields<'_>) -> Result<T, BuildError> {
        fields.count(field).map(T::from_raw)
    }
}

impl Shown for bool {
    const INFO: FieldInfo = FieldInfo::boolean("");

    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
        field.visit_bool(visit, *self);
    }
}

impl Built for bool {
    fn build(field: &FieldInfo, fields: &Fields<'_>) -> Result<bool, BuildError> {
        fields.boolean(field)
    }
}

impl<const N: usize> Shown for [u8; N] {
    const INFO: FieldInfo = FieldInfo::other(FieldKind::Bytes, "");

    fn visit(&self, field: &FieldInfo, visit: &mut Visit<'_>) {
        field.visit_bytes(visit, self);
    }
}

macro_rules! integer {
    ($($raw:ident)*) => {
        $(impl Number for $raw {
            type Raw = $raw;
            const INFO: FieldInfo = FieldInfo::integer("", "", $raw::MIN as i64, $raw::MAX as i64);

            fn from_raw(raw: $raw) -> $raw {
                raw
            }

            fn raw(self) -> $raw {
                self
            }
        })*
    };
}

integer!(u8 u16 u32);

/// Defines units: newtypes over the integers that travel on the wire.
///
/// `Centiamps(i16): "A" / 100.0;` counts hundredths of an ampere; `Milliseconds(u32): "ms";` is a
/// whole number, shown as it is.
#[macro_export]
macro_rules! units {
    ($($(#[$doc:meta])* $Unit:ident($Raw:ident): $unit:literal $(/ $counts:literal)?;)*) => {
        $(
            $(#[$doc])*
            #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
            #[cfg_attr(feature = "defmt", derive(defmt::Format))]
            #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
            pub struct $Unit(pub $Raw);

            impl $crate::Number for $Unit {
                type Raw = $Raw;
                const INFO: $crate::FieldInfo =
                    $crate::__unit_info!($unit, ($Raw::MIN as i64, $Raw::MAX as i64) $(, $counts)?);

                fn from_raw(raw: $Raw) -> $Unit {
                    $Unit(raw)
                }

                fn raw(self) -> $Raw {
                    self.0
                }
            }
        )*
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __unit_info {
    ($unit:literal, $range:expr) => {
        $crate::FieldInfo::integer("", $unit, $range.0, $range.1)
    };
    ($unit:literal, $range:expr, $counts:literal) => {
        $crate::FieldInfo::physical("", $unit, $range, $counts)
    };
}
