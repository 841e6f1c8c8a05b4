//! Frames to the motors of a pair, byte for byte.

use crate::action::Ask;
use crate::bus::crc16;
use crate::plant::{LINE, Wired};
use host_protocol::Protocol;

/// RMD: frees the brake.
pub const FREE_BRAKE: [u8; 8] = [0x77, 0, 0, 0, 0, 0, 0, 0];

/// A relative move by the manual of an RMD motor, which must go out once; the setpoint of a
/// thruster.
pub fn native(motor: &Wired) -> Vec<u8> {
    match motor.protocol {
        Protocol::Rmd => vec![0xA8, 0, 60, 0, 100, 0, 0, 0],
        Protocol::Thruster | Protocol::D5 => moves(motor),
    }
}

fn d5(node: u8, command: u8, address: u8, value: u8) -> Vec<u8> {
    let body = [node, 5, command, address, value, 0];
    let sum = body.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
    std::iter::once(0xD5).chain(body).chain([sum]).collect()
}

/// A question.
pub fn read(motor: &Wired) -> Vec<u8> {
    match motor.protocol {
        Protocol::Rmd => vec![0x9C, 0, 0, 0, 0, 0, 0, 0],
        Protocol::Thruster => b"QV\0\0".to_vec(),
        Protocol::D5 => d5(motor.node, 2, 0x26, 0),
    }
}

/// A motion as the manual has it.
pub fn moves(motor: &Wired) -> Vec<u8> {
    match motor.protocol {
        Protocol::Rmd => vec![0xA2, 0, 0, 0, 0x88, 0x13, 0, 0],
        Protocol::Thruster => b"TC\0\0\0\0\0\x05".to_vec(),
        Protocol::D5 => d5(motor.node, 3, 0x20, 30),
    }
}

/// A motion that a lenient motor obeys: with something in bytes that the manual does not use, or to
/// all.
pub fn moves_leniently(motor: &Wired) -> Vec<u8> {
    match motor.protocol {
        Protocol::Rmd => vec![0xA2, 7, 0, 0, 0x88, 0x13, 0, 0],
        Protocol::Thruster => b"TC\0\x09\x01\0\0\x05".to_vec(),
        Protocol::D5 => d5(0xFE, 3, 0x20, 30),
    }
}

/// A motion on RS485 whose checksum is the beginning of the request behind it.
pub fn raw_in_two(motor: &Wired) -> [Ask; 2] {
    let mut begun = serial(motor, moves(motor));
    let mut ended = begun.split_off(begun.len() - 2);
    ended.extend(serial(motor, read(motor)));
    [begun, ended].map(|data| Ask::RawSend { bus: motor.bus, id: 0, data })
}

/// A raw frame to a motor.
pub fn raw(motor: &Wired, data: Vec<u8>) -> Ask {
    if motor.bus != LINE {
        return Ask::RawSend { bus: motor.bus, id: request_id(motor), data };
    }
    Ask::RawSend { bus: motor.bus, id: 0, data: serial(motor, data) }
}

/// A frame on RS485.
pub fn serial(motor: &Wired, data: Vec<u8>) -> Vec<u8> {
    let mut bytes = vec![0x3E, motor.node, 8];
    bytes.extend(data);
    bytes.extend(crc16(&bytes).to_le_bytes());
    bytes
}

pub fn request_id(motor: &Wired) -> u32 {
    let base = match motor.protocol {
        Protocol::Rmd => 0x140,
        Protocol::Thruster => 0x300,
        Protocol::D5 => 0,
    };
    base + u32::from(motor.node)
}

pub fn reply_id(motor: &Wired) -> u32 {
    let base = match motor.protocol {
        Protocol::Rmd => 0x240,
        Protocol::Thruster => 0x280,
        Protocol::D5 => 0,
    };
    base + u32::from(motor.node)
}
