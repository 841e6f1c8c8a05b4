//! What a scenario demands.

use super::bench::Bench;
use super::words::{duration, parse};
use host_protocol::{AxisState, Trip};
use std::time::Duration;

impl Bench {
    /// `expect WHAT …`
    pub fn expect(&mut self, words: &[&str]) -> Result<(), String> {
        self.collect();
        let (what, rest) = words.split_first().ok_or("expect what?")?;
        match *what {
            "state" => self.expect_state(rest),
            "trip" => self.expect_trip(rest),
            "wire" => self.expect_wire(rest),
            "no-wire" => self.expect_no_wire(rest),
            "first-wire" => self.expect_first_wire(rest),
            "stopped" => self.expect_motor(rest, false),
            "moving" => self.expect_motor(rest, true),
            "event" => self.expect_event(rest),
            "bus" => self.expect_bus(rest),
            other => Err(format!("{other} cannot be expected")),
        }
    }

    /// `state AXIS idle|armed|active|stopping|tripped|tripped-confirmed`
    fn expect_state(&mut self, words: &[&str]) -> Result<(), String> {
        let axis = parse(words, 0, "axis")?;
        let wanted = match words.get(1) {
            Some(&"unconfigured") => AxisState::Unconfigured,
            Some(&"idle") => AxisState::Idle,
            Some(&"armed") => AxisState::Armed,
            Some(&"active") => AxisState::Active,
            Some(&"stopping") => AxisState::Stopping,
            Some(&"tripped") => AxisState::Tripped { confirmed: false },
            Some(&"tripped-confirmed") => AxisState::Tripped { confirmed: true },
            other => return Err(format!("{other:?} is no state")),
        };
        let list = self.client.list_axes().map_err(|e| e.to_string())?;
        let state = list.iter().find(|summary| summary.axis == axis).map(|summary| summary.state);
        if state == Some(wanted) { Ok(()) } else { Err(format!("axis {axis} is {state:?}")) }
    }

    /// `trip AXIS REASON`
    fn expect_trip(&mut self, words: &[&str]) -> Result<(), String> {
        let axis = parse(words, 0, "axis")?;
        let wanted: String = parse(words, 1, "reason")?;
        let trip = self.state(axis)?.trip;
        match trip {
            Some(Trip { reason, .. }) if format!("{reason:?}").starts_with(&wanted) => Ok(()),
            other => Err(format!("axis {axis} has {other:?}")),
        }
    }

    /// `wire BUS FRAME [within TIME] [times N]`, counted from the mark.
    fn expect_wire(&mut self, words: &[&str]) -> Result<(), String> {
        let bus = parse(words, 0, "bus")?;
        let wanted: String = parse(words, 1, "frame")?;
        let within = match words.iter().position(|word| *word == "within") {
            Some(at) => duration(words, at + 1)?,
            None => Duration::MAX,
        };
        let times: usize = match words.iter().position(|word| *word == "times") {
            Some(at) => parse(words, at + 1, "count")?,
            None => 1,
        };
        let limit = u64::try_from(within.as_micros()).unwrap_or(u64::MAX);
        let seen: Vec<u64> = self
            .wire(bus)
            .filter(|(_, text)| text.starts_with(&wanted))
            .map(|(at, _)| at - self.mark_us)
            .collect();
        let count = seen.iter().filter(|after| **after <= limit).count();
        if count >= times {
            return Ok(());
        }
        Err(format!("{wanted} was seen {count} times in time, on bus {bus} after {seen:?} µs"))
    }

    /// `no-wire BUS FRAME`, from the mark on.
    fn expect_no_wire(&mut self, words: &[&str]) -> Result<(), String> {
        let bus = parse(words, 0, "bus")?;
        let unwanted: String = parse(words, 1, "frame")?;
        match self.wire(bus).find(|(_, text)| text.starts_with(&unwanted)) {
            Some((at, text)) => Err(format!("{text} was sent at {at} µs")),
            None => Ok(()),
        }
    }

    /// `first-wire BUS FRAME`: nothing else was on the bus between the mark and this frame.
    fn expect_first_wire(&mut self, words: &[&str]) -> Result<(), String> {
        let bus = parse(words, 0, "bus")?;
        let wanted: String = parse(words, 1, "frame")?;
        match self.wire(bus).next() {
            Some((_, text)) if text.starts_with(&wanted) => Ok(()),
            other => Err(format!("the first frame was {other:?}")),
        }
    }

    /// `stopped MOTOR` or `moving MOTOR`: by the shaft itself, which no gateway can fake.
    fn expect_motor(&mut self, words: &[&str], moving: bool) -> Result<(), String> {
        /// Slower than any speed that a motor here can report.
        const STILL_RAD_S: f64 = 0.1;
        let index: usize = parse(words, 0, "motor")?;
        let speed = self.world.borrow().motor(index).speed_rad_s();
        if (speed.abs() > STILL_RAD_S) == moving {
            return Ok(());
        }
        Err(format!("motor {index} turns at {speed} rad/s"))
    }

    /// `event NAME [FIELDS AS PRINTED]`
    fn expect_event(&mut self, words: &[&str]) -> Result<(), String> {
        let wanted = words.join(" ");
        let seen = self.events.iter().any(|event| format!("{event:?}").starts_with(&wanted));
        if seen { Ok(()) } else { Err(format!("no event {wanted}")) }
    }

    /// `bus BUS COUNTER MIN`
    fn expect_bus(&mut self, words: &[&str]) -> Result<(), String> {
        let bus = parse(words, 0, "bus")?;
        let report = self.client.bus_status(bus).map_err(|e| e.to_string())?;
        let counters = report.counters;
        let count = match words.get(1) {
            Some(&"sent") => counters.sent,
            Some(&"received") => counters.received,
            Some(&"unmatched") => counters.unmatched,
            Some(&"late") => counters.late,
            Some(&"rejected") => counters.rejected,
            Some(&"missed-acknowledgements") => counters.missed_acknowledgements,
            Some(&"bus-offs") => counters.bus_offs,
            other => return Err(format!("{other:?} is no counter")),
        };
        let min: u32 = parse(words, 2, "count")?;
        if count >= min { Ok(()) } else { Err(format!("{count}, not at least {min}")) }
    }
}
