//! What must be true after a command.

use std::time::Duration;

use host_protocol::Incident;
use mgw_client::Client;
use mgw_sim::{MotorEvent, SimTransport};

use super::line::Mark;
use super::{Bench, CLEAN_LINK};
use crate::scenario::images::runs;
use crate::scenario::words::{duration, parse};

/// A shaft slower than this is at rest, rad/s.
const AT_REST_RAD_S: f64 = 0.05;

impl Bench {
    pub fn expect(&mut self, words: &[&str]) -> Result<(), String> {
        let what = words.first().copied().unwrap_or_default();
        match what {
            "exit" => {
                let code: u8 = parse(words, 1, "exit code")?;
                hold(self.outcome()?.0.exit_code == code, || format!("{:?}", self.outcome))
            }
            "failure" => {
                let failure = self.outcome()?.0.failure.as_ref();
                hold(
                    failure.is_some_and(|(name, _)| Some(name.as_str()) == words.get(1).copied()),
                    || format!("{failure:?}"),
                )
            }
            "says" => {
                let text = words.get(1..).unwrap_or_default().join(" ");
                let failure = self.outcome()?.0.failure.as_ref();
                hold(failure.is_some_and(|(_, said)| said.contains(&text)), || {
                    format!("{failure:?}")
                })
            }
            "baud" => {
                let baud = self.line.borrow().baud();
                hold(baud == parse::<u32>(words, 1, "rate")?, || {
                    format!("the gateway is at {baud} baud")
                })
            }
            "runs" => {
                let clean = SimTransport::new(self.world.clone(), CLEAN_LINK);
                let mut client = Client::connect(clean).map_err(|error| error.to_string())?;
                let seen = runs(&mut client)?;
                hold(words.get(1..) == Some(&seen.split(' ').collect::<Vec<_>>()), || {
                    format!("{seen} runs")
                })
            }
            "took" => {
                let (took, most) = (self.outcome()?.1, duration(words, 1)?);
                hold(took <= most, || format!("it took {took:?}"))
            }
            "first" => {
                let line = self.line.borrow();
                let first = line.written.first().map(|written| written.name);
                hold(first == words.get(1).copied(), || format!("the first frame is {first:?}"))
            }
            "next" => self.expect_next(words),
            "no" => self.expect_none(words),
            "at-least" | "at-most" => {
                let count: usize = parse(words, 1, "number")?;
                let name: String = parse(words, 2, "frame")?;
                let line = self.line.borrow();
                let seen = line.written.iter().filter(|written| written.name == name).count();
                let holds = if what == "at-least" { seen >= count } else { seen <= count };
                hold(holds, || format!("{seen} times"))
            }
            "gap" => {
                let name: String = parse(words, 1, "frame")?;
                let most = duration(words, 2)?;
                let line = self.line.borrow();
                let times: Vec<Duration> = line
                    .written
                    .iter()
                    .filter(|written| written.name == name)
                    .map(|w| w.at)
                    .collect();
                let gap =
                    times.windows(2).filter_map(|pair| Some(*pair.get(1)? - *pair.first()?)).max();
                hold(gap.is_some_and(|gap| gap <= most), || format!("the greatest gap is {gap:?}"))
            }
            "rest" => self.expect_rest(words),
            "moved" => self.expect_motion(words, true),
            "unmoved" => self.expect_motion(words, false),
            "tripped" | "untripped" => self.expect_trip(words, what == "tripped"),
            "wire-order" => self.expect_order(words),
            "no-wire" => {
                let (bus, unwanted): (u8, String) =
                    (parse(words, 1, "bus")?, parse(words, 2, "frame")?);
                let seen = self.seen(bus).into_iter().find(|text| text.starts_with(&unwanted));
                hold(seen.is_none(), || format!("{seen:?}"))
            }
            "state" => {
                let axis = parse(words, 1, "axis")?;
                let state =
                    self.observer()?.read_state_when_free(axis).map_err(|e| e.to_string())?.state;
                let name = format!("{state:?}");
                hold(words.get(2).is_some_and(|wanted| name.starts_with(wanted)), || name)
            }
            other => Err(format!("{other:?} is nothing to expect")),
        }
    }

    fn outcome(&self) -> Result<&(mgw_cli::Outcome, Duration), String> {
        self.outcome.as_ref().ok_or_else(|| "no command has run".to_owned())
    }

    /// The last action of this name in the last command.
    fn mark(&self, name: Option<&&str>) -> Result<Mark, String> {
        let name = name.ok_or("after what?")?;
        let mark = self.line.borrow().marks.iter().rfind(|mark| mark.name == *name).cloned();
        mark.ok_or_else(|| format!("there was no {name}"))
    }

    /// `next FRAME within TIME after ACTION`
    fn expect_next(&self, words: &[&str]) -> Result<(), String> {
        let (name, most) = (words.get(1).copied(), duration(words, 3)?);
        let mark = self.mark(words.get(6))?;
        let next = self.line.borrow().written.get(mark.written).cloned();
        hold(
            next.as_ref().is_some_and(|next| Some(next.name) == name && next.at - mark.at <= most),
            || format!("next after {:?} is {next:?}", mark.at),
        )
    }

    /// `no FRAME [after ACTION]`
    fn expect_none(&self, words: &[&str]) -> Result<(), String> {
        let name = words.get(1).copied().unwrap_or_default();
        let from = match words.get(2) {
            Some(_) => self.mark(words.get(3))?.written,
            None => 0,
        };
        let line = self.line.borrow();
        let count = line.written.iter().skip(from).filter(|written| written.name == name).count();
        hold(count == 0, || format!("{count} times"))
    }

    /// `rest MOTOR [within TIME after ACTION]`
    fn expect_rest(&self, words: &[&str]) -> Result<(), String> {
        let motor: usize = parse(words, 1, "motor")?;
        let latest = match words.get(2) {
            Some(_) => {
                Some(self.line.borrow().began() + self.mark(words.get(6))?.at + duration(words, 3)?)
            }
            None => None,
        };
        if let Some(latest) = latest {
            // The command may have ended before.
            self.line.borrow_mut().advance(latest, false);
        }
        let world = self.world.borrow();
        let motor = world.motor(motor);
        let speed = motor.speed_rad_s();
        hold(speed.abs() < AT_REST_RAD_S, || format!("{speed} rad/s"))?;
        let Some(latest) = latest else { return Ok(()) };
        let stopped =
            motor.log().entries().rfind(|entry| matches!(entry.what, MotorEvent::Stopped { .. }));
        let at = stopped.map(|entry| Duration::from_micros(entry.time_us));
        hold(at.is_some_and(|at| at <= latest), || {
            format!("it came to rest at {at:?}, not by {latest:?}")
        })
    }

    /// The frames of a bus while the last command ran.
    fn seen(&self, bus: u8) -> Vec<String> {
        self.trace
            .iter()
            .filter(|entry| entry.bus == bus)
            .map(|entry| entry.wire.to_string())
            .collect()
    }

    /// `wire-order BUS FRAME FRAME …`: each of them at some time after the one before.
    fn expect_order(&self, words: &[&str]) -> Result<(), String> {
        let mut rest = self.seen(parse(words, 1, "bus")?).into_iter();
        for frame in words.get(2..).unwrap_or_default() {
            hold(rest.any(|text| text.starts_with(frame)), || {
                format!("{frame} was not seen in its place")
            })?;
        }
        Ok(())
    }

    /// `moved MOTOR`, `unmoved MOTOR`: in the last command.
    fn expect_motion(&self, words: &[&str], wanted: bool) -> Result<(), String> {
        let motor: usize = parse(words, 1, "motor")?;
        let began = self.line.borrow().began();
        let world = self.world.borrow();
        let moved = world.motor(motor).log().entries().any(|entry| {
            matches!(entry.what, MotorEvent::Moving { .. })
                && Duration::from_micros(entry.time_us) >= began
        });
        hold(moved == wanted, || format!("moved: {moved}"))
    }

    /// `tripped AXIS [REASON]`, `untripped AXIS`
    fn expect_trip(&self, words: &[&str], wanted: bool) -> Result<(), String> {
        let of: u8 = parse(words, 1, "axis")?;
        let incidents = self.observer()?.incidents().map_err(|e| e.to_string())?;
        let reasons: Vec<String> = incidents
            .iter()
            .filter_map(|incident| match incident {
                Incident::Tripped { axis, trip, .. } if *axis == of => {
                    Some(format!("{:?}", trip.reason))
                }
                _ => None,
            })
            .collect();
        let named =
            words.get(2).is_none_or(|reason| reasons.iter().any(|seen| seen.starts_with(reason)));
        hold(reasons.is_empty() != wanted && (named || !wanted), || format!("{reasons:?}"))
    }
}

fn hold(holds: bool, seen: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(seen()) }
}
