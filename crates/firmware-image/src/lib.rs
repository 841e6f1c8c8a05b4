//! What an image of the firmware says of itself, and whether one is whole and signed: for the board
//! that takes it and the computer that sends it.
//!
//! An image is what lies in the flash from its vector table on, in whole units of [`UNIT`] bytes.
//! Its [`Header`] lies at [`HEADER_OFFSET`]. A signature is an Ed25519 signature (RFC 8032) of the
//! SHA-512 digest of the image, beside it.
#![no_std]
#![forbid(unsafe_code)]

mod check;
mod header;

pub use check::{Check, Wrong};
pub use header::{
    BOARD_SIZE, HEADER_OFFSET, HEADER_SIZE, Header, HeaderError, KEY_SIZE, MAGIC, NO_KEY, version,
};
pub use host_protocol::{FirmwareVersion, IMAGE_UNIT as UNIT};

use crc::{CRC_32_ISCSI, Crc, NoTable};

/// Of a whole image: CRC-32C. Bit by bit: it is small.
pub const CHECKSUM: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISCSI);
