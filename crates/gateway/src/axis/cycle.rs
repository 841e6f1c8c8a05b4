//! What becomes of an axis's setpoint of a cycle.

use super::Axis;
use crate::time::Instant;
use host_protocol::{CycleResult, CycleState, Error, StateField, StateFields};
use serde::{Deserialize, Serialize};

/// The setpoint of the latest cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Cycling {
    /// Its motor has yet to answer this motion.
    Waits(u32),
    Over(CycleResult),
}

/// Fields whose age a cycle tells.
const AGED: [StateField; 3] = [StateField::Position, StateField::Velocity, StateField::Current];

impl Axis {
    /// A cycle has brought a setpoint, which was taken or not.
    pub fn cycle(&mut self, taken: Result<(), Error>) {
        let motions = self.armed().map_or(0, |armed| armed.motions);
        self.cycling = match taken {
            Ok(()) => Cycling::Waits(motions),
            Err(error) => Cycling::Over(CycleResult::Refused { error: error.number() }),
        };
    }

    /// Whether the setpoint of a cycle is still to be answered.
    pub fn is_cycling(&self) -> bool {
        matches!(self.cycling, Cycling::Waits(_))
    }

    /// The setpoint of a cycle that has still to be answered will not be any more.
    pub(super) fn end_cycle(&mut self, result: CycleResult) {
        if self.is_cycling() {
            self.cycling = Cycling::Over(result);
        }
    }

    /// The axis at the end of a cycle.
    pub fn cycle_state(&self, now: Instant, fields: StateFields) -> CycleState {
        let aged = AGED.into_iter().filter(|field| fields.contains(*field));
        let number = |field| self.measured.number(field);
        CycleState {
            axis: self.index,
            state: self.state(),
            result: match self.cycling {
                Cycling::Waits(_) => CycleResult::Superseded,
                Cycling::Over(result) => result,
            },
            age_us: aged.map(|field| self.measured.age_us(now, field)).max().unwrap_or(0),
            position_rad: number(StateField::Position),
            velocity_rad_s: number(StateField::Velocity),
            current_a: number(StateField::Current),
            voltage_v: number(StateField::Voltage),
            motor_temperature_c: number(StateField::MotorTemperature),
            driver_temperature_c: number(StateField::DriverTemperature),
            faults: self.measured.fault_word(),
        }
    }
}
