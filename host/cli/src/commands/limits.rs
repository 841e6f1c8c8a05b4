//! What the gateway would refuse to move, found before anything is armed: arming may free a brake.
//! The rules are the gateway's own, for the configuration that it tells; it checks them again.

use gateway::{AxisRules, NativeEffect};
use host_protocol::{AxisParameter, BusKind, Error, Setpoint, Value};
use mgw_client::ClientError;

use crate::config;
use crate::failure::Failure;
use crate::session::Session;

/// An axis, its bus, and what it may be asked for.
pub struct Limits {
    axis: u8,
    bus: BusKind,
    rules: AxisRules,
}

/// Refuses a setpoint that the axis would not take.
pub fn check_setpoint(session: &mut Session, axis: u8, setpoint: Setpoint) -> Result<(), Failure> {
    Limits::of(session, axis)?.map_or(Ok(()), |limits| limits.setpoint(setpoint))
}

/// Refuses a move that the axis would not make from where it is.
pub fn check_move(
    session: &mut Session,
    axis: u8,
    distance_rad: f32,
    speed_limit_rad_s: f32,
) -> Result<(), Failure> {
    let Some(limits) = Limits::of(session, axis)? else { return Ok(()) };
    limits.rules.check_move(distance_rad, speed_limit_rad_s).map_err(refusal)?;
    // Where it would end is known only if the motor answers; if not, arming says so.
    let start =
        session.client.read_state_when_free(axis).ok().and_then(|report| report.position_rad);
    start.map_or(Ok(()), |start| {
        limits.setpoint(Setpoint::Position {
            position_rad: start.value + distance_rad,
            speed_limit_rad_s,
        })
    })
}

impl Limits {
    /// `None` of an axis without protocol: arming names what it lacks.
    pub fn of(session: &mut Session, axis: u8) -> Result<Option<Self>, Failure> {
        let values = values(session, axis)?;
        let is = |wanted: AxisParameter| {
            move |(parameter, _): &&(AxisParameter, Value)| *parameter == wanted
        };
        if !values.iter().any(|value| is(AxisParameter::Protocol)(&value)) {
            return Ok(None);
        }
        let bus = values.iter().find(is(AxisParameter::Bus)).and_then(|(_, bus)| bus.as_unsigned());
        let bus = bus.and_then(|bus| u8::try_from(bus).ok()).unwrap_or(u8::MAX);
        let bus = config::kind_of(session.client.hello(), bus);
        let mut rules = AxisRules::new(axis, bus);
        for (parameter, value) in values {
            rules.set(parameter, value).map_err(refusal)?;
        }
        Ok(Some(Self { axis, bus, rules }))
    }

    fn setpoint(&self, setpoint: Setpoint) -> Result<(), Failure> {
        let axis = self.axis;
        self.rules.check_setpoint(setpoint).map_err(|error| match (error, self.bus, setpoint) {
            (Error::Unsupported { .. }, BusKind::Rs485, Setpoint::Impedance { .. }) => {
                let text = format!("axis {axis} is on RS485; impedance needs CAN");
                Failure::Explained { error, text }
            }
            _ => refusal(error),
        })
    }

    /// What a native command does.
    pub fn native_effect(&self, data: &[u8]) -> Result<NativeEffect, Error> {
        self.rules.native_effect(data)
    }

    /// Refuses a native command that the limits of the axis do not allow, or that could break one
    /// unnoticed.
    pub fn native(&self, data: &[u8]) -> Result<(), Failure> {
        self.rules.check_native(data).map_err(refusal)
    }
}

/// Everything that the axis is configured with, defaults included.
fn values(session: &mut Session, axis: u8) -> Result<Vec<(AxisParameter, Value)>, Failure> {
    let mut values = Vec::new();
    for parameter in AxisParameter::ALL {
        let value = session.client.read_axis_parameter(axis, *parameter)?;
        values.extend(value.map(|value| (*parameter, value)));
    }
    Ok(values)
}

/// A refusal as the gateway would say it.
pub fn refusal(error: Error) -> Failure {
    ClientError::Gateway(error).into()
}
