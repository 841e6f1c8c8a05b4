//! The configuration of one axis: the values set, and what each means to the core.

use crate::filled::filled;
use crate::time::Duration;
use core::num::NonZeroU64;
use core::ops::Range;
use host_protocol::{AxisParameter, Error, Protocol, StopAction, Value, ValueKind};
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

/// What the host has set for one axis. Unset parameters have the defaults of the parameter table.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct AxisConfig {
    /// The values as bits, each in as many bytes as it needs; the parameter table says which kind
    /// it is.
    #[serde(with = "BigArray")]
    values: [u8; VALUE_BYTES],
    /// Which of them are set: a bit for each, by its place in the table.
    set: u64,
    /// What is asked for at every frame, kept apart from the values that say it.
    bus: Option<u8>,
    protocol: Option<Protocol>,
    node: Option<u8>,
    /// Counts what was set: what follows from the values alone is worked out anew with each.
    version: u16,
}

impl PartialEq for AxisConfig {
    fn eq(&self, other: &Self) -> bool {
        (self.values, self.set) == (other.values, other.set)
    }
}

/// The part of the time between two fault polls that is kept for waiting.
const FAULT_POLL_RESERVE: NonZeroU64 = NonZeroU64::new(10).unwrap();
/// What an armed axis may turn at without a setpoint, in standstill thresholds (GUARANTEES G1).
const UNCOMMANDED_STANDSTILLS: f32 = 5.0;
const PARAMETERS: usize = AxisParameter::ALL.len();
/// Words that say which parameters are set.
const SET_WORDS: usize = 2;
/// The required parameters, none of which has a default: a bit for each, by its place.
const REQUIRED: u64 = required();

const fn required() -> u64 {
    let (mut required, mut place) = (0, 0);
    while place < PARAMETERS {
        if AxisParameter::ALL[place].info().required {
            required |= 1 << place;
        }
        place += 1;
    }
    required
}

/// Where the value of each parameter begins, and behind the last one where all end.
const OFFSETS: [u8; PARAMETERS + 1] = offsets();
const VALUE_BYTES: usize = OFFSETS[PARAMETERS] as usize;

#[allow(clippy::cast_possible_truncation, reason = "the sum of the widths is less than 256")]
const fn offsets() -> [u8; PARAMETERS + 1] {
    let mut offsets = [0; PARAMETERS + 1];
    let mut place = 0;
    while place < PARAMETERS {
        let end = offsets[place] as usize + width(AxisParameter::ALL[place]);
        assert!(end <= u8::MAX as usize, "an offset is a byte");
        offsets[place + 1] = end as u8;
        place += 1;
    }
    offsets
}

/// Bytes of a value: what its range needs.
const fn width(parameter: AxisParameter) -> usize {
    match parameter.info().max {
        // The only signed parameter is a direction, -1 or 1.
        Value::Bool(_) | Value::Signed(_) | Value::Unsigned(..=0xFF) => 1,
        Value::Unsigned(..=0xFFFF) => 2,
        Value::Unsigned(_) | Value::Float(_) => 4,
    }
}
const _: () = assert!(PARAMETERS <= u64::BITS as usize, "one bit for each parameter");

/// Where and what an axis is; exists once the required parameters are set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Address {
    pub bus: u8,
    pub protocol: Protocol,
    pub node: u8,
}

impl AxisConfig {
    pub const fn new() -> Self {
        Self { values: [0; VALUE_BYTES], set: 0, bus: None, protocol: None, node: None, version: 0 }
    }

    /// Sets a parameter after checking type and range.
    pub fn set(&mut self, parameter: AxisParameter, value: Value) -> Result<(), Error> {
        parameter.check(value)?;
        self.exchange(parameter.place(), Some(to_bits(value)));
        Ok(())
    }

    /// Gives the parameter at a place a value, whose bits have been checked, or none. Returns the
    /// bits of the one before.
    pub fn exchange(&mut self, place: usize, bits: Option<u32>) -> Option<u32> {
        let before = self.bits(place);
        let range = range_of(place)?;
        for (byte, new) in
            self.values.get_mut(range)?.iter_mut().zip(bits.unwrap_or(0).to_le_bytes())
        {
            *byte = new;
        }
        self.set = self.set & !(1 << place) | u64::from(bits.is_some()) << place;
        self.version = self.version.wrapping_add(1);
        self.bus = self.small(AxisParameter::Bus);
        self.node = self.small(AxisParameter::Node);
        let protocol = self.unsigned(AxisParameter::Protocol);
        self.protocol = protocol.and_then(|number| Protocol::try_from(number).ok());
        before
    }

    /// The bits of the value at a place, where it is set.
    fn bits(&self, place: usize) -> Option<u32> {
        if place >= PARAMETERS || self.set & (1 << place) == 0 {
            return None;
        }
        match *self.values.get(range_of(place)?)? {
            [byte] if place == AxisParameter::Direction.place() => {
                Some(i32::from(byte.cast_signed()).cast_unsigned())
            }
            [byte] => Some(u32::from(byte)),
            [low, high] => Some(u32::from(u16::from_le_bytes([low, high]))),
            [a, b, c, d] => Some(u32::from_le_bytes([a, b, c, d])),
            _ => None,
        }
    }

    /// Whether a parameter is set.
    pub fn is_set(&self, parameter: AxisParameter) -> bool {
        self.set & (1 << parameter.place()) != 0
    }

    /// Another number after each parameter that was set.
    pub fn version(&self) -> u16 {
        self.version
    }

    /// Words of [`to_words`](Self::to_words).
    pub const WORDS: usize = SET_WORDS + PARAMETERS;

    /// Which parameters are set, then the bits of each.
    pub fn to_words(&self) -> [u32; Self::WORDS] {
        #[allow(clippy::cast_possible_truncation)]
        let set = [self.set as u32, (self.set >> u32::BITS) as u32];
        let values = (0..PARAMETERS).map(|place| self.bits(place).unwrap_or(0));
        filled(set.into_iter().chain(values))
    }

    /// A configuration from its words, each value checked as if it came from a host.
    pub fn from_words(words: &[u32]) -> Result<Self, Error> {
        let mut config = Self::new();
        let [low, high, values @ ..] = words else { return Ok(config) };
        let set = u64::from(*low) | u64::from(*high) << u32::BITS;
        for (parameter, bits) in AxisParameter::ALL.iter().zip(values) {
            if set & (1 << parameter.place()) != 0 {
                config.set(*parameter, from_bits(parameter.info().kind, *bits))?;
            }
        }
        Ok(config)
    }

    /// The value in force: the one set, else the default.
    pub fn get(&self, parameter: AxisParameter) -> Option<Value> {
        let info = parameter.info();
        match self.bits(parameter.place()) {
            Some(bits) => Some(from_bits(info.kind, bits)),
            None => info.default,
        }
    }

    /// The first required parameter that is not set.
    pub fn missing(&self) -> Option<AxisParameter> {
        AxisParameter::ALL.get((REQUIRED & !self.set).trailing_zeros() as usize).copied()
    }

    /// Whether nothing has been set.
    pub fn is_empty(&self) -> bool {
        self.set == 0
    }

    pub fn bus(&self) -> Option<u8> {
        self.bus
    }

    pub fn protocol(&self) -> Option<Protocol> {
        self.protocol
    }

    pub fn node(&self) -> Option<u8> {
        self.node
    }

    pub fn address(&self) -> Option<Address> {
        Some(Address { bus: self.bus()?, protocol: self.protocol()?, node: self.node()? })
    }

    pub fn stop_action(&self) -> Option<StopAction> {
        self.unsigned(AxisParameter::StopAction).and_then(|a| StopAction::try_from(a).ok())
    }

    /// Whether the axis says that its motor has a holding brake: its stop locks it, or its arming
    /// frees it. Of other motors the brake is not judged.
    pub fn has_brake(&self) -> bool {
        self.stop_action() == Some(StopAction::Brake)
            || self.flag(AxisParameter::ReleaseBrakeWhenArming)
    }

    /// Whether the motor's own word on its brake counts.
    pub fn verifies_brake(&self) -> bool {
        self.has_brake() && !self.flag(AxisParameter::AllowUnverifiedBrake)
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

    /// When the fault word is asked for again: early enough to be read within the configured time,
    /// whatever is under way then.
    pub fn fault_poll(&self) -> Duration {
        let longest = self.span(AxisParameter::FaultPollUs);
        longest - longest.part(FAULT_POLL_RESERVE)
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

    /// A configured upper limit; infinity where the axis has none.
    pub fn limit(&self, parameter: AxisParameter) -> f32 {
        self.float(parameter).unwrap_or(f32::INFINITY)
    }

    /// The lowest and the highest value allowed of a quantity that is limited to both sides of
    /// zero.
    pub fn range(&self, parameter: AxisParameter) -> (f32, f32) {
        let limit = self.limit(parameter);
        (-limit, limit)
    }

    /// Above this speed an armed axis without a setpoint trips.
    pub fn uncommanded_rad_s(&self) -> f32 {
        let unset = UNCOMMANDED_STANDSTILLS * self.standstill_rad_s();
        self.float(AxisParameter::UncommandedRadS).unwrap_or(unset)
    }

    /// The lowest and the highest position allowed, rad.
    pub fn position_range(&self) -> (f32, f32) {
        let min = self.float(AxisParameter::PositionMinRad).unwrap_or(f32::NEG_INFINITY);
        (min, self.limit(AxisParameter::PositionMaxRad))
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
}

/// Where the value at a place lies.
fn range_of(place: usize) -> Option<Range<usize>> {
    let [begin, end] = *OFFSETS.get(place..place + 2)? else { return None };
    Some(usize::from(begin)..usize::from(end))
}

/// A value as the bits that are kept.
pub(crate) fn to_bits(value: Value) -> u32 {
    match value {
        Value::Bool(value) => u32::from(value),
        Value::Unsigned(value) => value,
        Value::Signed(value) => value.cast_unsigned(),
        Value::Float(value) => value.to_bits(),
    }
}

fn from_bits(kind: ValueKind, bits: u32) -> Value {
    match kind {
        ValueKind::Bool => Value::Bool(bits != 0),
        ValueKind::Unsigned => Value::Unsigned(bits),
        ValueKind::Signed => Value::Signed(bits.cast_signed()),
        ValueKind::Float => Value::Float(f32::from_bits(bits)),
    }
}

#[cfg(test)]
#[path = "../tests/unit/config.rs"]
mod tests;
