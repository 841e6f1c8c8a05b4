//! The bounded sequences of the wire, under the names that this protocol uses for them.

use serde::Serializer;

/// At most `N` elements.
pub type Vec<T, const N: usize> = heapless::Vec<T, N>;

/// At most `N` bytes.
pub type Bytes<const N: usize> = heapless::Vec<u8, N>;

/// At most `N` bytes of UTF-8.
pub type Text<const N: usize> = heapless::String<N>;

/// As a byte string, which is the same on the wire, and copied in one piece.
pub(crate) fn in_one_piece<const N: usize, S: Serializer>(
    bytes: &Bytes<N>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}
