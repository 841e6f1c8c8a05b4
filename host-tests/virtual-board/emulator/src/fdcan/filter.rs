//! Acceptance filters: GFC, SIDFC, XIDFC, XIDAM and the filter lists in the message RAM.

use rigless::chip::can::{Frame, Id};
use serde::{Deserialize, Serialize};

use super::registers::{count, field, reset};
use crate::message_ram::MessageRam;

/// Most filters for 11-bit and for 29-bit ids.
const MAX_STANDARD: usize = 128;
const MAX_EXTENDED: usize = 64;
/// Words of a filter for 29-bit ids.
const EXTENDED_WORDS: usize = 2;

/// The registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Filters {
    /// GFC.
    pub global: u32,
    /// SIDFC.
    pub standard: u32,
    /// XIDFC.
    pub extended: u32,
    /// XIDAM.
    pub extended_mask: u32,
}

/// What becomes of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verdict {
    /// Where it goes.
    pub place: Place,
    /// The filter that matched, if one did.
    pub filter: Option<u8>,
    /// It is to be reported as of high priority.
    pub priority: bool,
}

/// Where a frame goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Receive FIFO 0 or 1.
    Fifo(usize),
    /// A dedicated receive buffer.
    Buffer(usize),
    /// Nowhere.
    Nowhere,
    /// A message of the debug unit, which this model does not have.
    Debug,
}

/// SFEC and EFEC: what a filter does with a frame that matches.
const DISABLED: u32 = 0b000;
const FIFO_0: u32 = 0b001;
const FIFO_1: u32 = 0b010;
const REJECT: u32 = 0b011;
const PRIORITY: u32 = 0b100;
const PRIORITY_FIFO_0: u32 = 0b101;
const PRIORITY_FIFO_1: u32 = 0b110;
/// SFT and EFT: how the two ids of a filter are meant.
const RANGE: u32 = 0b00;
const DUAL: u32 = 0b01;
const MASK: u32 = 0b10;
/// 11-bit: disabled; 29-bit: a range to which XIDAM does not apply.
const DISABLED_OR_RANGE: u32 = 0b11;

/// One filter, read from the RAM.
struct Filter {
    action: u32,
    kind: u32,
    first: u32,
    second: u32,
    extended: bool,
}

impl Filters {
    /// After a reset.
    pub const RESET: Self =
        Self { global: 0, standard: 0, extended: 0, extended_mask: reset::XIDAM };

    /// What becomes of a received frame. `taken`: the dedicated buffers with new data, one bit
    /// each: they match nothing.
    #[must_use]
    pub fn judge(&self, ram: &MessageRam, frame: &Frame, taken: u64) -> Verdict {
        let extended = frame.id.is_extended();
        let reject_remote = field(self.global, if extended { 0 } else { 1 }, 1) == 1;
        if frame.remote && reject_remote {
            return Verdict { place: Place::Nowhere, filter: None, priority: false };
        }
        let length = if extended {
            count(self.extended, 16, 7).min(MAX_EXTENDED)
        } else {
            count(self.standard, 16, 8).min(MAX_STANDARD)
        };
        (0..length)
            .find_map(|index| {
                let filter = self.filter(ram, index, extended)?;
                let (place, priority) = filter.act(frame.id, self.extended_mask, taken)?;
                Some(Verdict { place, filter: u8::try_from(index).ok(), priority })
            })
            .unwrap_or_else(|| self.without_match(extended))
    }

    fn without_match(&self, extended: bool) -> Verdict {
        let place = match field(self.global, if extended { 2 } else { 4 }, 2) {
            0b00 => Place::Fifo(0),
            0b01 => Place::Fifo(1),
            _ => Place::Nowhere,
        };
        Verdict { place, filter: None, priority: false }
    }

    fn filter(&self, ram: &MessageRam, index: usize, extended: bool) -> Option<Filter> {
        if extended {
            let start = count(self.extended, 2, 14) + index * EXTENDED_WORDS;
            let (first, second) = (ram.word(start)?, ram.word(start + 1)?);
            Some(Filter {
                action: field(first, 29, 3),
                kind: field(second, 30, 2),
                first: field(first, 0, 29),
                second: field(second, 0, 29),
                extended,
            })
        } else {
            let word = ram.word(count(self.standard, 2, 14) + index)?;
            Some(Filter {
                action: field(word, 27, 3),
                kind: field(word, 30, 2),
                first: field(word, 16, 11),
                second: field(word, 0, 11),
                extended,
            })
        }
    }
}

impl Filter {
    /// Where a frame with this id goes and whether with priority; `None` if the filter does not
    /// match.
    fn act(&self, id: Id, extended_mask: u32, taken: u64) -> Option<(Place, bool)> {
        match self.action {
            DISABLED => None,
            FIFO_0..=PRIORITY_FIFO_1 if !self.matches(id.value(), extended_mask) => None,
            FIFO_0 => Some((Place::Fifo(0), false)),
            FIFO_1 => Some((Place::Fifo(1), false)),
            REJECT => Some((Place::Nowhere, false)),
            PRIORITY => Some((Place::Nowhere, true)),
            PRIORITY_FIFO_0 => Some((Place::Fifo(0), true)),
            PRIORITY_FIFO_1 => Some((Place::Fifo(1), true)),
            // Into a dedicated buffer: the first id exactly, the second says which.
            _ if self.masked(id.value(), extended_mask) != self.first => None,
            _ if field(self.second, 9, 2) != 0 => Some((Place::Debug, false)),
            _ => {
                let buffer = count(self.second, 0, 6);
                (taken >> buffer & 1 == 0).then_some((Place::Buffer(buffer), false))
            }
        }
    }

    fn masked(&self, id: u32, extended_mask: u32) -> u32 {
        if self.extended && self.kind != DISABLED_OR_RANGE { id & extended_mask } else { id }
    }

    fn matches(&self, id: u32, extended_mask: u32) -> bool {
        let id = self.masked(id, extended_mask);
        let in_range = (self.first..=self.second).contains(&id);
        match self.kind {
            RANGE => in_range,
            DUAL => id == self.first || id == self.second,
            MASK => id & self.second == self.first & self.second,
            _ => self.extended && in_range,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standard(id: u16) -> Frame {
        Frame::data_frame(Id::Standard(id), &[])
    }

    fn extended(id: u32) -> Frame {
        Frame::data_frame(Id::Extended(id), &[])
    }

    /// Standard filters at word 0, extended ones at word 100.
    fn with(ram: &MessageRam, standard: &[u32], extended: &[[u32; 2]]) -> Filters {
        standard.iter().enumerate().for_each(|(index, word)| assert!(ram.set_word(index, *word)));
        for (index, word) in extended.as_flattened().iter().enumerate() {
            assert!(ram.set_word(100 + index, *word));
        }
        let count = |length: usize| u32::try_from(length).unwrap() << 16;
        Filters {
            global: 0x0000_0028, // nothing else passes
            standard: count(standard.len()),
            extended: count(extended.len()) | 100 << 2,
            extended_mask: 0x1FFF_FFFF,
        }
    }

    fn places(filters: &Filters, ram: &MessageRam, frames: &[Frame]) -> Vec<Place> {
        frames.iter().map(|frame| filters.judge(ram, frame, 0).place).collect()
    }

    const NOWHERE: Place = Place::Nowhere;

    #[test]
    fn frames_that_match_nothing_go_where_gfc_says() {
        let ram = MessageRam::new();
        let mut filters = Filters::RESET;
        assert_eq!(
            places(&filters, &ram, &[standard(1), extended(1)]),
            [Place::Fifo(0), Place::Fifo(0)]
        );
        filters.global = 0x0000_0014; // ANFS 1, ANFE 1
        assert_eq!(
            places(&filters, &ram, &[standard(1), extended(1)]),
            [Place::Fifo(1), Place::Fifo(1)]
        );
        filters.global = 0x0000_002C; // ANFS 2, ANFE 3
        assert_eq!(places(&filters, &ram, &[standard(1), extended(1)]), [NOWHERE, NOWHERE]);
    }

    #[test]
    fn remote_frames_are_rejected_per_format() {
        let ram = MessageRam::new();
        let remote =
            [Frame::remote_frame(Id::Standard(1), 0), Frame::remote_frame(Id::Extended(1), 0)];
        let mut filters = Filters::RESET;
        filters.global = 0x0000_0001; // RRFE
        assert_eq!(places(&filters, &ram, &remote), [Place::Fifo(0), NOWHERE]);
        filters.global = 0x0000_0002; // RRFS
        assert_eq!(places(&filters, &ram, &remote), [NOWHERE, Place::Fifo(0)]);
    }

    #[test]
    fn standard_filters_match_by_range_pair_and_mask_and_the_first_one_counts() {
        let ram = MessageRam::new();
        let filters = with(
            &ram,
            &[
                0x0910_011F, // range 0x110..=0x11F → FIFO 0
                0x5200_0300, // 0x200 or 0x300 → FIFO 1
                0x8C00_0700, // 0x400 under mask 0x700 → FIFO 0
                0x9C00_07FF, // 0x400 exactly → rejected, but the one before comes first
                0xC900_0100, // SFT 3: disabled
                0x0100_0100, // SFEC 0: disabled
            ],
            &[],
        );
        let frames = [0x10F, 0x110, 0x11F, 0x120, 0x200, 0x300, 0x250, 0x400, 0x4FF, 0x500, 0x100];
        let expected = [
            NOWHERE,
            Place::Fifo(0),
            Place::Fifo(0),
            NOWHERE,
            Place::Fifo(1),
            Place::Fifo(1),
            NOWHERE,
            Place::Fifo(0),
            Place::Fifo(0),
            NOWHERE,
            NOWHERE,
        ];
        assert_eq!(places(&filters, &ram, &frames.map(standard)), expected);
        assert_eq!(filters.judge(&ram, &standard(0x4FF), 0).filter, Some(2));
        assert_eq!(filters.judge(&ram, &standard(0x500), 0).filter, None);
    }

    #[test]
    fn extended_filters_apply_the_mask_of_all_but_in_their_fourth_kind() {
        let ram = MessageRam::new();
        let mut filters = with(
            &ram,
            &[],
            &[
                [0x2000_0100, 0x0000_01FF], // range 0x100..=0x1FF → FIFO 0
                [0x4000_5100, 0xC000_51FF], // the same above, without XIDAM → FIFO 1
            ],
        );
        let frames = [0x0000_0150, 0x0000_5150, 0x0000_0250].map(extended);
        assert_eq!(places(&filters, &ram, &frames), [Place::Fifo(0), Place::Fifo(1), NOWHERE]);
        filters.extended_mask = 0x0000_0FFF;
        assert_eq!(places(&filters, &ram, &frames), [Place::Fifo(0), Place::Fifo(0), NOWHERE]);
    }

    #[test]
    fn priority_is_reported_with_and_without_storing() {
        let ram = MessageRam::new();
        let filters = with(&ram, &[0x6123_0123, 0x6924_0124, 0x7125_0125], &[]);
        let verdicts = [0x123, 0x124, 0x125].map(|id| filters.judge(&ram, &standard(id), 0));
        assert!(verdicts.iter().all(|verdict| verdict.priority));
        assert_eq!(
            verdicts.map(|verdict| verdict.place),
            [NOWHERE, Place::Fifo(0), Place::Fifo(1)]
        );
    }

    #[test]
    fn a_dedicated_buffer_with_new_data_matches_nothing() {
        let ram = MessageRam::new();
        // 0x123 into buffer 5; what does not fit there, into FIFO 1.
        let filters = with(&ram, &[0x3923_0005, 0x9000_0000], &[]);
        assert_eq!(filters.judge(&ram, &standard(0x123), 0).place, Place::Buffer(5));
        assert_eq!(filters.judge(&ram, &standard(0x123), 1 << 5).place, Place::Fifo(1));
        assert_eq!(filters.judge(&ram, &standard(0x124), 0).place, Place::Fifo(1));
        assert!(ram.set_word(0, 0x3923_0205));
        assert_eq!(filters.judge(&ram, &standard(0x123), 0).place, Place::Debug);
    }
}
