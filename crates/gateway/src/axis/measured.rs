//! What is known of a motor, in SI units, and how old it is.

use crate::time::Instant;
use host_protocol::{FaultReading, Reading};

/// What one reply of a motor tells, in SI units and in the axis's direction; `None` where it says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Observation {
    pub position_rad: Option<f32>,
    pub velocity_rad_s: Option<f32>,
    pub current_a: Option<f32>,
    /// RMD motion mode; compared with the limit, not kept.
    pub torque_nm: Option<f32>,
    pub voltage_v: Option<f32>,
    pub motor_temperature_c: Option<f32>,
    pub driver_temperature_c: Option<f32>,
    /// The protocol's fault word, bits as its manual numbers them.
    pub faults: Option<u16>,
    /// Every fault since the motor started, where it keeps such a record.
    pub fault_record: Option<u16>,
    /// RMD: the holding brake is locked.
    pub brake_locked: Option<bool>,
    /// D5: the acknowledgement level read back.
    pub ack_level: Option<u8>,
    /// D5: the motor's own communication timeout is switched on.
    pub timeout_on: Option<bool>,
    /// D5: an asynchronous write waits for its trigger.
    pub write_pending: Option<bool>,
    /// D5: the commanded speed read back is zero.
    pub commanded_zero: Option<bool>,
}

/// A value with the time at which its reply arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Dated<T> {
    value: T,
    at: Instant,
}

/// The latest of everything a motor has told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Measured {
    position_rad: Option<Dated<f32>>,
    velocity_rad_s: Option<Dated<f32>>,
    current_a: Option<Dated<f32>>,
    voltage_v: Option<Dated<f32>>,
    motor_temperature_c: Option<Dated<f32>>,
    driver_temperature_c: Option<Dated<f32>>,
    faults: Option<Dated<u16>>,
    pub fault_record: Option<u16>,
}

impl Measured {
    pub const fn new() -> Self {
        Self {
            position_rad: None,
            velocity_rad_s: None,
            current_a: None,
            voltage_v: None,
            motor_temperature_c: None,
            driver_temperature_c: None,
            faults: None,
            fault_record: None,
        }
    }

    /// Keeps what the observation says; what it does not say stays as it was.
    pub fn update(&mut self, at: Instant, seen: &Observation) {
        fn keep<T>(slot: &mut Option<Dated<T>>, value: Option<T>, at: Instant) {
            if let Some(value) = value {
                *slot = Some(Dated { value, at });
            }
        }
        keep(&mut self.position_rad, seen.position_rad, at);
        keep(&mut self.velocity_rad_s, seen.velocity_rad_s, at);
        keep(&mut self.current_a, seen.current_a, at);
        keep(&mut self.voltage_v, seen.voltage_v, at);
        keep(&mut self.motor_temperature_c, seen.motor_temperature_c, at);
        keep(&mut self.driver_temperature_c, seen.driver_temperature_c, at);
        keep(&mut self.faults, seen.faults, at);
        if seen.fault_record.is_some() {
            self.fault_record = seen.fault_record;
        }
    }

    pub fn position_rad(&self) -> Option<f32> {
        self.position_rad.map(|d| d.value)
    }

    pub fn velocity_rad_s(&self) -> Option<f32> {
        self.velocity_rad_s.map(|d| d.value)
    }

    pub fn current_a(&self) -> Option<f32> {
        self.current_a.map(|d| d.value)
    }

    pub fn fault_word(&self) -> Option<u16> {
        self.faults.map(|d| d.value)
    }

    /// The velocity, if it was measured at `since` or later.
    pub fn velocity_since(&self, since: Instant) -> Option<f32> {
        self.velocity_rad_s.filter(|d| d.at >= since).map(|d| d.value)
    }

    /// The readings as the host sees them at `now`.
    pub fn readings(&self, now: Instant) -> Readings {
        let dated = |slot: Option<Dated<f32>>| {
            slot.map(|d| Reading { value: d.value, age_us: now.since(d.at).as_micros_u32() })
        };
        Readings {
            position_rad: dated(self.position_rad),
            velocity_rad_s: dated(self.velocity_rad_s),
            current_a: dated(self.current_a),
            voltage_v: dated(self.voltage_v),
            motor_temperature_c: dated(self.motor_temperature_c),
            driver_temperature_c: dated(self.driver_temperature_c),
            faults: self
                .faults
                .map(|d| FaultReading { word: d.value, age_us: now.since(d.at).as_micros_u32() }),
        }
    }
}

/// Everything dated of one axis.
pub(crate) struct Readings {
    pub position_rad: Option<Reading>,
    pub velocity_rad_s: Option<Reading>,
    pub current_a: Option<Reading>,
    pub voltage_v: Option<Reading>,
    pub motor_temperature_c: Option<Reading>,
    pub driver_temperature_c: Option<Reading>,
    pub faults: Option<FaultReading>,
}
