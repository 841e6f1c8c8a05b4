//! The id of a motor on its bus.

/// Defines the id of one motor: `struct Node in 1..=32;`.
#[macro_export]
macro_rules! node {
    ($(#[$meta:meta])* struct $Node:ident in $min:literal..=$max:literal;) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub struct $Node(u8);

        impl $Node {
            /// Lowest id.
            pub const MIN: u8 = $min;
            /// Highest id.
            pub const MAX: u8 = $max;

            #[doc = concat!("The motor with this id; refuses anything outside ", $min, "..=", $max, ".")]
            pub const fn new(node: u8) -> Result<$Node, $crate::EncodeError> {
                match $crate::check_range("node", node as i64, $min, $max) {
                    Ok(()) => Ok($Node(node)),
                    Err(error) => Err(error),
                }
            }

            #[doc = concat!("The id as a number, ", $min, "..=", $max, ".")]
            pub const fn get(self) -> u8 {
                self.0
            }
        }
    };
}
