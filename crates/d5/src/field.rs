//! Headers, byte positions and fixed bytes, each written once.

/// Length of every frame (D5 manual, frame format).
pub const FRAME_LEN: usize = 8;
/// Length of what lies between id and checksum: length, command, address, low and high byte.
pub const PAYLOAD_LEN: usize = FRAME_LEN - 3;
/// First byte of a request (D5 manual, frame format).
pub const REQUEST_HEADER: u8 = 0xD5;
/// First byte of a reply (D5 manual, frame format).
pub const REPLY_HEADER: u8 = 0x5D;

/// Offset of the length byte in a frame.
pub(crate) const LENGTH: usize = 2;
/// Offset of the register address in a frame.
pub(crate) const ADDRESS: usize = 4;
/// Offset of the lower data byte in a frame.
pub(crate) const LOW: usize = 5;
/// Offset of the upper data byte in a frame.
pub(crate) const HIGH: usize = 6;

/// Length byte of a frame with one data byte; the upper one is then 0 (D5 manual, frame format).
pub(crate) const ONE_DATA_BYTE: u8 = 0x04;
/// Length byte of a frame with two data bytes (D5 manual, frame format).
pub(crate) const TWO_DATA_BYTES: u8 = 0x05;

/// Address and data bytes of a self test (D5 manual, table rows 3 to 5).
pub(crate) const SELF_TEST_BYTES: [u8; 3] = [0x12, 0x34, 0x56];
/// Address and data bytes of the reply to an id query (D5 manual, table row 1).
pub(crate) const ID_MARK: u8 = 0xCC;
/// Address and data bytes of the reply to a reset (D5 manual, table row 6).
pub(crate) const RESET_MARK: u8 = 0xFF;
/// Data bytes of an error reply (D5 manual, table rows 3 to 5).
pub(crate) const ERROR_MARK: u8 = 0xEE;
/// Address byte of an error reply: the id was wrong (D5 manual, table row 5).
pub(crate) const ERROR_ID: u8 = 0x01;
/// Address byte of an error reply: the command was wrong (D5 manual, table row 4).
pub(crate) const ERROR_COMMAND: u8 = 0x03;
/// Address byte of an error reply: the checksum was wrong (D5 manual, table row 3).
pub(crate) const ERROR_CHECKSUM: u8 = 0x07;
