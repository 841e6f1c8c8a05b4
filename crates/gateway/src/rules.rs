//! What an axis may be asked for: every check that needs no more than its configuration. The
//! gateway makes them before it takes anything that moves; a program may make the same ones before
//! it arms, as arming may free a brake.

use crate::bus_rules;
use crate::config::{Address, AxisConfig};
use crate::protocol::{self, Command, Demand, Effect, Exchange, Info, Native};
use crate::time::Duration;
use host_protocol::{AxisParameter, BusKind, Error, Quantity, Setpoint, StopAction, Value};

/// The rules of one axis, for a program that asks what its gateway would refuse before it sends.
#[derive(Debug, Clone)]
pub struct AxisRules {
    axis: u8,
    bus: BusKind,
    config: AxisConfig,
}

/// What a native command does, as far as different rules hold for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NativeEffect {
    /// It only asks.
    Asks,
    /// It changes the motor.
    Changes,
    /// It stops the motor, or is a setpoint of 0.
    Stops,
    /// It moves the motor, and may be sent again and again.
    Moves,
    /// It moves the motor anew each time it is sent.
    MovesOnce,
    /// It prepares a motion in the motor, or starts what was prepared.
    Prepares,
}

impl AxisRules {
    /// The rules of an axis with the default of every parameter, on a bus of that kind.
    #[must_use]
    pub fn new(axis: u8, bus: BusKind) -> Self {
        Self { axis, bus, config: AxisConfig::new() }
    }

    /// Takes over a parameter of the axis.
    ///
    /// # Errors
    /// Those of a value that the parameter cannot have.
    pub fn set(&mut self, parameter: AxisParameter, value: Value) -> Result<(), Error> {
        self.config.set(parameter, value)
    }

    /// Refuses a configuration that no gateway would take, whatever else is on its bus. Of one that
    /// is not complete, what is there.
    ///
    /// # Errors
    /// [`Error::WrongBusKind`], [`Error::Unsupported`], [`Error::CannotMeasure`],
    /// [`Error::ParameterNeedsProtocol`], [`Error::BrakeStaysOpen`] and [`Error::OutOfRange`].
    pub fn check(&self) -> Result<(), Error> {
        check_motor(self.axis, self.bus, &self.config)?;
        check_config(self.axis, self.bus, &self.config)
    }

    /// Refuses a time that the motor's own timeout cannot be set to, whatever else is on its bus.
    ///
    /// # Errors
    /// [`Error::OutOfRange`].
    pub fn check_motor_timeout(&self, timeout_ms: u32) -> Result<(), Error> {
        protocol::check_timeout(timeout_ms, &self.config)
    }

    /// Refuses a setpoint that the axis would not take.
    ///
    /// # Errors
    /// Those of the request `Setpoint` that do not depend on time or state.
    pub fn check_setpoint(&self, setpoint: Setpoint) -> Result<(), Error> {
        check_bus(self.axis, self.bus, setpoint, &self.config)?;
        command(self.axis, setpoint, &self.config).map(drop)
    }

    /// Refuses a move that the axis would make from nowhere. Whether its target is within the
    /// limits is a question of where it begins: [`check_setpoint`](Self::check_setpoint) of the
    /// target tells.
    ///
    /// # Errors
    /// Those of the request `MoveRelative` that do not depend on time, state or position.
    pub fn check_move(&self, distance_rad: f32, speed_limit_rad_s: f32) -> Result<(), Error> {
        check_move(self.axis, distance_rad, speed_limit_rad_s, &self.config)
    }

    /// What a native command does.
    ///
    /// # Errors
    /// Those of data that are no command to the motor of this axis.
    pub fn native_effect(&self, data: &[u8]) -> Result<NativeEffect, Error> {
        Ok(match self.native(data)?.effect {
            Effect::Asks => NativeEffect::Asks,
            Effect::Changes { .. } => NativeEffect::Changes,
            Effect::Stops | Effect::Rests(_) => NativeEffect::Stops,
            Effect::Moves(_) => NativeEffect::Moves,
            Effect::MovesOnce(Demand::Distance { .. }) => NativeEffect::MovesOnce,
            // A setpoint that waits in the motor, and what starts it.
            Effect::MovesOnce(_) => NativeEffect::Prepares,
        })
    }

    /// Refuses a native command that the limits of the axis do not allow, or that could break one
    /// unnoticed.
    ///
    /// # Errors
    /// Those of the request `Native` that do not depend on time or state.
    pub fn check_native(&self, data: &[u8]) -> Result<(), Error> {
        match self.native(data)?.effect {
            Effect::Moves(demand) | Effect::MovesOnce(demand) | Effect::Rests(demand) => {
                check_demand(self.axis, demand, &self.config)
            }
            Effect::Asks | Effect::Stops | Effect::Changes { .. } => Ok(()),
        }
    }

    fn native(&self, data: &[u8]) -> Result<Native, Error> {
        protocol::native(self.axis, data, self.bus, &self.config)
    }
}

/// Refuses a motor that its protocol does not have: on a bus of this kind, with this id, with this
/// stop action.
pub(crate) fn check_motor(axis: u8, bus: BusKind, config: &AxisConfig) -> Result<(), Error> {
    let Some(Address { bus: number, protocol, node }) = config.address() else { return Ok(()) };
    bus_rules::check_kind(number, bus, protocol)?;
    let info = Info::of(protocol);
    Quantity::Node.check(node.into(), (1, info.last_node.into()))?;
    match config.stop_action() {
        Some(action) if info.stop(action).is_none() => Err(Error::Unsupported { axis, protocol }),
        _ => Ok(()),
    }
}

/// So many eighths of what its motor may wait for what it must hear a timeout lasts at least: the
/// frame before went out a third of the timeout earlier, and the timeout acts up to a twentieth too
/// early, as the motor's clock may be faster than ours.
const EIGHTHS_OF_WAIT: u64 = 13;
/// The same behind a command to the brake, which may not be answered: nothing goes out before.
const NINETEENTHS_OF_BRAKE: u64 = 20;

/// Refuses a time that the motor's own timeout cannot be set to, and one that may act while its bus
/// keeps what it must hear waiting for so long: what the motor holds would drop.
pub(crate) fn check_timeout(
    axis: u8,
    timeout_ms: u32,
    waits: Duration,
    config: &AxisConfig,
) -> Result<(), Error> {
    protocol::check_timeout(timeout_ms, config)?;
    // What is only on or off does not say when it acts.
    let has_time = timeout_ms != 0 && !protocol::is_served(Exchange::TimeoutSwitch, config);
    let brake = protocol::waits_for_brake(config);
    let behind_brake = match brake {
        Duration::ZERO => 0,
        _ => ((brake + waits).as_micros() * NINETEENTHS_OF_BRAKE).div_ceil(19 * 1_000),
    };
    let least_ms = (waits.as_micros() * EIGHTHS_OF_WAIT).div_ceil(8 * 1_000).max(behind_brake);
    if has_time && u64::from(timeout_ms) < least_ms {
        let (motor_timeout_ms, least_ms) =
            (timeout_ms, u32::try_from(least_ms).unwrap_or(u32::MAX));
        return Err(Error::MotorTimeoutTooShort { axis, motor_timeout_ms, least_ms });
    }
    Ok(())
}

/// As far as a target without a speed limit, or the first one that a motor tracks, may lie from
/// where the motor is, rad: it goes there at once, without a ramp.
const NEAR_RAD: f32 = 0.2;

/// The limits of an axis.
const LIMITS: [AxisParameter; 7] = [
    AxisParameter::VelocityLimitRadS,
    AxisParameter::CurrentLimitA,
    AxisParameter::PositionMinRad,
    AxisParameter::PositionMaxRad,
    AxisParameter::SignalLimit,
    AxisParameter::TemperatureLimitC,
    AxisParameter::TorqueLimitNm,
];

/// Refuses parameters that do not fit each other, in whatever order they were set.
pub(crate) fn check_config(axis: u8, bus: BusKind, config: &AxisConfig) -> Result<(), Error> {
    if let Some(info) = Info::of_axis(config) {
        let acting = (info.limits)(bus, config);
        let idle =
            |limit: &&AxisParameter| config.get(**limit).is_some() && !acting.contains(limit);
        if let Some(limit) = LIMITS.iter().find(idle) {
            return Err(Error::CannotMeasure { axis, parameter: limit.number() });
        }
    }
    for parameter in AxisParameter::ALL.iter().copied() {
        if config.is_set(parameter)
            && let Some(protocol) = protocol::only_of(parameter)
            && Some(protocol) != config.protocol()
            && config.get(parameter) != parameter.info().default
        {
            return Err(Error::ParameterNeedsProtocol {
                axis,
                parameter: parameter.number(),
                protocol,
            });
        }
    }
    // Coasting leaves the brake as it is, and a hanging load falls.
    let coasts = config.stop_action() == Some(StopAction::Coast);
    if coasts && config.flag(AxisParameter::ReleaseBrakeWhenArming) {
        return Err(Error::BrakeStaysOpen { axis });
    }
    check_return_mode(config)?;
    protocol::check_dialect(axis, config)?;
    let least = Info::of_axis(config).map_or(0.0, Info::speed_unit_rad_s);
    within_range(AxisParameter::StandstillRadS, config.standstill_rad_s(), least, 10.0)?;
    check_reach(config)?;
    let (min, max) = config.position_range();
    within_range(AxisParameter::PositionMinRad, min, f32::NEG_INFINITY, max)
}

/// The part of what a motor tells of its position that lies beyond a limit where no limit of the
/// speed says how far it gets between two readings.
const UNKNOWN_TRAVEL: f32 = 0.25;

/// Refuses a position limit, or a speed beside it, with which the motor could pass all positions
/// that trip the axis between two readings: beyond the last one it tells another angle, or stays.
fn check_reach(config: &AxisConfig) -> Result<(), Error> {
    use AxisParameter::{PositionMaxRad, PositionMinRad, VelocityLimitRadS};
    let Some(info) = Info::of_axis(config) else { return Ok(()) };
    let mut limits = [PositionMinRad, PositionMaxRad]
        .into_iter()
        .filter_map(|limit| Some((limit, config.float(limit)?)))
        .peekable();
    if limits.peek().is_none() {
        return Ok(());
    }
    let margin = config.limit_margin();
    // The last position that trips lies beyond the threshold.
    let farthest = info.position_rad(info.farthest - 1);
    let seconds = config.state_poll().as_micros_u32() as f32 / 1e6 * (1.0 + margin);
    let travel = match config.float(VelocityLimitRadS) {
        Some(fastest) => {
            within_range(VelocityLimitRadS, fastest, 0.0, (farthest - margin) / seconds)?;
            fastest * seconds
        }
        None => farthest * UNKNOWN_TRAVEL,
    };
    // Near 0 a position has the margin of 1 rad.
    let last = farthest - travel;
    let reach = (last - margin).min(last / (1.0 + margin));
    limits.try_for_each(|(limit, value)| within_range(limit, value, -reach, reach))
}

fn check_return_mode(config: &AxisConfig) -> Result<(), Error> {
    let mode = config.unsigned(AxisParameter::ReturnMode).unwrap_or_default();
    let quantity = Quantity::Parameter(AxisParameter::ReturnMode.number());
    if mode & protocol::RETURN_MODE_RESERVED == 0 { Ok(()) } else { quantity.check(mode, (0, 0)) }
}

fn within_range(parameter: AxisParameter, value: f32, min: f32, max: f32) -> Result<(), Error> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(Error::OutOfRange { quantity: Quantity::Parameter(parameter.number()), value, min, max })
}

/// Refuses an impedance on a serial bus: it has no serial form.
pub(crate) fn check_bus(
    axis: u8,
    bus: BusKind,
    setpoint: Setpoint,
    config: &AxisConfig,
) -> Result<(), Error> {
    match (config.protocol(), bus, setpoint) {
        (Some(protocol), BusKind::Rs485, Setpoint::Impedance { .. }) => {
            Err(Error::Unsupported { axis, protocol })
        }
        _ => Ok(()),
    }
}

/// The command that carries out a setpoint, or why the axis does not take it.
pub(crate) fn command(axis: u8, setpoint: Setpoint, config: &AxisConfig) -> Result<Command, Error> {
    check_limits(setpoint, config)?;
    protocol::motion(axis, setpoint, config)
}

/// Refuses what is wrong with a relative move wherever it begins.
pub(crate) fn check_move(
    axis: u8,
    distance_rad: f32,
    speed_limit_rad_s: f32,
    config: &AxisConfig,
) -> Result<(), Error> {
    if !distance_rad.is_finite() {
        return Err(Error::NotANumber { quantity: Quantity::Position });
    }
    check_speed_limit(speed_limit_rad_s, config)?;
    protocol::motion(axis, Setpoint::Position { position_rad: 0.0, speed_limit_rad_s }, config)
        .map(drop)
}

/// Refuses a native command that the limits of the axis do not allow, or that could break one
/// unnoticed.
pub(crate) fn check_demand(axis: u8, demand: Demand, config: &AxisConfig) -> Result<(), Error> {
    let unnoticed = |quantity| Err(Error::CannotCheckLimit { axis, quantity });
    match demand {
        Demand::Prepared => Ok(()),
        Demand::Setpoint(Setpoint::Position { speed_limit_rad_s: 0.0, .. })
        | Demand::Tracking { speed_limit_rad_s: 0.0, .. }
        | Demand::Distance { speed_limit_rad_s: 0.0 } => Err(Error::SpeedLimitZero { axis }),
        Demand::Tracking { position_rad, speed_limit_rad_s } => {
            check_limits(Setpoint::Position { position_rad, speed_limit_rad_s }, config)
        }
        Demand::Setpoint(setpoint) => check_limits(setpoint, config),
        Demand::Unlimited { .. } if config.limit(AxisParameter::VelocityLimitRadS).is_finite() => {
            unnoticed(Quantity::Velocity)
        }
        Demand::Unlimited { position_rad } => check_position(position_rad, config),
        Demand::Distance { speed_limit_rad_s } => {
            check_speed_limit(speed_limit_rad_s, config)?;
            // Where it ends depends on where the motor is when it begins.
            let (min, max) = config.position_range();
            if min.is_finite() || max.is_finite() { unnoticed(Quantity::Position) } else { Ok(()) }
        }
    }
}

/// Refuses a target that the motor would jump to unless it is near where it is (PROTOCOL-NOTES
/// R33). `measured` is where it was, and how far it has gone since.
pub(crate) fn check_nearness(
    axis: u8,
    demand: Demand,
    measured: Option<(f32, f32)>,
) -> Result<(), Error> {
    let (Demand::Unlimited { position_rad: target }
    | Demand::Tracking { position_rad: target, .. }) = demand
    else {
        return Ok(());
    };
    let (at, way) =
        measured.ok_or(Error::CannotCheckLimit { axis, quantity: Quantity::Position })?;
    let near = (NEAR_RAD - way).max(0.0);
    within(Quantity::Position, target, at - near, at + near)
}

/// Refuses a setpoint that is not a number or lies beyond a limit of the axis.
pub(crate) fn check_limits(setpoint: Setpoint, config: &AxisConfig) -> Result<(), Error> {
    let symmetric = |quantity, value, limit: f32| within(quantity, value, -limit, limit);
    let limit = |parameter| config.limit(parameter);
    match setpoint {
        Setpoint::Signal { fraction } => {
            let limit = config.float(AxisParameter::SignalLimit).unwrap_or(1.0);
            symmetric(Quantity::Signal, fraction, limit)
        }
        Setpoint::Current { current_a } => {
            symmetric(Quantity::Current, current_a, limit(AxisParameter::CurrentLimitA))
        }
        Setpoint::Velocity { velocity_rad_s } => {
            symmetric(Quantity::Velocity, velocity_rad_s, limit(AxisParameter::VelocityLimitRadS))
        }
        Setpoint::Position { position_rad, speed_limit_rad_s } => {
            check_speed_limit(speed_limit_rad_s, config)?;
            check_position(position_rad, config)
        }
        Setpoint::Impedance {
            position_rad,
            velocity_rad_s,
            stiffness_nm_per_rad,
            damping_nm_s_per_rad,
            torque_nm,
        } => {
            symmetric(Quantity::Velocity, velocity_rad_s, limit(AxisParameter::VelocityLimitRadS))?;
            // Their ranges are those of the motor, and are held against its words.
            finite(Quantity::Stiffness, stiffness_nm_per_rad)?;
            finite(Quantity::Damping, damping_nm_s_per_rad)?;
            symmetric(Quantity::Torque, torque_nm, limit(AxisParameter::TorqueLimitNm))?;
            check_position(position_rad, config)
        }
    }
}

fn check_speed_limit(speed_limit_rad_s: f32, config: &AxisConfig) -> Result<(), Error> {
    let quantity = Quantity::SpeedLimit;
    match config.float(AxisParameter::VelocityLimitRadS) {
        Some(fastest) => within(quantity, speed_limit_rad_s, 0.0, fastest),
        // The range is that of the motor, and is held against its words.
        None => finite(quantity, speed_limit_rad_s),
    }
}

fn check_position(position_rad: f32, config: &AxisConfig) -> Result<(), Error> {
    let (min, max) = config.position_range();
    within(Quantity::Position, position_rad, min, max)
}

/// Refuses NaN and infinities.
fn finite(quantity: Quantity, value: f32) -> Result<(), Error> {
    if value.is_finite() { Ok(()) } else { Err(Error::NotANumber { quantity }) }
}

/// Refuses NaN, infinities and values outside an inclusive range.
fn within(quantity: Quantity, value: f32, min: f32, max: f32) -> Result<(), Error> {
    finite(quantity, value)?;
    if value < min || value > max {
        return Err(Error::OutOfRange { quantity, value, min, max });
    }
    Ok(())
}
