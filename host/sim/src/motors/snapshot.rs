//! How values of the codecs, which know no serde, are serialised with a motor: as the numbers on
//! the wire.

use d5::{Register, Value};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A module for `#[serde(with)]`: the type, the number it is serialised as, there and back.
macro_rules! as_number {
    ($name:ident, $type:ty, $number:ty, $there:expr, $back:expr) => {
        pub(super) mod $name {
            use super::*;

            pub(in super::super) fn serialize<S: Serializer>(
                value: &$type,
                to: S,
            ) -> Result<S::Ok, S::Error> {
                let there: fn(&$type) -> $number = $there;
                there(value).serialize(to)
            }

            pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
                from: D,
            ) -> Result<$type, D::Error> {
                let back: fn($number) -> Option<$type> = $back;
                let number = <$number>::deserialize(from)?;
                back(number).ok_or_else(|| D::Error::custom(concat!("no ", stringify!($name))))
            }
        }
    };
}

as_number!(rmd_node, ::rmd::Node, u8, |node| node.get(), |raw| ::rmd::Node::new(raw).ok());
as_number!(thruster_node, ::thruster::Node, u8, |node| node.get(), |raw| ::thruster::Node::new(
    raw
)
.ok());
as_number!(d5_node, ::d5::Node, u8, |node| node.get(), |raw| ::d5::Node::new(raw).ok());
as_number!(rmd_faults, ::rmd::Faults, u16, |faults| faults.bits(), |bits| {
    Some(::rmd::Faults::from_bits_retain(bits))
});
as_number!(thruster_faults, ::thruster::Faults, u16, |faults| faults.bits(), |bits| {
    Some(::thruster::Faults::from_bits_retain(bits))
});
as_number!(d5_faults, ::d5::Faults, u8, |faults| faults.bits(), |bits| {
    Some(::d5::Faults::from_bits_retain(bits))
});
as_number!(d5_registers, [u8; 256], Vec<u8>, |registers| registers.to_vec(), |bytes| bytes
    .try_into()
    .ok());
// Register, byte or word.
as_number!(
    d5_write,
    Option<(Register, Value)>,
    Option<(u8, Result<u8, u16>)>,
    |write| write.map(|(Register(address), value)| match value {
        Value::Byte(byte) => (address, Ok(byte)),
        Value::Word(word) => (address, Err(word)),
    }),
    |write| Some(
        write.map(|(address, value)| (
            Register(address),
            value.map_or_else(Value::Word, Value::Byte)
        ))
    )
);
