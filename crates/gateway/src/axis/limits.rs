//! The limits of an axis: setpoints beyond them are refused, measured values beyond them trip.

use super::{Axis, Observation};
use crate::motor::Demand;
use crate::outbox::Outbox;
use crate::time::{Duration, Instant};
use host_protocol::{AxisParameter, AxisState, Error, Quantity, Setpoint, TripReason};

/// How long a turning motor that nobody here moves is left alone where its own timeout is not known.
const UNKNOWN_TIMEOUT_PAUSE: Duration = Duration::from_millis(5_000);

impl Axis {
    /// Refuses a setpoint that is not a number or lies beyond a limit of the axis.
    pub(super) fn check_limits(&self, setpoint: Setpoint) -> Result<(), Error> {
        match setpoint {
            Setpoint::Signal { fraction } => {
                let limit = self.config.float(AxisParameter::SignalLimit).unwrap_or(1.0);
                within(Quantity::Signal, fraction, -limit, limit)
            }
            Setpoint::Current { current_a } => {
                let limit = self.limit(AxisParameter::CurrentLimitA);
                within(Quantity::Current, current_a, -limit, limit)
            }
            Setpoint::Velocity { velocity_rad_s } => {
                let limit = self.limit(AxisParameter::VelocityLimitRadS);
                within(Quantity::Velocity, velocity_rad_s, -limit, limit)
            }
            Setpoint::Position { position_rad, speed_limit_rad_s } => {
                self.check_speed_limit(speed_limit_rad_s)?;
                self.check_position(position_rad)
            }
            Setpoint::Impedance {
                position_rad,
                velocity_rad_s,
                stiffness_nm_per_rad,
                damping_nm_s_per_rad,
                torque_nm,
            } => {
                let fastest = self.limit(AxisParameter::VelocityLimitRadS);
                let torque = self.limit(AxisParameter::TorqueLimitNm);
                within(Quantity::Velocity, velocity_rad_s, -fastest, fastest)?;
                within(Quantity::Stiffness, stiffness_nm_per_rad, 0.0, f32::INFINITY)?;
                within(Quantity::Damping, damping_nm_s_per_rad, 0.0, f32::INFINITY)?;
                within(Quantity::Torque, torque_nm, -torque, torque)?;
                self.check_position(position_rad)
            }
        }
    }

    /// Refuses a native command that the limits of the axis do not allow, or that could break one unnoticed.
    pub(super) fn check_demand(&self, demand: Demand) -> Result<(), Error> {
        let axis = self.index;
        let unnoticed = |quantity| Err(Error::CannotCheckLimit { axis, quantity });
        match demand {
            Demand::Prepared => Ok(()),
            Demand::Setpoint(Setpoint::Position { speed_limit_rad_s: 0.0, .. })
            | Demand::Distance { speed_limit_rad_s: 0.0 } => Err(Error::SpeedLimitZero { axis }),
            Demand::Setpoint(setpoint) => self.check_limits(setpoint),
            Demand::Unlimited { .. } if self.limit(AxisParameter::VelocityLimitRadS).is_finite() => {
                unnoticed(Quantity::Velocity)
            }
            Demand::Unlimited { position_rad } => self.check_position(position_rad),
            Demand::Distance { speed_limit_rad_s } => {
                self.check_speed_limit(speed_limit_rad_s)?;
                // Where it ends depends on where the motor is when it begins.
                let (min, max) = self.position_range();
                if min.is_finite() || max.is_finite() { unnoticed(Quantity::Position) } else { Ok(()) }
            }
        }
    }

    pub(super) fn check_speed_limit(&self, speed_limit_rad_s: f32) -> Result<(), Error> {
        let fastest = self.limit(AxisParameter::VelocityLimitRadS);
        within(Quantity::SpeedLimit, speed_limit_rad_s, 0.0, fastest)
    }

    fn check_position(&self, position_rad: f32) -> Result<(), Error> {
        let (min, max) = self.position_range();
        within(Quantity::Position, position_rad, min, max)
    }

    /// Takes in what a reply tells, and trips an armed axis on a fault or a limit.
    pub(super) fn observe(&mut self, now: Instant, seen: &Observation, out: &mut Outbox<'_>) {
        self.measured.update(now, seen);
        if seen.faults.is_some() {
            self.faults_unread = 0;
        }
        if let Some(waits) = seen.write_pending {
            self.write_waits = waits;
        }
        if self.holding && seen.velocity_rad_s.is_some_and(|velocity| !self.is_standstill(velocity)) {
            // A motor that should hold turns. Going on with the polls would keep its own timeout from stopping it.
            self.stop(now, out);
            return;
        }
        if !self.is_armed() {
            self.leave_turning_motor_alone(now, seen);
            return;
        }
        if let Some(faults) = seen.faults
            && faults != 0
        {
            self.trip(now, TripReason::MotorFault { faults }, out);
        } else if let Some(reason) = self.exceeded(seen) {
            self.trip(now, reason, out);
        }
    }

    /// An idle axis that is read for somebody who watches, and turns: something else has set it in motion. Reading on would
    /// keep its own timeout from stopping it.
    fn leave_turning_motor_alone(&mut self, now: Instant, seen: &Observation) {
        let turns = seen.velocity_rad_s.is_some_and(|velocity| !self.is_standstill(velocity));
        if self.state == AxisState::Idle && turns {
            let pause = self.programmed_timeout().map_or(UNKNOWN_TIMEOUT_PAUSE, Duration::and_a_half);
            self.state_poll_at = now + pause;
        }
    }

    /// Whether what has just been read still is what the axis tripped for. A position stays where it is until somebody
    /// moves it, so it bars nothing: the next arming watches it again.
    pub(super) fn check_limit_cause(&self, tripped: TripReason, seen: &Observation) -> Result<(), Error> {
        let TripReason::LimitExceeded { quantity, .. } = tripped else { return Ok(()) };
        match self.exceeded(&Observation { position_rad: None, ..*seen }) {
            Some(reason @ TripReason::LimitExceeded { quantity: still, .. }) if still == quantity => {
                Err(Error::CauseRemains { axis: self.index, reason })
            }
            _ => Ok(()),
        }
    }

    /// The first limit that a reading exceeds. Noise and overshoot have the axis's margin.
    fn exceeded(&self, seen: &Observation) -> Option<TripReason> {
        let margin = self.config.limit_margin();
        let beyond = |quantity, value: Option<f32>, min: f32, max: f32| {
            let value = value?;
            let limit = if value > max { max } else { min };
            (value > max || value < min).then_some(TripReason::LimitExceeded { quantity, value, limit })
        };
        // A limit of zero has a margin too.
        let slack = |limit: f32| if limit.is_finite() { limit.abs().max(1.0) * margin } else { 0.0 };
        let velocity = self.limit(AxisParameter::VelocityLimitRadS) * (1.0 + margin);
        let current = self.limit(AxisParameter::CurrentLimitA) * (1.0 + margin);
        let torque = self.limit(AxisParameter::TorqueLimitNm) * (1.0 + margin);
        let hottest = self.limit(AxisParameter::TemperatureLimitC);
        let (lowest, highest) = self.position_range();
        beyond(Quantity::Velocity, seen.velocity_rad_s, -velocity, velocity)
            .or_else(|| beyond(Quantity::Current, seen.current_a, -current, current))
            .or_else(|| beyond(Quantity::Torque, seen.torque_nm, -torque, torque))
            .or_else(|| {
                beyond(
                    Quantity::Position,
                    seen.position_rad,
                    lowest - slack(lowest),
                    highest + slack(highest),
                )
            })
            .or_else(|| beyond(Quantity::Temperature, seen.motor_temperature_c, f32::NEG_INFINITY, hottest))
            .or_else(|| beyond(Quantity::Temperature, seen.driver_temperature_c, f32::NEG_INFINITY, hottest))
    }

    /// A configured upper limit, or none.
    fn limit(&self, parameter: AxisParameter) -> f32 {
        self.config.float(parameter).unwrap_or(f32::INFINITY)
    }

    fn position_range(&self) -> (f32, f32) {
        let min = self.config.float(AxisParameter::PositionMinRad).unwrap_or(f32::NEG_INFINITY);
        (min, self.limit(AxisParameter::PositionMaxRad))
    }
}

/// Refuses NaN, infinities and values outside an inclusive range.
fn within(quantity: Quantity, value: f32, min: f32, max: f32) -> Result<(), Error> {
    if !value.is_finite() {
        return Err(Error::NotANumber { quantity });
    }
    if value < min || value > max {
        return Err(Error::OutOfRange { quantity, value, min, max });
    }
    Ok(())
}
