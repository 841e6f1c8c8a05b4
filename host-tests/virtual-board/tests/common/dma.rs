//! What comes of a DMA buffer that lies where DMA does not reach.

use std::ops::Range;

use host_protocol::MAX_FRAME;
use virtual_board::machine::Machine;

const WORD_BYTES: usize = 4;

/// Has the firmware take memory at `to` for its messages to hosts, as if it had been linked so:
/// changes every place in its `data` that names such a buffer in the region of DMA.
pub fn misplace_messages(machine: &mut Machine, data: Range<u64>, region: Range<u32>, to: u32) {
    let length = usize::try_from(data.end - data.start).expect("a memory");
    let bytes = machine.read_memory(data.start, length);
    let words: Vec<u32> =
        bytes.as_chunks::<WORD_BYTES>().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
    // A reference to bytes is their address and their number.
    let names = |at: &usize| {
        region.contains(&words[*at]) && usize::try_from(words[at + 1]) == Ok(MAX_FRAME)
    };
    let places: Vec<usize> = (0..words.len() - 1).filter(names).collect();
    assert!(!places.is_empty(), "the firmware has no such buffer");
    for at in places {
        machine.write_memory(data.start + (at * WORD_BYTES) as u64, &to.to_le_bytes());
    }
}
