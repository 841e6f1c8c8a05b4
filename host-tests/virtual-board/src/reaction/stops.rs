//! Which frames on a bus are stops, and of which axis: by their bytes, as the manuals have them.

use std::time::Duration;

use rigless::chip::can::{Frame, Id};

use super::situation::MOST_AXES;
use crate::nodes::since_start;
use crate::rs485_line::SentByte;
use virtual_stm32::fdcan::{FrameEnd, FrameRecord, Sender};

/// When the first stop of each axis began since an instant; the node of axis n is n + 1 on RS485,
/// and 2n + 1 on CAN.
pub(super) type FirstStops = [Option<Duration>; MOST_AXES as usize];

/// RMD V3.6 §2.15: 0x81 at 0x140 plus the node.
const RMD_IDS: u16 = 0x140;
const RMD_STOP: [u8; 8] = [0x81, 0, 0, 0, 0, 0, 0, 0];
/// RMD V3.6 §4: header, node, length, and the same eight bytes before the checksum.
const RMD_SERIAL_HEADER: u8 = 0x3E;
/// D5 manual, quick start 5: speed 0, at the node's own id, between header, node, and checksum.
const D5_STOP: [u8; 5] = [0x05, 0x03, 0x20, 0, 0];

/// The axis that a frame stops.
fn on_can(frame: &Frame) -> Option<usize> {
    let (Id::Standard(id), payload) = (frame.id, frame.payload()) else { return None };
    let node = match payload {
        stop if stop == RMD_STOP => id.checked_sub(RMD_IDS)?,
        [0xD5, node, stop @ .., _] if *stop == D5_STOP && u16::from(*node) == id => id,
        _ => return None,
    };
    (node % 2 == 1).then(|| axis(node / 2 + 1)).flatten()
}

/// The axis that a message on RS485 stops.
fn on_rs485(message: &[u8]) -> Option<usize> {
    match message {
        [RMD_SERIAL_HEADER, node, 8, stop @ .., _, _] if *stop == RMD_STOP => axis((*node).into()),
        _ => None,
    }
}

fn axis(node: u16) -> Option<usize> {
    let axis = usize::from(node).checked_sub(1)?;
    (axis < usize::from(MOST_AXES)).then_some(axis)
}

fn first(found: impl Iterator<Item = (Duration, Option<usize>)>, since: Duration) -> FirstStops {
    let mut stops = FirstStops::default();
    for (at, axis) in found.filter(|(at, _)| *at >= since) {
        if let Some(axis) = axis {
            stops[axis].get_or_insert(at - since);
        }
    }
    stops
}

/// Among the frames of a CAN bus.
pub(super) fn among_frames(frames: &[FrameRecord], since: Duration) -> FirstStops {
    let ours = frames.iter().filter(|record| record.sender == Sender::Controller);
    let arrived = ours.filter(|record| record.outcome == FrameEnd::Acknowledged);
    first(arrived.map(|record| (since_start(record.start), on_can(&record.frame))), since)
}

/// Among the bytes on RS485: those without a pause between them are a message.
pub(super) fn among_bytes(sent: &[SentByte], since: Duration) -> FirstStops {
    let joined =
        |one: &SentByte, next: &SentByte| next.first_bit < one.end + (one.end - one.first_bit) / 2;
    let messages = sent.chunk_by(joined).filter(|message| message.iter().all(|sent| sent.driven));
    let stops = messages.map(|message| {
        let bytes: Vec<u8> = message.iter().map(|sent| sent.byte).collect();
        (message[0].first_bit, on_rs485(&bytes))
    });
    first(stops, since)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u16, data: [u8; 8]) -> Frame {
        crate::nodes::to_bus(&host_protocol::CanFrame::standard(id, &data).unwrap())
    }

    #[test]
    fn a_stop_is_known_by_its_bytes() {
        assert_eq!(on_can(&frame(0x141, RMD_STOP)), Some(0));
        assert_eq!(on_can(&frame(0x15F, RMD_STOP)), Some(15));
        assert_eq!(on_can(&frame(0x161, RMD_STOP)), None, "no axis of ours");
        assert_eq!(on_can(&frame(0x142, RMD_STOP)), None, "between two axes");
        assert_eq!(on_can(&frame(0x141, [0x9C, 0, 0, 0, 0, 0, 0, 0])), None);
        assert_eq!(on_can(&frame(0x00B, [0xD5, 0x0B, 0x05, 0x03, 0x20, 0, 0, 0x33])), Some(5));
        assert_eq!(
            on_can(&frame(0x00B, [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x73, 0, 0xA6])),
            None,
            "a speed"
        );
        let stop = [0x3E, 1, 8, 0x81, 0, 0, 0, 0, 0, 0, 0, 0x32, 0xA5];
        assert_eq!(on_rs485(&stop), Some(0));
        assert_eq!(on_rs485(&stop[..12]), None);
    }

    #[test]
    fn the_first_of_each_axis_counts() {
        let at = Duration::from_micros;
        let found = [
            (at(5), Some(1)),
            (at(20), Some(1)),
            (at(30), None),
            (at(40), Some(1)),
            (at(50), Some(0)),
        ];
        let stops = first(found.into_iter(), at(10));
        assert_eq!((stops[0], stops[1], stops[2]), (Some(at(40)), Some(at(10)), None));
    }
}
