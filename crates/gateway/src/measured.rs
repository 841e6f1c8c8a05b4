//! What is known of a motor, in SI units, and how old it is.

use crate::time::Instant;
use host_protocol::{Reading, StateField, StateFields};
use serde::{Deserialize, Serialize};

/// A set of versions of a motor's protocol, one bit for each by its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Versions(u8);

impl Versions {
    pub const NONE: Self = Self(0);

    pub const fn of_bits(bits: u8) -> Self {
        Self(bits)
    }

    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The number of the only one.
    pub fn only(self) -> Option<u8> {
        u8::try_from(self.0.trailing_zeros()).ok().filter(|_| self.0.is_power_of_two())
    }
}

/// What one reply of a motor tells, in SI units and in the axis's direction; `None` where it says
/// nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Observation {
    pub position_rad: Option<f32>,
    /// The same as the motor counts it, in its own unit and sense of rotation.
    pub position_count: Option<i32>,
    /// The same as far as a reply with few bits tells it: in whole steps, and it starts again at
    /// the end of its range ([`AngleForm`](crate::protocol::AngleForm)).
    pub angle_count: Option<i32>,
    pub velocity_rad_s: Option<f32>,
    pub current_a: Option<f32>,
    /// Compared with the limit, not kept.
    pub torque_nm: Option<f32>,
    pub voltage_v: Option<f32>,
    pub motor_temperature_c: Option<f32>,
    pub driver_temperature_c: Option<f32>,
    /// The protocol's fault word, bits as its manual numbers them.
    pub faults: Option<u16>,
    /// Every fault since the motor started, where it keeps such a record.
    pub fault_record: Option<u16>,
    /// The holding brake is locked.
    pub brake_locked: Option<bool>,
    /// Time since the motor started.
    pub run_time_ms: Option<u32>,
    /// The acknowledgement level read back.
    pub ack_level: Option<u8>,
    /// The motor's own communication timeout is switched on.
    pub timeout_on: Option<bool>,
    /// An asynchronous write waits for its trigger.
    pub write_pending: Option<bool>,
    /// The commanded speed read back is zero.
    pub commanded_zero: Option<bool>,
    /// The versions of its protocol whose motors answer so; none where the reply tells nothing of
    /// that.
    pub versions: Versions,
    /// A motion was answered by zeros, which may as well be the request of 0 thrown back.
    pub may_be_thrown_back: bool,
}

/// Fields that are numbers; the last field is the fault word.
const NUMBERS: usize = StateField::ALL.len() - 1;

/// The latest of everything a motor has told. Kept apart by kind, so that 32 axes take little room.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Measured {
    /// By field; without meaning where the field is not known.
    numbers: [f32; NUMBERS],
    faults: u16,
    /// When the reply that told each field arrived.
    at: [Instant; StateField::ALL.len()],
    known: StateFields,
    pub fault_record: Option<u16>,
}

impl Measured {
    pub const fn new() -> Self {
        Self {
            numbers: [0.0; NUMBERS],
            faults: 0,
            at: [Instant::from_micros(0); StateField::ALL.len()],
            known: StateFields::NONE,
            fault_record: None,
        }
    }

    /// Keeps what the observation says; what it does not say stays as it was.
    pub fn update(&mut self, at: Instant, seen: &Observation) {
        let numbers = [
            (StateField::Position, seen.position_rad),
            (StateField::Velocity, seen.velocity_rad_s),
            (StateField::Current, seen.current_a),
            (StateField::Voltage, seen.voltage_v),
            (StateField::MotorTemperature, seen.motor_temperature_c),
            (StateField::DriverTemperature, seen.driver_temperature_c),
        ];
        for (field, value) in numbers {
            if let (Some(value), Some(place)) = (value, self.numbers.get_mut(index(field))) {
                *place = value;
                self.note(field, at);
            }
        }
        if let Some(faults) = seen.faults {
            self.faults = faults;
            self.note(StateField::Faults, at);
        }
        if seen.fault_record.is_some() {
            self.fault_record = seen.fault_record;
        }
    }

    /// The position is this.
    pub fn place(&mut self, at: Instant, position_rad: f32) {
        if let Some(place) = self.numbers.get_mut(index(StateField::Position)) {
            *place = position_rad;
            self.note(StateField::Position, at);
        }
    }

    fn note(&mut self, field: StateField, at: Instant) {
        if let Some(place) = self.at.get_mut(index(field)) {
            *place = at;
        }
        self.known = self.known.with(field);
    }

    /// The latest value of a field that is a number.
    pub fn number(&self, field: StateField) -> Option<f32> {
        self.numbers.get(index(field)).copied().filter(|_| self.known.contains(field))
    }

    pub fn fault_word(&self) -> Option<u16> {
        self.known.contains(StateField::Faults).then_some(self.faults)
    }

    /// The position last read, and how far the motor has gone since at the velocity last read, rad.
    pub fn position_and_way(&self, now: Instant) -> Option<(f32, f32)> {
        let (position, velocity) =
            (self.number(StateField::Position)?, self.number(StateField::Velocity)?);
        let age_s = self.age_us(now, StateField::Position) as f32 / 1e6;
        Some((position, velocity.abs() * age_s))
    }

    /// The velocity, if it was measured at `since` or later.
    pub fn velocity_since(&self, since: Instant) -> Option<f32> {
        let at = self.at.get(index(StateField::Velocity)).copied()?;
        self.number(StateField::Velocity).filter(|_| at >= since)
    }

    /// The latest value of a field that is a number, as the host sees it at `now`.
    pub fn reading(&self, now: Instant, field: StateField) -> Option<Reading> {
        Some(Reading { value: self.number(field)?, age_us: self.age_us(now, field) })
    }

    /// How old a field is at `now`, µs; as old as can be where it is not known.
    pub fn age_us(&self, now: Instant, field: StateField) -> u32 {
        let at = self.at.get(index(field)).filter(|_| self.known.contains(field));
        at.map_or(u32::MAX, |at| now.since(*at).as_micros_u32())
    }
}

fn index(field: StateField) -> usize {
    // Fields are numbered from 1 without gaps.
    usize::from(field.number()).saturating_sub(1)
}
