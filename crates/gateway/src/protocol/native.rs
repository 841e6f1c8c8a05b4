//! Native commands: data bytes of a manual, decoded before the gateway acts on them.

use super::{Command, Info, to_can, to_serial};
use crate::config::AxisConfig;
use host_protocol::{AxisParameter, BusKind, Error, Setpoint};

/// A decoded native command and what it does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Native {
    pub command: Command,
    pub effect: Effect,
}

/// What a native command does to the motor, and so which rules hold for it (GUARANTEES G2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Effect {
    /// It only asks.
    Asks,
    /// It stops the motor.
    Stops,
    /// It is a setpoint of 0, which many take for a stop.
    Rests(Demand),
    /// It moves the motor like a setpoint, so that it may be sent again and again.
    Moves(Demand),
    /// Each time it is sent it moves the motor anew.
    MovesOnce(Demand),
    /// It changes the motor: its memory, its brake, its id, its clock.
    Changes {
        /// What is known of the motor's own timeout may no longer hold.
        timeout: bool,
    },
}

impl Effect {
    /// What a command does that is the same as a setpoint, of 0 or another one.
    pub fn of_setpoint(setpoint: Setpoint, is_zero: bool) -> Self {
        let demand = Demand::Setpoint(setpoint);
        if is_zero { Self::Rests(demand) } else { Self::Moves(demand) }
    }
}

/// What a native command asks of the shaft, in SI units and in the axis's direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Demand {
    /// The same as this setpoint.
    Setpoint(Setpoint),
    /// A position, at whatever speed the motor can.
    Unlimited { position_rad: f32 },
    /// A position that the motor follows from one command to the next.
    Tracking { position_rad: f32, speed_limit_rad_s: f32 },
    /// A distance.
    Distance { speed_limit_rad_s: f32 },
    /// What an earlier command has prepared, and was checked then.
    Prepared,
}

/// The command that `data` is to the motor of an axis.
pub(crate) fn native(
    axis: u8,
    data: &[u8],
    kind: BusKind,
    config: &AxisConfig,
) -> Result<Native, Error> {
    let Some(protocol) = config.protocol() else {
        return Err(Error::NotConfigured { axis, parameter: AxisParameter::Protocol.number() });
    };
    let encodes = |command: &Command| match kind {
        BusKind::Can => to_can(command, config).is_some(),
        BusKind::Rs485 => to_serial(command, config).is_some(),
    };
    let native = (Info::of(protocol).native)(axis, data, config)?;
    native.filter(|native| encodes(&native.command)).ok_or(Error::NotACommand { axis, protocol })
}
