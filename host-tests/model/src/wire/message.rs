//! What the gateway says of its axes (PROTOCOL.md, Replies and Events).

use super::body::Body;
use super::frame::Message;

/// The state of an axis, as the gateway tells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Told {
    /// Not all of it is configured.
    #[default]
    Unconfigured,
    /// At rest.
    Idle,
    /// At rest, the motor's output on.
    Holding,
    /// On the way to armed.
    Arming,
    /// May be moved.
    Armed,
    /// Has a setpoint.
    Active,
    /// Is being stopped on request.
    Stopping,
    /// Is being stopped, or kept stopped.
    Tripped {
        /// The motor has confirmed the stop.
        confirmed: bool,
    },
}

impl Told {
    /// It is configured, and nothing moves or may.
    pub fn is_at_rest(self) -> bool {
        matches!(self, Self::Idle | Self::Holding)
    }
}

/// An event that the promises speak of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum News {
    /// 0x8001
    Tripped {
        /// Which axis.
        axis: u8,
        /// The `Trip`, byte for byte.
        trip: Vec<u8>,
    },
    /// 0x8003
    State {
        /// Which axis.
        axis: u8,
        /// Its state from now on.
        state: Told,
    },
    /// 0x8005
    EStopLatched,
    /// 0x8006
    EStopCleared,
    /// 0x800A
    Unreachable {
        /// Which axis.
        axis: u8,
        /// Its stop has been sent.
        stop_transmitted: bool,
    },
}

/// How many events before this one the host has lost.
pub fn events_lost(message: &Message) -> Option<u32> {
    Body(message.body()).u32()
}

/// What an event says, if the promises speak of it.
pub fn event(message: &Message) -> Option<News> {
    let mut body = Body(message.body());
    body.u32()?;
    body.varint(64)?;
    Some(match message.number {
        0x8001 => News::Tripped { axis: body.byte()?, trip: body.0.to_vec() },
        0x8003 => News::State { axis: body.byte()?, state: state(&mut body)? },
        0x8005 => News::EStopLatched,
        0x8006 => News::EStopCleared,
        0x800A => News::Unreachable { axis: body.byte()?, stop_transmitted: body.bool()? },
        _ => return None,
    })
}

pub(super) fn state(body: &mut Body<'_>) -> Option<Told> {
    Some(match body.varint(32)? {
        0 => Told::Unconfigured,
        1 => Told::Idle,
        2 => Told::Arming,
        3 => Told::Armed,
        4 => Told::Active,
        5 => Told::Stopping,
        6 => Told::Tripped { confirmed: body.bool()? },
        7 => Told::Holding,
        _ => return None,
    })
}
