//! What raw frames would do to the motors of axes: motion obeys the rules of axes however it comes (GUARANTEES G2).

use super::{Effect, d5, rmd, thruster};
use crate::axis::{Address, AxisConfig};
use ::rmd::{Target, command::CLOSED_LOOP};
use embedded_can::Id;
use host_protocol::{CanFrame, MAX_CAN_DATA, Protocol};

/// What a frame does to one motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Touch {
    /// It moves it.
    Moves,
    /// It changes it.
    Changes {
        /// What is known of the motor's own timeout may no longer hold.
        timeout: bool,
    },
}

/// What a frame on a CAN bus does to the motor of an axis there.
pub(crate) fn touched_by_can(frame: &CanFrame, config: &AxisConfig) -> Option<Touch> {
    let Address { protocol, node, .. } = config.address()?;
    let Id::Standard(id) = frame.id() else { return None };
    // A motor may take what is missing for zeros.
    let mut data = [0; MAX_CAN_DATA];
    for (place, byte) in data.iter_mut().zip(frame.data()) {
        *place = *byte;
    }
    let full = CanFrame::standard(id.as_raw(), &data)?;
    match protocol {
        Protocol::Rmd => {
            let (target, request) = ::rmd::can::decode_any_request(&full).ok()?;
            touched_by_rmd(target, request, node)
        }
        Protocol::Thruster => {
            let (addressed, request) = ::thruster::can::decode_request(&full).ok()?;
            let effect = thruster::effect(request, 1.0).filter(|_| addressed.get() == node);
            effect.and_then(touch)
        }
        Protocol::D5 => {
            let (address, request) = ::d5::can::decode_request(&full).ok()?;
            let reaches = match address {
                ::d5::Address::Node(addressed) => addressed.get() == node,
                _ => true,
            };
            d5::effect(request, 1.0).filter(|_| reaches).and_then(touch)
        }
    }
}

/// What a frame on a serial bus does to the motor of an axis there.
pub(crate) fn touched_by_serial(frame: &[u8; ::rmd::rs485::FRAME_LEN], config: &AxisConfig) -> Option<Touch> {
    let (target, request) = ::rmd::rs485::decode_any_request(frame).ok()?;
    touched_by_rmd(target, request, config.node()?)
}

fn touched_by_rmd(target: Target, request: ::rmd::Request, node: u8) -> Option<Touch> {
    let reaches = match target {
        Target::Node(addressed) => addressed.get() == node,
        Target::All => true,
    };
    if !reaches {
        return None;
    }
    match rmd::effect(request, 1.0) {
        // Unknown, but of the kind that moves.
        None if CLOSED_LOOP.contains(&request.command()) => Some(Touch::Moves),
        effect => touch(effect?),
    }
}

fn touch(effect: Effect) -> Option<Touch> {
    match effect {
        Effect::Moves(_) | Effect::MovesOnce(_) => Some(Touch::Moves),
        Effect::Changes { timeout } => Some(Touch::Changes { timeout }),
        Effect::Asks | Effect::Stops | Effect::Rests(_) => None,
    }
}
