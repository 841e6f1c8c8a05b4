//! The configuration of one axis: the values set, and what each means to the core.

use crate::time::Duration;
use host_protocol::{AxisParameter, Error, Protocol, StopAction, Value};

/// What the host has set for one axis. Unset parameters have the defaults of the parameter table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AxisConfig {
    values: [Option<Value>; AxisParameter::ALL.len()],
}

/// Where and what an axis is; exists once the required parameters are set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Address {
    pub bus: u8,
    pub protocol: Protocol,
    pub node: u8,
}

impl AxisConfig {
    pub const fn new() -> Self {
        Self { values: [None; AxisParameter::ALL.len()] }
    }

    /// Sets a parameter after checking type and range.
    pub fn set(&mut self, parameter: AxisParameter, value: Value) -> Result<(), Error> {
        parameter.check(value)?;
        if let Some(slot) = self.values.get_mut(Self::index(parameter)) {
            *slot = Some(value);
        }
        Ok(())
    }

    /// The value in force: the one set, else the default.
    pub fn get(&self, parameter: AxisParameter) -> Option<Value> {
        self.values.get(Self::index(parameter)).copied().flatten().or(parameter.info().default)
    }

    /// The first required parameter that is not set.
    pub fn missing(&self) -> Option<AxisParameter> {
        AxisParameter::ALL.iter().copied().find(|p| p.info().required && self.get(*p).is_none())
    }

    /// Whether nothing has been set.
    pub fn is_empty(&self) -> bool {
        self.values.iter().all(Option::is_none)
    }

    pub fn bus(&self) -> Option<u8> {
        self.small(AxisParameter::Bus)
    }

    pub fn protocol(&self) -> Option<Protocol> {
        self.unsigned(AxisParameter::Protocol).and_then(|p| Protocol::try_from(p).ok())
    }

    pub fn node(&self) -> Option<u8> {
        self.small(AxisParameter::Node)
    }

    pub fn address(&self) -> Option<Address> {
        Some(Address { bus: self.bus()?, protocol: self.protocol()?, node: self.node()? })
    }

    pub fn stop_action(&self) -> Option<StopAction> {
        self.unsigned(AxisParameter::StopAction).and_then(|a| StopAction::try_from(a).ok())
    }

    /// +1.0, or −1.0 where the motor counts clockwise as the axis's positive direction.
    pub fn sign(&self) -> f32 {
        match self.get(AxisParameter::Direction) {
            Some(Value::Signed(-1)) => -1.0,
            _ => 1.0,
        }
    }

    pub fn ttl(&self) -> Duration {
        self.span(AxisParameter::TtlUs)
    }

    pub fn refresh(&self) -> Duration {
        self.span(AxisParameter::RefreshUs)
    }

    pub fn fault_poll(&self) -> Duration {
        self.span(AxisParameter::FaultPollUs)
    }

    pub fn state_poll(&self) -> Duration {
        self.span(AxisParameter::StatePollUs)
    }

    pub fn stop_repeat(&self) -> Duration {
        self.span(AxisParameter::StopRepeatUs)
    }

    pub fn missed_replies(&self) -> u8 {
        self.small(AxisParameter::MissedReplies).unwrap_or(1)
    }

    pub fn stops_before_unreachable(&self) -> u8 {
        self.small(AxisParameter::StopsBeforeUnreachable).unwrap_or(1)
    }

    pub fn standstill_rad_s(&self) -> f32 {
        self.float(AxisParameter::StandstillRadS).unwrap_or(0.0)
    }

    pub fn limit_margin(&self) -> f32 {
        self.float(AxisParameter::LimitMargin).unwrap_or(0.0)
    }

    /// The configured limit of a float parameter, `None` where the axis has none.
    pub fn float(&self, parameter: AxisParameter) -> Option<f32> {
        match self.get(parameter)? {
            Value::Float(value) => Some(value),
            _ => None,
        }
    }

    pub fn flag(&self, parameter: AxisParameter) -> bool {
        matches!(self.get(parameter), Some(Value::Bool(true)))
    }

    pub fn unsigned(&self, parameter: AxisParameter) -> Option<u32> {
        match self.get(parameter)? {
            Value::Unsigned(value) => Some(value),
            _ => None,
        }
    }

    fn small(&self, parameter: AxisParameter) -> Option<u8> {
        self.unsigned(parameter).and_then(|value| u8::try_from(value).ok())
    }

    fn span(&self, parameter: AxisParameter) -> Duration {
        Duration::from_micros(u64::from(self.unsigned(parameter).unwrap_or(0)))
    }

    fn index(parameter: AxisParameter) -> usize {
        // Parameters are numbered from 1 without gaps; the table's own test holds it so.
        usize::from(parameter.number()).saturating_sub(1)
    }
}
