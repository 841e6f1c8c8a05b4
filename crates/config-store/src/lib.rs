//! The configuration of the gateway in a NOR flash: the old one or the new one, whenever the power
//! fails.
//!
//! There are two areas. A save erases the one that does not count, writes the rows there and, last
//! of all, a head with a number that is higher by one: the area with the highest number counts. So
//! whatever a cut leaves of an erasure or of a word lies in the area that does not count. Each word
//! is written once after it was erased: chips with an error-correcting code allow no other.
//!
//! | An area | |
//! |---|---|
//! | 0 | the head, in whole words of up to 32 bytes |
//! | 32 | the head once more: there, and neither is whole, it was damaged later |
//! | 64 | the rows: number, length (u16), bytes; 0xFF behind the last |
//!
//! Where the power or the flash fails at the second head, the first is the only one, and a bit of
//! it that flips brings back the older area. The next start writes what is still erased of the
//! second head. A word of it that is torn cannot be written again: it stays so until the next save.
//!
//! A word whose write a loss of power has cut short may fail its error-correcting code. The driver
//! must hand out whatever is read then, and no error: the checksums tell.
#![no_std]
#![forbid(unsafe_code)]

use core::ops::Range;

use crc::{CRC_32_ISCSI, Crc, NoTable};
use embedded_storage_async::nor_flash::NorFlash;
use gateway::{Found, MAX_STORED_ROW, STORED_ROWS, SaveError, StoredState};

/// The version of the layout. It grows when what was stored before would be misread.
pub const LAYOUT: u8 = 1;

/// Layout, number, bytes of all rows, their checksum, the digest of the core, and the checksum of
/// these: one word of the longest.
const HEAD: usize = 1 + 4 + 4 + 4 + 4 + 4;
const MAX_WORD: usize = 32;
const SECOND_HEAD: u32 = 32;
const ROWS: u32 = 64;
/// Number and length of a row.
const ROW_HEAD: usize = 3;
const ERASED: u8 = 0xFF;
const _: () = assert!(STORED_ROWS <= ERASED as usize, "a row has a number");

/// Bit by bit: it is small.
static CHECKSUM: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISCSI);

/// Where the configuration is stored.
pub struct ConfigStore<S: NorFlash> {
    flash: S,
    areas: [u32; 2],
    /// Bytes of each.
    length: u32,
}

/// What the head says.
#[derive(Clone, Copy)]
struct Head {
    layout: u8,
    number: u32,
    length: u32,
    checksum: u32,
    digest: u32,
}

impl Head {
    fn to_bytes(self) -> [u8; MAX_WORD] {
        let mut bytes = [ERASED; MAX_WORD];
        let words = [self.number, self.length, self.checksum, self.digest];
        let fields = [self.layout].into_iter().chain(words.into_iter().flat_map(u32::to_le_bytes));
        bytes.iter_mut().zip(fields).for_each(|(place, byte)| *place = byte);
        let (said, rest) = bytes.split_at_mut(HEAD - 4);
        let check = CHECKSUM.checksum(said).to_le_bytes();
        rest.iter_mut().zip(check).for_each(|(place, byte)| *place = byte);
        bytes
    }

    fn from_bytes(bytes: &[u8; MAX_WORD]) -> Option<Self> {
        let (layout, rest) = bytes.split_first()?;
        let word = |index: usize| {
            let bytes = rest.get(4 * index..4 * index + 4)?;
            Some(u32::from_le_bytes(bytes.try_into().ok()?))
        };
        let said = bytes.get(..HEAD - 4)?;
        (CHECKSUM.checksum(said) == word(4)?).then_some(Self {
            layout: *layout,
            number: word(0)?,
            length: word(1)?,
            checksum: word(2)?,
            digest: word(3)?,
        })
    }
}

/// What counts.
enum Reading {
    Head { area: usize, head: Head },
    Nothing,
    Damaged,
}

impl<S: NorFlash> ConfigStore<S> {
    /// A store in whole pages of a flash: an even number of them.
    ///
    /// # Errors
    /// `range` is not that.
    pub fn new(flash: S, range: Range<u32>) -> Option<Self> {
        let pages = range.end.checked_sub(range.start)? / u32::try_from(S::ERASE_SIZE).ok()?;
        let length = pages / 2 * u32::try_from(S::ERASE_SIZE).ok()?;
        let fits = S::WRITE_SIZE <= MAX_WORD
            && length > ROWS
            && range.start + 2 * length == range.end
            && usize::try_from(range.start).ok()?.is_multiple_of(S::ERASE_SIZE);
        fits.then_some(Self { flash, areas: [range.start, range.start + length], length })
    }

    /// The flash, for what drives it.
    pub fn flash(&mut self) -> &mut S {
        &mut self.flash
    }

    /// What is stored. It writes what is missing of the second head, so it is for a start, when no
    /// axis is armed.
    pub async fn find(&mut self) -> Found {
        let (area, head) = match self.head().await {
            Reading::Nothing => return Err(StoredState::Nothing),
            Reading::Damaged => return Err(StoredState::Damaged),
            Reading::Head { area, head } => (area, head),
        };
        if head.layout != LAYOUT {
            return Err(StoredState::OtherLayout { layout: head.layout });
        }
        self.complete(area, head).await;
        if head.length == 0 {
            return Err(StoredState::Nothing);
        }
        let (mut at, mut digest) = (0, CHECKSUM.digest());
        while at < head.length {
            let mut bytes = [0; MAX_WORD];
            let count = (head.length - at).min(SECOND_HEAD);
            let bytes = bytes.get_mut(..count as usize).unwrap_or_default();
            if self.read(area, ROWS + at, bytes).await.is_err() {
                return Err(StoredState::Damaged);
            }
            digest.update(bytes);
            at += count;
        }
        if digest.finalize() == head.checksum { Ok(head.digest) } else { Err(StoredState::Damaged) }
    }

    /// The first row from `from` on: its number, and its bytes in `out`; nothing after the last.
    ///
    /// # Errors
    /// It cannot be read.
    #[allow(clippy::result_unit_err, reason = "there is one reason")]
    pub async fn next_row(
        &mut self,
        from: usize,
        out: &mut [u8; MAX_STORED_ROW],
    ) -> Result<Option<(usize, usize)>, ()> {
        let Reading::Head { area, head } = self.head().await else { return Err(()) };
        let mut at = 0;
        while at < head.length {
            let mut row = [0; ROW_HEAD];
            self.read(area, ROWS + at, &mut row).await?;
            let [number, low, high] = row;
            let length = u16::from_le_bytes([low, high]);
            at += 3;
            if usize::from(number) >= from {
                let bytes = out.get_mut(..length.into()).ok_or(())?;
                self.read(area, ROWS + at, bytes).await?;
                return Ok(Some((number.into(), length.into())));
            }
            at += u32::from(length);
        }
        Ok(None)
    }

    /// Stores a configuration: `row` writes each of the [`STORED_ROWS`] and returns its bytes. What
    /// was stored before is until this has ended well.
    ///
    /// # Errors
    /// It does not fit, or the flash fails.
    pub async fn save(
        &mut self,
        digest: u32,
        row: &mut dyn FnMut(usize, &mut [u8; MAX_STORED_ROW]) -> usize,
    ) -> Result<(), SaveError> {
        let (area, number) = self.begin().await?;
        let mut writer = Writer {
            store: self,
            area,
            length: 0,
            word: [ERASED; MAX_WORD],
            digest: CHECKSUM.digest(),
        };
        let mut bytes = [0; MAX_STORED_ROW];
        for index in 0..STORED_ROWS {
            let length = row(index, &mut bytes).min(MAX_STORED_ROW);
            let bytes = bytes.get(..length).unwrap_or_default();
            if !bytes.is_empty() {
                let [low, high, ..] = length.to_le_bytes();
                #[allow(clippy::cast_possible_truncation, reason = "below 0xFF")]
                writer.write(&[index as u8, low, high]).await?;
                writer.write(bytes).await?;
            }
        }
        let (length, checksum) = writer.end().await?;
        let head = Head { layout: LAYOUT, number, length, checksum, digest };
        self.write_head(area, head).await
    }

    /// Forgets the configuration.
    ///
    /// # Errors
    /// The flash fails.
    pub async fn forget(&mut self) -> Result<(), SaveError> {
        let (area, number) = self.begin().await?;
        let head = Head { layout: LAYOUT, number, length: 0, checksum: 0, digest: 0 };
        self.write_head(area, head).await
    }

    /// Erases the area that does not count; it, and the number that it will have.
    async fn begin(&mut self) -> Result<(usize, u32), SaveError> {
        let (area, number) = match self.head().await {
            Reading::Head { area, head } => (1 - area, head.number.wrapping_add(1)),
            Reading::Nothing | Reading::Damaged => (0, 0),
        };
        let from = self.areas[area];
        let erased = self.flash.erase(from, from + self.length).await;
        erased.map(|()| (area, number)).map_err(|_| SaveError::Failed)
    }

    async fn write_head(&mut self, area: usize, head: Head) -> Result<(), SaveError> {
        let bytes = head.to_bytes();
        let bytes = bytes.get(..HEAD.next_multiple_of(S::WRITE_SIZE)).ok_or(SaveError::Failed)?;
        let first = self.flash.write(self.areas[area], bytes).await;
        first.map_err(|_| SaveError::Failed)?;
        // From here on the area counts, with one head or with two.
        let _ = self.flash.write(self.areas[area] + SECOND_HEAD, bytes).await;
        Ok(())
    }

    /// Writes the words of the second head that are still erased.
    async fn complete(&mut self, area: usize, head: Head) {
        let (wanted, mut there) = (head.to_bytes(), [0; MAX_WORD]);
        let _ = self.read(area, SECOND_HEAD, &mut there).await;
        let begin = self.areas[area] + SECOND_HEAD;
        let words = wanted.chunks(S::WRITE_SIZE).zip(there.chunks(S::WRITE_SIZE));
        for (at, (word, is)) in (begin..).step_by(S::WRITE_SIZE).zip(words) {
            if word != is && is.iter().all(|byte| *byte == ERASED) {
                let _ = self.flash.write(at, word).await;
            }
        }
    }

    async fn head(&mut self) -> Reading {
        let mut newest = Reading::Nothing;
        for area in 0..self.areas.len() {
            let (mut bytes, mut found) = ([0; MAX_WORD], None);
            for at in [0, SECOND_HEAD] {
                if self.read(area, at, &mut bytes).await.is_err() {
                    bytes = [0; MAX_WORD];
                }
                found = found.or(Head::from_bytes(&bytes));
            }
            let is_newer =
                |head: &Head, than: &Head| head.number.wrapping_sub(than.number).cast_signed() > 0;
            newest = match (found, newest) {
                (Some(head), Reading::Head { head: older, area: other }) => {
                    let (area, head) =
                        if is_newer(&head, &older) { (area, head) } else { (other, older) };
                    Reading::Head { area, head }
                }
                (Some(head), _) => Reading::Head { area, head },
                (None, Reading::Nothing) if bytes.iter().any(|byte| *byte != ERASED) => {
                    Reading::Damaged
                }
                (None, newest) => newest,
            };
        }
        newest
    }

    async fn read(&mut self, area: usize, at: u32, bytes: &mut [u8]) -> Result<(), ()> {
        let length = u32::try_from(bytes.len()).map_err(|_| ())?;
        if at.checked_add(length).is_none_or(|end| end > self.length) {
            return Err(());
        }
        self.flash.read(self.areas[area] + at, bytes).await.map_err(|_| ())
    }
}

/// Gathers bytes to words.
struct Writer<'a, S: NorFlash> {
    store: &'a mut ConfigStore<S>,
    area: usize,
    /// Bytes so far.
    length: u32,
    word: [u8; MAX_WORD],
    digest: crc::Digest<'static, u32, NoTable>,
}

impl<S: NorFlash> Writer<'_, S> {
    async fn write(&mut self, bytes: &[u8]) -> Result<(), SaveError> {
        self.digest.update(bytes);
        for byte in bytes {
            let at = self.length as usize % S::WRITE_SIZE;
            if let Some(place) = self.word.get_mut(at) {
                *place = *byte;
            }
            self.length += 1;
            if at + 1 == S::WRITE_SIZE {
                self.flush().await?;
            }
        }
        Ok(())
    }

    /// Writes the word that ends here.
    async fn flush(&mut self) -> Result<(), SaveError> {
        let word = self.word.get(..S::WRITE_SIZE).ok_or(SaveError::Failed)?;
        let begin = (self.length as usize - 1) / S::WRITE_SIZE * S::WRITE_SIZE;
        #[allow(clippy::cast_possible_truncation, reason = "within an area")]
        let at = ROWS + begin as u32;
        if at as usize + S::WRITE_SIZE > self.store.length as usize {
            return Err(SaveError::Full);
        }
        let written = self.store.flash.write(self.store.areas[self.area] + at, word).await;
        self.word = [ERASED; MAX_WORD];
        written.map_err(|_| SaveError::Failed)
    }

    /// The bytes and their checksum.
    async fn end(mut self) -> Result<(u32, u32), SaveError> {
        if !(self.length as usize).is_multiple_of(S::WRITE_SIZE) {
            self.flush().await?;
        }
        Ok((self.length, self.digest.finalize()))
    }
}
