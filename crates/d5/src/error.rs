//! What can go wrong, with the data needed to say so.

pub use codec::EncodeError;

codec::errors! {
    /// Why received bytes are not a message of this protocol.
    enum DecodeError;

    /// A remote frame: the protocol has data frames only.
    RemoteFrame = "remote frame";
    /// Wrong number of bytes.
    Length {
        /// Bytes received, or the length byte.
        got: usize,
        /// Bytes of a frame, or the length byte of a frame with two data bytes; it may also be one
        /// less.
        expected: usize,
    } = "{got} data bytes instead of {expected}";
    /// The last byte is not the sum of the bytes after the header (D5 manual, frame format).
    Checksum {
        /// Checksum received.
        got: u8,
        /// Checksum of the bytes received.
        expected: u8,
    } = "checksum {got:#04x} instead of {expected:#04x}";
    /// The frame does not start with the header byte of its direction (D5 manual, frame format).
    Header {
        /// First byte received.
        got: u8,
        /// The header byte.
        expected: u8,
    } = "first byte {got:#04x} instead of {expected:#04x}";
    /// The id byte names no single motor, or is a broadcast where there can be none.
    Node {
        /// The id byte received.
        node: u8,
    } = "id {node:#04x} names no single motor";
    /// A byte that the manual fixes has another value.
    FixedByte {
        /// Its offset in the frame.
        offset: usize,
        /// The value received.
        got: u8,
        /// The value the manual gives.
        expected: u8,
    } = "byte {offset} is {got:#04x} instead of {expected:#04x}";
}
