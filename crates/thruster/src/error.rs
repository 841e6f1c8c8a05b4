//! What can go wrong, with the data needed to say so.

pub use codec::EncodeError;

codec::errors! {
    /// Why received bytes are not a message of this protocol.
    enum DecodeError;

    /// The standard CAN id belongs to no device in this direction.
    WrongId {
        /// The id received.
        id: u16,
    } = "CAN id {id:#05x} belongs to no device in this direction";
    /// An extended CAN id: the protocol has standard frames only (Thruster manual §1.1).
    ExtendedId {
        /// The id received.
        id: u32,
    } = "extended CAN id {id:#010x}";
    /// A remote frame: the protocol has data frames only (Thruster manual §1.1).
    RemoteFrame = "remote frame";
    /// The data field has another length than the command needs.
    Length {
        /// Bytes received.
        got: usize,
        /// Bytes of the full form.
        expected: usize,
    } = "{got} data bytes instead of {expected}";
    /// Bytes 4–5 are neither zero nor, where the value is signed, a sign extension.
    UpperHalf {
        /// The upper half received.
        got: u16,
    } = "upper half {got:#06x} of a 16-bit value";
    /// A byte that the manual fixes has another value.
    FixedByte {
        /// Its offset in the data field.
        offset: usize,
        /// The value received.
        got: u8,
        /// The value the manual gives.
        expected: u8,
    } = "byte {offset} is {got:#04x} instead of {expected:#04x}";
}
