//! Why a run failed: a text in retained RAM, read once by the run after it.

use core::fmt::{self, Write};

use crc::{CRC_32_ISCSI, Crc, NoTable};
use host_protocol::BootReason;
use static_cell::StaticCell;

use crate::retained::{self, CRASH_REPORT};
use crate::watchdog;

/// Longest text, bytes; what the host protocol can carry of it.
const MAX_TEXT: usize = 240;
const WORD_BYTES: usize = size_of::<u32>();
/// Words of a record: magic, length in bytes, CRC, text.
pub const RECORD_WORDS: usize = TEXT + MAX_TEXT / WORD_BYTES;
const MAGIC: usize = 0;
const LENGTH: usize = 1;
const CHECK: usize = 2;
const TEXT: usize = 3;
/// "LAST", in the order of the bytes in RAM.
const RECORDED: u32 = u32::from_le_bytes(*b"LAST");

/// What a run without configuration begins its text with.
const NO_CONFIGURATION: &str = "started without configuration, as start after start has failed: ";

/// Bit by bit: it is needed once in a run at most.
static CHECKSUM: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISCSI);

/// A text that ends where its room ends.
pub struct Text {
    bytes: [u8; MAX_TEXT],
    length: usize,
}

impl Text {
    const fn new() -> Self {
        Self { bytes: [0; MAX_TEXT], length: 0 }
    }

    fn as_str(&self) -> &str {
        self.bytes.get(..self.length).and_then(|text| str::from_utf8(text).ok()).unwrap_or_default()
    }
}

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = self.bytes.get_mut(self.length..).unwrap_or_default();
        let fits = text.floor_char_boundary(room.len());
        room.iter_mut().zip(text.bytes().take(fits)).for_each(|(place, byte)| *place = byte);
        self.length += fits;
        if fits == text.len() { Ok(()) } else { Err(fmt::Error) }
    }
}

fn check(text: &Text) -> u32 {
    let mut digest = CHECKSUM.digest();
    digest.update(&text.length.to_le_bytes());
    digest.update(&text.bytes);
    digest.finalize()
}

/// Keeps a text for the run after this one, cut where it is too long. From any context, after a
/// fault too.
pub fn keep(write: impl FnOnce(&mut Text) -> fmt::Result) {
    let mut text = Text::new();
    // An error says that it was cut.
    let _ = write(&mut text);
    // Half a record is none.
    retained::write(CRASH_REPORT, MAGIC, 0);
    let (words, _) = text.bytes.as_chunks::<WORD_BYTES>();
    for (index, word) in (TEXT..).zip(words) {
        retained::write(CRASH_REPORT, index, u32::from_le_bytes(*word));
    }
    retained::write(CRASH_REPORT, LENGTH, u32::try_from(text.length).unwrap_or(u32::MAX));
    retained::write(CRASH_REPORT, CHECK, check(&text));
    retained::write(CRASH_REPORT, MAGIC, RECORDED);
    retained::close();
}

/// Takes the crash report of the run before, or which loop failed to check in where the watchdog
/// ended it. Empty if there is none. Once, when the retained RAM has been started.
/// A run without configuration, after many that failed, says so first.
pub fn take(boot: BootReason, is_bare: bool) -> &'static str {
    static LAST: StaticCell<Text> = StaticCell::new();
    let mut text = recorded().unwrap_or(const { Text::new() });
    if text.length == 0 && boot == BootReason::Watchdog {
        let _ = watchdog::write_verdict(&mut text);
    }
    retained::write(CRASH_REPORT, MAGIC, 0);
    watchdog::forget();
    retained::close();
    if is_bare {
        let last = core::mem::replace(&mut text, Text::new());
        // An error says that it was cut.
        let _ = write!(text, "{NO_CONFIGURATION}{}", last.as_str());
    }
    LAST.init(text).as_str()
}

fn recorded() -> Option<Text> {
    let mut text = Text::new();
    let (words, _) = text.bytes.as_chunks_mut::<WORD_BYTES>();
    for (index, word) in (TEXT..).zip(words) {
        *word = retained::read(CRASH_REPORT, index).to_le_bytes();
    }
    text.length = usize::try_from(retained::read(CRASH_REPORT, LENGTH)).ok()?;
    let is_whole = retained::read(CRASH_REPORT, MAGIC) == RECORDED
        && text.length <= MAX_TEXT
        && retained::read(CRASH_REPORT, CHECK) == check(&text);
    is_whole.then_some(text)
}
