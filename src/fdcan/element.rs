//! Frames as they lie in the message RAM of an FDCAN controller (RM0433 and RM0440, FDCAN chapter,
//! message RAM).

use embedded_can::{ExtendedId, Frame as _, Id, StandardId};
use host_protocol::CanFrame;

/// Words of a frame of at most 8 bytes: two of header, two of data.
pub const FRAME_WORDS: usize = 4;

/// First word: bit 30 marks a 29-bit id, bit 29 a remote frame; an 11-bit id lies in bits 28..18.
const EXTENDED: u32 = 1 << 30;
const REMOTE: u32 = 1 << 29;
const EXTENDED_ID_MASK: u32 = 0x1FFF_FFFF;
const STANDARD_ID_SHIFT: u32 = 18;
const STANDARD_ID_MASK: u32 = 0x7FF;

/// Second word: data length in bits 19..16.
const LENGTH_SHIFT: u32 = 16;
const LENGTH_MASK: u32 = 0xF;
/// Second word to send: bit 23 asks for an entry in the transmit event FIFO, bits 31..24 are
/// repeated there.
const STORE_EVENT: u32 = 1 << 23;
const MARKER_SHIFT: u32 = 24;

/// A frame to send, whose transmission is to be recorded under `marker`.
pub fn to_send(frame: &CanFrame, marker: u8) -> [u32; FRAME_WORDS] {
    let id = match frame.id() {
        Id::Standard(id) => u32::from(id.as_raw()) << STANDARD_ID_SHIFT,
        Id::Extended(id) => id.as_raw() | EXTENDED,
    };
    let remote = if frame.is_remote_frame() { REMOTE } else { 0 };
    // At most 8, so the fallback is never taken.
    let length = u32::try_from(frame.dlc()).unwrap_or(0);
    let [a, b, c, d, e, f, g, h] = frame.padded();
    [
        id | remote,
        u32::from(marker) << MARKER_SHIFT | STORE_EVENT | length << LENGTH_SHIFT,
        u32::from_le_bytes([a, b, c, d]),
        u32::from_le_bytes([e, f, g, h]),
    ]
}

/// A frame that was received. Never `None` for what a controller stores.
pub fn received([id_word, length_word, low, high]: [u32; FRAME_WORDS]) -> Option<CanFrame> {
    let id = if id_word & EXTENDED != 0 {
        Id::Extended(ExtendedId::new(id_word & EXTENDED_ID_MASK)?)
    } else {
        Id::Standard(StandardId::new(
            u16::try_from(id_word >> STANDARD_ID_SHIFT & STANDARD_ID_MASK).ok()?,
        )?)
    };
    // A classic frame may announce up to 15 and carries 8.
    let length = u8::try_from(length_word >> LENGTH_SHIFT & LENGTH_MASK).ok()?.min(8);
    if id_word & REMOTE != 0 {
        return CanFrame::remote_frame(id, length);
    }
    let data = [low.to_le_bytes(), high.to_le_bytes()];
    CanFrame::data_frame(id, data.as_flattened().get(..usize::from(length))?)
}

/// The marker of an entry of the transmit event FIFO, from its second word.
pub fn event_marker(word: u32) -> u8 {
    let [.., marker] = word.to_le_bytes();
    marker
}
