//! What a motor obeys that reads leniently: bytes that a command does not use may be anything, data
//! may be short, what is missing counts as zero, and no pause ends a frame.
//!
//! The manuals do not say how a motor reads a frame that they do not draw. The gateway must reckon
//! with a motor of this kind.

use std::ops::Range;

use d5::{Address, Payload, REQUEST_HEADER};
use embedded_can::Frame;
use host_protocol::CanFrame;
use rmd::DATA_LEN;
use rmd::rs485::{Deframer, FRAME_LEN};

/// D5: the length byte where the upper data byte is empty, and where it is not.
const D5_SHORT: u8 = 4;
const D5_FULL: u8 = 5;

/// Eight bytes, with zeros in the place of those that are missing.
fn filled(frame: &CanFrame) -> [u8; DATA_LEN] {
    let mut data = [0; DATA_LEN];
    data.iter_mut().zip(frame.data()).for_each(|(place, byte)| *place = *byte);
    data
}

fn with(frame: &CanFrame, data: &[u8]) -> CanFrame {
    if frame.is_remote_frame() {
        *frame
    } else {
        CanFrame::data_frame(frame.id(), data).unwrap_or(*frame)
    }
}

/// The frame that an RMD motor takes this one for. Of its eight bytes it looks only at those that
/// the command uses.
pub(super) fn as_rmd(frame: &CanFrame) -> CanFrame {
    with(frame, &filled(frame))
}

/// The frame that a thruster takes this one for: of the bytes behind the command those that a
/// command may use.
pub(super) fn as_thruster(frame: &CanFrame) -> CanFrame {
    /// Nothing is left out; the parameter; that and the upper half of a value; all.
    const LEFT_OUT: [Range<usize>; 4] = [2..2, 2..4, 2..6, 2..8];
    let readings = LEFT_OUT.map(|left_out| {
        let mut data = filled(frame);
        data[left_out].fill(0);
        with(frame, &data)
    });
    *readings.iter().find(|reading| is_thruster_command(reading)).unwrap_or(frame)
}

fn is_thruster_command(frame: &CanFrame) -> bool {
    let request = thruster::can::decode_request(frame);
    request.is_ok_and(|(_, request)| !matches!(request, thruster::Request::Unknown { .. }))
}

/// The frame that a D5 motor with this id takes this one for: the checksum is not looked at, and
/// one to all is for it.
pub(super) fn as_d5(id: u8, frame: &CanFrame) -> CanFrame {
    let [header, to, length, command, address, low, high, _] = filled(frame);
    if header != REQUEST_HEADER || ![id, Address::BROADCAST_ID].contains(&to) {
        return *frame;
    }
    let length = if length == D5_SHORT { D5_SHORT } else { D5_FULL };
    let high = if length == D5_SHORT { 0 } else { high };
    let readings = [
        [length, command, address, low, high],
        [length, command, address, 0, 0],
        [D5_FULL, command, 0, 0, 0],
    ];
    let understood =
        readings.into_iter().find(|bytes| d5::Request::decode(&Payload(*bytes)).is_ok());
    let Some(bytes @ [length, command, address, low, high]) = understood else { return *frame };
    let sum = bytes.iter().fold(id, |sum, byte| sum.wrapping_add(*byte));
    with(frame, &[REQUEST_HEADER, id, length, command, address, low, high, sum])
}

/// The last bytes of an RS485 line, whatever the pauses between them and whatever frames they were
/// part of.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Line([u8; FRAME_LEN]);

impl Line {
    /// Takes the next byte; yields the frame that it completes.
    pub(super) fn push(&mut self, byte: u8) -> Option<[u8; FRAME_LEN]> {
        self.0.rotate_left(1);
        self.0[FRAME_LEN - 1] = byte;
        let mut deframer = Deframer::new();
        self.0.iter().filter_map(|byte| deframer.push(*byte)).last()
    }
}

#[cfg(test)]
#[path = "lenient_tests.rs"]
mod tests;
