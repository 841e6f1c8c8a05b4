//! What a scenario demands.

use super::bench::{Bench, Told};
use super::requests::subject;
use super::words::{duration, fields, parse};
use host_protocol::{AxisParameter, AxisState, Event, MotorTimeout, StateField, Trip};
use std::time::Duration;

impl Bench {
    /// `expect WHAT …`
    pub fn expect(&mut self, words: &[&str]) -> Result<(), String> {
        self.collect();
        let (what, rest) = words.split_first().ok_or("expect what?")?;
        match *what {
            "wire" | "no-wire" | "first-wire" | "wire-count" | "wire-order" | "spacing" => {
                self.expect_on_wire(what, rest)
            }
            "state" => self.expect_state(rest),
            "trip" => self.expect_trip(rest),
            "refusal" => self.expect_refusal(rest),
            "reaction" | "acknowledged" | "standstill" | "trip-time" | "trip-values" => {
                self.expect_of_stop(what, rest)
            }
            "motor-timeout" => self.expect_motor_timeout(rest),
            "enable-output" | "boot" | "crash-report" | "incident" | "incidents" => {
                self.expect_of_gateway(what, rest)
            }
            "stopped" => self.expect_motor(rest, false),
            "moving" => self.expect_motor(rest, true),
            "position" => self.expect_position(rest),
            "turned" => self.expect_turned(rest),
            "cycled" => self.expect_cycled(rest),
            "period" | "periods" | "overruns" => self.expect_of_cycle(what, rest),
            "native-reply" => self.expect_native_reply(rest),
            "move-target" => self.expect_move_target(rest),
            "sample" => self.expect_sample(rest),
            "samples" => self.expect_samples(rest),
            "sample-ages" => self.expect_sample_ages(rest),
            "event" => self.expect_event(rest),
            "no-event" => self.expect_no_event(rest),
            "bus" => self.expect_bus(rest),
            "setting" => self.expect_setting(rest),
            "name" => self.expect_name(rest),
            "image" => self.expect_image(rest),
            "bus-runs" => self.expect_bus_runs(rest),
            other => Err(format!("{other} cannot be expected")),
        }
    }

    /// `state AXIS
    /// unconfigured|idle|holding|arming|armed|active|stopping|tripped|tripped-confirmed`
    fn expect_state(&mut self, words: &[&str]) -> Result<(), String> {
        let axis: u8 = parse(words, 0, "axis")?;
        let wanted = match words.get(1) {
            Some(&"unconfigured") => AxisState::Unconfigured,
            Some(&"idle") => AxisState::Idle,
            Some(&"holding") => AxisState::Holding,
            Some(&"arming") => AxisState::Arming,
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

    /// `setting AXIS NAME VALUE|unset`: as the value is printed.
    fn expect_setting(&mut self, words: &[&str]) -> Result<(), String> {
        let (axis, name, wanted): (u8, String, String) =
            (parse(words, 0, "axis")?, parse(words, 1, "name")?, parse(words, 2, "value")?);
        let parameter = AxisParameter::from_name(&name).ok_or("no such parameter")?.number();
        let (settings, _) = self.client.axis_settings(axis).map_err(|e| e.to_string())?;
        let setting = settings.iter().find(|setting| setting.parameter == parameter);
        let is = setting.map_or("unset".to_string(), |setting| setting.value.to_string());
        if is == wanted { Ok(()) } else { Err(format!("{name} of axis {axis} is {is}")) }
    }

    /// `name gateway|bus N|axis N NAME|none`
    fn expect_name(&mut self, words: &[&str]) -> Result<(), String> {
        let (wanted, of) = words.split_last().ok_or("whose name?")?;
        let of = subject(of)?;
        let names = self.client.names().map_err(|e| e.to_string())?;
        let name = names.iter().find(|named| named.of == of).map(|named| named.name.as_str());
        if name.unwrap_or("none") == *wanted { Ok(()) } else { Err(format!("{of} is {name:?}")) }
    }

    /// `bus-runs BUS BITRATE|no`
    fn expect_bus_runs(&mut self, words: &[&str]) -> Result<(), String> {
        let (bus, wanted): (u8, String) = (parse(words, 0, "bus")?, parse(words, 1, "bitrate")?);
        let report = self.client.bus_status(bus).map_err(|e| e.to_string())?;
        let is = report.config.map_or("no".to_string(), |config| config.bitrate.to_string());
        if is == wanted { Ok(()) } else { Err(format!("bus {bus}: {report:?}")) }
    }

    /// `motor-timeout AXIS unknown|off|verified|MS`
    fn expect_motor_timeout(&mut self, words: &[&str]) -> Result<(), String> {
        let axis = parse(words, 0, "axis")?;
        let wanted = match words.get(1) {
            Some(&"unknown") => MotorTimeout::Unknown,
            Some(&"off") => MotorTimeout::Off,
            Some(&"verified") => MotorTimeout::Verified,
            _ => MotorTimeout::Written { timeout_ms: parse(words, 1, "timeout")? },
        };
        let known = self.state(axis)?.motor_timeout;
        if known == wanted { Ok(()) } else { Err(format!("axis {axis} has {known:?}")) }
    }

    /// `trip AXIS REASON[|REASON]`: the reason as it is printed for programmers begins so.
    fn expect_trip(&mut self, words: &[&str]) -> Result<(), String> {
        let axis = parse(words, 0, "axis")?;
        let wanted = words.get(1..).unwrap_or_default().join(" ");
        if wanted.is_empty() {
            return Err("for which reason?".to_string());
        }
        let trip = self.state(axis)?.trip;
        match trip {
            Some(Trip { reason, .. })
                if wanted.split('|').any(|one| format!("{reason:?}").starts_with(one)) =>
            {
                Ok(())
            }
            other => Err(format!("axis {axis} has {other:?}")),
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

    /// `position MOTOR RAD within RAD`: by the shaft itself.
    fn expect_position(&mut self, words: &[&str]) -> Result<(), String> {
        let index: usize = parse(words, 0, "motor")?;
        let (wanted, within): (f64, f64) =
            (parse(words, 1, "position")?, parse(words, 3, "tolerance")?);
        let position = self.world.borrow().motor(index).position_rad();
        if (position - wanted).abs() <= within {
            return Ok(());
        }
        Err(format!("motor {index} is at {position} rad"))
    }

    /// `native-reply DATA|none`: what the motor answered to the last native command begins so.
    fn expect_native_reply(&mut self, words: &[&str]) -> Result<(), String> {
        let wanted: String = parse(words, 0, "data")?;
        let reply: String = self.native_reply.iter().map(|byte| format!("{byte:02X}")).collect();
        let fits = if wanted == "none" { reply.is_empty() } else { reply.starts_with(&wanted) };
        if fits { Ok(()) } else { Err(format!("the reply was `{reply}`")) }
    }

    /// `cycled AXIS RESULT`: what became of its setpoint in the last cycle.
    fn expect_cycled(&mut self, words: &[&str]) -> Result<(), String> {
        let axis: u8 = parse(words, 0, "axis")?;
        let wanted = words.get(1..).unwrap_or_default().join(" ");
        match self.cycled.iter().find(|state| state.axis == axis) {
            Some(state) if state.result.to_string() == wanted => Ok(()),
            other => Err(format!("it was {other:?}")),
        }
    }

    /// `move-target RAD`: what the last relative move was answered with.
    fn expect_move_target(&mut self, words: &[&str]) -> Result<(), String> {
        /// Half a step of the finest position that a motor here reports, 0.01°.
        const STEP_RAD: f32 = 1e-4;
        let wanted: f32 = parse(words, 0, "target")?;
        match self.move_target_rad {
            Some(target) if (target - wanted).abs() <= STEP_RAD => Ok(()),
            other => Err(format!("the target is {other:?}")),
        }
    }

    /// `samples AXIS MIN MAX`: how many were taken since the mark.
    fn expect_samples(&mut self, words: &[&str]) -> Result<(), String> {
        let wanted: u8 = parse(words, 0, "axis")?;
        let (min, max): (usize, usize) = (parse(words, 1, "count")?, parse(words, 2, "count")?);
        let of_axis = |told: &&Told| {
            told.time_us >= self.mark_us
                && matches!(told.event, Event::Sample { axis, .. } if axis == wanted)
        };
        let count = self.samples.iter().filter(of_axis).count();
        if (min..=max).contains(&count) { Ok(()) } else { Err(format!("{count} samples")) }
    }

    /// `sample AXIS FIELDS`: the last sample of the axis has exactly these fields, none older than
    /// 1 s.
    fn expect_sample(&mut self, words: &[&str]) -> Result<(), String> {
        const OLDEST_US: u32 = 1_000_000;
        let wanted: u8 = parse(words, 0, "axis")?;
        let wanted_fields = fields(words.get(1).copied().unwrap_or_default())?;
        let is_wanted =
            |event: &&Event| matches!(event, Event::Sample { axis, .. } if *axis == wanted);
        let found = self.samples.iter().rev().map(|told| &told.event).find(is_wanted);
        let sample = found.ok_or_else(|| format!("no sample of axis {wanted}"))?;
        let ages: Vec<_> =
            StateField::ALL.iter().map(|field| (*field, sample.age_us(*field))).collect();
        let fresh = |age: Option<u32>| age.is_some_and(|age| age <= OLDEST_US);
        let fits = ages.iter().all(|(field, age)| {
            if wanted_fields.contains(*field) { fresh(*age) } else { age.is_none() }
        });
        if fits { Ok(()) } else { Err(format!("the last sample has {ages:?}")) }
    }

    /// `sample-ages AXIS FIELD MIN MAX`: how old the field is in the oldest sample since the mark.
    fn expect_sample_ages(&mut self, words: &[&str]) -> Result<(), String> {
        let wanted: u8 = parse(words, 0, "axis")?;
        let wanted_fields = fields(words.get(1).copied().unwrap_or_default())?;
        let field = StateField::ALL.iter().find(|field| wanted_fields.contains(**field));
        let field = *field.ok_or("of which field?")?;
        let (min, max) = (duration(words, 2)?, duration(words, 4)?);
        let ages = self.samples.iter().filter_map(|told| match told.event {
            Event::Sample { axis, .. } if axis == wanted && told.time_us >= self.mark_us => {
                Some((told.event.age_us(field)?, told.time_us))
            }
            _ => None,
        });
        match ages.max() {
            Some((oldest, _)) if (min..=max).contains(&Duration::from_micros(oldest.into())) => {
                Ok(())
            }
            Some((oldest, told_us)) => {
                self.focus_us = Some(told_us);
                Err(format!("the oldest is {oldest} µs, told at {told_us} µs"))
            }
            None => Err(format!("no sample of axis {wanted} tells it")),
        }
    }

    /// `event NAME [FIELDS AS PRINTED]`: at any time so far, on the host's link.
    fn expect_event(&mut self, words: &[&str]) -> Result<(), String> {
        let wanted = words.join(" ");
        let seen = self.events.iter().any(|told| self.is_told(told, &wanted));
        if seen { Ok(()) } else { Err(format!("no event {wanted}")) }
    }

    /// `no-event NAME [FIELDS AS PRINTED]`: not since the mark, on the host's link.
    fn expect_no_event(&mut self, words: &[&str]) -> Result<(), String> {
        let unwanted = words.join(" ");
        let since = |told: &&Told| told.time_us >= self.mark_us && self.is_told(told, &unwanted);
        match self.events.iter().find(since) {
            Some(told) => Err(format!("at {} µs: {:?}", told.time_us, told.event)),
            None => Ok(()),
        }
    }

    fn is_told(&self, told: &Told, wanted: &str) -> bool {
        told.link == self.link && format!("{:?}", told.event).starts_with(wanted)
    }

    /// `refusal TEXT`: the last refusal, as it is printed for programmers, contains this.
    fn expect_refusal(&mut self, words: &[&str]) -> Result<(), String> {
        let wanted = words.join(" ");
        let seen = self.refusal.map(|error| format!("{error:?}")).unwrap_or_default();
        if seen.contains(&wanted) { Ok(()) } else { Err(format!("the last refusal was {seen}")) }
    }

    /// `turned MOTOR MIN MAX`: how far the shaft has turned since the mark, rad, in either
    /// direction.
    fn expect_turned(&mut self, words: &[&str]) -> Result<(), String> {
        let index: usize = parse(words, 0, "motor")?;
        let (min, max): (f64, f64) =
            (parse(words, 1, "least angle")?, parse(words, 2, "greatest angle")?);
        let before = self.mark_rad.get(index).copied().unwrap_or_default();
        let turned = (self.world.borrow().motor(index).position_rad() - before).abs();
        if (min..=max).contains(&turned) {
            return Ok(());
        }
        Err(format!("motor {index} has turned by {turned} rad since the mark"))
    }

    /// `bus BUS COUNTER MIN`
    fn expect_bus(&mut self, words: &[&str]) -> Result<(), String> {
        let bus = parse(words, 0, "bus")?;
        let report = self.client.bus_status(bus).map_err(|e| e.to_string())?;
        let counters = report.counters;
        let count = match words.get(1) {
            Some(&"transmitted") => counters.transmitted,
            Some(&"received") => counters.received,
            Some(&"unmatched") => counters.unmatched,
            Some(&"late") => counters.late,
            Some(&"rejected") => counters.rejected,
            Some(&"missed-acknowledgements") => counters.missed_acknowledgements,
            Some(&"cancelled") => counters.cancelled,
            Some(&"bus-offs") => counters.bus_offs,
            other => return Err(format!("{other:?} is no counter")),
        };
        let min: u32 = parse(words, 2, "count")?;
        if count >= min { Ok(()) } else { Err(format!("{count}, not at least {min}")) }
    }
}
