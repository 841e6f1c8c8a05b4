//! Trips and starts as they are remembered (PROTOCOL.md, `Incident`, `Trip`).

use super::body::Body;
use super::frame::Message;

/// Something that is remembered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Incident {
    /// The gateway started.
    Started {
        /// Which start.
        start: u32,
    },
    /// An axis tripped.
    Tripped {
        /// After which start.
        start: u32,
        /// Which axis.
        axis: u8,
        /// The `Trip`, byte for byte.
        trip: Vec<u8>,
    },
}

/// Trip reasons with fields, by their place in the list.
mod reason {
    pub const MOTOR_FAULT: u64 = 3;
    pub const COMMAND_REFUSED: u64 = 4;
    pub const LIMIT_EXCEEDED: u64 = 7;
    pub const INTERNAL: u64 = 10;
    pub const GROUP: u64 = 12;
}
/// Place of the only quantity with a field.
const PARAMETER: u64 = 14;

/// An `IncidentPage`: its incidents, the latest first, and where the list goes on.
pub fn page(message: &Message) -> Option<(Vec<Incident>, Option<u8>)> {
    let mut body = Body(message.body());
    let mut incidents = Vec::new();
    for _ in 0..body.varint(32)? {
        incidents.push(incident(&mut body)?);
    }
    let next = body.optional(Body::byte)?;
    body.end((incidents, next))
}

fn incident(body: &mut Body<'_>) -> Option<Incident> {
    let kind = body.varint(32)?;
    let start = body.u32()?;
    if kind == 0 {
        let _boot_and_crash_report = (body.varint(32)?, body.bool()?);
        return Some(Incident::Started { start });
    }
    let axis = body.byte()?;
    let from = body.0;
    trip(body)?;
    let trip = from.get(..from.len() - body.0.len())?.to_vec();
    Some(Incident::Tripped { start, axis, trip })
}

fn trip(body: &mut Body<'_>) -> Option<()> {
    match body.varint(32)? {
        reason::MOTOR_FAULT | reason::INTERNAL => {
            body.u16()?;
        }
        reason::COMMAND_REFUSED => {
            body.optional(Body::u16)?;
        }
        reason::LIMIT_EXCEEDED => {
            if body.varint(32)? == PARAMETER {
                body.u16()?;
            }
            let _value_and_limit = (body.f32()?, body.f32()?);
        }
        reason::GROUP => {
            body.byte()?;
        }
        _ => {}
    }
    body.varint(64)?;
    for _ in 0..3 {
        body.optional(Body::f32)?;
    }
    body.bool().map(|_| ())
}
