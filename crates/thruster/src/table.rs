//! The protocol as data: every command by name with its fields, for tools that list, build and print commands.
//!
//! Names of commands and fields, their units and ranges are written here and nowhere else.

mod build;
mod commands;
pub(crate) mod field;
mod value;

pub use build::BuildError;
pub(crate) use build::Fields;
pub use commands::COMMANDS;
pub(crate) use commands::*;
pub use value::FieldValue;
pub(crate) use value::Visit;
use value::count;

/// Name of whatever has none in [`COMMANDS`].
pub(crate) const UNKNOWN: &str = "unknown";

/// One command of the manual: what its request and its reply carry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandInfo {
    /// Name in snake_case, the same for the request and the reply; unique in [`COMMANDS`].
    pub name: &'static str,
    /// Command word on the wire; of a returned frame its header.
    pub code: u16,
    /// Where the manual describes it.
    pub section: &'static str,
    /// Fields of the request in the order of the wire; [`Request::build`](crate::Request::build) asks for exactly these.
    pub request: &'static [FieldInfo],
    /// Fields of the reply in the order of the wire.
    pub reply: &'static [FieldInfo],
    /// What else a sender should know; often empty.
    pub note: &'static str,
}

/// One field of a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldInfo {
    /// Name in snake_case, with the unit as its last part where there is one.
    pub name: &'static str,
    /// Unit of the name; empty for numbers without one.
    pub unit: &'static str,
    /// What the field holds.
    pub kind: FieldKind,
    /// Lowest value, in the unit.
    pub min: f64,
    /// Highest value, in the unit.
    pub max: f64,
    /// Counts on the wire for one unit.
    pub counts_per_unit: f64,
}

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FieldKind {
    /// A whole number.
    Integer,
    /// A measured or commanded quantity in the unit of the name.
    Physical,
    /// False or true, built from 0 or 1.
    Bool,
    /// A bit mask with named bits.
    Flags,
    /// A name or printable characters.
    Text,
    /// Bytes without further meaning.
    Bytes,
}

impl FieldInfo {
    /// One count on the wire, in the unit of the name.
    pub const fn lsb(&self) -> f64 {
        1.0 / self.counts_per_unit
    }

    /// A whole number in `min..=max`.
    pub(crate) const fn integer(name: &'static str, unit: &'static str, min: i64, max: i64) -> FieldInfo {
        FieldInfo::of(FieldKind::Integer, name, unit, min, max)
    }

    /// A quantity of which one unit is `counts_per_unit` counts; the range is given in counts.
    pub(crate) const fn physical(
        name: &'static str,
        unit: &'static str,
        counts: (i64, i64),
        counts_per_unit: f64,
    ) -> FieldInfo {
        FieldInfo {
            name,
            unit,
            kind: FieldKind::Physical,
            min: counts.0 as f64 / counts_per_unit,
            max: counts.1 as f64 / counts_per_unit,
            counts_per_unit,
        }
    }

    /// False or true.
    pub(crate) const fn boolean(name: &'static str) -> FieldInfo {
        FieldInfo::of(FieldKind::Bool, name, "", 0, 1)
    }

    /// A field without a number: flags, text or bytes.
    pub(crate) const fn other(kind: FieldKind, name: &'static str) -> FieldInfo {
        FieldInfo::of(kind, name, "", 0, 0)
    }

    /// A bit mask; its range is that of the bits that may be sent.
    pub(crate) const fn flags(name: &'static str, bits: i64) -> FieldInfo {
        FieldInfo::of(FieldKind::Flags, name, "", 0, bits)
    }

    const fn of(kind: FieldKind, name: &'static str, unit: &'static str, min: i64, max: i64) -> FieldInfo {
        FieldInfo { name, unit, kind, min: min as f64, max: max as f64, counts_per_unit: 1.0 }
    }
}

impl CommandInfo {
    pub(crate) const fn new(name: &'static str, code: u16, section: &'static str) -> CommandInfo {
        CommandInfo { name, code, section, request: &[], reply: &[], note: "" }
    }

    pub(crate) const fn request(self, request: &'static [FieldInfo]) -> CommandInfo {
        CommandInfo { request, ..self }
    }

    pub(crate) const fn reply(self, reply: &'static [FieldInfo]) -> CommandInfo {
        CommandInfo { reply, ..self }
    }

    pub(crate) const fn note(self, note: &'static str) -> CommandInfo {
        CommandInfo { note, ..self }
    }
}

#[cfg(test)]
mod tests;
