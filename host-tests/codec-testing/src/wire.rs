//! Frames as the vector files write them.

use core::fmt;

use embedded_can::{ExtendedId, Frame, Id, StandardId};

use super::CanFrame;

/// A frame on a bus: candump's `id#data` (eight digits of id: extended; `R8`: remote) on CAN, bare
/// bytes on RS485.
#[derive(Debug, Clone, PartialEq)]
pub enum Wire {
    /// A CAN frame.
    Can(CanFrame),
    /// A CAN frame that the manual prints with more bytes than a frame can hold.
    TooLong(Vec<u8>),
    /// The bytes of a serial line.
    Serial(Vec<u8>),
}

impl Wire {
    /// Reads a frame.
    pub fn parse(text: &str) -> Wire {
        let Some((id, data)) = text.split_once('#') else { return Wire::Serial(hex(text)) };
        let number = u32::from_str_radix(id, 16).expect("hex id");
        let id: Id = match id.len() {
            8 => ExtendedId::new(number).expect("29 bits").into(),
            _ => StandardId::new(u16::try_from(number).expect("11 bits")).expect("11 bits").into(),
        };
        if let Some(dlc) = data.strip_prefix('R') {
            let frame = CanFrame::new_remote(id, dlc.parse().expect("a length"));
            return Wire::Can(frame.expect("at most eight bytes"));
        }
        let data = hex(data);
        CanFrame::new(id, &data).map_or(Wire::TooLong(data), Wire::Can)
    }

    /// The CAN frame.
    pub fn can(&self) -> &CanFrame {
        let Wire::Can(frame) = self else { panic!("{self:?} is not a CAN frame") };
        frame
    }

    /// The bytes of the line, which must be `LEN`.
    pub fn serial<const LEN: usize>(&self) -> &[u8; LEN] {
        let Wire::Serial(bytes) = self else { panic!("{self:?} is not serial") };
        bytes.as_slice().try_into().expect("a frame's bytes")
    }
}

impl fmt::Display for Wire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Wire::Can(frame) => {
                let Id::Standard(id) = frame.id() else { panic!("no codec sends extended ids") };
                write!(f, "{:03X}#{}", id.as_raw(), digits(frame.data()))
            }
            Wire::TooLong(bytes) | Wire::Serial(bytes) => f.write_str(&digits(bytes)),
        }
    }
}

/// The bytes of hexadecimal digits.
pub fn hex(text: &str) -> Vec<u8> {
    assert!(text.is_ascii() && text.len().is_multiple_of(2), "{text}: half a byte");
    let bytes = (0..text.len()).step_by(2);
    bytes.map(|at| u8::from_str_radix(&text[at..at + 2], 16).expect("hex")).collect()
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}
