//! Raw frames of every class, and what they are by the manuals: written here as numbers, apart from
//! the code under test.

use crate::motors::crc16_modbus;

/// What a raw frame may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// It reads a motor.
    Reads,
    /// It is on an id that no protocol of the bus uses.
    Foreign,
    /// Anything else.
    Acts,
}

/// A frame as `ID#HEX`, or as hex on a serial line.
pub type Frame = (String, Class);

/// RMD V3.6 §2: 0x30, 0x42, 0x60 to 0x62, 0x70, 0x71, 0x92, 0x9A, 0x9C, 0x9D, 0xB1, 0xB2, 0xB5.
pub const RMD_READS: [u8; 14] =
    [0x30, 0x42, 0x60, 0x61, 0x62, 0x70, 0x71, 0x92, 0x9A, 0x9C, 0x9D, 0xB1, 0xB2, 0xB5];
/// RMD V3.6: gains, acceleration, offsets, zero, function, reset, brake, id, output, stop, motion,
/// timeout, bitrate.
pub const RMD_ACTS: [u8; 23] = [
    0x20, 0x31, 0x32, 0x43, 0x63, 0x64, 0x76, 0x77, 0x78, 0x79, 0x80, 0x81, 0xA1, 0xA2, 0xA3, 0xA4,
    0xA5, 0xA6, 0xA7, 0xA8, 0xB3, 0xB4, 0xF1,
];
/// Reads with an index, which older motors pass over (docs/rmd-dialects.md): a gain from V4.2 on,
/// an acceleration from V3.9 on, a part of the model's name of V4.4.
pub const fn reads_by_index(data: [u8; 8]) -> bool {
    matches!(
        data,
        [0x30, 1 | 2 | 4 | 5 | 7..=9, 0, 0, 0, 0, 0, 0]
            | [0x42, 1..=3, 0, 0, 0, 0, 0, 0]
            | [0xB5, 1, 1..=3, 0, 0, 0, 0, 0]
    )
}
/// Thruster manual §2 to §4.
const THRUSTER_READS: [&[u8; 2]; 9] =
    [b"QV", b"QC", b"QP", b"QT", b"EQ", b"EF", b"FR", b"QA", b"QR"];
const THRUSTER_ACTS: [&[u8; 2]; 19] = [
    b"TC", b"VC", b"CF", b"MQ", b"ML", b"MM", b"CI", b"CB", b"ST", b"VM", b"SR", b"SP", b"LA",
    b"AZ", b"LR", b"RZ", b"RC", b"LS", b"XX",
];

fn text(id: u16, data: &[u8]) -> String {
    format!("{id:03X}#{}", crate::text::hex(data))
}

/// Every RMD command byte to an axis, a stranger and all; motion mode, replies, ids, and what is
/// cut short or too long.
pub fn rmd_on_can() -> Vec<Frame> {
    let mut frames = Vec::new();
    for command in 0..=u8::MAX {
        let class = if RMD_READS.contains(&command) { Class::Reads } else { Class::Acts };
        for id in [0x141, 0x147, 0x160, 0x280] {
            frames.push((text(id, &[command, 0, 0, 0, 0, 0, 0, 0]), class));
            frames.push((text(id, &[command, 0, 0, 0, 0x10, 0x27, 0, 0]), Class::Acts));
            frames.push((text(id, &[command]), Class::Acts));
            frames.push((text(id, &[command, 0, 0, 0, 0x10, 0x27]), Class::Acts));
        }
        frames.push((text(0x241, &[command, 0, 0, 0, 0, 0, 0, 0]), Class::Acts));
        for index in [1, 2, 3, 4, 6, 9, 10, 0x80, u8::MAX] {
            let data = [command, index, 0, 0, 0, 0, 0, 0];
            let class = if reads_by_index(data) { Class::Reads } else { Class::Acts };
            frames.push((text(0x141, &data), class));
            let data = [command, 1, index, 0, 0, 0, 0, 0];
            let class = if reads_by_index(data) { Class::Reads } else { Class::Acts };
            frames.push((text(0x141, &data), class));
        }
    }
    for id in [0x401, 0x407, 0x420, 0x501, 0x520, 0x241, 0x260] {
        for length in 0..=8 {
            frames.push((text(id, &[0x80, 0, 0x80, 0, 0, 0, 8, 0][..length]), Class::Acts));
        }
    }
    for (flag, class) in [(0, Class::Acts), (1, Class::Reads), (2, Class::Acts)] {
        frames.push((text(0x300, &[0x79, 0, flag, 0, 0, 0, 0, 0]), class));
        frames.push((text(0x300, &[0x79, 0, flag, 0, 0, 0, 0, 2]), Class::Acts));
    }
    frames.push((text(0x300, &[0x9C, 0, 0, 0, 0, 0, 0, 0]), Class::Acts));
    for id in [0x000, 0x140, 0x161, 0x240, 0x261, 0x380, 0x400, 0x421, 0x500, 0x521, 0x7FF] {
        frames.push((text(id, &[0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]), Class::Foreign));
        frames.push((text(id, &[0x54, 0x43, 0, 0, 0, 0, 0, 10]), Class::Foreign));
    }
    frames
}

/// Every thruster command to an axis and a stranger, bare, with a value, with odd bytes and cut
/// short; replies.
pub fn thruster() -> Vec<Frame> {
    let mut frames = Vec::new();
    for id in [0x301, 0x30B, 0x30C, 0x37F] {
        for [c0, c1] in THRUSTER_READS {
            frames.push((text(id, &[*c0, *c1, 0, 0]), Class::Reads));
            frames.push((text(id, &[*c0, *c1, 0, 0, 0, 0, 0, 0]), Class::Reads));
        }
        frames.push((text(id, &[b'R', b'P', 0, 1]), Class::Reads));
        for [c0, c1] in THRUSTER_READS.into_iter().chain(THRUSTER_ACTS) {
            let (c0, c1) = (*c0, *c1);
            for value in [
                [0, 0, 0, 0, 0, 10],
                [1, 0, 0, 0, 0, 10],
                [0, 0, 1, 0, 0, 10],
                [0, 60, 0, 0, 0, 100],
            ] {
                let [v0, v1, v2, v3, v4, v5] = value;
                frames.push((text(id, &[c0, c1, v0, v1, v2, v3, v4, v5]), Class::Acts));
            }
            for length in [2, 3, 5, 6, 7] {
                frames.push((text(id, &[c0, c1, 0, 0, 0, 0, 10][..length]), Class::Acts));
            }
        }
        for [c0, c1] in THRUSTER_ACTS {
            frames.push((text(id, &[*c0, *c1, 0, 0]), Class::Acts));
            frames.push((text(id, &[*c0, *c1, 0, 0, 0, 0, 0, 0]), Class::Acts));
        }
    }
    for id in [0x281, 0x28B, 0x2FF] {
        frames.push((text(id, &[b'Q', b'V', 0, 0]), Class::Acts));
        frames.push((text(id, &[0x54, 0x43, 0, 0, 0, 0, 0, 10]), Class::Acts));
    }
    frames
}

/// The eight bytes of a D5 request; the checksum is the sum of all but the head.
fn d5_bytes(id: u8, length: u8, command: u8, address: u8, low: u8, high: u8) -> [u8; 8] {
    let sum = [id, length, command, address, low, high].into_iter().fold(0u8, u8::wrapping_add);
    [0xD5, id, length, command, address, low, high, sum]
}

/// Every D5 command to an axis, a stranger and all, on the usual id and others; the speed in every
/// encoding; wrong checksums.
pub fn d5() -> Vec<Frame> {
    let mut frames = Vec::new();
    for (id, node) in [(0x00B, 0x0B), (0x00C, 0x0C), (0x0FE, 0xFE), (0x141, 0x0B), (0x7FF, 0x0C)] {
        for command in 0..=u8::MAX {
            // Commands 0x01 and 0xD4 read, and carry nothing; 0x02 reads any register. To all only
            // 0x01 is printed (D21).
            let reads: &[u8] = if node == 0xFE { &[0x01] } else { &[0x01, 0x02, 0xD4] };
            let class = if reads.contains(&command) { Class::Reads } else { Class::Acts };
            frames.push((text(id, &d5_bytes(node, 5, command, 0, 0, 0)), class));
            frames.push((text(id, &d5_bytes(node, 5, command, 0x20, 0x58, 0x02)), Class::Acts));
        }
        for address in 0..=u8::MAX {
            let class = if node == 0xFE { Class::Acts } else { Class::Reads };
            frames.push((text(id, &d5_bytes(node, 4, 0x02, address, 0, 0)), class));
            for command in [0x03, 0x04] {
                frames.push((text(id, &d5_bytes(node, 4, command, address, 1, 0)), Class::Acts));
                frames.push((text(id, &d5_bytes(node, 5, command, address, 1, 0)), Class::Acts));
            }
        }
        let [head, rest @ .., sum] = d5_bytes(node, 5, 0x02, 0x26, 0, 0);
        let wrong = [&[head][..], &rest, &[sum ^ 1]].concat();
        frames.push((text(id, &wrong), Class::Acts));
        frames.push((text(id, &[&[0x5D][..], &rest, &[sum]].concat()), Class::Acts));
        frames.push((text(id, &[&[head][..], &rest].concat()), Class::Acts));
        frames.push((text(id, &[]), Class::Acts));
    }
    frames
}

/// A whole RMD frame of a serial line.
pub fn serial_frame(id: u8, data: [u8; 8]) -> Vec<u8> {
    let mut bytes = [&[0x3E, id, 0x08][..], &data].concat();
    bytes.extend(crc16_modbus(&bytes).to_le_bytes());
    bytes
}

/// The reads of a serial line to one motor or, with 0xCD, to all, who also tell their ids.
pub fn serial_reads(id: u8) -> Vec<Vec<u8>> {
    let mut reads: Vec<_> = RMD_READS
        .into_iter()
        .map(|command| serial_frame(id, [command, 0, 0, 0, 0, 0, 0, 0]))
        .collect();
    reads.extend(
        [[0x30, 1, 0], [0x30, 9, 0], [0x42, 3, 0], [0xB5, 1, 1], [0xB5, 1, 3]]
            .map(|[command, index, part]| serial_frame(id, [command, index, part, 0, 0, 0, 0, 0])),
    );
    if id == 0xCD {
        reads.push(serial_frame(id, [0x79, 0, 1, 0, 0, 0, 0, 0]));
    }
    reads
}

/// Every RMD command on a serial line, to an axis, a stranger and all; wrong checksums, unfinished
/// frames, more than one.
pub fn serial() -> Vec<Frame> {
    let hex = |bytes: &[u8]| crate::text::hex(bytes);
    let mut frames = Vec::new();
    for id in [0x01, 0x07, 0x20, 0xCD] {
        for command in 0..=u8::MAX {
            let class = if RMD_READS.contains(&command) { Class::Reads } else { Class::Acts };
            let whole = serial_frame(id, [command, 0, 0, 0, 0, 0, 0, 0]);
            frames.push((hex(&whole), class));
            frames
                .push((hex(&serial_frame(id, [command, 0, 0, 0, 0x10, 0x27, 0, 0])), Class::Acts));
            let (last, but_last) = whole.split_last().unwrap();
            frames.push((hex(but_last), Class::Acts));
            frames.push((hex(&[but_last, &[last ^ 1]].concat()), Class::Acts));
            frames.push((hex(&[&[0x3E][..], &whole].concat()), Class::Acts));
            frames.push((hex(&[&whole[..], &whole].concat()), Class::Acts));
        }
        for flag in [0, 1, 2] {
            let class = if id == 0xCD && flag == 1 { Class::Reads } else { Class::Acts };
            frames.push((hex(&serial_frame(id, [0x79, 0, flag, 0, 0, 0, 0, 0])), class));
        }
    }
    for id in [0, 33, 0xFF] {
        frames.push((hex(&serial_frame(id, [0x9C, 0, 0, 0, 0, 0, 0, 0])), Class::Acts));
    }
    frames
}
