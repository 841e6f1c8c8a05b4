//! What a motor might obey that reads leniently: bytes that a command does not use may be anything,
//! data may be as short as what it carries allows, what is missing counts as zero, and nothing is
//! checked but what tells motors apart. A motor of this kind is the one that the gateway must
//! reckon with.

use super::Protocol;
use crate::can_id::EXTENDED;

/// What a frame makes a motor do. What only asks makes it do nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Deed {
    /// It turns, or prepares to.
    Moves,
    /// It comes to rest, or a setpoint of zero is taken.
    Rests,
    /// It is another motor afterwards: its brake, id, zero, gains, timeout, start.
    Changes,
}

/// Group ids of RMD motors: requests to all (RMD V3.6 §3), and their ids (§4.4).
const RMD_ALL: u32 = 0x280;
const RMD_IDS: u32 = 0x300;
/// The same on RS485.
pub const RMD_SERIAL_ALL: u8 = 0xCD;
/// D5: the id of all motors.
const D5_ALL: u8 = 0xFE;
/// D5: the registers of the set speed.
const SPEED: [u8; 2] = [0x20, 0x21];

impl Protocol {
    /// What a CAN frame makes a motor do that is listening: `d5_id` where a D5 motor has not the
    /// usual one.
    pub fn obeys(self, node: u8, d5_id: Option<u32>, id: u32, data: &[u8]) -> Option<Deed> {
        let node_id = u32::from(node);
        match self {
            Self::Rmd if id == 0x140 + node_id || id == RMD_ALL => rmd(data),
            Self::Rmd if id == 0x400 + node_id => Some(Deed::Moves),
            // 1 asks for the id, anything else sets it.
            Self::Rmd if id == RMD_IDS && data.first() == Some(&0x79) => {
                (data.get(2) != Some(&1)).then_some(Deed::Changes)
            }
            Self::Thruster if id == 0x300 + node_id => thruster(data),
            // What goes to all has the length of id that the motor listens to.
            Self::D5
                if id == d5_id.unwrap_or(node_id)
                    || id == u32::from(D5_ALL) | d5_id.unwrap_or(0) & EXTENDED =>
            {
                let [0xD5, to, ..] = *data else { return None };
                (to == node || to == D5_ALL).then(|| d5(data))?
            }
            _ => None,
        }
    }

    /// What a CAN frame would make some motor of this protocol do, whatever its node.
    pub fn some_obeys(self, id: u32, data: &[u8]) -> Option<Deed> {
        match self {
            Self::Rmd if (0x141..=0x160).contains(&id) || id == RMD_ALL => rmd(data),
            Self::Rmd if (0x401..=0x420).contains(&id) => Some(Deed::Moves),
            Self::Rmd if id == RMD_IDS => self.obeys(1, None, id, data),
            Self::Thruster if (0x301..=0x37F).contains(&id) => thruster(data),
            // Its manual gives no ids.
            Self::D5 if data.first() == Some(&0xD5) => d5(data),
            _ => None,
        }
    }
}

/// What the command of an RMD motor makes it do, on CAN or in the data of a serial frame.
pub(super) fn rmd(data: &[u8]) -> Option<Deed> {
    match data.first()? {
        0xA0..=0xA9 | 0x72 | 0x73 => Some(Deed::Moves),
        0x80 | 0x81 => Some(Deed::Rests),
        0x30
        | 0x42
        | 0x60..=0x62
        | 0x70
        | 0x71
        | 0x90
        | 0x92
        | 0x94
        | 0x9A
        | 0x9C
        | 0x9D
        | 0xB1
        | 0xB2
        | 0xB5 => None,
        _ => Some(Deed::Changes),
    }
}

fn thruster(data: &[u8]) -> Option<Deed> {
    let is_zero = data.iter().skip(4).all(|byte| *byte == 0);
    match data.get(..2)? {
        b"TC" | b"VC" if is_zero => Some(Deed::Rests),
        b"TC" | b"VC" | b"LA" | b"LR" => Some(Deed::Moves),
        b"LS" => Some(Deed::Rests),
        b"QV" | b"QC" | b"QP" | b"QT" | b"EQ" | b"EF" | b"FR" | b"QA" | b"QR" | b"RP" => None,
        _ => Some(Deed::Changes),
    }
}

pub(super) fn d5(data: &[u8]) -> Option<Deed> {
    let mut whole = [0; 8];
    whole.iter_mut().zip(data).for_each(|(place, byte)| *place = *byte);
    let [_, _, length, command, address, low, high, _] = whole;
    // A write of two bytes reaches the next register too.
    let sets_speed = SPEED.contains(&address) || length != 4 && address == SPEED[0] - 1;
    let is_zero = address == SPEED[0] && length != 4 && low == 0 && high & 0x7F == 0;
    match command {
        0x01 | 0x02 | 0xD4 => None,
        0x03 | 0x04 if is_zero => Some(Deed::Rests),
        0x03 | 0x04 if sets_speed => Some(Deed::Moves),
        0x05 => Some(Deed::Moves),
        _ => Some(Deed::Changes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unused_bytes_and_short_data_do_not_keep_a_motor_from_moving() {
        let rmd = |id, data: &[u8]| Protocol::Rmd.obeys(1, None, id, data);
        assert_eq!(rmd(0x141, &[0xA2, 9, 9, 9, 0x10, 0x27]), Some(Deed::Moves));
        assert_eq!(rmd(0x280, &[0xA2]), Some(Deed::Moves));
        assert_eq!(rmd(0x401, &[0xD5, 0x26, 5, 3, 0x20, 0, 0, 0x4E]), Some(Deed::Moves));
        assert_eq!(rmd(0x300, &[0x79, 0, 0, 0, 0, 0, 0, 2]), Some(Deed::Changes));
        assert_eq!(rmd(0x300, &[0x79, 0, 1, 0, 0, 0, 0, 0]), None);
        assert_eq!(rmd(0x142, &[0xA2, 0, 0, 0, 0, 0, 0, 0]), None);
        let thruster = |data: &[u8]| Protocol::Thruster.obeys(0x0E, None, 0x30E, data);
        assert_eq!(thruster(&[0x54, 0x43, 7, 7, 0, 0, 0, 5]), Some(Deed::Moves));
        assert_eq!(thruster(&[0x54, 0x43, 7, 7, 0, 0, 0, 0]), Some(Deed::Rests));
        assert_eq!(thruster(&[0x45, 0x46, 0, 0]), None);
        let d5 = |id, data: &[u8]| Protocol::D5.obeys(0x26, None, id, data);
        assert_eq!(d5(0x26, &[0xD5, 0x26, 4, 3, 0x21, 1]), Some(Deed::Moves));
        assert_eq!(d5(0x26, &[0xD5, 0xFE, 5, 3, 0x1F, 0, 9, 0]), Some(Deed::Moves));
        assert_eq!(d5(0xFE, &[0xD5, 0xFE, 5, 5, 0, 0, 0, 8]), Some(Deed::Moves));
        assert_eq!(d5(0x26, &[0xD5, 0x27, 5, 5, 0, 0, 0, 0]), None);
        assert_eq!(d5(0x26, &[0xD5, 0x26, 5, 6, 0, 0, 0, 0]), Some(Deed::Changes));
    }

    #[test]
    fn some_motor_of_a_protocol_obeys_where_one_node_does() {
        for (protocol, node, id, data) in [
            (Protocol::Rmd, 32, 0x160, &[0x77][..]),
            (Protocol::Rmd, 32, 0x420, &[]),
            (Protocol::Thruster, 127, 0x37F, b"LS"),
            (Protocol::D5, 0x26, 0x26, &[0xD5, 0x26, 5, 3, 0x20, 1]),
        ] {
            let one = protocol.obeys(node, None, id, data);
            assert!(one.is_some());
            assert_eq!(protocol.some_obeys(id, data), one);
        }
        assert_eq!(Protocol::Rmd.some_obeys(0x161, &[0xA2]), None);
    }
}
