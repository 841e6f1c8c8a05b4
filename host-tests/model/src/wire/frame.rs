//! Frames of the host protocol: COBS between zeros, a header of five bytes, CRC-32C (PROTOCOL.md,
//! Frames).

/// Most bytes of a message.
const MAX_MESSAGE: usize = 512;
/// Header and checksum.
const MIN_MESSAGE: usize = 9;

/// What a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// From a host.
    Request,
    /// A result.
    Reply,
    /// A result too.
    Error,
    /// Unasked.
    Event,
    /// From a host, for a program of its that only watches.
    WatcherRequest,
}

/// A message whose checksum is right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// What it is.
    pub kind: Kind,
    /// Its sequence number.
    pub sequence: u16,
    /// Which request, reply, error or event.
    pub number: u16,
    /// Header, body and checksum: the whole message tells it from another.
    pub bytes: Vec<u8>,
}

impl Message {
    /// The fields.
    pub fn body(&self) -> &[u8] {
        &self.bytes[5..self.bytes.len() - 4]
    }

    fn read(bytes: Vec<u8>) -> Option<Self> {
        if !(MIN_MESSAGE..=MAX_MESSAGE).contains(&bytes.len()) {
            return None;
        }
        let (text, sum) = bytes.split_at(bytes.len() - 4);
        if crc32c(text).to_le_bytes() != sum {
            return None;
        }
        let kind = match text[0] {
            1 => Kind::Request,
            2 => Kind::Reply,
            3 => Kind::Error,
            4 => Kind::Event,
            5 => Kind::WatcherRequest,
            _ => return None,
        };
        let word = |at: usize| u16::from_le_bytes([text[at], text[at + 1]]);
        Some(Self { kind, sequence: word(1), number: word(3), bytes })
    }
}

/// Collects the bytes between two zeros.
#[derive(Debug, Clone, Default)]
pub struct Deframer(Vec<u8>);

impl Deframer {
    /// The message that this byte ends, if it is one.
    pub fn push(&mut self, byte: u8) -> Option<Message> {
        if byte != 0 {
            // What is longer than any frame is kept long enough to be none.
            if self.0.len() <= 2 * MAX_MESSAGE {
                self.0.push(byte);
            }
            return None;
        }
        let text = std::mem::take(&mut self.0);
        if text.is_empty() { None } else { Message::read(uncobs(&text)?) }
    }
}

/// Undoes COBS; `None` where the last block is not complete.
fn uncobs(text: &[u8]) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len());
    let mut rest = text;
    while let Some((code, after)) = rest.split_first() {
        let length = usize::from(*code) - 1;
        if after.len() < length {
            return None;
        }
        let (block, next) = after.split_at(length);
        out.extend_from_slice(block);
        if *code != 0xFF && !next.is_empty() {
            out.push(0);
        }
        rest = next;
    }
    Some(out)
}

/// The frame of a message: for those who write traces by hand.
pub fn frame(kind: u8, sequence: u16, number: u16, body: &[u8]) -> Vec<u8> {
    let mut text = vec![kind];
    text.extend(sequence.to_le_bytes());
    text.extend(number.to_le_bytes());
    text.extend(body);
    text.extend(crc32c(&text).to_le_bytes());
    let mut out = vec![0];
    let mut block = Vec::new();
    for byte in text {
        if byte != 0 {
            block.push(byte);
        }
        if byte == 0 || block.len() == 254 {
            out.push(u8::try_from(block.len() + 1).unwrap_or(u8::MAX));
            out.append(&mut block);
        }
    }
    out.push(u8::try_from(block.len() + 1).unwrap_or(u8::MAX));
    out.append(&mut block);
    out.push(0);
    out
}

/// CRC-32 Castagnoli, reflected, initial value and final XOR of ones.
fn crc32c(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = table();
    let step = |sum: u32, byte: &u8| TABLE[usize::from(sum.to_le_bytes()[0] ^ byte)] ^ (sum >> 8);
    !bytes.iter().fold(u32::MAX, step)
}

const fn table() -> [u32; 256] {
    const REFLECTED_1EDC6F41: u32 = 0x82F6_3B78;
    let mut table = [0; 256];
    let mut index = 0;
    while index < 256 {
        #[allow(clippy::cast_possible_truncation)] // below 256
        let mut value = index as u32;
        let mut bit = 0;
        while bit < 8 {
            value = if value & 1 == 1 { (value >> 1) ^ REFLECTED_1EDC6F41 } else { value >> 1 };
            bit += 1;
        }
        table[index] = value;
        index += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_of_the_nine_digits() {
        assert_eq!(crc32c(b"123456789"), 0xE306_9283); // PROTOCOL.md, Frames
    }

    #[test]
    fn the_printed_ping_is_read_and_written() {
        let ping = [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x87, 0x00];
        let mut deframer = Deframer::default();
        let read: Vec<_> = ping.iter().filter_map(|byte| deframer.push(*byte)).collect();
        assert_eq!((read[0].kind, read[0].sequence, read[0].number), (Kind::Request, 1, 2));
        assert_eq!(frame(1, 1, 2, &[]), ping);
        let wrong = [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x88, 0x00];
        assert!(wrong.iter().all(|byte| deframer.push(*byte).is_none()));
    }
}
