//! What an RMD motor tells of itself.

use super::super::counts::{to_i8, to_i16, to_i32, to_u16, to_wrapped_i16};
use super::super::dynamics::Drive;
use super::{NM_PER_AMPERE, Rmd};
use rmd::{
    Celsius, Centiamps, Centidegrees, Decivolts, Deciwatts, Degrees, DegreesPerSecond, Motion,
    MotionFeedback, MotionRanges, Reply, RunMode, Span,
};

/// The divisors with which the manual reads the words of motion mode (RMD V3.6 §5.4).
const POSITION_DIVISOR: f64 = 65_536.0;
const WORD_DIVISOR: f64 = 4_095.0;
const POSITION_LAST: f64 = 65_535.0;

impl Rmd {
    /// The angle from the zero point, rad.
    pub(super) fn angle_rad(&self) -> f64 {
        self.plant.position_rad() - self.memory.zero_rad()
    }

    pub(super) fn angle(&self) -> Centidegrees {
        Centidegrees(to_i32(self.angle_rad().to_degrees() * 100.0))
    }

    pub(super) fn temperature(&self) -> Celsius {
        Celsius(to_i8(self.plant.motor_c()))
    }

    pub(super) fn motion(&self) -> Motion {
        Motion {
            temperature: self.temperature(),
            current: Centiamps(to_i16(self.plant.current_a() * 100.0)),
            speed: DegreesPerSecond(to_i16(self.plant.speed_rad_s().to_degrees())),
            // It starts again after 65 536°, which no manual says.
            angle: Degrees(to_wrapped_i16(self.angle_rad().to_degrees())),
        }
    }

    /// The state in the words of motion mode; beyond their ranges it stays at their ends (RMD V3.6
    /// §5.3).
    pub(super) fn feedback(&self) -> MotionFeedback {
        let word = |value: f64, Span { min, max }: Span, divisor: f64, last: f64| {
            to_u16(((value - min) / (max - min) * divisor).clamp(0.0, last))
        };
        let ranges = MotionRanges::DEFAULT;
        let torque_nm = self.plant.current_a() * NM_PER_AMPERE;
        MotionFeedback {
            id: self.node.get(),
            position: word(self.angle_rad(), ranges.position_rad, POSITION_DIVISOR, POSITION_LAST),
            velocity: word(
                self.plant.speed_rad_s(),
                ranges.velocity_rad_s,
                WORD_DIVISOR,
                WORD_DIVISOR,
            ),
            torque: word(torque_nm, ranges.torque_nm, WORD_DIVISOR, WORD_DIVISOR),
        }
    }

    pub(super) fn status_1(&self) -> Reply {
        Reply::Status1 {
            temperature: self.temperature(),
            brake_released: !self.is_locked(),
            voltage: Decivolts(to_u16(self.plant.voltage_v() * 10.0)),
            faults: self.faults,
        }
    }

    /// The phases in the moment in which one carries all of the torque current.
    pub(super) fn status_3(&self) -> Reply {
        let phase = |share: f64| Centiamps(to_i16(self.plant.current_a() * share * 100.0));
        let (phase_a, phase_b, phase_c) = (phase(1.0), phase(-0.5), phase(-0.5));
        Reply::Status3 { temperature: self.temperature(), phase_a, phase_b, phase_c }
    }

    /// What the supply gives.
    pub(super) fn power(&self) -> Deciwatts {
        Deciwatts(to_u16(self.plant.voltage_v() * self.plant.current_a().abs() * 10.0))
    }

    /// The loop that runs; the manual does not name the one for a motor without output, nor that of
    /// motion mode.
    pub(super) fn run_mode(&self) -> RunMode {
        match self.plant.drive() {
            Drive::Current(_) => RunMode::Current,
            Drive::Speed { .. } => RunMode::Velocity,
            Drive::Position { .. } => RunMode::Position,
            Drive::Off | Drive::Locked => RunMode::Unknown(0),
            Drive::Spring { .. } => RunMode::Unknown(4),
        }
    }
}
