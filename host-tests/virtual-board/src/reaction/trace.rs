//! What a bus carried about a command, as text: for the eyes of who looks for the cause of a late
//! stop.

use std::fmt::Write as _;
use std::time::Duration;

use rigless::chip::can::{Frame, Id};

use crate::nodes::since_start;
use crate::rs485_line::SentByte;
use virtual_stm32::fdcan::{FrameRecord, Sender};

/// How long before the command it begins.
const BEFORE: Duration = Duration::from_millis(5);

/// From the command's last bit, µs: negative before it.
fn relative_us(at: Duration, since: Duration) -> f64 {
    (at.as_secs_f64() - since.as_secs_f64()) * 1e6
}

fn frame_text(frame: &Frame) -> String {
    let id = match frame.id {
        Id::Standard(id) => format!("{id:03X}"),
        Id::Extended(id) => format!("{id:08X}"),
    };
    frame.payload().iter().fold(id + "#", |text, byte| text + &format!("{byte:02X}"))
}

/// A line for each frame: begin and end from the command's last bit on, µs; sender; frame; how it
/// ended.
pub(super) fn of_frames(frames: &[FrameRecord], since: Duration) -> String {
    let mut text = String::new();
    for record in frames.iter().filter(|record| since_start(record.start) + BEFORE >= since) {
        let [start, end] = [record.start, record.end].map(|at| relative_us(since_start(at), since));
        let sender = match record.sender {
            Sender::Controller => "gateway".to_owned(),
            Sender::Node(index) => format!("node {index}"),
        };
        let frame = frame_text(&record.frame);
        let _ =
            writeln!(text, "{start:10.1} {end:10.1}  {sender:<8} {frame:<21} {:?}", record.outcome);
    }
    text
}

/// A line for each byte that the port has sent: begin and end from the command's last bit on, µs;
/// the byte.
pub(super) fn of_bytes(sent: &[SentByte], since: Duration) -> String {
    let mut text = String::new();
    for byte in sent.iter().filter(|sent| sent.first_bit + BEFORE >= since) {
        let [start, end] = [byte.first_bit, byte.end].map(|at| relative_us(at, since));
        let heard = if byte.driven { "" } else { "  not driven" };
        let _ = writeln!(text, "{start:10.1} {end:10.1}  {:02X}{heard}", byte.byte);
    }
    text
}

#[cfg(test)]
mod tests {
    use rigless::time::VirtualNanos;

    use virtual_stm32::fdcan::FrameEnd;

    use super::*;

    #[test]
    fn frames_are_shown_from_5_ms_before_the_command_on() {
        let frame =
            crate::nodes::to_bus(&host_protocol::CanFrame::standard(0x00B, &[0xD5, 0x0B]).unwrap());
        let record = |start, end, sender, outcome| FrameRecord {
            start: VirtualNanos(start),
            end: VirtualNanos(end),
            sender,
            frame,
            outcome,
        };
        let frames = [
            record(4_999_999, 5_100_000, Sender::Controller, FrameEnd::Acknowledged),
            record(5_000_000, 5_600_000, Sender::Node(3), FrameEnd::Acknowledged),
            record(10_000_500, 10_600_000, Sender::Controller, FrameEnd::Destroyed),
        ];
        let expected = "   -5000.0    -4400.0  node 3   00B#D50B              Acknowledged\n       \
                        0.5      600.0  gateway  00B#D50B              Destroyed\n";
        assert_eq!(of_frames(&frames, Duration::from_millis(10)), expected);
    }

    #[test]
    fn bytes_that_nobody_heard_are_marked() {
        let us = Duration::from_micros;
        let byte =
            |at, driven| SentByte { first_bit: us(at), end: us(at + 87), byte: 0x3E, driven };
        let expected = "       0.0       87.0  3E\n     100.0      187.0  3E  not driven\n";
        assert_eq!(of_bytes(&[byte(10_000, true), byte(10_100, false)], us(10_000)), expected);
    }
}
