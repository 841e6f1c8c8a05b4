//! Where frames lie in the message RAM of a controller, in words from the start of its part.
//!
//! On a chip with a RAM of fixed layout this is that layout (RM0440, FDCAN chapter, message RAM);
//! where the layout can be chosen the driver chooses the same, at an offset of its own for each
//! controller.

use embassy_stm32::pac::common::{RW, Reg};

use super::element::FRAME_WORDS;

/// Frames in each receive FIFO, places to transmit from, entries of the event FIFO.
const PER_QUEUE: usize = 3;
/// Words of a frame's place, room for 64 bytes of data.
const PLACE_WORDS: usize = 18;
/// Words of an entry of the transmit event FIFO.
const EVENT_WORDS: usize = 2;
/// 28 filters for 11-bit ids of one word, 8 for 29-bit ids of two.
const FILTER_WORDS: usize = 28 + 8 * 2;

const RECEIVE_START: usize = FILTER_WORDS;
/// After two receive FIFOs.
const EVENT_START: usize = RECEIVE_START + 2 * PER_QUEUE * PLACE_WORDS;
const TRANSMIT_START: usize = EVENT_START + PER_QUEUE * EVENT_WORDS;
const END: usize = TRANSMIT_START + PER_QUEUE * PLACE_WORDS;
const _: () = assert!(END == 212);

/// Transmit places; one bit each in the registers.
pub const TRANSMIT_PLACES: usize = PER_QUEUE;

/// One controller's part of the message RAM.
#[derive(Clone, Copy)]
pub struct MessageRam {
    start: *mut u32,
}

// Safety: an address of hardware, good in any context.
unsafe impl Send for MessageRam {}

impl MessageRam {
    /// # Safety
    ///
    /// From `start` on 212 words belong to one controller.
    pub const unsafe fn new(start: *mut u32) -> Self {
        Self { start }
    }

    fn word(self, index: usize) -> Reg<u32, RW> {
        assert!(index < END);
        // Safety: inside the controller's part.
        unsafe { Reg::from_ptr(self.start.add(index)) }
    }

    /// The frame at a place of the first receive FIFO, below 3.
    pub fn received(self, place: usize) -> [u32; FRAME_WORDS] {
        let start = RECEIVE_START + place * PLACE_WORDS;
        core::array::from_fn(|offset| self.word(start + offset).read())
    }

    /// The second word of an entry of the transmit event FIFO, below 3.
    pub fn event(self, entry: usize) -> u32 {
        self.word(EVENT_START + entry * EVENT_WORDS + 1).read()
    }

    /// Puts a frame into a transmit place, below 3.
    pub fn put(self, place: usize, frame: [u32; FRAME_WORDS]) {
        let start = TRANSMIT_START + place * PLACE_WORDS;
        for (offset, word) in frame.into_iter().enumerate() {
            self.word(start + offset).write_value(word);
        }
    }
}
