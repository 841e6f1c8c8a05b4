//! A UART receiver that looks at the levels of a line: what it makes of a sender at another rate is
//! garbage, as on a real line.

use serde::{Deserialize, Serialize};

/// Start bit, eight data bits, stop bit.
pub(crate) const BITS_PER_BYTE: u64 = 10;
/// Data bits.
const DATA_BITS: u8 = 8;

/// A byte that the receiver made out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Sampled {
    /// When its start bit began, ps.
    pub(super) start_ps: u64,
    pub(super) byte: u8,
    /// Its stop bit was low.
    pub(super) damaged: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum State {
    /// The line rests; a falling edge is a start bit.
    Idle,
    /// After a byte without a stop bit: the line must rise first.
    Low,
    /// In a byte, `taken` of its bits after the start bit seen.
    Byte { start_ps: u64, taken: u8, byte: u8 },
}

/// The receiver: no parity, one stop bit. Each bit is looked at once, in its middle.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Sampler {
    bit_ps: u64,
    /// Up to when it has seen the line.
    seen_ps: u64,
    state: State,
}

impl Sampler {
    /// A receiver on a resting line. `bit_ps`: what it takes for a bit, picoseconds, not 0.
    pub(super) fn new(bit_ps: u64) -> Self {
        Self { bit_ps, seen_ps: 0, state: State::Idle }
    }

    /// The line rests up to `start_ps`, then a byte is on it whose bits last `bit_ps` each. What
    /// the receiver completes goes to `out`. A byte that begins in the past, beside another
    /// one, is seen from now on.
    pub(super) fn hear(&mut self, start_ps: u64, bit_ps: u64, byte: u8, out: &mut Vec<Sampled>) {
        self.rest(start_ps, out);
        let frame = u64::from(byte) << 1 | 1 << (BITS_PER_BYTE - 1);
        for bit in 0..BITS_PER_BYTE {
            self.level(frame >> bit & 1 == 1, start_ps + (bit + 1) * bit_ps, out);
        }
    }

    /// The line rests up to `until_ps`.
    pub(super) fn rest(&mut self, until_ps: u64, out: &mut Vec<Sampled>) {
        self.level(true, until_ps, out);
    }

    fn level(&mut self, high: bool, until_ps: u64, out: &mut Vec<Sampled>) {
        if until_ps <= self.seen_ps {
            return;
        }
        let mut from_ps = std::mem::replace(&mut self.seen_ps, until_ps);
        loop {
            match self.state {
                State::Idle if high => return,
                State::Idle => self.state = State::Byte { start_ps: from_ps, taken: 0, byte: 0 },
                State::Low if high => self.state = State::Idle,
                State::Low => return,
                State::Byte { start_ps, taken, byte } => {
                    // The middle of the bit after the start bit and those taken.
                    let look_ps = start_ps + self.bit_ps * (2 * u64::from(taken) + 3) / 2;
                    if look_ps >= until_ps {
                        return;
                    }
                    from_ps = from_ps.max(look_ps);
                    self.state = if taken < DATA_BITS {
                        State::Byte {
                            start_ps,
                            taken: taken + 1,
                            byte: byte | u8::from(high) << taken,
                        }
                    } else {
                        out.push(Sampled { start_ps, byte, damaged: !high });
                        if high { State::Idle } else { State::Low }
                    };
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BIT_115200: u64 = 8_680_556;
    const BIT_500000: u64 = 2_000_000;

    fn heard(receiver: u64, sender: u64, bytes: &[u8]) -> Vec<(u8, bool)> {
        let mut sampler = Sampler::new(receiver);
        let mut out = Vec::new();
        for (start, byte) in (0..).map(|nth| 1_000_000 + nth * BITS_PER_BYTE * sender).zip(bytes) {
            sampler.hear(start, sender, *byte, &mut out);
        }
        sampler.rest(1_000_000_000_000, &mut out);
        out.into_iter().map(|sampled| (sampled.byte, sampled.damaged)).collect()
    }

    #[test]
    fn at_the_senders_rate_every_byte_arrives() {
        let all: Vec<u8> = (0..=255).collect();
        let expected: Vec<_> = all.iter().map(|byte| (*byte, false)).collect();
        assert_eq!(heard(BIT_115200, BIT_115200, &all), expected);
        // 3 % off is within what a UART bears, 115207 instead of 115200 all the more.
        assert_eq!(heard(BIT_115200, BIT_115200 * 103 / 100, &all), expected);
        assert_eq!(heard(BIT_115200, BIT_115200 * 97 / 100, &all), expected);
    }

    /// 4.34 bits of the receiver fit into one of the sender: start bit and 0x00 are nine low bits,
    /// 39 of the receiver.
    #[test]
    fn a_slower_sender_is_zeros_without_a_stop_bit() {
        assert_eq!(heard(BIT_500000, BIT_115200, &[0x00]), [(0x00, true)]);
        // 0xFF: one low bit, 4.34 of the receiver's: start bit and three zeros, then ones.
        assert_eq!(heard(BIT_500000, BIT_115200, &[0xFF]), [(0xF8, false)]);
    }

    /// A byte of the sender lasts 2.3 bits of the receiver, whose looks fall 1.5, 2.5, … bits after
    /// the first edge.
    #[test]
    fn a_faster_sender_is_garbage() {
        let bytes = heard(
            BIT_115200,
            BIT_500000,
            &[0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30],
        );
        assert!(bytes.len() < 5, "{bytes:02X?}");
        assert!(bytes.iter().all(|(byte, _)| *byte != 0x3E), "{bytes:02X?}");
    }

    #[test]
    fn each_byte_knows_its_start() {
        let mut out = Vec::new();
        let mut sampler = Sampler::new(BIT_115200);
        sampler.hear(5_000, BIT_115200, 0x55, &mut out);
        assert_eq!(out, [Sampled { start_ps: 5_000, byte: 0x55, damaged: false }]);
    }
}
