//! Which dialect a motor speaks, told by the form of its answers to reads that every dialect takes
//! (docs/rmd-dialects.md).
//!
//! A motor may repeat its last answer to what it does not know, and may echo: an answer tells only
//! where it has the command and the index of its question, and a value that is no echo.

use crate::command;
use crate::dialect::{Dialect, Dialects};
use crate::field::DATA_LEN;
use crate::gain::Gain;
use crate::ramp::Ramp;
use crate::request::Request;
use crate::table::MODEL_PART_MIN;

/// The reads whose answers tell the dialect. Older motors pass their index over.
pub const PROBES: [Request; 3] = [
    Request::ReadGain { gain: Gain(1) },
    Request::ReadModelPart { part: MODEL_PART_MIN },
    Request::ReadRamp { ramp: Ramp::VELOCITY_DECELERATION },
];

/// The first byte of a text: what lies below is an index.
const FIRST_CHARACTER: u8 = b' ';

/// The dialects whose motors answer a probe with these data bytes; `None` where the answer tells
/// nothing, or is none to it.
///
/// ```
/// use rmd::{Dialect, PROBES, Recognised, tells};
///
/// // A gain by index, the name in parts: V4.4.
/// let gain = tells(&PROBES[0], &[0x30, 1, 0, 0, 0, 0, 0, 0x3F]).unwrap();
/// let name = tells(&PROBES[1], &[0xB5, 1, 1, b'R', b'M', b'D', b'-', b'X']).unwrap();
/// assert_eq!(Recognised::by(&[gain, name]), Recognised::As(Dialect::V4_4));
/// ```
pub fn tells(probe: &Request, answer: &[u8; DATA_LEN]) -> Option<Dialects> {
    let [code, first, second, third, value @ ..] = *answer;
    if code != probe.command() {
        return None;
    }
    match (*probe, first) {
        (Request::ReadGain { gain: Gain(index) }, _) if first == index => {
            let gain = f32::from_le_bytes(value);
            let is_gain = [second, third] == [0; 2] && gain.is_finite() && gain > 0.0;
            is_gain.then_some(Dialects::FROM_V4_2)
        }
        // Six gains of a byte.
        (Request::ReadGain { .. }, 0) => Some(Dialects::TO_V3_9),
        (Request::ReadModelPart { part }, 1) if second == part => {
            let [a, b, c, d] = value;
            let name = [third, a, b, c, d];
            let is_text = third >= FIRST_CHARACTER
                && name.iter().all(|byte| *byte == 0 || (b' '..=b'~').contains(byte));
            is_text.then_some(Dialects::V4_4)
        }
        (Request::ReadModelPart { .. }, FIRST_CHARACTER..=b'~') => Some(Dialects::TO_V4_3),
        (Request::ReadRamp { ramp: Ramp(index) }, _) if first == index => {
            (value != [0; 4]).then_some(Dialects::FROM_V3_9)
        }
        (Request::ReadRamp { .. }, 0) => Some(Dialects::TO_V3_7),
        _ => None,
    }
}

/// What the answers of one motor say together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recognised {
    /// The only dialect that fits them all, and two or more of them say something.
    As(Dialect),
    /// Several fit, or only one answer says something.
    OneOf(Dialects),
    /// None fits: the answers contradict each other.
    Contradicted,
}

impl Recognised {
    /// What these answers say together, each as [`tells`] has it.
    pub fn by(told: &[Dialects]) -> Recognised {
        let fitting = told.iter().fold(Dialects::KNOWN, |all, some| all.both(*some));
        let mut dialects = fitting.iter();
        match (dialects.next(), dialects.next()) {
            (None, _) => Recognised::Contradicted,
            (Some(only), None) if told.len() >= 2 => Recognised::As(only),
            _ => Recognised::OneOf(fitting),
        }
    }

    /// The dialect to state for the motor: unknown unless it is recognised.
    pub const fn dialect(self) -> Dialect {
        match self {
            Recognised::As(dialect) => dialect,
            _ => Dialect::Unknown,
        }
    }

    /// Whether the answers leave it possible that the motor speaks this dialect. Unknown
    /// contradicts nothing.
    pub const fn allows(self, dialect: Dialect) -> bool {
        match (self, dialect) {
            (_, Dialect::Unknown) => true,
            (Recognised::As(only), _) => only as u8 == dialect as u8,
            (Recognised::OneOf(some), _) => some.contains(dialect),
            (Recognised::Contradicted, _) => false,
        }
    }
}

/// Whether an answer to 0xB2 is the echo with which a motor answers the first command after its own
/// timeout: no date.
pub const fn is_echo_of_version(answer: &[u8; DATA_LEN]) -> bool {
    matches!(answer, [command::READ_VERSION_DATE, 0, 0, 0, 0, 0, 0, 0])
}
