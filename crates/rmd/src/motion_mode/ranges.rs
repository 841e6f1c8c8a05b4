//! What the words of motion mode mean on a given motor.

use codec::{BuildError, FieldInfo, FieldKind, Fields, Visit, nearest_count};

use super::{MotionCommand, MotionFeedback};
use crate::node::Node;

/// Highest position word.
const RAW_16_MAX: u16 = u16::MAX;
/// Highest word of the 12-bit fields.
pub(crate) const RAW_12_MAX: u16 = 0xFFF;

/// Divisor with which the manual reads the position word (RMD V3.6 §5.4).
const POSITION_DIVISOR: f64 = 65536.0;
/// Divisor with which the manual reads the 12-bit words (RMD V3.6 §5.4).
const WORD_DIVISOR: f64 = 4095.0;

/// The physical values that a word's lower and upper end stand for.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Span {
    /// Value of the word 0.
    pub min: f64,
    /// Value of the upper end; above `min`.
    pub max: f64,
}

/// The ranges of one motor. Newer motors than those of the manual have others.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionRanges {
    /// Position of the output shaft, rad.
    pub position_rad: Span,
    /// Velocity of the output shaft, rad/s.
    pub velocity_rad_s: Span,
    /// Gain of the position error, N·m/rad.
    pub kp: Span,
    /// Gain of the velocity error, N·m·s/rad.
    pub kd: Span,
    /// Torque, N·m.
    pub torque_nm: Span,
}

/// A motion-mode request in physical values.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionTarget {
    /// Desired position of the output shaft, rad.
    pub position_rad: f64,
    /// Desired velocity of the output shaft, rad/s.
    pub velocity_rad_s: f64,
    /// Gain of the position error, N·m/rad.
    pub kp: f64,
    /// Gain of the velocity error, N·m·s/rad.
    pub kd: f64,
    /// Torque in addition, N·m.
    pub torque_nm: f64,
}

/// A motion-mode reply in physical values.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionState {
    /// Position of the output shaft, rad.
    pub position_rad: f64,
    /// Velocity of the output shaft, rad/s.
    pub velocity_rad_s: f64,
    /// Torque, N·m.
    pub torque_nm: f64,
}

/// A motion-mode field, with the default range of `last` + 1 counts.
const fn span(name: &'static str, unit: &'static str, span: Span, last: u16) -> FieldInfo {
    let counts_per_unit = (last as f64 + 1.0) / (span.max - span.min);
    FieldInfo {
        name,
        unit,
        kind: FieldKind::Physical,
        min: span.min,
        max: span.max,
        counts_per_unit,
    }
}

pub(super) const POSITION: FieldInfo =
    span("position_rad", "rad", MotionRanges::DEFAULT.position_rad, RAW_16_MAX);
pub(super) const VELOCITY: FieldInfo =
    span("velocity_rad_s", "rad/s", MotionRanges::DEFAULT.velocity_rad_s, RAW_12_MAX);
pub(super) const KP: FieldInfo = span("kp", "N*m/rad", MotionRanges::DEFAULT.kp, RAW_12_MAX);
pub(super) const KD: FieldInfo = span("kd", "N*m*s/rad", MotionRanges::DEFAULT.kd, RAW_12_MAX);
pub(super) const TORQUE: FieldInfo =
    span("torque_nm", "N*m", MotionRanges::DEFAULT.torque_nm, RAW_12_MAX);
/// The motor's id as it stands in a reply.
pub(super) const ID: FieldInfo = FieldInfo::integer("id", "", Node::MIN as i64, Node::MAX as i64);

impl MotionTarget {
    /// Not checked against the ranges of the table, which are the manual's: the caller's ranges
    /// decide.
    pub(crate) fn build(fields: &Fields<'_>) -> Result<MotionTarget, BuildError> {
        Ok(MotionTarget {
            position_rad: fields.any(&POSITION)?,
            velocity_rad_s: fields.any(&VELOCITY)?,
            kp: fields.any(&KP)?,
            kd: fields.any(&KD)?,
            torque_nm: fields.any(&TORQUE)?,
        })
    }

    pub(crate) fn visit(&self, visit: &mut Visit<'_>) {
        POSITION.visit_physical(visit, self.position_rad);
        VELOCITY.visit_physical(visit, self.velocity_rad_s);
        KP.visit_physical(visit, self.kp);
        KD.visit_physical(visit, self.kd);
        TORQUE.visit_physical(visit, self.torque_nm);
    }
}

impl MotionState {
    /// The state of the motor with this id.
    pub(crate) fn visit(&self, id: u8, visit: &mut Visit<'_>) {
        ID.visit_integer(visit, id);
        POSITION.visit_physical(visit, self.position_rad);
        VELOCITY.visit_physical(visit, self.velocity_rad_s);
        TORQUE.visit_physical(visit, self.torque_nm);
    }
}

impl Span {
    /// A span between two ends.
    pub const fn new(min: f64, max: f64) -> Span {
        Span { min, max }
    }

    /// `round((value − min) · 2ⁿ / (max − min))`, the upper end as the highest word: reproduces the
    /// printed request.
    fn to_raw(self, field: &'static str, value: f64, last: u16) -> Result<u16, BuildError> {
        let Span { min, max } = self;
        let refused = BuildError::OutOfRange { field, value, min, max };
        // NaN lies in no range.
        if !(min..=max).contains(&value) {
            return Err(refused);
        }
        let steps = f64::from(last) + 1.0;
        let raw = nearest_count((value - min) * steps / (max - min)).min(i64::from(last));
        u16::try_from(raw).map_err(|_| refused)
    }

    fn to_physical(self, raw: u16, divisor: f64) -> f64 {
        f64::from(raw) / divisor * (self.max - self.min) + self.min
    }
}

impl MotionRanges {
    /// The ranges of the manual (RMD V3.6 §5.1).
    pub const DEFAULT: MotionRanges = MotionRanges {
        position_rad: Span::new(-12.5, 12.5),
        velocity_rad_s: Span::new(-45.0, 45.0),
        kp: Span::new(0.0, 500.0),
        kd: Span::new(0.0, 5.0),
        torque_nm: Span::new(-24.0, 24.0),
    };

    /// The ranges of a V4.4 motor, of which the highest torque depends on the model, and that of kd
    /// on whom one asks: its manual says 5 and 50.
    pub const fn v4_4(torque_nm: f64, kd: f64) -> MotionRanges {
        MotionRanges {
            position_rad: Span::new(-12.566, 12.566),
            kd: Span::new(0.0, kd),
            torque_nm: Span::new(-torque_nm, torque_nm),
            ..MotionRanges::DEFAULT
        }
    }

    /// The words nearest to a target; values outside their range are refused by name.
    pub fn command(&self, target: &MotionTarget) -> Result<MotionCommand, BuildError> {
        Ok(MotionCommand {
            position: self.position_rad.to_raw("position_rad", target.position_rad, RAW_16_MAX)?,
            velocity: self.velocity_rad_s.to_raw(
                "velocity_rad_s",
                target.velocity_rad_s,
                RAW_12_MAX,
            )?,
            kp: self.kp.to_raw("kp", target.kp, RAW_12_MAX)?,
            kd: self.kd.to_raw("kd", target.kd, RAW_12_MAX)?,
            torque: self.torque_nm.to_raw("torque_nm", target.torque_nm, RAW_12_MAX)?,
        })
    }

    /// What a request's words ask for.
    pub fn target(&self, command: &MotionCommand) -> MotionTarget {
        MotionTarget {
            position_rad: self.position_rad.to_physical(command.position, POSITION_DIVISOR),
            velocity_rad_s: self.velocity_rad_s.to_physical(command.velocity, WORD_DIVISOR),
            kp: self.kp.to_physical(command.kp, WORD_DIVISOR),
            kd: self.kd.to_physical(command.kd, WORD_DIVISOR),
            torque_nm: self.torque_nm.to_physical(command.torque, WORD_DIVISOR),
        }
    }

    /// What a reply's words report.
    pub fn state(&self, feedback: &MotionFeedback) -> MotionState {
        MotionState {
            position_rad: self.position_rad.to_physical(feedback.position, POSITION_DIVISOR),
            velocity_rad_s: self.velocity_rad_s.to_physical(feedback.velocity, WORD_DIVISOR),
            torque_nm: self.torque_nm.to_physical(feedback.torque, WORD_DIVISOR),
        }
    }
}

impl Default for MotionRanges {
    fn default() -> Self {
        Self::DEFAULT
    }
}
