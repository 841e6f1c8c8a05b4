//! Words of which each bit has a name.

/// Defines a word of flags, over `bitflags`: `STALL = 0x0002;` names a bit, in snake_case `stall`.
/// Bits without a name stay as received.
///
/// - `sent` behind the word's type: requests carry it; its range is that of the named bits.
/// - `FAULTS of FaultInfo by info;` makes a table: each bit has a row, made by the constant
///   function `info` from the bit, its name and the columns that stand behind the bit.
#[macro_export]
macro_rules! flags {
    (
        $(#[$($meta:tt)*])* struct $Flags:ident: $Word:ident $(, $sent:ident)?;
        $($(#[$($doc:tt)*])* $NAME:ident = $bits:expr;)*
    ) => {
        ::bitflags::bitflags! {
            $(#[$($meta)*])*
            #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
            #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
            pub struct $Flags: $Word {
                $($(#[$($doc)*])* const $NAME = $bits;)*
            }
        }

        impl $Flags {
            /// Hands on the name of every named bit in a word, the lowest first.
            pub(crate) fn visit_names(word: u32, visit: &mut dyn FnMut(&'static str)) {
                $(if word & u32::from($Flags::$NAME.bits()) != 0 {
                    visit($crate::__lower!($NAME));
                })*
            }
        }

        impl $crate::Shown for $Flags {
            const INFO: $crate::FieldInfo = $crate::__flags_info!($Flags $(, $sent)?);

            fn visit(&self, field: &$crate::FieldInfo, visit: &mut $crate::Visit<'_>) {
                field.visit_flags(visit, self.bits(), $Flags::visit_names);
            }
        }

        $($crate::__flags_built!($Flags, $sent);)?

        #[cfg(feature = "defmt")]
        impl defmt::Format for $Flags {
            fn format(&self, f: defmt::Formatter<'_>) {
                defmt::write!(f, "{=str}({=u32:#x})", stringify!($Flags), u32::from(self.bits()));
            }
        }
    };
    (
        $(#[$($meta:tt)*])* struct $Flags:ident: $Word:ident;
        $(#[$($rows_meta:tt)*])* $ROWS:ident of $Info:ident by $info:ident;
        $($(#[$($doc:tt)*])* $NAME:ident = $bits:expr, $($column:expr),+;)*
    ) => {
        $crate::flags! {
            $(#[$($meta)*])* struct $Flags: $Word;
            $($(#[$($doc)*])* $NAME = $bits;)*
        }

        $(#[$($rows_meta)*])*
        pub const $ROWS: &[$Info] =
            &[$($info($Flags::$NAME, $crate::__lower!($NAME), $($column),+)),*];

        impl $Flags {
            /// The table's row of every listed bit that is set, the lowest first.
            pub fn infos(self) -> impl Iterator<Item = &'static $Info> {
                $ROWS.iter().filter(move |info| self.contains(info.fault))
            }
        }
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __flags_info {
    ($Flags:ident) => {
        $crate::FieldInfo::other($crate::FieldKind::Flags, "")
    };
    ($Flags:ident, sent) => {
        $crate::FieldInfo::flags("", $Flags::all().bits() as i64)
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __flags_built {
    ($Flags:ident, sent) => {
        impl $crate::Built for $Flags {
            fn build(
                field: &$crate::FieldInfo,
                fields: &$crate::Fields<'_>,
            ) -> Result<$Flags, $crate::BuildError> {
                fields.count(field).map($Flags::from_bits_retain)
            }
        }
    };
}

/// A constant's name in lower case.
#[doc(hidden)]
#[macro_export]
macro_rules! __lower {
    ($NAME:ident) => {{
        const NAME: [u8; stringify!($NAME).len()] = $crate::snake_case(stringify!($NAME));
        $crate::ascii(&NAME)
    }};
}
