//! The configuration of the gateway in a NOR flash: the old one or the new one, whenever the power
//! fails.
//!
//! There is room for two sets of rows, and a head that names the one that counts. A save writes the
//! rows of the other set, then the head, twice: the first is one item, which is old or new, and the
//! second keeps a head that has lost a bit from passing for one whose write was cut short, which
//! would have the set before it count again. Wear-levelling, checksums and
//! repair after a cut are those of `sequential-storage`. Each write goes to erased words, once: chips
//! with an error-correcting code allow no other.
//!
//! A word whose write a loss of power has cut short may fail its error-correcting code. The driver
//! must hand out whatever is read then, and no error: the checksum of the item tells.
#![no_std]
#![forbid(unsafe_code)]

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use gateway::{Found, MAX_STORED_ROW, STORED_ROWS, SaveError};
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

/// The version of the layout. It grows when what was stored before would be misread.
pub const LAYOUT: u8 = 1;

/// Of the heads, in the order in which they are written: behind the keys of both sets.
const HEAD_KEYS: [u8; 2] = [u8::MAX, u8::MAX - 1];
const SET_KEYS: u8 = 64;
const _: () = assert!(STORED_ROWS <= SET_KEYS as usize, "a set has a key for each row");
/// The head: layout, its number, set, the rows of it as bits, their digest.
const HEAD: usize = 1 + 1 + 1 + 8 + 4;
/// The longest item with its key, in whole words of any flash.
const BUFFER: usize = MAX_STORED_ROW + MAX_WORD;
const MAX_WORD: usize = 32;

type NoCache = Cache<Uncached, Uncached, Uncached, u8>;

/// Where the configuration is stored.
pub struct ConfigStore<S: NorFlash> {
    map: MapStorage<u8, S, NoCache>,
    /// The flash works in words of up to 32 bytes, and takes them from here.
    buffer: [u8; BUFFER],
}

/// What the head says.
#[derive(Clone, Copy)]
struct Head {
    /// One more than that of the head before, modulo 256.
    number: u8,
    set: u8,
    rows: u64,
    digest: u32,
}

enum Reading {
    Head(Head),
    Nothing,
    OtherLayout(u8),
    Damaged,
}

impl<S: NorFlash> ConfigStore<S> {
    /// A store in whole pages of a flash: at least two.
    ///
    /// # Errors
    /// `range` is not that.
    pub fn new(flash: S, range: Range<u32>) -> Option<Self> {
        let config = MapConfig::try_new(range).ok()?;
        let map = MapStorage::new(flash, config, Cache::new_uncached());
        Some(Self { map, buffer: [0; BUFFER] })
    }

    /// The flash, for what drives it.
    pub fn flash(&mut self) -> &mut S {
        self.map.flash()
    }

    /// What is stored.
    pub async fn find(&mut self) -> Found {
        match self.head().await {
            Reading::Head(Head { rows: 0, .. }) | Reading::Nothing => Found::Nothing,
            Reading::Head(head) => Found::Rows { digest: head.digest },
            Reading::OtherLayout(layout) => Found::OtherLayout { layout },
            Reading::Damaged => Found::Damaged,
        }
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
        let Reading::Head(head) = self.head().await else { return Err(()) };
        let Some(row) = (from..STORED_ROWS).find(|row| head.rows >> row & 1 == 1) else {
            return Ok(None);
        };
        let key = key(head.set, row);
        let Ok(Some(bytes)) = self.map.fetch_item::<&[u8]>(&mut self.buffer, &key).await else {
            return Err(());
        };
        out.get_mut(..bytes.len()).ok_or(())?.copy_from_slice(bytes);
        Ok(Some((row, bytes.len())))
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
        let next = self.next_head().await?;
        let (mut bytes, mut rows) = ([0; MAX_STORED_ROW], 0);
        for index in 0..STORED_ROWS {
            let length = row(index, &mut bytes);
            let bytes = bytes.get(..length).unwrap_or_default();
            if !bytes.is_empty() {
                rows |= 1 << index;
                self.store(key(next.set, index), bytes).await?;
            }
        }
        self.store_head(Head { rows, digest, ..next }).await
    }

    /// Forgets the configuration.
    ///
    /// # Errors
    /// The flash fails.
    pub async fn forget(&mut self) -> Result<(), SaveError> {
        let next = self.next_head().await?;
        self.store_head(next).await
    }

    /// The head of the set that does not count, with nothing in it. What this firmware cannot read
    /// is erased.
    async fn next_head(&mut self) -> Result<Head, SaveError> {
        let none = Head { number: 0, set: 0, rows: 0, digest: 0 };
        match self.head().await {
            Reading::Head(Head { number, set, .. }) => {
                Ok(Head { number: number.wrapping_add(1), set: 1 - set, ..none })
            }
            Reading::Nothing => Ok(none),
            Reading::OtherLayout(_) | Reading::Damaged => {
                self.map.erase_all().await.map(|()| none).map_err(|_| SaveError::Failed)
            }
        }
    }

    async fn store_head(&mut self, head: Head) -> Result<(), SaveError> {
        let [a, b, c, d, e, f, g, h] = head.rows.to_le_bytes();
        let [w, x, y, z] = head.digest.to_le_bytes();
        let bytes: [u8; HEAD] = [LAYOUT, head.number, head.set, a, b, c, d, e, f, g, h, w, x, y, z];
        for key in HEAD_KEYS {
            self.store(key, &bytes).await?;
        }
        Ok(())
    }

    async fn store(&mut self, key: u8, bytes: &[u8]) -> Result<(), SaveError> {
        let result = self.map.store_item(&mut self.buffer, &key, &bytes).await;
        result.map_err(|error| match error {
            sequential_storage::Error::FullStorage => SaveError::Full,
            _ => SaveError::Failed,
        })
    }

    /// The younger head of the two; of one alone, that.
    async fn head(&mut self) -> Reading {
        let [first, second] = HEAD_KEYS;
        match (self.head_at(first).await, self.head_at(second).await) {
            (Reading::Head(one), Reading::Head(other)) => {
                // A save writes both, so they are one apart at most.
                let is_younger = other.number == one.number.wrapping_add(1);
                Reading::Head(if is_younger { other } else { one })
            }
            (Reading::Nothing | Reading::Damaged, other @ Reading::Head(_))
            | (Reading::Nothing, other) => other,
            (one, _) => one,
        }
    }

    async fn head_at(&mut self, key: u8) -> Reading {
        let bytes = match self.map.fetch_item::<&[u8]>(&mut self.buffer, &key).await {
            Ok(Some(bytes)) => bytes,
            Ok(None) => return Reading::Nothing,
            Err(_) => return Reading::Damaged,
        };
        match *bytes {
            [LAYOUT, number, set @ 0..=1, a, b, c, d, e, f, g, h, w, x, y, z] => {
                Reading::Head(Head {
                    number,
                    set,
                    rows: u64::from_le_bytes([a, b, c, d, e, f, g, h]),
                    digest: u32::from_le_bytes([w, x, y, z]),
                })
            }
            [layout, ..] if layout != LAYOUT => Reading::OtherLayout(layout),
            _ => Reading::Damaged,
        }
    }
}

#[allow(clippy::cast_possible_truncation, reason = "below the keys of a set")]
fn key(set: u8, row: usize) -> u8 {
    set * SET_KEYS + row as u8
}
