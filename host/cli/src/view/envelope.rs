//! Samples between two pictures: of each axis the lowest, the highest and the last value of each
//! field, however many there were. Pure.

use std::collections::BTreeMap;

use host_protocol::{AxisState, CycleMessage, Event, EventMessage};
use serde_json::{Value, json};

use crate::json;
use crate::json::axis::NUMBERS;
use crate::output::number;

/// The values of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span {
    low: f32,
    high: f32,
    last: f32,
}

/// One axis since the last picture.
#[derive(Debug, Clone)]
struct Axis {
    samples: u64,
    time_us: u64,
    state: AxisState,
    fields: [Option<Span>; NUMBERS.len()],
}

/// All axes since the last picture.
#[derive(Debug, Default)]
pub struct Envelope {
    axes: BTreeMap<u8, Axis>,
    /// When the last reading of each field was taken, gateway time in µs: a sample repeats what a
    /// motor has said last, however long ago.
    read_us: BTreeMap<u8, [u64; NUMBERS.len()]>,
}

impl Envelope {
    /// Takes a sample in; whether the event was one.
    pub fn take(&mut self, message: &EventMessage) -> bool {
        let Event::Sample { axis, state, .. } = message.event else { return false };
        let read_us = self.read_us.entry(axis).or_default();
        let mut values = [None; NUMBERS.len()];
        for ((value, read_us), (field, _)) in values.iter_mut().zip(read_us).zip(NUMBERS) {
            // An age ends counting somewhere.
            let Some(reading) =
                message.event.reading(*field).filter(|reading| reading.age_us < u32::MAX)
            else {
                continue;
            };
            let at = message.time_us.saturating_sub(u64::from(reading.age_us));
            if at > *read_us {
                (*read_us, *value) = (at, Some(reading.value));
            }
        }
        self.put(axis, message.time_us, state, &values);
        true
    }

    /// Takes a period of a free-running cycle in.
    pub fn take_cycle(&mut self, message: &CycleMessage) {
        for state in message.event.states() {
            let values = [state.position_rad, state.velocity_rad_s, state.current_a];
            self.put(state.axis, message.time_us, state.state, &values);
        }
    }

    fn put(&mut self, axis: u8, time_us: u64, state: AxisState, values: &[Option<f32>]) {
        let new = Axis { samples: 0, time_us, state, fields: Default::default() };
        let of = self.axes.entry(axis).or_insert(new);
        of.samples += 1;
        (of.time_us, of.state) = (time_us, state);
        let all = of.fields.iter_mut().zip(values);
        for (field, value) in all.filter_map(|(field, value)| Some((field, (*value)?))) {
            let span = field.get_or_insert(Span { low: value, high: value, last: value });
            *span = Span { low: span.low.min(value), high: span.high.max(value), last: value };
        }
    }

    /// What there was, and begins anew.
    pub fn draw(&mut self) -> Value {
        let all = std::mem::take(&mut self.axes);
        all.into_iter().map(|(axis, of)| of.into_json(axis)).collect()
    }
}

impl Axis {
    fn into_json(self, axis: u8) -> Value {
        let mut value = json::axis::in_state(axis, self.state);
        json::extend(&mut value, json!({ "samples": self.samples, "time_us": self.time_us }));
        for ((_, name), span) in NUMBERS.iter().zip(self.fields) {
            if let Some(Span { low, high, last }) = span {
                value[*name] = json!([number(low), number(high), number(last)]);
            }
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::Reading;

    fn sample(time_us: u64, velocity: f32) -> EventMessage {
        aged(time_us, velocity, 0)
    }

    fn aged(time_us: u64, velocity: f32, age_us: u32) -> EventMessage {
        let event = Event::Sample {
            axis: 3,
            state: AxisState::Active,
            position_rad: None,
            velocity_rad_s: Some(Reading { value: velocity, age_us }),
            current_a: None,
            voltage_v: None,
            motor_temperature_c: None,
            driver_temperature_c: None,
            faults: None,
        };
        EventMessage { dropped: 0, time_us, event }
    }

    #[test]
    fn a_flood_becomes_one_picture_that_hides_no_peak() {
        let mut envelope = Envelope::default();
        for time_us in 1..=8_000_u16 {
            let velocity = match time_us {
                4_000 => 9.0,
                4_001 => -7.0,
                _ => 0.5,
            };
            assert!(envelope.take(&sample(u64::from(time_us), velocity)));
        }
        let wanted = json!([{
            "axis": 3, "state": "active", "stop_confirmed": null, "samples": 8_000,
            "time_us": 8_000, "velocity_rad_s": [-7.0, 9.0, 0.5],
        }]);
        assert_eq!(envelope.draw(), wanted);
        assert_eq!(envelope.draw(), json!([]), "it begins anew");
    }

    #[test]
    fn what_a_motor_said_long_ago_is_no_value_of_now() {
        let mut envelope = Envelope::default();
        let values = |envelope: &mut Envelope| envelope.draw()[0]["velocity_rad_s"].clone();
        envelope.take(&aged(10_000, 2.0, 500));
        assert_eq!(values(&mut envelope), json!([2.0, 2.0, 2.0]));
        envelope.take(&aged(20_000, 2.0, 10_500));
        envelope.take(&aged(30_000, 2.0, u32::MAX));
        assert_eq!(values(&mut envelope), json!(null));
        envelope.take(&aged(40_000, 2.0, 500));
        assert_eq!(values(&mut envelope), json!([2.0, 2.0, 2.0]));
    }
}
