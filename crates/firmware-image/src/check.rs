//! Whether an image is whole, for its board, and signed.

use salty::{PublicKey, Sha512, Signature};

use crate::header::{HEADER_OFFSET, HEADER_SIZE, Header, KEY_SIZE, NO_KEY};
use crate::{CHECKSUM, FirmwareVersion, UNIT};

/// Why an image is not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrong {
    /// It is not what was announced, or not what its header says: its checksum, its length, its
    /// board or its version differ.
    Damaged,
    /// It is to be signed, and is not: with the key of the running one, or where that has none with
    /// its own.
    NotSigned,
}

/// Looks at an image as it is read, from its first byte on.
pub struct Check {
    length: usize,
    header: [u8; HEADER_SIZE],
    checksum: crc::Digest<'static, u32, crc::NoTable>,
    key: [u8; KEY_SIZE],
    hash: Sha512,
}

impl Check {
    /// `key`: that of the running image; [`NO_KEY`] where it has none.
    #[must_use]
    pub fn new(key: [u8; KEY_SIZE]) -> Self {
        static ALGORITHM: crc::Crc<u32, crc::NoTable> = CHECKSUM;
        Self {
            length: 0,
            header: [0; HEADER_SIZE],
            checksum: ALGORITHM.digest(),
            key,
            hash: Sha512::new(),
        }
    }

    /// The next bytes of the image.
    pub fn update(&mut self, bytes: &[u8]) {
        self.checksum.update(bytes);
        self.hash.update(bytes);
        for (at, byte) in (self.length..).zip(bytes) {
            let place = at.checked_sub(HEADER_OFFSET).and_then(|at| self.header.get_mut(at));
            place.into_iter().for_each(|place| *place = *byte);
        }
        self.length = self.length.saturating_add(bytes.len());
    }

    /// Whether the image is the one that was announced, and signed where it must be: whoever puts a
    /// key into a board has its other half. `signature`: 64 bytes, or none.
    ///
    /// # Errors
    /// Why it is not taken.
    pub fn finish(
        self,
        board: &str,
        version: FirmwareVersion,
        checksum: u32,
        signature: &[u8],
    ) -> Result<(), Wrong> {
        let header = Header::read(&self.header).map_err(|_| Wrong::Damaged)?;
        let is_announced = header.version == version && header.board() == board;
        let length =
            usize::try_from(header.length).ok().and_then(|n| n.checked_next_multiple_of(UNIT));
        let is_whole = length == Some(self.length);
        if self.checksum.finalize() != checksum || !is_announced || !is_whole {
            return Err(Wrong::Damaged);
        }
        let key = if self.key == NO_KEY { header.key } else { self.key };
        if key == NO_KEY {
            return Ok(());
        }
        if is_signed(&key, &self.hash.finalize(), signature) {
            Ok(())
        } else {
            Err(Wrong::NotSigned)
        }
    }
}

/// Whether it is the key's signature of the digest. Apart, so that its kilobyte of stack is taken
/// only while it works.
#[inline(never)]
fn is_signed(key: &[u8; KEY_SIZE], digest: &[u8], signature: &[u8]) -> bool {
    let Ok(signature) = <&[u8; 64]>::try_from(signature) else { return false };
    PublicKey::try_from(key)
        .is_ok_and(|key| key.verify(digest, &Signature::from(signature)).is_ok())
}
