//! The motor protocols, the stop actions and the fields of a subscription: numbers with names, and
//! sets of them.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::MaxSize;

/// A number outside the list of a numbered enum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnknownNumber(pub u32);

impl fmt::Display for UnknownNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} names nothing here", self.0)
    }
}

impl core::error::Error for UnknownNumber {}

/// An enum whose variants have a number on the wire and a name for people, one list for both.
macro_rules! numbered {
    (
        $(#[$meta:meta])*
        pub enum $name:ident {
            $($(#[$variant_meta:meta])* $variant:ident = $number:literal $text:literal),+ $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[serde(into = "u8", try_from = "u8")]
        #[repr(u8)]
        pub enum $name { $($(#[$variant_meta])* $variant = $number),+ }

        impl $name {
            /// Every value, in the order of their numbers.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The number, as on the wire and in parameters.
            #[must_use]
            pub const fn number(self) -> u8 {
                self as u8
            }

            /// The name, in lower case.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $text),+ }
            }

            /// What has this name.
            #[must_use]
            pub fn from_name(name: &str) -> Option<Self> {
                match name { $($text => Some(Self::$variant),)+ _ => None }
            }
        }

        impl From<$name> for u8 {
            fn from(value: $name) -> u8 {
                value.number()
            }
        }

        impl From<$name> for u32 {
            fn from(value: $name) -> u32 {
                u32::from(value.number())
            }
        }

        impl TryFrom<u32> for $name {
            type Error = UnknownNumber;

            fn try_from(number: u32) -> Result<Self, UnknownNumber> {
                match number { $($number => Ok(Self::$variant),)+ _ => Err(UnknownNumber(number)) }
            }
        }

        impl TryFrom<u8> for $name {
            type Error = UnknownNumber;

            fn try_from(number: u8) -> Result<Self, UnknownNumber> {
                Self::try_from(u32::from(number))
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.name())
            }
        }

        impl MaxSize for $name {
            const MAX_SIZE: usize = u8::MAX_SIZE;
            const LAYOUT: u32 = crate::layout_of(stringify!($name $($variant $number)+), &[]);
        }
    };
}

numbered! {
    /// What a motor speaks. On the wire: its number as one byte.
    pub enum Protocol {
        /// RMD servo motors, CAN or RS485.
        Rmd = 1 "rmd",
        /// The thruster protocol, CAN.
        Thruster = 2 "thruster",
        /// The D5 driver, CAN or serial.
        D5 = 3 "d5",
    }
}

numbered! {
    /// What the gateway does with a motor to stop it; there is no default, the configuration
    /// chooses.
    pub enum StopAction {
        /// Output off; the motor runs out.
        Coast = 1 "coast",
        /// Speed 0, held by the motor's own control loop.
        Hold = 2 "hold",
        /// Speed 0, then the mechanical brake.
        Brake = 3 "brake",
    }
}

/// A set of the values of a numbered enum, as one byte.
macro_rules! set_of {
    ($(#[$meta:meta])* pub struct $set:ident of $item:ident) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $set(u8);

        impl $set {
            /// Nothing.
            pub const NONE: Self = Self(0);

            /// Exactly these.
            #[must_use]
            pub const fn of(items: &[$item]) -> Self {
                let mut set = Self::NONE;
                let mut rest = items;
                while let [first, others @ ..] = rest {
                    set = set.with(*first);
                    rest = others;
                }
                set
            }

            /// This set and `item`.
            #[must_use]
            pub const fn with(self, item: $item) -> Self {
                Self(self.0 | Self::bit(item))
            }

            /// Whether `item` is in it.
            #[must_use]
            pub const fn contains(self, item: $item) -> bool {
                self.0 & Self::bit(item) != 0
            }

            /// Whether everything of `other` is in it, the unknown ones too.
            #[must_use]
            pub const fn contains_all(self, other: Self) -> bool {
                other.0 & !self.0 == 0
            }

            /// Whether nothing is in it.
            #[must_use]
            pub const fn is_empty(self) -> bool {
                self.0 == 0
            }

            /// The byte of the wire.
            #[must_use]
            pub const fn bits(self) -> u8 {
                self.0
            }

            /// From the byte of the wire.
            #[must_use]
            pub const fn from_bits(bits: u8) -> Self {
                Self(bits)
            }

            /// The known ones in it.
            pub fn iter(self) -> impl Iterator<Item = $item> {
                let mut left = self.0;
                core::iter::from_fn(move || {
                    let at = usize::try_from(left.trailing_zeros()).ok()?;
                    let item = $item::ALL.get(at)?;
                    left &= left - 1;
                    Some(*item)
                })
            }

            const fn bit(item: $item) -> u8 {
                1 << (item.number() - 1)
            }
        }

        const _: () = {
            let mut at = 0;
            while at < $item::ALL.len() {
                assert!($set::bit($item::ALL[at]) == 1 << at, "in the order of their numbers");
                at += 1;
            }
        };

        impl MaxSize for $set {
            const MAX_SIZE: usize = u8::MAX_SIZE;
            const LAYOUT: u32 = crate::layout_of(stringify!($set), &[$item::LAYOUT]);
        }
    };
}

set_of! {
    /// Protocols, as one byte: bit `number − 1` of each. Bits of protocols unknown here are kept.
    pub struct ProtocolSet of Protocol
}

numbered! {
    /// What a subscription can tell of an axis.
    pub enum StateField {
        /// rad.
        Position = 1 "position",
        /// rad/s.
        Velocity = 2 "velocity",
        /// A.
        Current = 3 "current",
        /// Supply of the motor, V.
        Voltage = 4 "voltage",
        /// °C.
        MotorTemperature = 5 "motor_temperature",
        /// °C.
        DriverTemperature = 6 "driver_temperature",
        /// The motor's own fault word.
        Faults = 7 "faults",
    }
}

set_of! {
    /// Fields, as one byte: bit `number − 1` of each. Bits of fields unknown here are kept.
    pub struct StateFields of StateField
}

impl StateFields {
    /// Refuses fields that there are not.
    ///
    /// # Errors
    /// [`Error::OutOfRange`](crate::Error::OutOfRange).
    pub fn check(self) -> Result<(), crate::Error> {
        let all = Self::of(StateField::ALL).bits();
        crate::Quantity::Fields.check(self.bits().into(), (0, all.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_belong_together() {
        assert_eq!(Protocol::try_from(2u32), Ok(Protocol::Thruster));
        assert_eq!(Protocol::try_from(0u32), Err(UnknownNumber(0)));
        assert_eq!(Protocol::try_from(4u32), Err(UnknownNumber(4)));
        assert_eq!(StopAction::try_from(3u32), Ok(StopAction::Brake));
        assert_eq!(StopAction::from_name("hold"), Some(StopAction::Hold));
        assert_eq!(Protocol::from_name("RMD"), None);
    }

    #[test]
    fn the_wire_carries_the_number() {
        assert_eq!(postcard::to_slice(&Protocol::D5, &mut [0; 4]).unwrap(), [3]);
        assert!(postcard::from_bytes::<Protocol>(&[0]).is_err());
    }

    #[test]
    fn a_set_has_one_bit_for_each_protocol() {
        let set = ProtocolSet::of(&[Protocol::Rmd, Protocol::D5]);
        assert_eq!(set.bits(), 0b101);
        assert!(set.contains(Protocol::D5) && !set.contains(Protocol::Thruster));
        assert!(set.iter().eq([Protocol::Rmd, Protocol::D5]));
        assert!(
            ProtocolSet::from_bits(0xFF).contains_all(set)
                && !set.contains_all(ProtocolSet::from_bits(0x81))
        );
        assert_eq!(postcard::to_slice(&set, &mut [0; 4]).unwrap(), [0b101]);
    }
}
