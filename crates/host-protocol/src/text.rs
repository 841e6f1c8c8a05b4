//! The bounded sequences of the wire, under the names that this protocol uses for them.

/// At most `N` elements.
pub type Vec<T, const N: usize> = heapless::Vec<T, N>;

/// At most `N` bytes.
pub type Bytes<const N: usize> = heapless::Vec<u8, N>;

/// At most `N` bytes of UTF-8.
pub type Text<const N: usize> = heapless::String<N>;
