//! D5 manual: `D5 id length command address low high sum`, replies with 5D.

use super::{Purpose, Question, Reading};
use std::f64::consts::PI;

/// Commanded speed, and its upper byte (table, 0x20 and 0x21).
const SPEED: u8 = 0x20;
/// Measured speed (table, 0x26).
const MEASURED: u8 = 0x26;
/// Travelled angle (table, 0x28), temperatures of board and motor (0x2E, 0x2F).
const ANGLE: u8 = 0x28;
const BOARD_TEMPERATURE: u8 = 0x2E;
const MOTOR_TEMPERATURE: u8 = 0x2F;
/// State bits (table, 0x12).
const STATUS: u8 = 0x12;

pub(super) fn is_from(node: u8, data: &[u8]) -> bool {
    data.first() == Some(&0x5D) && serial_frame(data).is_some_and(|(from, _)| from == node)
}

/// A frame on a serial line: the same bytes as on CAN.
pub(super) fn serial_frame(bytes: &[u8]) -> Option<(u8, [u8; 8])> {
    let [0xD5 | 0x5D, node, body @ .., sum] = bytes else { return None };
    let total = body.iter().fold(*node, |total, byte| total.wrapping_add(*byte));
    Some((*node, bytes.try_into().ok()?)).filter(|_| total == *sum)
}

/// What it says to a request that was for another (table, row 5).
pub(super) fn is_objection(data: &[u8]) -> bool {
    matches!(data, [_, _, 5, _, 0x01, 0xEE, 0xEE, _])
}

pub(super) fn purpose(data: &[u8]) -> Purpose {
    let [_, _, length, command, address, low, high, _] = *data else { return Purpose::Change };
    // A write of two bytes reaches the next register too.
    let touches_speed = matches!((length, address), (_, SPEED | 0x21) | (5, 0x1F));
    let is_zero = (length, address) == (5, SPEED) && low == 0 && high & 0x7F == 0;
    match command {
        0x03 if is_zero => Purpose::Stop,
        0x03 if touches_speed => Purpose::Motion { once: false },
        0x04 if is_zero => Purpose::Rest,
        0x04 if touches_speed => Purpose::Motion { once: true },
        0x05 => Purpose::Motion { once: true },
        0x01 | 0x02 | 0xD4 => Purpose::Read,
        _ => Purpose::Change,
    }
}

pub(super) fn question(data: &[u8]) -> Option<Question> {
    match (*data.get(3)?, *data.get(4)?) {
        (0x02, MEASURED) => Some(Question::Speed),
        (0x02, STATUS) => Some(Question::Faults),
        (0x02, register) => Some(Question::Register(register)),
        (0x04, SPEED) => Some(Question::Overwrite),
        _ => None,
    }
}

pub(super) fn answer(request: &[u8], reply: &[u8]) -> Option<Reading> {
    let none = Reading::default();
    if request.get(3..5)? != reply.get(3..5)? {
        return None;
    }
    let [_, _, _, command, address, low, high, _] = *reply else { return None };
    let word = u16::from_le_bytes([low, high]);
    let magnitude = word & 0x7FFF; // bit 15 is the direction (D3)
    Some(match (command, address) {
        (0x03 | 0x02, SPEED) => Reading { stops: magnitude == 0, ..none },
        // Another value belongs to another request.
        (0x04, SPEED) if request.get(5..7) != reply.get(5..7) => return None,
        (0x02, MEASURED) => Reading { speed: Some(f64::from(magnitude) * PI / 180.0), ..none },
        (0x02, STATUS) => Reading { faults: Some(low.into()), ..none },
        // A request for a byte has length 4, one for a word 5.
        (0x02, ANGLE) if request.get(2) == Some(&5) => {
            Reading { position: Some(f64::from(word.cast_signed()) * PI / 180.0), ..none }
        }
        (0x02, BOARD_TEMPERATURE | MOTOR_TEMPERATURE) => {
            // Bit 7 is the sign.
            let magnitude = f64::from(low & 0x7F);
            Reading {
                temperature: Some(if low & 0x80 == 0 { magnitude } else { -magnitude }),
                ..none
            }
        }
        (0x02, _) => Reading { register: Some(low), ..none },
        _ => none,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manuals_examples() {
        assert_eq!(purpose(&[0xD5, 0x0B, 5, 3, 0x20, 0, 0, 0x33]), Purpose::Stop);
        assert_eq!(
            purpose(&[0xD5, 0x0A, 5, 3, 0x20, 0x1E, 0, 0x50]),
            Purpose::Motion { once: false }
        );
        assert_eq!(
            purpose(&[0xD5, 0x0B, 5, 4, 0x20, 0xB0, 4, 0xE8]),
            Purpose::Motion { once: true }
        );
        assert_eq!(
            purpose(&[0xD5, 0x0B, 4, 4, 0x21, 0x84, 0, 0xB8]),
            Purpose::Motion { once: true }
        );
        assert_eq!(purpose(&[0xD5, 0x0B, 5, 5, 0, 0, 0, 0x15]), Purpose::Motion { once: true });
        assert_eq!(purpose(&[0xD5, 0x0B, 5, 2, 0x15, 0, 0, 0x27]), Purpose::Read);
        assert_eq!(purpose(&[0xD5, 0x0B, 4, 3, 0x05, 0x22, 0, 0x39]), Purpose::Change);
    }

    #[test]
    fn a_reply_needs_its_node_and_its_sum() {
        let reply = [0x5D, 0x0B, 5, 3, 0x20, 0, 0, 0x33];
        assert!(is_from(0x0B, &reply) && !is_from(0x0A, &reply));
        assert!(answer(&[0xD5, 0x0B, 5, 3, 0x20, 0, 0, 0x33], &reply).unwrap().stops);
        let mut broken = reply;
        broken[7] = 0x34;
        assert!(!is_from(0x0B, &broken));
    }
}
