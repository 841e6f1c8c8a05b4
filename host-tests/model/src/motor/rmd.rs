//! RMD V3.6, and what newer dialects add (docs/rmd-dialects.md).

use super::{Purpose, Question, Reading, Timeout};
use std::f64::consts::PI;

/// Put before the data of motion mode, whose CAN ids say what it is (§5): no command of §2 has this
/// number.
const MOTION_MODE: u8 = 0x00;

pub(super) fn motion_mode(data: &[u8]) -> Vec<u8> {
    std::iter::once(MOTION_MODE).chain(data.iter().copied()).collect()
}

pub(super) fn purpose(data: &[u8]) -> Purpose {
    match data.first() {
        // §2.17 to §2.22, and §5
        Some(0xA8) => Purpose::Motion { once: true },
        // and 0xA9 of V4.3, 0x72 and 0x73 of V4.4
        Some(0xA0..=0xA7 | 0xA9 | 0x72 | 0x73 | &MOTION_MODE) => Purpose::Motion { once: false },
        // §2.15, §2.16
        Some(0x80 | 0x81) => Purpose::Stop,
        // §2.1, §2.5, §2.7 to §2.9, §2.11 to §2.14, §2.23, §2.24, §2.28, §2.29, §2.31
        Some(
            0x30 | 0x42 | 0x60 | 0x61 | 0x62 | 0x70 | 0x71 | 0x90 | 0x92 | 0x94 | 0x9A | 0x9C
            | 0x9D | 0xB1 | 0xB2 | 0xB5,
        ) => Purpose::Read,
        _ => Purpose::Change,
    }
}

pub(super) fn question(data: &[u8]) -> Option<Question> {
    match data.first()? {
        0x9A => Some(Question::Faults),
        0x9C => Some(Question::Speed),
        // With an index, which older motors pass over.
        0x30 | 0x42 | 0xB5 if data.get(1) != Some(&0) => Some(Question::Dialect),
        _ => None,
    }
}

/// Whether a motor may be sent this whose axis states the dialect with this number; 0 is unknown.
/// Reads by index tell the dialect and go to all (docs/rmd-dialects.md, What differs, Dangerous
/// differences).
pub(super) fn has(dialect: u32, data: &[u8]) -> bool {
    const V3_6: u32 = 1;
    const V3_7: u32 = 2;
    const V3_9: u32 = 3;
    const V4_2: u32 = 4;
    const V4_3: u32 = 5;
    const V4_4: u32 = 6;
    match *data {
        // Six gains of a byte, or one by index.
        [0x31 | 0x32, 0, ..] => (V3_6..=V3_9).contains(&dialect),
        [0x31 | 0x32, ..] => dialect >= V4_2,
        [0x71, ..] => (V3_6..=V3_9).contains(&dialect),
        [0x90, ..] => (V3_7..=V4_3).contains(&dialect),
        [0x94, ..] => dialect >= V3_7,
        // Bit rates have other codes in V4.4: without a dialect nothing is known of them.
        [0xB4, ..] | [MOTION_MODE, ..] => dialect >= V3_6,
        // Without a torque cap.
        [0xA2, 0, ..] => true,
        [0xA2 | 0xA9, cap, ..] => dialect >= V4_3 && cap > 0,
        [0xA3 | 0xA5, ..] => dialect == V3_6,
        // No limit of speed, no ramp.
        [0xA4 | 0xA8, _, low, high, ..] => (low, high) != (0, 0),
        [0x43, _, _, _, a, b, c, d] => [a, b, c, d] != [0; 4],
        [0x20, 8, ..] => dialect == V4_4,
        [0x20, index, ..] => (1..=4).contains(&index),
        [0x72 | 0x73 | 0xA6 | 0xB6 | 0x79 | 0xC0 | 0xC1 | 0x19 | 0x33 | 0x34 | 0x88 | 0x9B, ..] => {
            false
        }
        _ => true,
    }
}

/// The dialects whose motors answer a read so, a bit for each by its number in `rmd_dialect`: the
/// form tells (docs/rmd-dialects.md, Recognition).
pub(super) fn dialects(request: &[u8], reply: &[u8]) -> Option<u8> {
    const UP_TO_V3_7: u8 = 0b000_0110;
    const UP_TO_V3_9: u8 = 0b000_1110;
    const UP_TO_V4_3: u8 = 0b011_1110;
    const FROM_V3_9: u8 = 0b111_1000;
    const FROM_V4_2: u8 = 0b111_0000;
    const V4_4: u8 = 0b100_0000;
    let value = f32::from_le_bytes(reply.get(4..8)?.try_into().ok()?);
    match (request.get(..2)?, reply.get(..4)?) {
        ([0x30, asked], [0x30, index, 0, 0]) if asked == index => {
            (value > 0.0 && value.is_finite()).then_some(FROM_V4_2)
        }
        ([0x30, asked], [0x30, 0, ..]) if *asked != 0 => Some(UP_TO_V3_9),
        ([0xB5, 1], [0xB5, 1, part, first]) if request.get(2) == Some(part) => {
            let text = |byte: &u8| (0x20..0x7F).contains(byte);
            let rest = reply[4..].iter().all(|byte| text(byte) || *byte == 0);
            (text(first) && rest).then_some(V4_4)
        }
        ([0xB5, 1], [0xB5, 0x20..=0x7E, ..]) => Some(UP_TO_V4_3),
        ([0x42, asked], [0x42, index, ..]) if asked == index => {
            (value.to_bits() != 0).then_some(FROM_V3_9)
        }
        ([0x42, _], [0x42, 0, ..]) => Some(UP_TO_V3_7),
        _ => None,
    }
}

/// §2.30 (0xB3) with its milliseconds; another id, another baud rate. A restart (§2.25) does not
/// lose what is in ROM.
pub(super) fn timeout_touched(data: &[u8]) -> Option<Timeout> {
    match data.first()? {
        0xB3 => Some(Timeout::of_ms(u32::from_le_bytes(data.get(4..8)?.try_into().ok()?))),
        0x79 | 0xB4 => Some(Timeout::Unknown),
        _ => None,
    }
}

pub(super) fn answer(request: &[u8], reply: &[u8]) -> Option<Reading> {
    let none = Reading::default();
    // The data field has eight bytes; those of motion mode have one put before them.
    let is_whole = reply.len() == 8 || reply.first() == Some(&MOTION_MODE) && reply.len() == 9;
    if request.first() != reply.first() || !is_whole {
        return None;
    }
    let word = |at: usize| Some(u16::from_le_bytes([*reply.get(at)?, *reply.get(at + 1)?]));
    Some(match *reply.first()? {
        0x80 | 0x81 => Reading { stops: true, ..none },
        // §2.12: byte 3 is 1 while the brake is released
        0x9A => Reading {
            faults: Some(word(6)?),
            locked: Some(*reply.get(3)? == 0),
            temperature: Some(reply.get(1)?.cast_signed().into()),
            ..none
        },
        // Thrown back: received, and not carried out. All zero may be that too (PROTOCOL-NOTES
        // R30).
        0xA1 | 0xA2 | 0xA4 | 0xA9
            if request == reply || reply[1..].iter().all(|byte| *byte == 0) =>
        {
            none
        }
        // §2.13, §2.17, §2.18, §2.20: 1 °C, 0.01 A, 1 degree a second
        0x9C | 0xA1 | 0xA2 | 0xA4 | 0xA9 => {
            let speed = f64::from(word(4)?.cast_signed()) * PI / 180.0;
            Reading {
                speed: Some(speed.abs()),
                current: Some((f64::from(word(2)?.cast_signed()) / 100.0).abs()),
                temperature: Some(reply.get(1)?.cast_signed().into()),
                ..none
            }
        }
        // §2.9: 0.01 degrees
        0x92 => {
            let angle = i32::from_le_bytes(reply.get(4..8)?.try_into().ok()?);
            Reading { position: Some(f64::from(angle) * PI / 18_000.0), ..none }
        }
        _ => none,
    })
}

/// The data of an RS485 frame to or from a node (RS485 framing of §1).
pub(super) fn serial_frame(bytes: &[u8]) -> Option<(u8, [u8; 8])> {
    let [0x3E, node, 8, data @ .., low, high] = bytes else { return None };
    let sum = crc16(&bytes[..bytes.len() - 2]);
    (sum == u16::from_le_bytes([*low, *high])).then_some((*node, data.try_into().ok()?))
}

/// CRC-16/MODBUS (PROTOCOL-NOTES R1).
fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |sum, byte| {
        (0..8).fold(sum ^ u16::from(*byte), |sum, _| {
            if sum & 1 == 1 { (sum >> 1) ^ 0xA001 } else { sum >> 1 }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksums_of_two_known_frames() {
        assert_eq!(crc16(&[0x3E, 1, 8, 0x9C, 0, 0, 0, 0, 0, 0, 0]).to_le_bytes(), [0xF2, 0x30]);
        let reply = [0x3E, 1, 8, 0x9C, 0x19, 0x34, 0x12, 0x9C, 0xFF, 0x78, 0x56, 0x7A, 0xD8];
        assert_eq!(
            serial_frame(&reply),
            Some((1, [0x9C, 0x19, 0x34, 0x12, 0x9C, 0xFF, 0x78, 0x56]))
        );
        assert_eq!(serial_frame(&reply[1..]), None);
    }

    #[test]
    fn what_moves_and_what_stops() {
        assert_eq!(purpose(&[0xA2, 0, 0, 0, 0, 0, 0, 0]), Purpose::Motion { once: false });
        assert_eq!(purpose(&[0xA9, 30, 1, 0, 0, 0, 0, 0]), Purpose::Motion { once: false });
        assert_eq!(purpose(&[0xA8, 0, 0, 0, 0, 0, 0, 0]), Purpose::Motion { once: true });
        assert_eq!(purpose(&motion_mode(&[0x80; 8])), Purpose::Motion { once: false });
        assert_eq!(purpose(&[0x80, 0, 0, 0, 0, 0, 0, 0]), Purpose::Stop);
        assert_eq!(purpose(&[0x9A, 0, 0, 0, 0, 0, 0, 0]), Purpose::Read);
        assert_eq!(purpose(&[0x77, 0, 0, 0, 0, 0, 0, 0]), Purpose::Change);
    }

    #[test]
    fn a_speed_and_a_fault_are_read() {
        let speed = answer(&[0x9C], &[0x9C, 50, 1, 0, 0xF4, 1, 45, 0]).unwrap().speed.unwrap();
        assert!((speed - 8.7266).abs() < 1e-3, "500 degrees a second");
        let status = answer(&[0x9A], &[0x9A, 50, 0, 1, 0xE5, 1, 4, 0]).unwrap();
        assert_eq!((status.faults, status.locked), (Some(4), Some(false)));
        assert_eq!(answer(&[0x9A], &[0x9C, 0, 0, 0, 0, 0, 0, 0]), None);
    }
}
