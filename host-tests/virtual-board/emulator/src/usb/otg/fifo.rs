//! The receive FIFO and the transmit FIFOs of the core.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// Words that the core keeps free in the receive FIFO for SETUP packets (RM0433, device FIFO
/// architecture: ten).
const KEPT_FOR_SETUP: usize = 10;
/// GRXSTSP: bytes, DATA0 or DATA1, and what it is.
const BCNT_SHIFT: u32 = 4;
const DPID_SHIFT: u32 = 15;
const PKTSTS_SHIFT: u32 = 17;
/// DPID of a packet with DATA1.
const DATA1: u32 = 2;

/// Bytes as words of the FIFO.
pub fn words(bytes: &[u8]) -> Vec<u32> {
    let word =
        |chunk: &[u8]| chunk.iter().rev().fold(0, |word: u32, byte| word << 8 | u32::from(*byte));
    bytes.chunks(4).map(word).collect()
}

/// A status word, and the words behind it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Entry {
    status: u32,
    data: Vec<u32>,
}

/// What was received, in order.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Receive {
    entries: VecDeque<Entry>,
    /// Of the entry whose status was popped.
    unread: VecDeque<u32>,
}

impl Receive {
    /// Words in use, one for each status too.
    fn used(&self) -> usize {
        self.entries.iter().map(|entry| 1 + entry.data.len()).sum::<usize>() + self.unread.len()
    }

    /// Whether a packet fits, with the status that ends its transfer, into so many words.
    pub fn has_room(&self, bytes: usize, words: usize) -> bool {
        self.used() + bytes.div_ceil(4) + 2 + KEPT_FOR_SETUP <= words
    }

    /// Whether a SETUP packet fits, with the status that ends its stage.
    pub fn has_room_for_setup(&self, words: usize) -> bool {
        self.used() + 4 <= words
    }

    /// A packet.
    pub fn push(&mut self, endpoint: usize, status: u32, data1: bool, bytes: &[u8]) {
        let count = u32::try_from(bytes.len()).expect("a packet");
        let dpid = if data1 { DATA1 } else { 0 };
        let status =
            number(endpoint) | count << BCNT_SHIFT | dpid << DPID_SHIFT | status << PKTSTS_SHIFT;
        self.entries.push_back(Entry { status, data: words(bytes) });
    }

    /// Whether GRXSTSP has something.
    pub fn is_filled(&self) -> bool {
        !self.entries.is_empty()
    }

    /// GRXSTSR.
    pub fn status(&self) -> u32 {
        self.entries.front().map_or(0, |entry| entry.status)
    }

    /// GRXSTSP: the next status, and whether the words of the one before had all been read.
    pub fn pop(&mut self) -> (u32, bool) {
        let clean = self.unread.is_empty();
        match self.entries.pop_front() {
            Some(Entry { status, data }) => {
                self.unread = data.into();
                (status, clean)
            }
            None => (0, clean),
        }
    }

    /// The next word of data.
    pub fn word(&mut self) -> Option<u32> {
        self.unread.pop_front()
    }

    /// Empties it.
    pub fn flush(&mut self) {
        *self = Self::default();
    }
}

/// The endpoint of a status word, and what it says.
pub fn endpoint_and_status(status: u32) -> (usize, u32) {
    ((status & 0xF) as usize, status >> PKTSTS_SHIFT & 0xF)
}

fn number(endpoint: usize) -> u32 {
    u32::try_from(endpoint).expect("one of nine")
}

/// What is to be sent by one endpoint.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Transmit {
    words: VecDeque<u32>,
}

impl Transmit {
    /// Words in it.
    pub fn used(&self) -> usize {
        self.words.len()
    }

    /// A word; false if there is no room in so many.
    pub fn push(&mut self, word: u32, depth: usize) -> bool {
        let fits = self.words.len() < depth;
        if fits {
            self.words.push_back(word);
        }
        fits
    }

    /// The first bytes, if they are all there.
    pub fn peek(&self, bytes: usize) -> Option<Vec<u8>> {
        let found: Vec<u8> = self
            .words
            .iter()
            .take(bytes.div_ceil(4))
            .flat_map(|word| word.to_le_bytes())
            .take(bytes)
            .collect();
        (found.len() == bytes).then_some(found)
    }

    /// They have been sent.
    pub fn drop_bytes(&mut self, bytes: usize) {
        self.words.drain(..bytes.div_ceil(4).min(self.words.len()));
    }

    /// Empties it.
    pub fn flush(&mut self) {
        self.words.clear();
    }
}
