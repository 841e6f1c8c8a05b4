//! The names of the gateway, its buses and its axes. Nothing here goes by them: they are kept for
//! the hosts, by the rows of the [stored configuration](super::stored).

use super::Gateway;
use super::requests::Result;
use super::stored::{AXIS_ROWS, BUS_ROWS, STORED_ROWS};
use crate::each::Each;
use crate::filled::filled;
use core::fmt;
use core::ops::Range;
use heapless::Vec;
use host_protocol::{Error, MAX_NAME, Named, Subject, Text, is_name, replies, requests};
use serde::{Deserialize, Serialize, Serializer};

/// Words of a name.
pub(crate) const NAME_WORDS: usize = MAX_NAME / size_of::<u32>();

/// A name as words: its bytes, then zeros.
pub(crate) type NameWords = [u32; NAME_WORDS];

/// The name of each row; zeros where it has none. Made in its place by [`init`](Self::init): what
/// is made before passes over the stack.
#[derive(Clone, Deserialize)]
pub(crate) struct Names {
    of: Vec<NameWords, STORED_ROWS>,
}

impl Names {
    /// Into how many pieces a snapshot divides them.
    pub const PIECES: usize = 4;

    /// A piece of it in a snapshot. All, one behind the other, are what its `Deserialize` reads.
    pub fn piece<S: Serializer>(
        &self,
        piece: usize,
        to: S,
    ) -> core::result::Result<S::Ok, S::Error> {
        const THESE: usize = STORED_ROWS.div_ceil(Names::PIECES);
        let Names { of } = self;
        let these = Each(|| of.iter().skip(piece * THESE).take(THESE));
        if piece == 0 { (of.len(), these).serialize(to) } else { these.serialize(to) }
    }

    pub const fn new() -> Self {
        Self { of: Vec::new() }
    }

    /// No row has a name.
    pub fn init(&mut self) {
        // They are so many.
        let _ = self.of.resize(STORED_ROWS, NameWords::default());
    }

    /// The name of a row.
    pub fn words(&self, row: usize) -> NameWords {
        self.of.get(row).copied().unwrap_or_default()
    }

    /// Gives a row another name.
    pub fn set(&mut self, row: usize, words: NameWords) {
        if let Some(name) = self.of.get_mut(row) {
            *name = words;
        }
    }

    /// Gives a word of a name another value, and returns the one before.
    pub fn exchange(&mut self, row: usize, word: usize, bits: u32) -> u32 {
        let word = self.of.get_mut(row).and_then(|name| name.get_mut(word));
        word.map_or(bits, |word| core::mem::replace(word, bits))
    }

    fn text(&self, row: usize) -> Option<Text<MAX_NAME>> {
        text_of(self.words(row))
    }
}

impl fmt::Debug for Names {
    /// The rows that have one.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = self.of.iter().enumerate().filter(|(_, name)| **name != NameWords::default());
        f.debug_map().entries(rows).finish()
    }
}

/// The words of a name, or of none.
pub(crate) fn words_of(name: Option<&str>) -> NameWords {
    let bytes = name.unwrap_or("").as_bytes().chunks(size_of::<u32>());
    filled(bytes.map(|bytes| u32::from_le_bytes(filled(bytes.iter().copied()))))
}

/// The name that words are; nothing where they are none.
fn text_of(words: NameWords) -> Option<Text<MAX_NAME>> {
    let mut text = Text::new();
    for byte in words.iter().flat_map(|word| word.to_le_bytes()).filter(|byte| *byte != 0) {
        text.push(char::from(byte)).ok()?;
    }
    (is_name(&text) && words_of(Some(&text)) == words).then_some(text)
}

/// The row of what has a name.
fn row_of(of: Subject) -> usize {
    match of {
        Subject::Gateway => 0,
        Subject::Bus(bus) => BUS_ROWS.start + usize::from(bus),
        Subject::Axis(axis) => AXIS_ROWS.start + usize::from(axis),
    }
}

pub(super) fn subject_of(row: usize) -> Subject {
    let number = |first: usize| u8::try_from(row.saturating_sub(first)).unwrap_or(u8::MAX);
    if AXIS_ROWS.contains(&row) {
        Subject::Axis(number(AXIS_ROWS.start))
    } else if BUS_ROWS.contains(&row) {
        Subject::Bus(number(BUS_ROWS.start))
    } else {
        Subject::Gateway
    }
}

impl Gateway {
    /// Adds a name to the list of changes.
    pub(crate) fn add_name(&mut self, of: Subject, name: Option<&str>) -> Result<()> {
        match of {
            Subject::Gateway => {}
            Subject::Bus(bus) => drop(self.bus(bus)?),
            Subject::Axis(axis) => drop(self.axis(axis)?),
        }
        if name.is_some_and(|name| !is_name(name)) {
            return Err(Error::NotAName { of });
        }
        self.draft.set_name(&self.names, row_of(of), words_of(name))
    }

    /// Refuses names that have been given and cannot be.
    pub(crate) fn check_names(&self) -> Result<()> {
        for rows in [BUS_ROWS, AXIS_ROWS] {
            for index in self.draft.named(rows.clone()) {
                let row = rows.start + index;
                if self.names.words(row) != NameWords::default() {
                    self.check_name(row, &rows)?;
                }
            }
        }
        Ok(())
    }

    /// Whether there is what the row of these rows is, and no other of them has its name.
    fn check_name(&self, row: usize, rows: &Range<usize>) -> Result<()> {
        let of = subject_of(row);
        if !self.is_there(of) {
            return Err(match of {
                Subject::Axis(axis) => {
                    let parameter = host_protocol::AxisParameter::Bus.number();
                    Error::NotConfigured { axis, parameter }
                }
                Subject::Bus(bus) => Error::BusNotConfigured { bus },
                Subject::Gateway => return Ok(()),
            });
        }
        let same = |other: &usize| {
            *other != row
                && self.names.words(*other) == self.names.words(row)
                && self.is_there(subject_of(*other))
        };
        match rows.clone().find(same) {
            Some(other) => Err(Error::NameTaken { of, by: subject_of(other) }),
            None => Ok(()),
        }
    }

    /// Whether it is configured, so that it can have a name.
    fn is_there(&self, of: Subject) -> bool {
        match of {
            Subject::Gateway => true,
            Subject::Bus(bus) => self.bus(bus).is_ok_and(|bus| bus.config().is_some()),
            Subject::Axis(axis) => self.axis(axis).is_ok_and(|axis| !axis.config.is_empty()),
        }
    }

    /// What follows for names from changes that have been made: what is no longer there has none.
    pub(crate) fn take_names_over(&mut self) {
        for row in BUS_ROWS.chain(AXIS_ROWS) {
            if !self.is_there(subject_of(row)) {
                self.names.set(row, NameWords::default());
            }
        }
    }

    /// Takes over the name that something had before a reset, if it is one that it could be given.
    pub(crate) fn restore_name(&mut self, of: Subject, words: &[u32]) {
        let row = row_of(of);
        let words = NameWords::try_from(words).unwrap_or_default();
        if text_of(words).is_none() {
            return;
        }
        self.names.set(row, words);
        let rows = [BUS_ROWS, AXIS_ROWS].into_iter().find(|rows| rows.contains(&row));
        if rows.is_some_and(|rows| self.check_name(row, &rows).is_err()) {
            self.names.set(row, NameWords::default());
        }
    }

    /// The name of something.
    pub(crate) fn name_of(&self, of: Subject) -> Option<Text<MAX_NAME>> {
        self.names.text(row_of(of))
    }

    pub(crate) fn read_names(&self, request: requests::ReadNames) -> replies::NameList {
        let name = |row| Some(Named { of: subject_of(row), name: self.names.text(row)? });
        let mut named = (row_of(request.first)..STORED_ROWS).filter_map(name);
        let names = named.by_ref().take(replies::MAX_NAMES).collect();
        replies::NameList { names, next: named.next().map(|named| named.of) }
    }
}
