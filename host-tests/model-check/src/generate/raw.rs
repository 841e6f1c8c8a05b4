//! Raw access to a bus in every state of its axes: frames and bytes that are harmless, that look
//! so, and that are not.

use super::Generator;
use super::asks::native;
use crate::action::{Action, Ask};
use crate::bus::crc16;
use crate::dice::Dice;
use crate::plant::{LINE, MOTORS, all_motors, extended_id};
use crate::world::World;
use host_protocol::Protocol;
use promise_model::{EXTENDED, Told};

impl Generator {
    /// What a host does on a bus whose axes are mostly at rest: it opens it for raw frames, and
    /// sends them.
    pub(super) fn raw(&mut self, world: &World, axis: u8) -> Action {
        let bus = MOTORS[usize::from(axis)].bus;
        if bus == LINE && self.dice.percent(15) {
            // What begins a frame that ends in the first bytes of the next request, in its checksum
            // too.
            let node = self.dice.pick(&[1, 2, 0xCD]);
            let next = frame(node, [0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]);
            let first = head(&mut self.dice, &next);
            let link = self.commander;
            let send = |data| Action::Ask { link, ask: Ask::RawSend { bus, id: 0, data } };
            self.first.push_back(send(next));
            return send(first);
        }
        let ask = match (self.dice.below(100), world.oracle().told(axis)) {
            (0..30, _) => Ask::RawOpen { bus, unsafe_access: self.dice.percent(10) },
            (30..70, _) => raw_send(&mut self.dice, bus),
            (70..74, _) => Ask::RawReceive { bus },
            (74..76, _) => Ask::RawClose { bus },
            (76..82, Told::Idle) => Ask::Arm { axis },
            (82..86, _) => native(&mut self.dice, axis),
            (86..90, Told::Armed | Told::Active | Told::Arming) => Ask::Stop { axis },
            (86..90, _) => Ask::Stop { axis },
            (90, _) => Ask::EStop,
            (91..94, _) => Ask::ClearGateway,
            (94..99, Told::Tripped { .. }) => Ask::Clear { axis },
            _ => Ask::Ping,
        };
        Action::Ask { link: self.commander, ask }
    }
}

/// What a host asks of a bus that has no axis: it opens it for everything, and sends what it likes.
pub(super) fn unsafe_access(dice: &mut Dice, bus: u8) -> Vec<Ask> {
    let mut asks = vec![Ask::RawOpen { bus, unsafe_access: true }];
    asks.extend((0..=dice.below(4)).map(|_| raw_send(dice, bus)));
    asks
}

/// A raw frame on a CAN bus, or bytes on the serial line.
pub(super) fn raw_send(dice: &mut Dice, bus: u8) -> Ask {
    if bus == LINE {
        return Ask::RawSend { bus, id: 0, data: serial(dice) };
    }
    let here: Vec<_> = all_motors().filter(|motor| motor.bus == bus).collect();
    let motor = if here.is_empty() { MOTORS[0] } else { dice.pick(&here) };
    let node = u32::from(motor.node);
    let (id, mut data) = match motor.protocol {
        _ if dice.percent(10) => (
            dice.pick(&[0x700, 0x7FF, 0x141, 0x30E, 0x26, 0x300, 0xFE, EXTENDED | 0x141]),
            dice.bytes(9),
        ),
        Protocol::Rmd if dice.percent(10) => (0x400 + node, dice.bytes(9)),
        Protocol::Rmd if dice.percent(10) => {
            (0x300, vec![0x79, 0, dice.byte() % 2, 0, 0, 0, 0, motor.node])
        }
        Protocol::Rmd => {
            let command = dice.pick(&[
                0x9A, 0x9C, 0x92, 0x81, 0x80, 0x77, 0x78, 0x76, 0xA2, 0xA0, 0xB3, 0x43, 0x51,
            ]);
            let id = if dice.percent(10) { 0x280 } else { 0x140 + node };
            (id, vec![command, 0, 0, 0, dice.byte(), 0, 0, 0])
        }
        Protocol::Thruster => {
            let [a, b] =
                *dice.pick(&[b"QV", b"EF", b"FR", b"TC", b"VC", b"LR", b"CI", b"ST", b"CF", b"XX"]);
            (0x300 + node, vec![a, b, 0, 0, 0, 0, 0, dice.pick(&[0, 9])])
        }
        Protocol::D5 => {
            let to = if dice.percent(30) { 0xFE } else { motor.node };
            let (command, address) = (
                dice.pick(&[1, 2, 2, 3, 4, 5, 6]),
                dice.pick(&[0x20, 0x21, 0x1F, 0x26, 0x10, 0x03]),
            );
            let body = [to, dice.pick(&[4, 5]), command, address, dice.pick(&[0, 30]), 0];
            let sum = body.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
            let id = if dice.percent(20) { extended_id(motor.node) } else { node };
            (id, std::iter::once(0xD5).chain(body).chain([sum]).collect())
        }
    };
    // Bytes that the command does not use, and data that are as short as they may be.
    if dice.percent(25) && data.len() > 4 {
        let place = 2 + usize::from(dice.byte() & 1);
        data[place] = dice.byte();
    }
    if dice.percent(15) {
        data.truncate(usize::from(dice.byte() % 9));
    }
    Ask::RawSend { bus, id, data }
}

/// Bytes on a serial line: a frame, a part of one, or one that begins inside another.
fn serial(dice: &mut Dice) -> Vec<u8> {
    let node = dice.pick(&[1, 2, 3, 0xCD]);
    let command = dice.pick(&[0x9A, 0x9C, 0x92, 0x81, 0x80, 0x77, 0x76, 0xA2, 0xA2, 0x79]);
    let inner = frame(node, [command, 0, 0, 0, 0x10, 0x27, 0, 0]);
    match dice.below(6) {
        0 => dice.bytes(30),
        1 => inner[..usize::from(dice.byte()) % inner.len()].to_vec(),
        2 => inner[usize::from(dice.byte()) % inner.len()..].to_vec(),
        // Two at once.
        3 => [frame(1, [0x9A, 0, 0, 0, 0, 0, 0, 0]), inner].concat(),
        _ => inner,
    }
}

fn frame(node: u8, data: [u8; 8]) -> Vec<u8> {
    let mut bytes = vec![0x3E, node, 8];
    bytes.extend(data);
    bytes.extend(crc16(&bytes).to_le_bytes());
    bytes
}

/// The beginning of a harmless frame whose end is the beginning of `next`: two of its data bytes
/// are chosen so that the checksum fits.
fn head(dice: &mut Dice, next: &[u8]) -> Vec<u8> {
    let length = 5 + usize::from(dice.byte() % 7);
    let mut whole = vec![0x3E, 1, 8, 0x9A];
    whole.resize(length, 0);
    whole.extend(&next[..13 - length]);
    let wanted = u16::from_le_bytes([whole[11], whole[12]]);
    // The checksum is linear in each bit: which of them give it is a system of 16 equations.
    let free: Vec<(usize, u8)> =
        (4..length.min(11)).flat_map(|byte| (0..8).map(move |bit| (byte, 1 << bit))).collect();
    let base = crc16(&whole[..11]);
    let mut rows: Vec<(u16, u128)> = Vec::new();
    let mut missing = (base ^ wanted, 0u128);
    for (place, (byte, bit)) in free.iter().enumerate() {
        whole[*byte] ^= bit;
        let mut row = (crc16(&whole[..11]) ^ base, 1u128 << place);
        whole[*byte] ^= bit;
        for (value, used) in &rows {
            if row.0 & highest(*value) != 0 {
                row = (row.0 ^ value, row.1 ^ used);
            }
        }
        if row.0 != 0 {
            rows.push(row);
        }
    }
    for (value, used) in &rows {
        if missing.0 & highest(*value) != 0 {
            missing = (missing.0 ^ value, missing.1 ^ used);
        }
    }
    for (place, (byte, bit)) in free.iter().enumerate() {
        if missing.1 >> place & 1 == 1 {
            whole[*byte] ^= bit;
        }
    }
    whole.truncate(length);
    whole
}

fn highest(value: u16) -> u16 {
    1u16.checked_shl(value.ilog2()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_head_is_the_beginning_of_the_next_request() {
        let next = frame(2, [0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]);
        let mut whole = 0;
        for seed in 0..50 {
            let both = [head(&mut Dice::seeded(seed), &next), next.clone()].concat();
            whole += usize::from(crc16(&both[..11]).to_le_bytes() == both[11..13]);
        }
        assert!(whole > 30, "{whole} of 50");
    }
}
