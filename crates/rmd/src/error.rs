//! What can go wrong, with the data needed to say so.

pub use codec::EncodeError;

codec::errors! {
    /// Why received bytes are not a message of this protocol.
    enum DecodeError;

    /// The standard CAN id belongs to no motor in this direction.
    WrongId {
        /// The id received.
        id: u16,
    } = "CAN id {id:#05x} belongs to no motor in this direction";
    /// An extended CAN id: the protocol has standard frames only (RMD V3.6 §1.1.2).
    ExtendedId {
        /// The id received.
        id: u32,
    } = "extended CAN id {id:#010x}";
    /// A remote frame: the protocol has data frames only (RMD V3.6 §1.1.2).
    RemoteFrame = "remote frame";
    /// Wrong number of data bytes.
    Length {
        /// Bytes received, or the RS485 length byte.
        got: usize,
        /// Bytes the protocol has.
        expected: usize,
    } = "{got} data bytes instead of {expected}";
    /// The RS485 checksum does not match (RMD V3.6 §1.2.2).
    Checksum {
        /// Checksum received.
        got: u16,
        /// Checksum of the bytes received.
        expected: u16,
    } = "checksum {got:#06x} instead of {expected:#06x}";
    /// The RS485 frame does not start with its header byte (RMD V3.6 §1.2.2).
    Header {
        /// First byte received.
        got: u8,
        /// The header byte.
        expected: u8,
    } = "first byte {got:#04x} instead of {expected:#04x}";
    /// The RS485 id byte names no single motor (RMD V3.6 §1.2.2).
    Node {
        /// The id byte received.
        node: u8,
    } = "id {node:#04x} names no single motor";
    /// The data of an id reply name no motor (RMD V3.6 §4.3, §7.3).
    BusId {
        /// The id in the data: the last byte of a written id, the last two of a read one.
        word: u16,
    } = "{word:#06x} is no motor's id";
}
