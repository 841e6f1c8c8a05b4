//! Elements of the message RAM: frames to send, received frames, events of sent frames, as words.
//!
//! Layout after embassy-stm32 0.6.0, `can/fd/message_ram`, and the register descriptions of the
//! M_CAN.

use rigless::chip::can::{Frame, Id};

use super::registers::field;
use crate::message_ram::MessageRam;

const EXTENDED: u32 = 1 << 30;
const REMOTE: u32 = 1 << 29;
const STANDARD_SHIFT: u32 = 18;
const DLC_SHIFT: u32 = 16;
/// To send: an event is to be stored.
const STORE_EVENT: u32 = 1 << 23;
const MARKER_SHIFT: u32 = 24;
/// Received: no filter matched.
const NON_MATCHING: u32 = 1 << 31;
const FILTER_SHIFT: u32 = 24;
/// Event: its type.
const EVENT_TYPE_SHIFT: u32 = 22;

/// Words of an event.
pub const EVENT_WORDS: usize = 2;

/// A frame in a transmit buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outgoing {
    /// The frame.
    pub frame: Frame,
    /// MM, EFC: the marker with which an event is to be stored.
    pub event_marker: Option<u8>,
}

/// Why an event was stored: the codes of ET.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventType {
    /// Sent.
    Sent = 0b01,
    /// Sent although it was to be cancelled.
    SentInSpiteOfCancellation = 0b10,
}

/// The frame in the transmit buffer at `start`; `None` beyond the end of the RAM.
pub fn outgoing(ram: &MessageRam, start: usize) -> Option<Outgoing> {
    let (first, second) = (ram.word(start)?, ram.word(start + 1)?);
    let id = if first & EXTENDED != 0 {
        Id::Extended(field(first, 0, 29))
    } else {
        Id::Standard(u16::try_from(field(first, STANDARD_SHIFT, 11)).expect("11 bits"))
    };
    let dlc = u8::try_from(field(second, DLC_SHIFT, 4)).expect("4 bits");
    let frame = if first & REMOTE != 0 {
        Frame::remote_frame(id, dlc)
    } else {
        let (low, high) = (ram.word(start + 2)?, ram.word(start + 3)?);
        let mut data = [0; 8];
        data[..4].copy_from_slice(&low.to_le_bytes());
        data[4..].copy_from_slice(&high.to_le_bytes());
        // Bytes beyond the length are not sent.
        data.iter_mut().skip(usize::from(dlc)).for_each(|byte| *byte = 0);
        Frame { id, remote: false, dlc, data }
    };
    let marker = u8::try_from(second >> MARKER_SHIFT).expect("8 bits");
    Some(Outgoing { frame, event_marker: (second & STORE_EVENT != 0).then_some(marker) })
}

/// Stores a received frame at `start`: its header and as many words as its data fill. False beyond
/// the end.
pub fn store_received(
    ram: &MessageRam,
    start: usize,
    frame: &Frame,
    filter: Option<u8>,
    timestamp: u16,
) -> bool {
    let matched = filter.map_or(NON_MATCHING, |filter| u32::from(filter) << FILTER_SHIFT);
    let header =
        [identifier(frame), matched | u32::from(frame.dlc) << DLC_SHIFT | u32::from(timestamp)];
    let mut words = header.to_vec();
    for chunk in frame.payload().chunks(4) {
        let mut bytes = [0; 4];
        bytes[..chunk.len()].copy_from_slice(chunk);
        words.push(u32::from_le_bytes(bytes));
    }
    (start..).zip(words).all(|(index, word)| ram.set_word(index, word))
}

/// Stores the event of a sent frame at `start`. False beyond the end.
pub fn store_event(
    ram: &MessageRam,
    start: usize,
    sent: &Frame,
    marker: u8,
    kind: EventType,
    timestamp: u16,
) -> bool {
    let second = u32::from(marker) << MARKER_SHIFT
        | (kind as u32) << EVENT_TYPE_SHIFT
        | u32::from(sent.dlc) << DLC_SHIFT
        | u32::from(timestamp);
    ram.set_word(start, identifier(sent)) && ram.set_word(start + 1, second)
}

fn identifier(frame: &Frame) -> u32 {
    let id = match frame.id {
        Id::Standard(id) => u32::from(id) << STANDARD_SHIFT,
        Id::Extended(id) => id | EXTENDED,
    };
    if frame.remote { id | REMOTE } else { id }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_read_from_its_words() {
        let ram = MessageRam::new();
        for (index, word) in
            [0x0504_0000, 0xA583_0000, 0x4433_2211, 0x8877_6655].into_iter().enumerate()
        {
            assert!(ram.set_word(10 + index, word));
        }
        let expected = Frame::data_frame(Id::Standard(0x141), &[0x11, 0x22, 0x33]);
        assert_eq!(
            outgoing(&ram, 10),
            Some(Outgoing { frame: expected, event_marker: Some(0xA5) })
        );
        assert!(ram.set_word(10, 0x7234_5678));
        assert!(ram.set_word(11, 0x0002_0000));
        let expected = Frame::remote_frame(Id::Extended(0x1234_5678), 2);
        assert_eq!(outgoing(&ram, 10), Some(Outgoing { frame: expected, event_marker: None }));
        assert_eq!(outgoing(&ram, 2559), None);
    }

    #[test]
    fn a_received_frame_takes_the_words_of_its_data() {
        let ram = MessageRam::new();
        assert!(ram.set_word(3, 0xDEAD_BEEF));
        let frame = Frame::data_frame(Id::Standard(0x7FF), &[1, 2]);
        assert!(store_received(&ram, 0, &frame, Some(5), 0x1234));
        let words: Vec<_> = (0..4).map(|index| ram.word(index).unwrap()).collect();
        assert_eq!(words, [0x1FFC_0000, 0x0502_1234, 0x0000_0201, 0xDEAD_BEEF]);
        assert!(store_received(&ram, 0, &Frame::remote_frame(Id::Extended(1), 8), None, 0));
        assert_eq!((ram.word(0), ram.word(1)), (Some(0x6000_0001), Some(0x8008_0000)));
        assert!(!store_received(&ram, 2559, &frame, None, 0));
    }

    #[test]
    fn an_event_repeats_id_marker_and_length() {
        let ram = MessageRam::new();
        let frame = Frame::data_frame(Id::Standard(0x141), &[0; 8]);
        assert!(store_event(&ram, 0, &frame, 7, EventType::Sent, 0xBEEF));
        assert_eq!((ram.word(0), ram.word(1)), (Some(0x0504_0000), Some(0x0748_BEEF)));
    }
}
