//! What was on the motor buses, as text: `141#A100000064000000` on CAN,
//! `3E01089C00000000000000F230` on RS485.

use std::fmt::Write as _;
use std::time::Duration;

use rigless::chip::can::{Frame, Id};
use virtual_board::nodes::since_start;
use virtual_board::rs485_line::SentByte;
use virtual_stm32::fdcan::{FrameEnd, FrameRecord, Sender};

/// A message on a bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OnWire {
    /// Its bus, as the gateway numbers it.
    pub bus: u8,
    /// When its first bit was sent, since the board was switched on.
    pub first_bit: Duration,
    /// When its last bit had been sent.
    pub end: Duration,
    /// The gateway sent it.
    pub by_gateway: bool,
    /// It reached the others: acknowledged on CAN, driven onto the line on RS485.
    pub arrived: bool,
    /// Its bytes.
    pub text: String,
}

/// A frame of a CAN bus.
pub fn of_can(bus: u8, record: &FrameRecord) -> OnWire {
    OnWire {
        bus,
        first_bit: since_start(record.start),
        end: since_start(record.end),
        by_gateway: record.sender == Sender::Controller,
        arrived: record.outcome == FrameEnd::Acknowledged,
        text: can_text(&record.frame),
    }
}

fn can_text(frame: &Frame) -> String {
    let id = match frame.id {
        Id::Standard(id) => format!("{id:03X}"),
        Id::Extended(id) => format!("{id:08X}"),
    };
    let remote = if frame.remote { "R" } else { "" };
    format!("{id}#{remote}{}", hex(frame.payload()))
}

/// The messages among the bytes that the gateway has sent on RS485: bytes without a pause between
/// them.
pub fn of_rs485(bus: u8, sent: &[SentByte]) -> Vec<OnWire> {
    let joined =
        |one: &SentByte, next: &SentByte| next.first_bit < one.end + (one.end - one.first_bit) / 2;
    sent.chunk_by(joined)
        .filter_map(|message| {
            let bytes: Vec<u8> = message.iter().map(|sent| sent.byte).collect();
            Some(OnWire {
                bus,
                first_bit: message.first()?.first_bit,
                end: message.last()?.end,
                by_gateway: true,
                arrived: message.iter().all(|sent| sent.driven),
                text: hex(&bytes),
            })
        })
        .collect()
}

/// Bytes as text.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02X}");
        text
    })
}

/// The first message of the gateway that reads like this and arrived.
/// Fails with what the gateway sent instead.
pub fn find<'a>(messages: &'a [OnWire], text: &str) -> Result<&'a OnWire, String> {
    let sent = || messages.iter().filter(|message| message.by_gateway);
    sent().find(|message| message.arrived && message.text == text).ok_or_else(|| {
        let instead: Vec<_> =
            sent().map(|message| (message.first_bit, &message.text, message.arrived)).collect();
        format!("{text} was not sent, but {instead:?}")
    })
}
