//! Setpoints for many axes in one call, answered by the state of all of them: what a control loop
//! needs once a round.

use std::time::Duration;

use host_protocol::requests as ask;
use host_protocol::{Call, CycleState, FixedU32, MAX_CYCLE_AXES, Setpoint, StateFields};

use crate::client::{Client, REPEAT_MOVE_AFTER};
use crate::commands::MOTOR_DEADLINE;
use crate::error::ClientError;
use crate::transport::Transport;

/// The axes of a request are 0 to this: requests for several axes have a bit for each.
pub const LAST_AXIS: u8 = 31;

/// A setpoint for one axis of a [`cycle`](Client::cycle).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisSetpoint {
    /// Number of the axis, from 0.
    pub axis: u8,
    /// What it should do.
    pub setpoint: Setpoint,
}

/// A fraction of the full signal, −1 to 1: thrusters.
#[must_use]
pub fn make_signal(axis: u8, fraction: f32) -> AxisSetpoint {
    AxisSetpoint { axis, setpoint: Setpoint::Signal { fraction } }
}

/// A current, A; positive drives counter-clockwise.
#[must_use]
pub fn make_current(axis: u8, current_a: f32) -> AxisSetpoint {
    AxisSetpoint { axis, setpoint: Setpoint::Current { current_a } }
}

/// A velocity, rad/s; positive is counter-clockwise.
#[must_use]
pub fn make_velocity(axis: u8, velocity_rad_s: f32) -> AxisSetpoint {
    AxisSetpoint { axis, setpoint: Setpoint::Velocity { velocity_rad_s } }
}

/// A position, rad, to be approached at most at `speed_limit_rad_s`.
#[must_use]
pub fn make_position(axis: u8, position_rad: f32, speed_limit_rad_s: f32) -> AxisSetpoint {
    AxisSetpoint { axis, setpoint: Setpoint::Position { position_rad, speed_limit_rad_s } }
}

/// A spring to `position_rad` and a damper to `velocity_rad_s`, in N·m/rad and N·m·s/rad, and a
/// torque of its own, N·m: RMD on CAN.
#[must_use]
pub fn make_impedance(
    axis: u8,
    position_rad: f32,
    velocity_rad_s: f32,
    stiffness_nm_per_rad: f32,
    damping_nm_s_per_rad: f32,
    torque_nm: f32,
) -> AxisSetpoint {
    let setpoint = Setpoint::Impedance {
        position_rad,
        velocity_rad_s,
        stiffness_nm_per_rad,
        damping_nm_s_per_rad,
        torque_nm,
    };
    AxisSetpoint { axis, setpoint }
}

impl<T: Transport> Client<T> {
    /// Arms several axes in one epoch, all of them or none. The epoch goes into every
    /// [`cycle`](Self::cycle) and every [setpoint](Self::set) of them.
    ///
    /// # Errors
    /// As [`request`](Self::request); [`ClientError::NamedTwice`] and [`ClientError::NoSuchAxis`]
    /// before anything is sent.
    pub fn arm_together(&mut self, axes: &[u8]) -> Result<u32, ClientError> {
        let request = ask::ArmTogether { axes: mask(axes.iter().copied())? };
        self.heed_interrupt(ask::ArmTogether::NUMBER)?;
        self.greet_anew()?;
        // Noted before it is asked for: an answer that is lost may have armed them all the same.
        let new: Vec<u8> = axes.iter().copied().filter(|axis| self.note_arming(*axis)).collect();
        let armed = self.request_within(&request, MOTOR_DEADLINE).inspect_err(|error| {
            if matches!(error, ClientError::Gateway(_)) {
                new.iter().for_each(|axis| self.forget_arming(*axis));
            }
        })?;
        // An interrupt may have come with the answer.
        self.heed_interrupt(ask::ArmTogether::NUMBER)?;
        Ok(armed.epoch)
    }

    /// Gives each of these axes its setpoint, valid for `ttl`, and returns the state of each as
    /// soon as every motor has answered or its own time is over: in the order of the axes' numbers,
    /// with the fields that were asked for. One that was refused says so in its result. Twice a
    /// second a ping comes first, which measures the clock that the expiry is derived from.
    ///
    /// # Errors
    /// [`ClientError::NamedTwice`] and [`ClientError::TooLong`] before anything is sent, else as
    /// [`request`](Self::request).
    pub fn cycle(
        &mut self,
        epoch: u32,
        setpoints: &[AxisSetpoint],
        fields: StateFields,
        ttl: Duration,
    ) -> Result<Vec<CycleState>, ClientError> {
        let axes = mask(setpoints.iter().map(|of| of.axis))?;
        let mut sorted: Vec<AxisSetpoint> = setpoints.to_vec();
        sorted.sort_by_key(|of| of.axis);
        if sorted.len() > MAX_CYCLE_AXES {
            return Err(ClientError::TooLong { request: "Cycle" });
        }
        self.refresh_clock()?;
        let request = ask::Cycle {
            epoch: FixedU32(epoch),
            expires_at_us: FixedU32(self.expiry(ttl)),
            fields,
            axes,
            setpoints: sorted.iter().map(|of| of.setpoint).collect(),
        };
        let (report, _) = self.exchange(&request, ttl, REPEAT_MOVE_AFTER)?;
        Ok(report.states().collect())
    }

    /// Has the gateway send the setpoints in force of these axes in each period, and tell of each
    /// by [`poll_cycle`](Self::poll_cycle): position, velocity and current of all of them, other
    /// fields of one in turns. Setpoints come by [`set`](Self::set) and [`cycle`](Self::cycle) as
    /// ever and expire as ever. No axis ends it.
    ///
    /// # Errors
    /// [`ClientError::NamedTwice`] before anything is sent, else as [`request`](Self::request):
    /// `OutOfRange` for a period beyond 250 µs to 20 ms, `BusOverloaded` for one that no bus could
    /// keep.
    pub fn run_cycle(
        &mut self,
        axes: &[u8],
        fields: StateFields,
        period: Duration,
    ) -> Result<(), ClientError> {
        let axes = mask(axes.iter().copied())?;
        // Too long for the field is too long for the gateway, which then names the limits.
        let period_us = u32::try_from(period.as_micros()).unwrap_or(u32::MAX);
        self.request(&ask::RunCycle { axes, fields, period_us }).map(drop)
    }
}

/// A bit for each axis.
fn mask(axes: impl Iterator<Item = u8>) -> Result<u32, ClientError> {
    let mut mask = 0_u32;
    for axis in axes {
        let bit = 1_u32.checked_shl(axis.into()).ok_or(ClientError::NoSuchAxis { axis })?;
        if mask & bit != 0 {
            return Err(ClientError::NamedTwice { axis });
        }
        mask |= bit;
    }
    Ok(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_axis_has_its_bit_and_the_others_are_told_what_is_wrong() {
        assert_eq!(mask([0, LAST_AXIS].into_iter()).unwrap(), 0x8000_0001);
        let said = |axes: [u8; 2]| mask(axes.into_iter()).unwrap_err().to_string();
        for axis in [32, 255] {
            let text = format!("there is no axis {axis}: the axes of a request are 0 to 31");
            assert_eq!(said([0, axis]), text);
        }
        assert_eq!(said([4, 4]), "axis 4 is named twice: name each axis of a request once");
    }
}
