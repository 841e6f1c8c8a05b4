//! The control loop a motor runs.

use core::convert::Infallible;

use codec::{Decode, Encode, FieldInfo, FieldKind, Visit};

use crate::error::EncodeError;
use crate::field::DATA_LEN;
use crate::payload::Payload;

/// Run mode of 0x70. The manual speaks of four and lists three (RMD V3.6 §2.23.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum RunMode {
    /// Current loop.
    Current,
    /// Speed loop.
    Velocity,
    /// Position loop.
    Position,
    /// Any other value.
    Unknown(u8),
}

impl RunMode {
    const CURRENT: u8 = 1;
    const VELOCITY: u8 = 2;
    const POSITION: u8 = 3;

    /// The mode of a wire value.
    pub const fn from_code(code: u8) -> RunMode {
        match code {
            RunMode::CURRENT => RunMode::Current,
            RunMode::VELOCITY => RunMode::Velocity,
            RunMode::POSITION => RunMode::Position,
            other => RunMode::Unknown(other),
        }
    }

    /// The value on the wire.
    pub const fn code(self) -> u8 {
        match self {
            RunMode::Current => RunMode::CURRENT,
            RunMode::Velocity => RunMode::VELOCITY,
            RunMode::Position => RunMode::POSITION,
            RunMode::Unknown(code) => code,
        }
    }

    /// Name of the three the manual lists.
    pub const fn name(self) -> Option<&'static str> {
        match self {
            RunMode::Current => Some("current"),
            RunMode::Velocity => Some("velocity"),
            RunMode::Position => Some("position"),
            RunMode::Unknown(_) => None,
        }
    }

    const CODE: FieldInfo = FieldInfo::integer("run_mode", "", 0, u8::MAX as i64);
    const NAME: FieldInfo = FieldInfo::other(FieldKind::Text, "run_mode_name");
    pub(crate) const SHOWN: &[FieldInfo] = &[RunMode::CODE, RunMode::NAME];

    pub(crate) fn visit(self, visit: &mut Visit<'_>) {
        RunMode::CODE.visit_integer(visit, self.code());
        RunMode::NAME.visit_name(visit, self.name());
    }
}

impl Decode<Payload> for RunMode {
    fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<RunMode, Infallible> {
        u8::get::<AT>(data).map(RunMode::from_code)
    }
}

impl Encode<Payload> for RunMode {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        self.code().put::<AT>(data);
    }

    fn check(&self) -> Result<(), EncodeError> {
        if RunMode::from_code(self.code()) == *self {
            return Ok(());
        }
        Err(EncodeError::Forbidden {
            field: "run_mode",
            value: i64::from(self.code()),
            reason: "this mode has a name of its own",
        })
    }
}
