//! What a scenario demands of a trip and of the stop that follows it.

use super::bench::Bench;
use super::words::{duration, parse};
use host_protocol::{Event, Trip};
use std::time::Duration;

impl Bench {
    /// `reaction|acknowledged|standstill|trip-time|trip-values AXIS …`
    pub fn expect_of_stop(&mut self, what: &str, words: &[&str]) -> Result<(), String> {
        match what {
            "reaction" => self.expect_reaction(words),
            "acknowledged" => self.expect_acknowledged(words),
            "standstill" => self.expect_standstill(words),
            "trip-time" => self.expect_trip_time(words),
            _ => self.expect_trip_values(words),
        }
    }

    /// `reaction AXIS TIME`: from the latest reason to stop that was confirmed since the mark, so
    /// long at most until the first stop frame had left.
    fn expect_reaction(&mut self, words: &[&str]) -> Result<(), String> {
        let wanted: u8 = parse(words, 0, "axis")?;
        let limit = duration(words, 1)?;
        let reaction = self.events.iter().rev().find_map(|told| match told.event {
            Event::StopConfirmed { axis, reaction_us, .. }
                if axis == wanted && told.time_us >= self.mark_us =>
            {
                Some(Duration::from_micros(reaction_us.into()))
            }
            _ => None,
        });
        match reaction {
            Some(reaction) if reaction <= limit => Ok(()),
            Some(reaction) => Err(format!("it took {reaction:?} until the stop had left")),
            None => Err("no stop was confirmed".to_string()),
        }
    }

    /// `standstill AXIS yes|no|unknown`: what the latest confirmation of a stop since the mark says
    /// of the shaft.
    fn expect_standstill(&mut self, words: &[&str]) -> Result<(), String> {
        let wanted_axis: u8 = parse(words, 0, "axis")?;
        let wanted = match words.get(1) {
            Some(&"yes") => Some(true),
            Some(&"no") => Some(false),
            Some(&"unknown") => None,
            other => return Err(format!("standstill, yes, no or unknown, not {other:?}")),
        };
        let told = self.events.iter().rev().find_map(|told| match told.event {
            Event::StopConfirmed { axis, standstill, .. }
                if axis == wanted_axis && told.time_us >= self.mark_us =>
            {
                Some(standstill)
            }
            _ => None,
        });
        match told {
            Some(standstill) if standstill == wanted => Ok(()),
            other => Err(format!("the confirmation says {other:?}")),
        }
    }

    /// `acknowledged AXIS yes|no`: whether the motor has acknowledged the stop under way.
    fn expect_acknowledged(&mut self, words: &[&str]) -> Result<(), String> {
        let axis = parse(words, 0, "axis")?;
        let wanted = match words.get(1) {
            Some(&"yes") => true,
            Some(&"no") => false,
            other => return Err(format!("acknowledged, yes or no, not {other:?}")),
        };
        let acknowledged = self.state(axis)?.stop_acknowledged;
        if acknowledged == wanted { Ok(()) } else { Err(format!("acknowledged: {acknowledged}")) }
    }

    /// `trip-time AXIS MIN MAX`: so long after the mark the axis has tripped.
    fn expect_trip_time(&mut self, words: &[&str]) -> Result<(), String> {
        let trip = self.trip(parse(words, 0, "axis")?)?;
        let (min, max) = (duration(words, 1)?, duration(words, 3)?);
        let at = self.world.borrow().gateway_started().as_micros() + trip.time_us;
        let after = Duration::from_micros(at.saturating_sub(self.mark_us));
        if at >= self.mark_us && (min..=max).contains(&after) {
            return Ok(());
        }
        self.focus_us = Some(at);
        Err(format!("it tripped at {at} µs, {after:?} after the mark"))
    }

    /// `trip-values AXIS velocity|position|current MIN MAX`: the last value before the trip.
    fn expect_trip_values(&mut self, words: &[&str]) -> Result<(), String> {
        let trip = self.trip(parse(words, 0, "axis")?)?;
        let value = match words.get(1) {
            Some(&"velocity") => trip.velocity_rad_s,
            Some(&"position") => trip.position_rad,
            Some(&"current") => trip.current_a,
            other => return Err(format!("{other:?} is no value of a trip")),
        };
        let (min, max): (f32, f32) =
            (parse(words, 2, "least value")?, parse(words, 3, "greatest value")?);
        match value {
            Some(value) if (min..=max).contains(&value) => Ok(()),
            other => Err(format!("it was {other:?}")),
        }
    }

    fn trip(&mut self, axis: u8) -> Result<Trip, String> {
        self.state(axis)?.trip.ok_or_else(|| format!("axis {axis} has not tripped"))
    }
}
