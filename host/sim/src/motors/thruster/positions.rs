//! The position controller of a device with an encoder (Thruster manual §4).

use std::f64::consts::{PI, TAU};

use thruster::{
    Decidegrees, LimitDecidegrees, POSITION_MAX, POSITION_MIN, Reply, Request, RpmLimit,
};

use super::RPM;
use crate::motors::counts::to_i32;
use crate::motors::dynamics::Plant;

/// 0.1° in rad.
const DECIDEGREE: f64 = TAU / 3_600.0;

/// Zero points, limits and the move under way.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Positions {
    /// Where the absolute and the relative count are zero, rad of the shaft.
    absolute_zero: f64,
    relative_zero: f64,
    /// What LR has added up, 0.1°.
    relative_target: i32,
    /// Set by SPLA, 0.1°, kept without power.
    reverse: i16,
    forward: i16,
    /// Target and speed of the move, rad of the shaft and rad/s.
    target: Option<(f64, f64)>,
}

impl Default for Positions {
    fn default() -> Self {
        let [reverse, forward] =
            [POSITION_MIN, POSITION_MAX].map(|limit| i16::try_from(limit).unwrap_or_default());
        Self {
            absolute_zero: 0.0,
            relative_zero: 0.0,
            relative_target: 0,
            reverse,
            forward,
            target: None,
        }
    }
}

impl Positions {
    /// Where it goes and how fast, rad of the shaft and rad/s.
    pub(super) fn target(&self) -> Option<(f64, f64)> {
        self.target
    }

    /// LS, the timeout, and TC or VC that move end a move. TC 0 does not: whether a real one's does
    /// is not given.
    pub(super) fn stop(&mut self) {
        self.target = None;
    }

    pub(super) fn after_power_cycle(&self, plant: &Plant) -> Self {
        Self {
            relative_zero: plant.position_rad(),
            relative_target: 0,
            target: None,
            ..self.clone()
        }
    }

    /// QA: within one turn.
    pub(super) fn absolute(&self, plant: &Plant) -> Decidegrees {
        let turned = plant.position_rad() - self.absolute_zero;
        Decidegrees(to_i32(((turned + PI).rem_euclid(TAU) - PI) / DECIDEGREE))
    }

    /// QR.
    pub(super) fn relative(&self, plant: &Plant) -> Decidegrees {
        Decidegrees(to_i32((plant.position_rad() - self.relative_zero) / DECIDEGREE))
    }

    pub(super) fn limits(&self) -> (LimitDecidegrees, LimitDecidegrees) {
        (LimitDecidegrees(self.reverse), LimitDecidegrees(self.forward))
    }

    /// Carries out a position command. Returns whether it does: what lies beyond the limits it
    /// acknowledges and leaves, as the manual does not say how it answers.
    pub(super) fn obey(&mut self, request: &Request, plant: &Plant) -> bool {
        let speed = |speed: RpmLimit| f64::from(speed.0) * RPM;
        let (here, back) = (plant.position_rad(), f64::from(self.absolute(plant).0) * DECIDEGREE);
        match *request {
            // Speed 0: do not start.
            Request::AbsolutePosition { speed: RpmLimit(0), .. }
            | Request::RelativePosition { speed: RpmLimit(0), .. } => {}
            Request::AbsolutePosition { speed: limit, position } => {
                if !(i32::from(self.reverse)..=i32::from(self.forward)).contains(&position.0) {
                    return false;
                }
                self.target =
                    Some((here - back + f64::from(position.0) * DECIDEGREE, speed(limit)));
            }
            Request::RelativePosition { speed: limit, position } => {
                self.relative_target = self.relative_target.saturating_add(position.0);
                let target = self.relative_zero + f64::from(self.relative_target) * DECIDEGREE;
                self.target = Some((target, speed(limit)));
            }
            Request::SetAbsoluteZero => self.absolute_zero = here,
            Request::SetRelativeZero | Request::ClearRelativePosition => {
                (self.relative_zero, self.relative_target) = (here, 0);
            }
            Request::SetPositionLimits { reverse, forward } => {
                (self.reverse, self.forward) = (reverse.0, forward.0);
            }
            _ => {}
        }
        true
    }
}

/// What the device answers.
pub(super) fn taken(request: &Request) -> Reply {
    match *request {
        Request::AbsolutePosition { speed, position } => {
            Reply::AbsolutePosition { speed, position }
        }
        Request::RelativePosition { speed, position } => {
            Reply::RelativePosition { speed, position }
        }
        Request::SetPositionLimits { reverse, forward } => {
            Reply::PositionLimitsSet { reverse, forward }
        }
        Request::SetAbsoluteZero => Reply::AbsoluteZeroSet,
        Request::SetRelativeZero => Reply::RelativeZeroSet,
        _ => Reply::RelativePositionCleared,
    }
}
