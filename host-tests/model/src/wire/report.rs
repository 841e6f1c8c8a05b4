//! What the gateway reports when it is asked (PROTOCOL.md, Replies and Types).

use super::body::Body;
use super::frame::Message;
use super::incident::{Incident, page};
use super::message::{Told, state};

/// Place of `BusOff` among the states of a bus.
const BUS_OFF: u64 = 4;

/// A reply that the promises speak of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Report {
    /// Of 0x0013
    Gateway {
        /// Starts since power came on.
        starts: u32,
        /// The e-stop is latched.
        e_stopped: bool,
    },
    /// Of 0x0012
    Bus {
        /// It is off.
        off: bool,
        /// `BusCounters` in their order.
        counters: [u32; 9],
    },
    /// Of 0x0060: a page of what is remembered, and where it goes on.
    Incidents(Vec<Incident>, Option<u8>),
    /// Of 0x0022: the axes, and whether the list goes on.
    Axes(Vec<Listed>, bool),
}

/// An axis in a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Listed {
    /// Its number.
    pub axis: u8,
    /// Bus, protocol and node, as far as they are set.
    pub wiring: [Option<u8>; 3],
    /// Its state.
    pub state: Told,
}

/// What a reply says, if the promises speak of it.
pub fn report(message: &Message) -> Option<Report> {
    let mut body = Body(message.body());
    match message.number {
        0x0013 => {
            body.varint(64)?;
            let starts = body.u32()?;
            body.optional(Body::byte)?;
            Some(Report::Gateway { starts, e_stopped: body.bool()? })
        }
        0x0012 => {
            body.optional(|config| {
                let _bitrate_and_protocols = (config.u32()?, config.byte()?);
                let _ours_and_window = (config.bool()?, config.u32()?);
                Some(())
            })?;
            let off = body.varint(32)? == BUS_OFF;
            let _errors = (body.u16()?, body.u16()?);
            let mut counters = [0; 9];
            for counter in &mut counters {
                *counter = body.u32()?;
            }
            let _raw_open = body.bool()?;
            body.end(Report::Bus { off, counters })
        }
        0x0060 => {
            let (incidents, next) = page(message)?;
            Some(Report::Incidents(incidents, next))
        }
        0x0022 => {
            let mut axes = Vec::new();
            for _ in 0..body.varint(32)? {
                axes.push(listed(&mut body)?);
            }
            let goes_on = body.optional(Body::byte)?.is_some();
            body.end(Report::Axes(axes, goes_on))
        }
        _ => None,
    }
}

fn listed(body: &mut Body<'_>) -> Option<Listed> {
    let axis = body.byte()?;
    let wiring =
        [body.optional(Body::byte)?, body.optional(Body::byte)?, body.optional(Body::byte)?];
    let state = state(body)?;
    body.optional(Body::u16)?;
    Some(Listed { axis, wiring, state })
}
