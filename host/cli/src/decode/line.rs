//! One line of a capture: a CAN frame as candump writes it, or the bytes of a serial line in
//! hexadecimal.

use embedded_can::{ExtendedId, Frame, Id, StandardId};
use host_protocol::{CanFrame, MAX_CAN_DATA};

/// What stands between id and data.
const ID_END: u8 = b'#';
/// Digits of a standard id; an extended one has up to 8.
const STANDARD_DIGITS: usize = 3;
const EXTENDED_DIGITS: usize = 8;
/// Bit of the id with which candump marks the error frames of the controller.
const ERROR_FLAG: u32 = 1 << 29;
/// What the name of a serial interface begins with.
const SERIAL: &[u8] = b"serial";
/// Marks a remote frame in place of its data.
const REMOTE: u8 = b'R';

/// Where and when a frame was captured, as far as the line says so.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Origin<'a> {
    /// What stood between brackets, seconds as a rule.
    pub time: Option<&'a [u8]>,
    pub interface: Option<&'a [u8]>,
}

/// A line taken apart.
pub struct Line<'a> {
    pub origin: Origin<'a>,
    /// All of the line, without the spaces around it.
    pub text: &'a [u8],
    pub content: Content<'a>,
}

/// What a line holds.
pub enum Content<'a> {
    Nothing,
    Can(CanFrame),
    Serial(HexBytes<'a>),
    Unreadable(Unreadable),
}

/// Why a line holds nothing that could be decoded.
pub struct Unreadable {
    /// Stable name.
    pub name: &'static str,
    pub message: &'static str,
}

impl Unreadable {
    /// Neither form.
    const LINE: Self = Self {
        name: "line",
        message: "neither a CAN frame such as 141#9A00000000000000 nor bytes in hexadecimal",
    };
    const CAN_ID: Self =
        Self { name: "can_id", message: "a CAN id ends at 7FF with 3 digits, at 1FFFFFFF with 8" };
    const CAN_FD: Self =
        Self { name: "can_fd", message: "a CAN FD frame: the motors speak classic CAN" };
    const ERROR_FRAME: Self =
        Self { name: "error_frame", message: "an error frame of the CAN controller" };
    const LENGTH: Self = Self { name: "length", message: "more than 8 data bytes" };
    /// The kind of line that `--bus` or `--protocol` leaves out.
    pub const OTHER_BUS: Self =
        Self { name: "other_bus", message: "not from a bus of the kind that was asked for" };
}

impl<'a> Line<'a> {
    /// Takes a line apart.
    pub fn parse(line: &'a [u8]) -> Self {
        let text = line.trim_ascii();
        let (time, rest) = match split_time(text) {
            Some((time, rest)) => (Some(time), rest),
            None => (None, text),
        };
        let mut origin = Origin { time, interface: None };
        let content = if rest.is_empty() {
            Content::Nothing
        } else if rest.contains(&ID_END) {
            log_frame(rest, &mut origin).map_or_else(Content::Unreadable, Content::Can)
        } else if rest.contains(&b'[') {
            screen_frame(rest, &mut origin).map_or_else(Content::Unreadable, Content::Can)
        } else {
            serial_bytes(rest, &mut origin)
                .map_or(Content::Unreadable(Unreadable::LINE), Content::Serial)
        };
        Self { origin, text, content }
    }
}

/// `(time) rest`.
fn split_time(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let inside = text.strip_prefix(b"(")?;
    let end = inside.iter().position(|byte| *byte == b')')?;
    let (time, rest) = inside.split_at_checked(end)?;
    Some((time.trim_ascii(), rest.get(1..)?.trim_ascii_start()))
}

/// `can0 141#9A00000000000000`, as in a candump log, or without the interface.
fn log_frame<'a>(text: &'a [u8], origin: &mut Origin<'a>) -> Result<CanFrame, Unreadable> {
    let mut words = words(text);
    let mut frame = words.next().ok_or(Unreadable::LINE)?;
    if !frame.contains(&ID_END) {
        origin.interface = Some(frame);
        frame = words.next().ok_or(Unreadable::LINE)?;
    }
    match (words.next(), words.next()) {
        // Received or transmitted, as `candump -x` adds.
        (None | Some(b"R" | b"T"), None) => {}
        _ => return Err(Unreadable::LINE),
    }
    let end = frame.iter().position(|byte| *byte == ID_END).ok_or(Unreadable::LINE)?;
    let (digits, data) = frame.split_at_checked(end).ok_or(Unreadable::LINE)?;
    let data = data.get(1..).unwrap_or_default();
    if data.first() == Some(&ID_END) {
        return Err(Unreadable::CAN_FD);
    }
    let id = id(digits)?;
    match data {
        [REMOTE | b'r', length @ ..] => remote(id, length),
        _ => data_frame(id, HexBytes::new(data).ok_or(Unreadable::LINE)?),
    }
}

/// `can0  141   [8]  9A 00 00 00 00 00 00 00`, as candump writes to a screen.
fn screen_frame<'a>(text: &'a [u8], origin: &mut Origin<'a>) -> Result<CanFrame, Unreadable> {
    let open = text.iter().position(|byte| *byte == b'[').ok_or(Unreadable::LINE)?;
    let (head, rest) = text.split_at_checked(open).ok_or(Unreadable::LINE)?;
    let close = rest.iter().position(|byte| *byte == b']').ok_or(Unreadable::LINE)?;
    let (length, data) = rest.split_at_checked(close).ok_or(Unreadable::LINE)?;
    // Behind the bytes `candump -a` prints them as text.
    let data = data.get(1..).unwrap_or_default();
    let data = data.split(|byte| *byte == b'\'').next().unwrap_or_default().trim_ascii();
    let mut words = words(head);
    let (first, second) = (words.next(), words.next());
    let digits = match (first, second) {
        (Some(interface), Some(id)) => {
            origin.interface = Some(interface);
            id
        }
        (Some(id), None) => id,
        _ => return Err(Unreadable::LINE),
    };
    let digits = match (digits, words.next(), words.next(), words.next()) {
        (id, None, None, None) => id,
        // Received or transmitted, bit rate and error state, as `candump -x` adds.
        (b"RX" | b"TX", Some(b"-" | b"B"), Some(b"-" | b"E"), Some(id)) => id,
        _ => return Err(Unreadable::LINE),
    };
    if words.next().is_some() {
        return Err(Unreadable::LINE);
    }
    let id = id(digits)?;
    if data == b"remote request" {
        return remote(id, length.get(1..).unwrap_or_default());
    }
    data_frame(id, HexBytes::new(data).ok_or(Unreadable::LINE)?)
}

/// `serial2 3E0108…`, as `mgw raw` writes it, or only the bytes.
fn serial_bytes<'a>(text: &'a [u8], origin: &mut Origin<'a>) -> Option<HexBytes<'a>> {
    HexBytes::new(text).or_else(|| {
        let end = text.iter().position(u8::is_ascii_whitespace)?;
        let (name, bytes) = text.split_at_checked(end)?;
        let bytes = name.starts_with(SERIAL).then(|| HexBytes::new(bytes)).flatten()?;
        origin.interface = Some(name);
        Some(bytes)
    })
}

fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

fn id(digits: &[u8]) -> Result<Id, Unreadable> {
    if digits.is_empty() || digits.len() > EXTENDED_DIGITS {
        return Err(Unreadable::LINE);
    }
    let mut id = 0;
    for digit in digits {
        id = id << 4 | u32::from(nibble(*digit).ok_or(Unreadable::LINE)?);
    }
    if digits.len() <= STANDARD_DIGITS {
        let standard = u16::try_from(id).ok().and_then(StandardId::new);
        return standard.map(Id::Standard).ok_or(Unreadable::CAN_ID);
    }
    if id & ERROR_FLAG != 0 {
        return Err(Unreadable::ERROR_FRAME);
    }
    ExtendedId::new(id).map(Id::Extended).ok_or(Unreadable::CAN_ID)
}

fn remote(id: Id, length: &[u8]) -> Result<CanFrame, Unreadable> {
    let length = match length {
        [] => 0,
        [digit @ b'0'..=b'8'] => digit - b'0',
        _ => return Err(Unreadable::LENGTH),
    };
    CanFrame::remote_frame(id, length).ok_or(Unreadable::LENGTH)
}

fn data_frame(id: Id, bytes: HexBytes<'_>) -> Result<CanFrame, Unreadable> {
    let mut data = [0; MAX_CAN_DATA];
    let mut length = 0;
    for byte in bytes {
        *data.get_mut(length).ok_or(Unreadable::LENGTH)? = byte;
        length += 1;
    }
    <CanFrame as Frame>::new(id, data.get(..length).unwrap_or_default()).ok_or(Unreadable::LENGTH)
}

/// Bytes written as pairs of hexadecimal digits, with or without something between them.
#[derive(Clone, Copy)]
pub struct HexBytes<'a> {
    rest: &'a [u8],
}

impl<'a> HexBytes<'a> {
    /// `None` unless the text is pairs of digits and what may stand between them; `0x` may stand
    /// before a pair.
    fn new(text: &'a [u8]) -> Option<Self> {
        let mut rest = text;
        while !rest.is_empty() {
            rest = match rest {
                [b'0', b'x' | b'X', rest @ ..]
                | [b' ' | b'\t' | b',' | b':' | b'.' | b'-', rest @ ..] => rest,
                [high, low, rest @ ..] if nibble(*high).is_some() && nibble(*low).is_some() => rest,
                _ => return None,
            };
        }
        Some(Self { rest: text })
    }
}

impl Iterator for HexBytes<'_> {
    type Item = u8;

    fn next(&mut self) -> Option<u8> {
        loop {
            let [high, low, rest @ ..] = self.rest else { return None };
            let Some((high, low)) = nibble(*high).zip(nibble(*low)) else {
                self.rest = self.rest.get(1..)?;
                continue;
            };
            self.rest = rest;
            return Some(high << 4 | low);
        }
    }
}

fn nibble(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'A'..=b'F' => Some(digit - b'A' + 10),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn can(text: &str) -> (Origin<'_>, CanFrame) {
        let line = Line::parse(text.as_bytes());
        let Content::Can(frame) = line.content else { panic!("{text}") };
        (line.origin, frame)
    }

    fn why(text: &str) -> &'static str {
        let Content::Unreadable(why) = Line::parse(text.as_bytes()).content else {
            panic!("{text}")
        };
        why.name
    }

    fn serial(text: &str) -> Vec<u8> {
        let Content::Serial(bytes) = Line::parse(text.as_bytes()).content else { panic!("{text}") };
        bytes.collect()
    }

    #[test]
    fn every_form_of_a_can_frame() {
        let frame = CanFrame::standard(0x141, &[0x9A, 0xFF]).unwrap();
        let bare = Origin::default();
        let named = Origin { interface: Some(b"can0"), ..bare };
        let timed = Origin { time: Some(b"1700000000.000000"), ..named };
        assert_eq!(can("141#9AFF"), (bare, frame));
        assert_eq!(can(" 141#9a.ff\r\n"), (bare, frame));
        assert_eq!(can("can0 141#9AFF"), (named, frame));
        assert_eq!(can("(1700000000.000000) can0 141#9AFF\n"), (timed, frame));
        assert_eq!(can("(1700000000.000000) can0 141#9AFF R"), (timed, frame));
        assert_eq!(can("  can0  141   [2]  9A FF"), (named, frame));
        assert_eq!(can(" (1700000000.000000)  can0  141   [2]  9A FF"), (timed, frame));
        assert_eq!(can("141 [2] 9A FF"), (bare, frame));
        for flags in ["RX - -", "TX B -", "RX - E"] {
            assert_eq!(can(&format!("  can0  {flags}  141   [2]  9A FF")).1, frame);
        }
        assert_eq!(can("00000141#9AFF").1, CanFrame::extended(0x141, &[0x9A, 0xFF]).unwrap());
        assert_eq!(can("141#").1, CanFrame::standard(0x141, &[]).unwrap());
        let remote =
            CanFrame::remote_frame(Id::Standard(StandardId::new(0x141).unwrap()), 8).unwrap();
        assert_eq!(can("141#R8").1, remote);
        assert_eq!(can("can0  141   [8]  remote request").1, remote);
    }

    #[test]
    fn what_is_no_frame_says_why() {
        for (text, name) in [
            ("hello", "line"),
            ("3E0", "line"),
            ("141#9", "line"),
            ("#9A", "line"),
            ("can0 can1 141#9A", "line"),
            ("14G#9A", "line"),
            ("123456789#9A", "line"),
            ("141#00112233445566778899", "length"),
            ("141#R9", "length"),
            ("141##19A", "can_fd"),
            ("800#9A", "can_id"),
            ("9FFFFFFF#9A", "can_id"),
            ("20000080#0000000000000000", "error_frame"),
            ("can0 [8]", "line"),
            ("can0 RX 141 [1] 9A", "line"),
            ("can0 RX - - - 141 [1] 9A", "line"),
            ("serial2 hello", "line"),
            ("hello2 3E01", "line"),
            ("can0 141 [8", "line"),
            ("(17", "line"),
        ] {
            assert_eq!(why(text), name, "{text}");
        }
        assert!(matches!(Line::parse(b" \r\n").content, Content::Nothing));
        assert!(matches!(Line::parse(b"(1.5)").content, Content::Nothing));
    }

    #[test]
    fn serial_bytes_may_have_gaps() {
        for text in
            ["3E01F230", "3e 01 f2 30", "3E:01:F2:30", "0x3E, 0x01, 0xF2, 0x30", "(1.5) 3E01 F230"]
        {
            assert_eq!(serial(text), [0x3E, 0x01, 0xF2, 0x30], "{text}");
        }
        let line = Line::parse(b"(1.5) serial2 3E01");
        assert_eq!(line.origin, Origin { time: Some(b"1.5"), interface: Some(b"serial2") });
        assert!(matches!(line.content, Content::Serial(_)));
    }
}
