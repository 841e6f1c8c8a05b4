//! A CAN frame as the bits on the wire: arbitration, stuffing, CRC-15, length (ISO 11898-1 §10).

use embedded_can::{Frame, Id};

/// Generator polynomial of CRC-15/CAN.
const CRC_POLYNOMIAL: u16 = 0x4599;
/// Bits of the CRC sequence.
const CRC_BITS: u32 = 15;
/// After this many equal bits the sender inserts one of the other value.
const STUFF_RUN: u32 = 5;
/// CRC delimiter and ACK slot: the last bits sent before a missing acknowledgement is noticed.
const UP_TO_ACK: u64 = 2;
/// ACK delimiter and end of frame.
const AFTER_ACK: u64 = 8;

/// Pause that every frame is followed by.
pub(crate) const INTERMISSION: u64 = 3;
/// Error flag (6 bits, echoed by the others from the first on) and error delimiter (8 bits).
pub(crate) const ERROR_FRAME: u64 = 14;
/// Extra pause of an error-passive transmitter after its frame.
pub(crate) const SUSPEND: u64 = 8;
/// Recessive bits that a bus-off controller must see before it takes part again: 128 × 11.
pub(crate) const BUS_OFF_RECOVERY: u64 = 128 * 11;

/// The stuffed bits of a frame from the start bit to the end of the CRC.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct FrameBits {
    bits: Vec<bool>,
}

impl FrameBits {
    pub(crate) fn of<F: Frame>(frame: &F) -> Self {
        let mut bits = raw_bits(frame);
        let crc = crc15(&bits);
        push(&mut bits, u32::from(crc), CRC_BITS);
        Self { bits: stuff(&bits) }
    }

    /// Bits of the whole frame, start bit to end of frame, without intermission.
    pub(crate) fn frame(&self) -> u64 {
        self.stuffed() + UP_TO_ACK + AFTER_ACK
    }

    /// Bits up to and with the ACK slot.
    pub(crate) fn up_to_ack(&self) -> u64 {
        self.stuffed() + UP_TO_ACK
    }

    /// Bits sent until this frame and another one differ, the differing bit included; all of them
    /// if they do not.
    pub(crate) fn up_to_difference(&self, other: &Self) -> u64 {
        let equal = self.bits.iter().zip(&other.bits).take_while(|(a, b)| a == b).count();
        (equal as u64 + 1).min(self.stuffed())
    }

    fn stuffed(&self) -> u64 {
        self.bits.len() as u64
    }
}

/// The arbitration field as a number: the lowest wins the bus.
pub(crate) fn priority<F: Frame>(frame: &F) -> u32 {
    let remote = u32::from(frame.is_remote_frame());
    match frame.id() {
        // id, RTR, IDE = 0, and nothing of what an extended frame has.
        Id::Standard(id) => u32::from(id.as_raw()) << 21 | remote << 20,
        // upper 11 bits of the id, SRR = 1, IDE = 1, lower 18 bits, RTR.
        Id::Extended(id) => {
            let (upper, lower) = split(id.as_raw());
            upper << 21 | 0b11 << 19 | lower << 1 | remote
        }
    }
}

/// The upper 11 and the lower 18 bits of an extended id.
fn split(id: u32) -> (u32, u32) {
    (id >> 18, id & 0x3_FFFF)
}

/// Start bit to the last data bit, unstuffed.
fn raw_bits<F: Frame>(frame: &F) -> Vec<bool> {
    let mut bits = Vec::with_capacity(160);
    let remote = u32::from(frame.is_remote_frame());
    push(&mut bits, 0, 1);
    match frame.id() {
        Id::Standard(id) => {
            push(&mut bits, u32::from(id.as_raw()), 11);
            push(&mut bits, remote, 1);
            push(&mut bits, 0b00, 2); // IDE, r0
        }
        Id::Extended(id) => {
            let (upper, lower) = split(id.as_raw());
            push(&mut bits, upper, 11);
            push(&mut bits, 0b11, 2); // SRR, IDE
            push(&mut bits, lower, 18);
            push(&mut bits, remote, 1);
            push(&mut bits, 0b00, 2); // r1, r0
        }
    }
    push(&mut bits, u32::try_from(frame.dlc()).unwrap_or(0), 4);
    for byte in frame.data() {
        push(&mut bits, u32::from(*byte), 8);
    }
    bits
}

/// Appends the lowest `count` bits of `value`, highest first.
fn push(bits: &mut Vec<bool>, value: u32, count: u32) {
    bits.extend((0..count).rev().map(|at| value >> at & 1 == 1));
}

fn crc15(bits: &[bool]) -> u16 {
    const TOP: u16 = 1 << (CRC_BITS - 1);
    const MASK: u16 = (1 << CRC_BITS) - 1;
    bits.iter().fold(0, |crc, bit| {
        let shifted = crc << 1 & MASK;
        if (crc & TOP != 0) != *bit { shifted ^ CRC_POLYNOMIAL } else { shifted }
    })
}

fn stuff(bits: &[bool]) -> Vec<bool> {
    let mut stuffed = Vec::with_capacity(bits.len() + bits.len() / 4);
    let mut run = 0;
    let mut last = None;
    for bit in bits {
        run = if last == Some(*bit) { run + 1 } else { 1 };
        stuffed.push(*bit);
        last = Some(*bit);
        if run == STUFF_RUN {
            // The stuff bit is itself the first of a new run.
            stuffed.push(!*bit);
            last = Some(!*bit);
            run = 1;
        }
    }
    stuffed
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::CanFrame;

    fn standard(id: u16, data: &[u8]) -> CanFrame {
        CanFrame::standard(id, data).unwrap()
    }

    /// The catalogue's check value of CRC-15/CAN: "123456789" → 0x059E.
    #[test]
    fn crc_matches_its_check_value() {
        let mut bits = Vec::new();
        for byte in b"123456789" {
            push(&mut bits, u32::from(*byte), 8);
        }
        assert_eq!(crc15(&bits), 0x059E);
    }

    /// 1 start, 11 id, RTR, IDE, r0, 4 length = 19 bits plus data and 15 CRC; 10 more to the end of
    /// frame.
    #[test]
    fn unstuffed_length_is_44_and_the_data() {
        for len in 0..=8 {
            let frame = standard(0x2AA, &[0x55; 8][..len]);
            assert_eq!(raw_bits(&frame).len(), 19 + 8 * len);
        }
        // An extended frame has 20 bits more: 18 of id, SRR, r1.
        let extended = CanFrame::extended(0x0AAA_AAAA, &[0x55; 8]).unwrap();
        assert_eq!(raw_bits(&extended).len() + 15 + 10, 64 + 64);
    }

    /// Id 0 without data is 34 dominant bits, its CRC being 0: a stuff bit after 5, 10, … 30 of
    /// them.
    #[test]
    fn a_frame_of_zeros_has_six_stuff_bits() {
        let bits = FrameBits::of(&standard(0, &[]));
        assert_eq!(bits.frame(), 44 + 6);
        assert_eq!(bits.up_to_ack(), 44 + 6 - 8);
    }

    /// A stuff bit counts in the run that follows it: 00000 1111 becomes 00000 1 1111 0.
    #[test]
    fn stuff_bits_start_the_next_run() {
        let bits = [false, false, false, false, false, true, true, true, true];
        let expected = [false, false, false, false, false, true, true, true, true, true, false];
        assert_eq!(stuff(&bits), expected);
    }

    /// At most (34 + 64 − 1) / 4 = 24 stuff bits: 135 bits with intermission, the F of the bounds.
    #[test]
    fn no_standard_frame_is_longer_than_135_bits() {
        let mut random = crate::random::Random::new(1);
        for _ in 0..2_000 {
            let [a, b, ..] = random.next().to_le_bytes();
            let data = (random.next() & random.next()).to_le_bytes();
            let bits = FrameBits::of(&standard(u16::from_le_bytes([a, b]) & 0x7FF, &data));
            assert!((108..=132).contains(&bits.frame()));
        }
    }

    #[test]
    fn priority_is_the_order_of_the_wire() {
        let remote =
            CanFrame::remote_frame(embedded_can::StandardId::new(0x141).unwrap().into(), 0)
                .unwrap();
        // 0x141 as the upper 11 bits of an extended id.
        let extended = CanFrame::extended(0x141 << 18, &[]).unwrap();
        let order =
            [standard(0x0B, &[]), standard(0x141, &[]), remote, extended, standard(0x142, &[])];
        assert!(order.is_sorted_by_key(priority));
        assert!(priority(&extended) != priority(&remote));
    }

    /// Both start with SOF 0, id 00000001011, RTR, IDE, r0 0, DLC 1000: 20 bits with one stuff bit
    /// after the first five zeros of SOF and id; then 1 of D5 against 0 of 5D.
    #[test]
    fn frames_of_one_id_part_at_their_data() {
        let (request, reply) = (standard(0x0B, &[0xD5; 8]), standard(0x0B, &[0x5D; 8]));
        assert_eq!(FrameBits::of(&request).up_to_difference(&FrameBits::of(&reply)), 21);
    }
}
