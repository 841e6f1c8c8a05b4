//! The position as the replies to setpoints tell it: an angle in whole steps that starts again at
//! the end of its range.
//!
//! It is placed next to where the motor was a moment before, and read only while it agrees with the
//! position that the motor counts on and on, whenever that is polled.

use super::Axis;
use crate::measured::Observation;
use crate::outbox::Outbox;
use crate::protocol::{AngleForm, Info};
use crate::time::{Duration, Instant};
use host_protocol::{Event, StateField};
use serde::{Deserialize, Serialize};

/// A place so old says no more next to which one an angle lies: no reply can tell a speed that
/// makes half a range in this time, and no motor restarts in it.
const PLACE_LASTS: Duration = Duration::from_millis(100);
/// An angle so old is not compared with a position.
const ANGLE_LASTS: Duration = Duration::from_millis(50);
/// Between the moments at which a motor measured two readings lies at most so much more than
/// between their arrivals.
const TRANSFER: Duration = Duration::from_millis(1);

/// What is known of an angle that starts again.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Angle {
    /// The last one told, in the motor's counts.
    told: Option<(Instant, i32)>,
    /// Where the motor was last, in its counts.
    place: (Instant, i32),
    /// Whether angle and position agreed when they were compared last.
    agrees: Option<bool>,
}

impl Angle {
    pub const UNKNOWN: Self =
        Self { told: None, place: (Instant::from_micros(0), 0), agrees: None };

    /// The count nearest to the last one that an angle can be.
    fn placed(&self, angle: i32, form: AngleForm) -> Option<i32> {
        let way = way(self.place.1, angle, form);
        // Finer than a step the last one stays the better one.
        if way.abs() < form.step { Some(self.place.1) } else { self.place.1.checked_add(way) }
    }
}

/// How far an angle is from a count, the short way round.
fn way(count: i32, angle: i32, form: AngleForm) -> i32 {
    let half = form.span / 2;
    match angle - count % form.span {
        way if way > half => way - form.span,
        way if way < -half => way + form.span,
        way => way,
    }
}

impl Axis {
    /// Takes in what a reply tells of the position.
    pub(super) fn track_angle(&mut self, now: Instant, seen: &Observation, out: &mut Outbox<'_>) {
        let Some(info) = Info::of_axis(&self.config) else { return };
        let Some(form) = info.angle else { return };
        let sign = self.config.sign();
        if let Some(count) = seen.position_count {
            self.check_angle(now, count, info, form, out);
            self.angle.place = (now, count);
        }
        let Some(angle) = seen.angle_count else { return };
        if angle.abs() >= form.span / 2 - form.step {
            self.angle.told = None;
            return;
        }
        self.angle.told = Some((now, angle));
        if self.angle.agrees == Some(true)
            && now.since(self.angle.place.0) <= PLACE_LASTS
            && let Some(count) = self.angle.placed(angle, form)
        {
            self.angle.place = (now, count);
            self.measured.place(now, sign * info.position_rad(count));
        }
    }

    /// Compares the last angle with a position that was read. What a motor turns in between is
    /// allowed, and a step to both sides: how it rounds is not known.
    fn check_angle(
        &mut self,
        now: Instant,
        count: i32,
        info: &Info,
        form: AngleForm,
        out: &mut Outbox<'_>,
    ) {
        let told = self.angle.told.filter(|(at, _)| now.since(*at) <= ANGLE_LASTS);
        let Some((at, angle)) = told else { return };
        let seconds = (now.since(at) + TRANSFER).as_micros_u32() as f32 / 1e6;
        let speed = self.measured.number(StateField::Velocity).unwrap_or(0.0).abs();
        let turned = (speed + form.acceleration_rad_s2 / 2.0 * seconds) * seconds;
        let off = info.position_rad(way(count, angle, form).abs());
        let agrees = off <= info.position_rad(form.step) + turned;
        if !agrees && self.angle.agrees != Some(false) {
            let sign = self.config.sign();
            out.event(&Event::AngleMismatch {
                axis: self.index,
                angle_rad: sign * info.position_rad(angle),
                position_rad: sign * info.position_rad(count),
            });
        }
        self.angle.agrees = Some(agrees);
    }
}

#[cfg(test)]
#[path = "../../tests/unit/angle.rs"]
mod tests;
