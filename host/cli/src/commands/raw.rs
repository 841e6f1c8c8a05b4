//! `mgw raw`

use std::time::Duration;

use host_protocol::{Bytes, CanFrame, MAX_SERIAL_FRAME, RawFrame, ReceivedFrame};
use mgw_client::ClientError;
use serde_json::json;

use crate::args::RawAction;
use crate::failure::Failure;
use crate::json;
use crate::session::Session;

/// What stands between id and data.
const ID_END: char = '#';
/// Digits of a standard id; an extended one has more.
const STANDARD_DIGITS: usize = 3;
/// Between two fetches of what has arrived.
const FETCH_EVERY: Duration = Duration::from_millis(20);
const MICROSECONDS_PER_SECOND: u64 = 1_000_000;

/// Opens the bus, sends and listens, and closes it.
pub fn run(
    session: &mut Session,
    bus: u8,
    unsafe_access: bool,
    action: &RawAction,
) -> Result<(), Failure> {
    let (frame, duration) = match action {
        RawAction::Send { frame, wait } => (Some(RawFrame::Can(can_frame(frame)?)), *wait),
        RawAction::SendHex { bytes, wait } => (Some(RawFrame::Serial(serial_frame(bytes)?)), *wait),
        RawAction::Listen { seconds } => (None, seconds.unwrap_or(Duration::MAX)),
    };
    if unsafe_access {
        session.client.raw_open_unsafe(bus)?;
    } else {
        session.client.raw_open(bus)?;
    }
    let sent =
        frame.map_or(Ok(()), |frame| session.client.raw_send(bus, frame).map_err(Failure::from));
    let result = sent.and_then(|()| match listen(session, bus, duration) {
        // Ctrl-C is how it ends.
        Err(Failure::Client(ClientError::Interrupted { .. })) => Ok(()),
        result => result,
    });
    // An open bus refuses arming, so it is closed whatever happened.
    let closed = session.client.raw_close(bus);
    result.and(closed.map_err(Failure::from))
}

fn listen(session: &mut Session, bus: u8, duration: Duration) -> Result<(), Failure> {
    let end = session.client.now().saturating_add(duration);
    loop {
        let received = session.client.raw_receive(bus)?;
        for frame in &received.frames {
            print(session, bus, frame)?;
        }
        if received.dropped > 0 {
            session.out.aside(format!("{} frames were lost", received.dropped));
            session.out.object(&json::line("lost", json!({ "count": received.dropped })))?;
        }
        if session.client.now() >= end {
            return Ok(());
        }
        if received.frames.is_empty() {
            session.client.pause(FETCH_EVERY)?;
        }
    }
}

fn print(session: &Session, bus: u8, received: &ReceivedFrame) -> Result<(), Failure> {
    let ReceivedFrame { time_us, frame } = received;
    let (kind, frame) = (json::kind(frame), json::frame(frame));
    let (seconds, rest) = (time_us / MICROSECONDS_PER_SECOND, time_us % MICROSECONDS_PER_SECOND);
    session.out.event(
        "frame",
        // As `candump -L` writes it, and `mgw decode` reads it.
        format!("({seconds:010}.{rest:06}) {kind}{bus} {frame}"),
        json!({ "bus": bus, "time_us": time_us, "frame": frame }),
    )
}

/// A frame as a recording has it; nothing where it is none, or a remote frame.
pub fn recorded_frame(kind: &str, text: &str) -> Option<RawFrame> {
    match kind {
        "can" => can_frame(text).ok().map(RawFrame::Can),
        "serial" => serial_frame(text).ok().map(RawFrame::Serial),
        _ => None,
    }
}

fn can_frame(text: &str) -> Result<CanFrame, Failure> {
    let wrong = || {
        Failure::Usage(format!(
            "`{text}` is no CAN frame. Write ID#DATA in hexadecimal, 3 digits for a standard id, 8 \
                for an extended one, at most 8 data bytes, for example 141#9A00000000000000"
        ))
    };
    let (id, data) = text.split_once(ID_END).ok_or_else(wrong)?;
    let data = bytes(data).ok_or_else(wrong)?;
    let frame = if id.len() <= STANDARD_DIGITS {
        u16::from_str_radix(id, 16).ok().and_then(|id| CanFrame::standard(id, &data))
    } else {
        u32::from_str_radix(id, 16).ok().and_then(|id| CanFrame::extended(id, &data))
    };
    frame.ok_or_else(wrong)
}

fn serial_frame(text: &str) -> Result<Bytes<MAX_SERIAL_FRAME>, Failure> {
    let wrong = || {
        Failure::Usage(format!(
            "`{text}` is no sequence of bytes. Write 1 to {MAX_SERIAL_FRAME} bytes in hexadecimal, \
                for example 3E01089A00000000000000721A"
        ))
    };
    let bytes = bytes(text).filter(|bytes| !bytes.is_empty()).ok_or_else(wrong)?;
    Bytes::from_slice(&bytes).map_err(|_| wrong())
}

/// Pairs of hexadecimal digits; spaces, dots and colons between them are ignored.
pub(super) fn bytes(text: &str) -> Option<Vec<u8>> {
    const HEX: u32 = 16;
    let digits: Option<Vec<u8>> = text
        .chars()
        .filter(|character| !matches!(character, ' ' | '.' | ':'))
        .map(|character| character.to_digit(HEX).and_then(|digit| u8::try_from(digit).ok()))
        .collect();
    let digits = digits?;
    let (pairs, rest) = digits.as_chunks::<2>();
    rest.is_empty().then(|| pairs.iter().map(|[high, low]| high << 4 | low).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_read_as_candump_writes_it() {
        let frame = can_frame("141#9A00000000000000").unwrap();
        assert_eq!(frame, CanFrame::standard(0x141, &[0x9A, 0, 0, 0, 0, 0, 0, 0]).unwrap());
        assert_eq!(can_frame("00000141#").unwrap(), CanFrame::extended(0x141, &[]).unwrap());
        for wrong in ["141", "141#9", "141#9A0000000000000000", "800#", "20000000#", "x#00", "#00"]
        {
            assert!(can_frame(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn bytes_are_read_with_or_without_gaps() {
        assert_eq!(serial_frame("3E 01:08.9c").unwrap(), [0x3E, 0x01, 0x08, 0x9C]);
        for wrong in ["", "3", "3E0", "zz"] {
            assert!(serial_frame(wrong).is_err(), "{wrong}");
        }
        assert!(serial_frame(&"00".repeat(65)).is_err());
    }
}
