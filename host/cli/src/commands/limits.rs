//! What the gateway would refuse to move, found before anything is armed: arming may free a brake. The gateway checks it all again.

use host_protocol::{AxisParameter, BusKind, Error, Protocol, Quantity, Setpoint, Value};
use mgw_client::ClientError;

use crate::failure::Failure;
use crate::native_request::Demand;
use crate::session::Session;

const DEGREES_PER_RAD: f64 = 180.0 / std::f64::consts::PI;
const RPM_PER_RAD_S: f64 = 60.0 / std::f64::consts::TAU;
/// Parts of the manuals' units in one: 0.01 A, 0.01°, 0.1°.
const HUNDREDTHS: f64 = 100.0;
const TENTHS: f64 = 10.0;

/// An axis whose configuration is asked for.
pub struct Limits<'a> {
    session: &'a mut Session,
    axis: u8,
    protocol: Protocol,
}

/// Refuses a setpoint that the axis would not take.
pub fn check_setpoint(session: &mut Session, axis: u8, setpoint: Setpoint) -> Result<(), Failure> {
    Limits::of(session, axis)?.map_or(Ok(()), |mut limits| limits.setpoint(setpoint))
}

/// Refuses a move that the axis would not make from where it is.
pub fn check_move(
    session: &mut Session,
    axis: u8,
    distance_rad: f32,
    speed_limit_rad_s: f32,
) -> Result<(), Failure> {
    let Some(mut limits) = Limits::of(session, axis)? else { return Ok(()) };
    finite(Quantity::Position, distance_rad)?;
    let setpoint = |position_rad| Setpoint::Position { position_rad, speed_limit_rad_s };
    limits.can(setpoint(0.0))?;
    limits.speed_limit(speed_limit_rad_s)?;
    limits.on_the_wire(setpoint(0.0))?;
    // Where it would end is known only if the motor answers; if not, arming says so.
    let start = limits.session.client.read_state_when_free(axis).ok().and_then(|report| report.position_rad);
    start.map_or(Ok(()), |start| limits.setpoint(setpoint(start.value + distance_rad)))
}

/// Refuses a native command that the limits of the axis do not allow, or that could break one unnoticed.
pub fn check_demand(session: &mut Session, axis: u8, demand: Demand) -> Result<(), Failure> {
    let Some(mut limits) = Limits::of(session, axis)? else { return Ok(()) };
    let unnoticed = |quantity| refused(Error::CannotCheckLimit { axis, quantity });
    match demand {
        Demand::Setpoint(Setpoint::Position { speed_limit_rad_s: 0.0, .. })
        | Demand::Distance { speed_limit_rad_s: 0.0 } => refused(Error::SpeedLimitZero { axis }),
        Demand::Setpoint(setpoint) => {
            limits.can(setpoint)?;
            let setpoint = limits.in_axis_direction(setpoint)?;
            limits.configured(setpoint)
        }
        Demand::Unlimited { position_rad } => {
            if limits.float(AxisParameter::VelocityLimitRadS)?.is_some() {
                return unnoticed(Quantity::Velocity);
            }
            let sign = limits.sign()?;
            limits.position(sign * position_rad)
        }
        Demand::Distance { speed_limit_rad_s } => {
            limits.can(Setpoint::Position { position_rad: 0.0, speed_limit_rad_s })?;
            limits.speed_limit(speed_limit_rad_s)?;
            let ends = [AxisParameter::PositionMinRad, AxisParameter::PositionMaxRad];
            for end in ends {
                if limits.float(end)?.is_some() {
                    return unnoticed(Quantity::Position);
                }
            }
            Ok(())
        }
    }
}

impl<'a> Limits<'a> {
    /// `None` of an axis without protocol: arming names what it lacks.
    fn of(session: &'a mut Session, axis: u8) -> Result<Option<Self>, Failure> {
        let number = session.client.read_axis_parameter(axis, AxisParameter::Protocol)?;
        let is_it = |protocol: &&Protocol| number == Some(Value::Unsigned(u32::from(**protocol)));
        let protocol = Protocol::ALL.iter().find(is_it).copied();
        Ok(protocol.map(|protocol| Self { session, axis, protocol }))
    }

    fn float(&mut self, parameter: AxisParameter) -> Result<Option<f32>, Failure> {
        Ok(match self.session.client.read_axis_parameter(self.axis, parameter)? {
            Some(Value::Float(value)) => Some(value),
            _ => None,
        })
    }

    /// A configured upper limit, or none.
    fn limit(&mut self, parameter: AxisParameter) -> Result<f32, Failure> {
        Ok(self.float(parameter)?.unwrap_or(f32::INFINITY))
    }

    fn sign(&mut self) -> Result<f32, Failure> {
        let direction = self.session.client.read_axis_parameter(self.axis, AxisParameter::Direction)?;
        Ok(if direction == Some(Value::Signed(-1)) { -1.0 } else { 1.0 })
    }

    fn setpoint(&mut self, setpoint: Setpoint) -> Result<(), Failure> {
        self.can(setpoint)?;
        self.configured(setpoint)?;
        self.on_the_wire(setpoint)
    }

    /// Whether motors of this protocol take such a setpoint at all.
    fn can(&mut self, setpoint: Setpoint) -> Result<(), Failure> {
        let axis = self.axis;
        let can = match (self.protocol, setpoint) {
            (Protocol::Rmd, Setpoint::Signal { .. }) => false,
            (Protocol::Rmd, Setpoint::Impedance { .. }) => return self.needs_can(),
            (Protocol::Rmd, _)
            | (Protocol::Thruster, Setpoint::Signal { .. } | Setpoint::Velocity { .. })
            | (Protocol::D5, Setpoint::Velocity { .. }) => true,
            (Protocol::Thruster, Setpoint::Position { .. }) => {
                let flag = self.session.client.read_axis_parameter(axis, AxisParameter::PositionDevice)?;
                flag == Some(Value::Bool(true))
            }
            _ => false,
        };
        if can { Ok(()) } else { refused(Error::Unsupported { axis, protocol: self.protocol }) }
    }

    fn needs_can(&mut self) -> Result<(), Failure> {
        let (axis, protocol) = (self.axis, self.protocol);
        let bus = self.session.client.read_axis_parameter(axis, AxisParameter::Bus)?;
        let Some(Value::Unsigned(bus)) = bus else { return Ok(()) };
        let place = usize::try_from(bus).unwrap_or(usize::MAX);
        let capability = self.session.client.hello().buses.get(place);
        if capability.is_none_or(|bus| bus.kind == BusKind::Can) {
            return Ok(());
        }
        let text = format!("axis {axis} is on RS485; impedance needs CAN");
        Err(Failure::Explained { error: Error::Unsupported { axis, protocol }, text })
    }

    /// A setpoint in the motor's sense of rotation as the axis counts it.
    fn in_axis_direction(&mut self, setpoint: Setpoint) -> Result<Setpoint, Failure> {
        let sign = self.sign()?;
        Ok(match setpoint {
            Setpoint::Signal { fraction } => Setpoint::Signal { fraction: sign * fraction },
            Setpoint::Current { current_a } => Setpoint::Current { current_a: sign * current_a },
            Setpoint::Velocity { velocity_rad_s } => {
                Setpoint::Velocity { velocity_rad_s: sign * velocity_rad_s }
            }
            Setpoint::Position { position_rad, speed_limit_rad_s } => {
                Setpoint::Position { position_rad: sign * position_rad, speed_limit_rad_s }
            }
            impedance @ Setpoint::Impedance { .. } => impedance,
        })
    }

    /// The limits that the axis is configured with.
    fn configured(&mut self, setpoint: Setpoint) -> Result<(), Failure> {
        let symmetric = |quantity, value, limit: f32| within(quantity, value, -limit, limit);
        match setpoint {
            Setpoint::Signal { fraction } => {
                let limit = self.float(AxisParameter::SignalLimit)?.unwrap_or(1.0);
                symmetric(Quantity::Signal, fraction, limit)
            }
            Setpoint::Current { current_a } => {
                symmetric(Quantity::Current, current_a, self.limit(AxisParameter::CurrentLimitA)?)
            }
            Setpoint::Velocity { velocity_rad_s } => {
                symmetric(Quantity::Velocity, velocity_rad_s, self.limit(AxisParameter::VelocityLimitRadS)?)
            }
            Setpoint::Position { position_rad, speed_limit_rad_s } => {
                self.speed_limit(speed_limit_rad_s)?;
                self.position(position_rad)
            }
            Setpoint::Impedance {
                position_rad,
                velocity_rad_s,
                stiffness_nm_per_rad,
                damping_nm_s_per_rad,
                torque_nm,
            } => {
                let fastest = self.limit(AxisParameter::VelocityLimitRadS)?;
                let torque = self.limit(AxisParameter::TorqueLimitNm)?;
                symmetric(Quantity::Velocity, velocity_rad_s, fastest)?;
                within(Quantity::Stiffness, stiffness_nm_per_rad, 0.0, f32::INFINITY)?;
                within(Quantity::Damping, damping_nm_s_per_rad, 0.0, f32::INFINITY)?;
                symmetric(Quantity::Torque, torque_nm, torque)?;
                self.position(position_rad)
            }
        }
    }

    fn speed_limit(&mut self, speed_limit_rad_s: f32) -> Result<(), Failure> {
        let fastest = self.limit(AxisParameter::VelocityLimitRadS)?;
        within(Quantity::SpeedLimit, speed_limit_rad_s, 0.0, fastest)
    }

    fn position(&mut self, position_rad: f32) -> Result<(), Failure> {
        let min = self.float(AxisParameter::PositionMinRad)?.unwrap_or(f32::NEG_INFINITY);
        let max = self.limit(AxisParameter::PositionMaxRad)?;
        within(Quantity::Position, position_rad, min, max)
    }

    /// What the motor's protocol has numbers for.
    fn on_the_wire(&mut self, setpoint: Setpoint) -> Result<(), Failure> {
        let (axis, protocol) = (self.axis, self.protocol);
        let (i16_max, u16_max, i32_max) = (f64::from(i16::MAX), f64::from(u16::MAX), f64::from(i32::MAX));
        match setpoint {
            Setpoint::Signal { .. } => Ok(()),
            Setpoint::Current { current_a } => {
                countable(Quantity::Current, current_a, HUNDREDTHS, (-i16_max, i16_max))
            }
            Setpoint::Velocity { velocity_rad_s } => {
                let (per_unit, most) = match protocol {
                    Protocol::Rmd => (DEGREES_PER_RAD * HUNDREDTHS, i32_max),
                    Protocol::Thruster => (RPM_PER_RAD_S, i16_max),
                    Protocol::D5 => (DEGREES_PER_RAD, i16_max),
                };
                countable(Quantity::Velocity, velocity_rad_s, per_unit, (-most, most))?;
                let slowest = f64::from(thruster::SPEED_MIN_MAGNITUDE);
                let count = (f64::from(velocity_rad_s) * per_unit).round();
                if protocol == Protocol::Thruster && count != 0.0 && count.abs() < slowest {
                    let bounds = if count < 0.0 { (-most, -slowest) } else { (slowest, most) };
                    return countable(Quantity::Velocity, velocity_rad_s, per_unit, bounds);
                }
                Ok(())
            }
            Setpoint::Position { position_rad, speed_limit_rad_s } => {
                let (per_speed, parts) = match protocol {
                    Protocol::Thruster => (RPM_PER_RAD_S, TENTHS),
                    Protocol::Rmd | Protocol::D5 => (DEGREES_PER_RAD, HUNDREDTHS),
                };
                countable(Quantity::SpeedLimit, speed_limit_rad_s, per_speed, (0.0, u16_max))?;
                if (f64::from(speed_limit_rad_s) * per_speed).round() == 0.0 {
                    return refused(Error::SpeedLimitZero { axis });
                }
                countable(Quantity::Position, position_rad, DEGREES_PER_RAD * parts, (-i32_max, i32_max))
            }
            Setpoint::Impedance {
                position_rad,
                velocity_rad_s,
                stiffness_nm_per_rad,
                damping_nm_s_per_rad,
                torque_nm,
            } => {
                for (quantity, value, parameter) in [
                    (Quantity::Position, position_rad, AxisParameter::MotionPositionRad),
                    (Quantity::Velocity, velocity_rad_s, AxisParameter::MotionVelocityRadS),
                    (Quantity::Torque, torque_nm, AxisParameter::MotionTorqueNm),
                    (Quantity::Stiffness, stiffness_nm_per_rad, AxisParameter::MotionStiffness),
                    (Quantity::Damping, damping_nm_s_per_rad, AxisParameter::MotionDamping),
                ] {
                    let end = self.limit(parameter)?;
                    let is_gain = matches!(quantity, Quantity::Stiffness | Quantity::Damping);
                    within(quantity, value, if is_gain { 0.0 } else { -end }, end)?;
                }
                Ok(())
            }
        }
    }
}

fn refused(error: Error) -> Result<(), Failure> {
    Err(ClientError::Gateway(error).into())
}

fn finite(quantity: Quantity, value: f32) -> Result<(), Failure> {
    if value.is_finite() { Ok(()) } else { refused(Error::NotANumber { quantity }) }
}

/// Refuses NaN, infinities and values outside an inclusive range.
fn within(quantity: Quantity, value: f32, min: f32, max: f32) -> Result<(), Failure> {
    finite(quantity, value)?;
    if value < min || value > max {
        return refused(Error::OutOfRange { quantity, value, min, max });
    }
    Ok(())
}

/// Refuses a value whose count in the manual's unit lies outside `bounds`.
fn countable(quantity: Quantity, value: f32, per_unit: f64, bounds: (f64, f64)) -> Result<(), Failure> {
    finite(quantity, value)?;
    let count = (f64::from(value) * per_unit).round();
    let (min, max) = bounds;
    if (min..=max).contains(&count) {
        return Ok(());
    }
    #[expect(clippy::cast_possible_truncation, reason = "for a message")]
    let in_si = |count: f64| (count / per_unit) as f32;
    refused(Error::OutOfRange { quantity, value, min: in_si(min), max: in_si(max) })
}
