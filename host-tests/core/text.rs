//! Frames as texts: `ID#HEX` on CAN, hex on RS485.

use embedded_can::Id;
use host_protocol::CanFrame;

/// Whether a text is that of a CAN frame.
pub fn is_can(text: &str) -> bool {
    text.contains('#')
}

pub fn can_text(frame: &CanFrame) -> String {
    let id = match frame.id() {
        Id::Standard(id) => format!("{:03X}", id.as_raw()),
        Id::Extended(id) => format!("{:08X}", id.as_raw()),
    };
    format!("{id}#{}", hex(frame.data()))
}

pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

pub fn unhex(text: &str) -> Vec<u8> {
    (0..text.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap())
        .collect()
}
