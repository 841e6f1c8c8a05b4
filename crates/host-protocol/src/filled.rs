//! What is filled of an array of bytes, for a snapshot.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The filled bytes at the beginning of an array: written in one piece, not one by one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Filled<'a>(pub &'a [u8]);

impl<'a> Filled<'a> {
    /// The first `length` bytes of an array; none where it has fewer.
    #[must_use]
    pub fn of(array: &'a [u8], length: usize) -> Self {
        Self(array.get(..length).unwrap_or_default())
    }

    /// The array, with zeros behind them.
    ///
    /// # Errors
    /// Where they are more than it holds.
    pub fn array<E: Error, const N: usize>(self) -> Result<[u8; N], E> {
        let mut array = [0; N];
        let place =
            array.get_mut(..self.0.len()).ok_or(E::invalid_length(self.0.len(), &"fewer"))?;
        place.copy_from_slice(self.0);
        Ok(array)
    }
}

impl Serialize for Filled<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(self.0)
    }
}

impl<'de> Deserialize<'de> for Filled<'de> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        <&[u8]>::deserialize(from).map(Self)
    }
}
