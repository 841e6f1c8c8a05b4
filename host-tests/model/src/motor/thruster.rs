//! Thruster manual.

use super::{Purpose, Question, Reading, Timeout};
use std::f64::consts::PI;

/// What the data of a refusal end in (T6).
const REFUSAL: [u8; 4] = [0, 0, 0xEE, 0xEE];

pub(super) fn purpose(data: &[u8]) -> Purpose {
    let value_is_zero = data.get(4..).is_some_and(|value| value.iter().all(|byte| *byte == 0));
    match data.get(..2) {
        // §2.1: signal and speed
        Some(b"TC") if value_is_zero => Purpose::Stop,
        Some(b"VC") if value_is_zero => Purpose::Rest,
        Some(b"TC" | b"VC") => Purpose::Motion { once: false },
        // §4: absolute, relative, emergency stop
        Some(b"LA") => Purpose::Motion { once: false },
        Some(b"LR") => Purpose::Motion { once: true },
        Some(b"LS") => Purpose::Rest,
        Some(b"QV" | b"QC" | b"QP" | b"QT" | b"EQ" | b"EF" | b"FR" | b"QA" | b"QR" | b"RP") => {
            Purpose::Read
        }
        _ => Purpose::Change,
    }
}

pub(super) fn question(data: &[u8]) -> Option<Question> {
    match data.get(..2)? {
        b"EF" => Some(Question::Faults),
        b"FR" => Some(Question::Record),
        b"QV" => Some(Question::Speed),
        _ => None,
    }
}

/// ST with its milliseconds; another id or bitrate.
pub(super) fn timeout_touched(data: &[u8]) -> Option<Timeout> {
    match data.get(..2)? {
        b"ST" => Some(Timeout::of_ms(u32::from_be_bytes(data.get(4..8)?.try_into().ok()?))),
        b"CI" | b"CB" => Some(Timeout::Unknown),
        _ => None,
    }
}

/// What answers TC and VC, as VM is set (§2.4; PROTOCOL-NOTES T8, T9, T22).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Returns {
    /// The echo.
    #[default]
    Echo,
    /// Frames with a header, of which this one acknowledges: with several for one command the
    /// others could be taken for those of the next.
    Frame(u8),
    /// One frame without a header.
    Headerless,
    /// Nothing.
    Nothing,
}

impl Returns {
    /// Bytes 6 and 7 of VM: bit 0 nothing, bit 1 no header; a bit for each frame.
    pub fn of(mode: u32) -> Self {
        match (mode >> 8 & 3, mode & 7) {
            (1 | 3, _) => Self::Nothing,
            (2, _) => Self::Headerless,
            (_, 0) => Self::Echo,
            (_, frames) => Self::Frame(u8::try_from(frames.trailing_zeros() + 1).unwrap_or(0)),
        }
    }
}

/// What a thruster returns for a signal or a speed in the place of the echo. That does not say
/// which value it has taken.
fn returned(returns: Returns, request: &[u8], reply: &[u8]) -> Option<Reading> {
    let (b"TC" | b"VC", Purpose::Stop | Purpose::Rest | Purpose::Motion { .. }) =
        (request.get(..2)?, purpose(request))
    else {
        return None;
    };
    let stops = purpose(request) == Purpose::Stop;
    let word =
        |place: usize| Some(i16::from_be_bytes([*reply.get(place)?, *reply.get(place + 1)?]));
    // 1 rpm, 0.1 A
    let moved = |at: usize| {
        let speed = Some((f64::from(word(at)?) * PI / 30.0).abs());
        Some(Reading {
            speed,
            current: Some((f64::from(word(at + 4)?) / 10.0).abs()),
            stops,
            ..Reading::default()
        })
    };
    match returns {
        Returns::Frame(number) if reply.get(..2)? == [request[0], number] => match number {
            1 => moved(2),
            2 => {
                let hottest = word(4)?.max(word(6)?);
                let faults = Some(word(2)?.cast_unsigned());
                Some(Reading {
                    faults,
                    temperature: Some(hottest.into()),
                    stops,
                    ..Reading::default()
                })
            }
            _ => Some(Reading { stops, ..Reading::default() }),
        },
        Returns::Headerless if reply.len() == 8 && !has_header(reply) => {
            Some(Reading { faults: Some(word(6)?.cast_unsigned()), ..moved(0)? })
        }
        _ => None,
    }
}

/// The commands of the manual, two letters each.
const COMMANDS: &[u8] = b"TCVCQVQCQPQTEQEFFRCFSTMQMLMMCICBVMSRSPRPLALRLSAZRZRCQAQR";

/// Whether a reply begins as those with a header do: with a command, or with a letter and the
/// number of a returned frame.
fn has_header(reply: &[u8]) -> bool {
    let is_command = COMMANDS.chunks(2).any(|command| reply.starts_with(command));
    is_command || matches!(reply, [b'A' | b'T' | b'V', 1..=3, ..])
}

pub(super) fn answer(returns: Returns, request: &[u8], reply: &[u8]) -> Option<Reading> {
    let none = Reading::default();
    if request.get(..2)? != reply.get(..2)? {
        return returned(returns, request, reply);
    }
    let word = || Some(u16::from_be_bytes([*reply.get(6)?, *reply.get(7)?]));
    // Nothing but the sign is in the upper half.
    let is_word = reply.get(4..6) == Some(&[0; 2]) || reply.get(4..6) == Some(&[0xFF; 2]);
    let value = || word().filter(|_| is_word).map(|word| f64::from(word.cast_signed()));
    let refused = reply.get(4..8) == Some(&REFUSAL);
    Some(match reply.get(..2)? {
        b"TC" if refused => Reading { refused, ..none },
        b"TC" => {
            // The device repeats the value that it has taken.
            if request.get(4..8)? != reply.get(4..8)? {
                return None;
            }
            Reading { stops: reply.get(4..8) == Some(&[0; 4]), ..none }
        }
        b"VC" | b"LA" | b"LR" => Reading { refused, ..none },
        b"EF" => Reading { faults: Some(word()?), ..none },
        // 0.1 A, and 1 °C of the motor and of the driver
        b"QC" => Reading { current: Some((value()? / 10.0).abs()), ..none },
        b"QT" | b"EQ" => Reading { temperature: Some(value()?), ..none },
        // 1 rpm
        b"QV" => {
            Reading { speed: Some((f64::from(word()?.cast_signed()) * PI / 30.0).abs()), ..none }
        }
        _ => none,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signal_zero_stops_and_others_move() {
        assert_eq!(purpose(&[0x54, 0x43, 0, 0, 0, 0, 0, 5]), Purpose::Motion { once: false });
        assert_eq!(purpose(&[0x54, 0x43, 0, 0, 0, 0, 0, 0]), Purpose::Stop);
        assert_eq!(purpose(&[0x4C, 0x52, 0, 9, 0, 0, 0, 1]), Purpose::Motion { once: true });
        assert_eq!(purpose(&[0x45, 0x46, 0, 0]), Purpose::Read);
        assert_eq!(purpose(&[0x43, 0x49, 0, 0, 0, 0, 0, 0x7F]), Purpose::Change);
    }

    #[test]
    fn a_refusal_is_no_acknowledgement() {
        let zero = [0x54, 0x43, 0, 0, 0, 0, 0, 0];
        assert!(answer(Returns::Echo, &zero, &zero).unwrap().stops);
        let refused = answer(Returns::Echo, &zero, &[0x54, 0x43, 0, 0, 0, 0, 0xEE, 0xEE]).unwrap();
        assert!(refused.refused && !refused.stops);
        let faults =
            answer(Returns::Echo, b"EF\0\0", &[0x45, 0x46, 0, 0, 0, 0, 0x08, 0]).unwrap().faults;
        assert_eq!(faults, Some(0x0800));
    }
}
