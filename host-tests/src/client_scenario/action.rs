//! What happens to a line while a command runs on it, and when.

use std::time::Duration;

use crate::scenario::words::{duration, parse};

/// What happens.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Ctrl-C.
    Interrupt,
    /// Nothing passes any more, in the directions named.
    Cut(Ways),
    /// Everything passes as it should.
    Clean,
    /// The connection fails, and cannot be opened again for so long.
    Close(Duration),
    /// A part of the frames gets lost.
    Lose(f64, Ways),
    /// The next frames get lost.
    LoseNext(u32, Ways),
    /// Frames take longer.
    Delay(Duration, Ways),
    /// Frames take longer, each by another time.
    Jitter(Duration, Ways),
    /// A part of the frames comes twice.
    Duplicate(f64, Ways),
    /// A part of the bytes arrives changed.
    Bytes(f64, Ways),
    /// Everything is held up for a while, and then comes at once.
    Stall(Duration, Ways),
    /// The program stands still.
    Freeze(Duration),
    /// The gateway's answers are not those of a gateway.
    Hostile(Hostile),
    /// Another host reads the state of an axis, at this period.
    OtherPolls(u8, Duration),
    /// Another host stops an axis.
    OtherStops(u8),
    /// Another host sends an e-stop.
    OtherEStops,
    /// The board of the gateway is reset.
    Reset,
    /// The program's adapter takes a rate and keeps the one that it has.
    StuckBaud,
}

/// The directions that a fault is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ways {
    /// From the program to the gateway.
    pub to_gateway: bool,
    /// From the gateway to the program.
    pub to_host: bool,
}

/// How answers are forged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hostile {
    /// Every `Pong` tells this time.
    Pong(u64),
    /// A part of the bytes in the body of each reply is changed, and the checksum is right.
    Bodies(f64),
    /// Events come without end, faster than they can be read.
    Events,
    /// Bytes come without end that are no frames.
    Noise,
}

/// When something happens.
#[derive(Debug, Clone, PartialEq)]
pub enum Moment {
    /// So long after the command began.
    At(Duration),
    /// So long after a frame was written for the n-th time.
    Frame {
        /// The name of the request.
        name: String,
        /// Which one, from 1.
        count: usize,
        /// How long after it.
        plus: Duration,
    },
}

impl Moment {
    /// `at TIME …` or `when FRAME N [plus TIME] …`, and what follows.
    pub fn parse<'a>(words: &'a [&'a str]) -> Result<(Self, &'a [&'a str]), String> {
        let rest = |at: usize| words.get(at..).unwrap_or_default();
        match words.first() {
            Some(&"at") => Ok((Self::At(duration(words, 1)?), rest(3))),
            Some(&"when") => {
                let (name, count) = (parse(words, 1, "frame")?, parse(words, 2, "number")?);
                match words.get(3) {
                    Some(&"plus") => {
                        let plus = duration(words, 4)?;
                        Ok((Self::Frame { name, count, plus }, rest(6)))
                    }
                    _ => Ok((Self::Frame { name, count, plus: Duration::ZERO }, rest(3))),
                }
            }
            other => Err(format!("{other:?} is no moment")),
        }
    }
}

impl Action {
    pub fn parse(words: &[&str]) -> Result<Self, String> {
        let percent = || parse::<f64>(words, 1, "percentage").map(|percent| percent / 100.0);
        Ok(match words.first() {
            Some(&"interrupt") => Self::Interrupt,
            Some(&"cut") => Self::Cut(ways(words, 1)?),
            Some(&"clean") => Self::Clean,
            Some(&"reset") => Self::Reset,
            Some(&"stuck-baud") => Self::StuckBaud,
            Some(&"close") => Self::Close(duration(words, 1)?),
            Some(&"lose") => Self::Lose(percent()?, ways(words, 3)?),
            Some(&"lose-next") => Self::LoseNext(parse(words, 1, "number")?, ways(words, 2)?),
            Some(&"delay") => Self::Delay(duration(words, 1)?, ways(words, 3)?),
            Some(&"jitter") => Self::Jitter(duration(words, 1)?, ways(words, 3)?),
            Some(&"duplicate") => Self::Duplicate(percent()?, ways(words, 3)?),
            Some(&"bytes") => Self::Bytes(percent()?, ways(words, 3)?),
            Some(&"stall") => Self::Stall(duration(words, 1)?, ways(words, 3)?),
            Some(&"freeze") => Self::Freeze(duration(words, 1)?),
            Some(&"hostile") => Self::Hostile(match words.get(1) {
                Some(&"pong") => Hostile::Pong(parse(words, 2, "time")?),
                Some(&"bodies") => Hostile::Bodies(parse::<f64>(words, 2, "percentage")? / 100.0),
                Some(&"events") => Hostile::Events,
                Some(&"noise") => Hostile::Noise,
                other => return Err(format!("{other:?} is nothing hostile")),
            }),
            Some(&"other") => match words.get(1) {
                Some(&"polls") => Self::OtherPolls(parse(words, 2, "axis")?, duration(words, 3)?),
                Some(&"stops") => Self::OtherStops(parse(words, 2, "axis")?),
                Some(&"estops") => Self::OtherEStops,
                other => return Err(format!("{other:?} is nothing that another host does")),
            },
            other => return Err(format!("{other:?} is no action")),
        })
    }

    /// The word by which expectations name it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Interrupt => "interrupt",
            Self::Cut(_) => "cut",
            Self::Reset => "reset",
            Self::StuckBaud => "stuck-baud",
            Self::Clean => "clean",
            Self::Close(_) => "close",
            Self::Lose(..) => "lose",
            Self::LoseNext(..) => "lose-next",
            Self::Delay(..) => "delay",
            Self::Jitter(..) => "jitter",
            Self::Duplicate(..) => "duplicate",
            Self::Bytes(..) => "bytes",
            Self::Stall(..) => "stall",
            Self::Freeze(_) => "freeze",
            Self::Hostile(_) => "hostile",
            Self::OtherPolls(..) | Self::OtherStops(_) | Self::OtherEStops => "other",
        }
    }
}

/// `to`, `from` or nothing for both, at a place.
fn ways(words: &[&str], at: usize) -> Result<Ways, String> {
    match words.get(at) {
        None => Ok(Ways { to_gateway: true, to_host: true }),
        Some(&"to") => Ok(Ways { to_gateway: true, to_host: false }),
        Some(&"from") => Ok(Ways { to_gateway: false, to_host: true }),
        Some(other) => Err(format!("{other} is no direction: `to` the gateway or `from` it")),
    }
}
