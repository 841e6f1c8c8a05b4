//! The header of an image.

use core::fmt;

use host_protocol::FirmwareVersion;

/// Where it lies in the image: behind the longest vector table.
pub const HEADER_OFFSET: usize = 0x300;
/// Its bytes.
pub const HEADER_SIZE: usize = 64;
/// Bytes of a board's name, zeros behind it.
pub const BOARD_SIZE: usize = 16;
/// Bytes of a public key.
pub const KEY_SIZE: usize = 32;
/// The key of an image that takes unsigned ones.
pub const NO_KEY: [u8; KEY_SIZE] = [0; KEY_SIZE];

/// What it begins with. The linker puts the length behind it.
pub const MAGIC: [u8; 4] = *b"MGWi";
const LAYOUT: u16 = 1;

/// What an image says of itself.
///
/// | Bytes | |
/// |---|---|
/// | 0 | `MGWi` |
/// | 4 | bytes of the image, u32 |
/// | 8 | layout, u16: 1 |
/// | 10 | version: major, minor, patch, each u16 |
/// | 16 | name of its board, zeros behind it |
/// | 32 | Ed25519 public key of those whose images it takes; zeros: it takes unsigned ones too |
///
/// Numbers are little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Bytes of the image.
    pub length: u32,
    /// The version of the firmware.
    pub version: FirmwareVersion,
    board: [u8; BOARD_SIZE],
    /// The Ed25519 public key of those whose images it takes; [`NO_KEY`]: unsigned ones too.
    pub key: [u8; KEY_SIZE],
}

/// Why bytes are no header that this program can read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeaderError {
    /// There is none: this is no image of the gateway's firmware.
    Missing,
    /// It has a layout that is not known here.
    OtherLayout {
        /// The layout.
        layout: u16,
    },
}

impl fmt::Display for HeaderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.write_str("it has no header of the gateway's firmware"),
            Self::OtherLayout { layout } => {
                write!(f, "its header has layout {layout}, and {LAYOUT} is known here")
            }
        }
    }
}

impl core::error::Error for HeaderError {}

impl Header {
    /// Of an image without a length for a board, of whose name the first 16 bytes count.
    #[must_use]
    pub const fn new(version: FirmwareVersion, board: &str, key: [u8; KEY_SIZE]) -> Self {
        Self { length: 0, version, board: put([0; BOARD_SIZE], 0, board.as_bytes()), key }
    }

    /// The same of an image with so many bytes.
    #[must_use]
    pub const fn with_length(self, length: u32) -> Self {
        Self { length, ..self }
    }

    /// The name of its board; empty where it is no text.
    #[must_use]
    pub fn board(&self) -> &str {
        let name = self.board.split(|byte| *byte == 0).next().unwrap_or_default();
        core::str::from_utf8(name).unwrap_or_default()
    }

    /// Whether it takes only images with a signature of its key.
    #[must_use]
    pub fn has_key(&self) -> bool {
        self.key != NO_KEY
    }

    /// Its bytes.
    #[must_use]
    pub const fn to_bytes(&self) -> [u8; HEADER_SIZE] {
        let FirmwareVersion { major, minor, patch } = self.version;
        let bytes = put([0; HEADER_SIZE], 0, &MAGIC);
        let bytes = put(bytes, 4, &self.length.to_le_bytes());
        let bytes = put(bytes, 8, &LAYOUT.to_le_bytes());
        let bytes = put(bytes, 10, &major.to_le_bytes());
        let bytes = put(bytes, 12, &minor.to_le_bytes());
        let bytes = put(bytes, 14, &patch.to_le_bytes());
        put(put(bytes, 16, &self.board), 32, &self.key)
    }

    /// Reads the header of bytes that are one.
    ///
    /// # Errors
    /// They are none, or of another layout.
    pub fn read(bytes: &[u8; HEADER_SIZE]) -> Result<Self, HeaderError> {
        let Some(rest) = bytes.strip_prefix(&MAGIC) else { return Err(HeaderError::Missing) };
        let (length, rest) = rest.split_first_chunk().ok_or(HeaderError::Missing)?;
        let (words, rest) = rest.split_first_chunk::<8>().ok_or(HeaderError::Missing)?;
        let (board, rest) = rest.split_first_chunk().ok_or(HeaderError::Missing)?;
        let key = rest.first_chunk().ok_or(HeaderError::Missing)?;
        let [l0, l1, j0, j1, n0, n1, p0, p1] = *words;
        let layout = u16::from_le_bytes([l0, l1]);
        if layout != LAYOUT {
            return Err(HeaderError::OtherLayout { layout });
        }
        let version = FirmwareVersion {
            major: u16::from_le_bytes([j0, j1]),
            minor: u16::from_le_bytes([n0, n1]),
            patch: u16::from_le_bytes([p0, p1]),
        };
        Ok(Self { length: u32::from_le_bytes(*length), version, board: *board, key: *key })
    }

    /// Reads the header of a whole image.
    ///
    /// # Errors
    /// There is none, or one of another layout.
    pub fn of_image(image: &[u8]) -> Result<Self, HeaderError> {
        let bytes = image.get(HEADER_OFFSET..).and_then(<[u8]>::first_chunk);
        Self::read(bytes.ok_or(HeaderError::Missing)?)
    }
}

/// The version that a text begins with: `1.2.3`, as a package has it. What is no number counts as
/// 0.
#[must_use]
pub const fn version(text: &str) -> FirmwareVersion {
    let (mut numbers, mut number, mut rest) = ([0u16; 3], 0, text.as_bytes());
    while let [byte, others @ ..] = rest {
        match byte {
            b'0'..=b'9' => {
                let digit = (*byte - b'0') as u16;
                numbers[number] = numbers[number].saturating_mul(10).saturating_add(digit);
            }
            b'.' if number < 2 => number += 1,
            _ => break,
        }
        rest = others;
    }
    let [major, minor, patch] = numbers;
    FirmwareVersion { major, minor, patch }
}

/// Bytes with a part of them replaced, as far as it fits.
const fn put<const N: usize>(mut bytes: [u8; N], at: usize, part: &[u8]) -> [u8; N] {
    let mut number = 0;
    while number < part.len() && at + number < N {
        bytes[at + number] = part[number];
        number += 1;
    }
    bytes
}
