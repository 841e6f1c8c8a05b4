//! What a scenario demands of the frames on the buses since the mark.

use super::bench::Bench;
use super::words::{duration, parse};
use mgw_sim::Station;
use std::time::Duration;

/// How long a frame is awaited, and how often it is looked for.
const PATIENCE: Duration = Duration::from_secs(1);
const STEP: Duration = Duration::from_micros(50);

/// A frame seen on a bus: µs since the mark, and its text.
type Seen = (u64, String);

impl Bench {
    /// `wire|no-wire|first-wire|wire-count|wire-order|spacing BUS FRAME …`. A frame is named by the
    /// beginning of its text.
    pub fn expect_on_wire(&mut self, what: &str, words: &[&str]) -> Result<(), String> {
        let bus = parse(words, 0, "bus")?;
        let wanted: String = parse(words, 1, "frame")?;
        let rest = words.get(2..).unwrap_or_default();
        let all = self.seen(bus);
        match what {
            "wire" => self.expect_wire(&all, &wanted, rest),
            "no-wire" => self.expect_no_wire(&all, &wanted),
            "first-wire" => match all.first() {
                Some((_, text)) if text.starts_with(&wanted) => Ok(()),
                other => Err(format!("the first frame was {other:?}")),
            },
            "wire-count" => expect_count(&all, &wanted, rest),
            "wire-order" => self.expect_order(&all, words.get(1..).unwrap_or_default()),
            _ => self.expect_spacing(bus, &wanted, rest),
        }
    }

    /// `await BUS FRAME`: time passes, the host silent, until the frame has been on the bus since
    /// the mark.
    pub fn wait_for(&mut self, words: &[&str]) -> Result<(), String> {
        let bus = parse(words, 0, "bus")?;
        let wanted: String = parse(words, 1, "frame")?;
        let end = self.client.now() + PATIENCE;
        while self.client.now() < end {
            if self.seen(bus).iter().any(|(_, text)| text.starts_with(&wanted)) {
                return Ok(());
            }
            self.silence(STEP);
        }
        Err(format!("{wanted} did not come within {PATIENCE:?}"))
    }

    fn seen(&self, bus: u8) -> Vec<Seen> {
        self.seen_from(bus, None)
    }

    fn seen_from(&self, bus: u8, from: Option<Station>) -> Vec<Seen> {
        let here = self.trace.iter().filter(|entry| {
            entry.bus == bus
                && entry.time_us >= self.mark_us
                && from.is_none_or(|from| from == entry.from)
        });
        here.map(|entry| (entry.time_us - self.mark_us, entry.wire.to_string())).collect()
    }

    /// `[not-before TIME] [within TIME] [times N]`: the first N of them have begun in that time,
    /// and none earlier.
    fn expect_wire(&mut self, all: &[Seen], wanted: &str, words: &[&str]) -> Result<(), String> {
        let within = match words.iter().position(|word| *word == "within") {
            Some(at) => duration(words, at + 1)?,
            None => Duration::MAX,
        };
        let times: usize = match words.iter().position(|word| *word == "times") {
            Some(at) => parse(words, at + 1, "count")?,
            None => 1,
        };
        let limit = u64::try_from(within.as_micros()).unwrap_or(u64::MAX);
        let seen = times_of(all, wanted);
        if let Some(at) = words.iter().position(|word| *word == "not-before")
            && let Some(first) = seen.first()
            && Duration::from_micros(*first) < duration(words, at + 1)?
        {
            self.focus_us = Some(self.mark_us + first);
            return Err(format!("{wanted} was seen after {first} µs already"));
        }
        let count = seen.iter().filter(|after| **after <= limit).count();
        if count >= times {
            return Ok(());
        }
        self.focus_us = Some(self.mark_us.saturating_add(limit));
        Err(format!("{wanted} was seen {count} times in time; in all after {seen:?} µs"))
    }

    fn expect_no_wire(&mut self, all: &[Seen], unwanted: &str) -> Result<(), String> {
        match all.iter().find(|(_, text)| text.starts_with(unwanted)) {
            Some((after, text)) => {
                self.focus_us = Some(self.mark_us + after);
                Err(format!("{text} was sent after {after} µs"))
            }
            None => Ok(()),
        }
    }

    /// `FRAME FRAME …`: each of them at some time after the one before.
    fn expect_order(&mut self, all: &[Seen], wanted: &[&str]) -> Result<(), String> {
        let mut rest = all.iter();
        let mut last = 0;
        for frame in wanted {
            let Some((after, _)) = rest.find(|(_, text)| text.starts_with(frame)) else {
                self.focus_us = Some(self.mark_us + last);
                return Err(format!("{frame} was not seen after {last} µs"));
            };
            last = *after;
        }
        Ok(())
    }

    /// `MIN MAX`: the pauses from one to the next of the gateway's own frames, at least two of
    /// them, each a time such as `400 ms`.
    fn expect_spacing(&mut self, bus: u8, wanted: &str, words: &[&str]) -> Result<(), String> {
        let (min, max) = (duration(words, 0)?, duration(words, 2)?);
        let seen = times_of(&self.seen_from(bus, Some(Station::Gateway)), wanted);
        let pauses: Vec<u64> =
            seen.iter().zip(seen.iter().skip(1)).map(|(one, next)| next - one).collect();
        if pauses.len() < 2 {
            return Err(format!("{wanted} was seen {} times only", seen.len()));
        }
        let fits = |pause: &u64| (min..=max).contains(&Duration::from_micros(*pause));
        if pauses.iter().all(fits) {
            return Ok(());
        }
        let wrong = pauses.iter().position(|pause| !fits(pause));
        self.focus_us = wrong.and_then(|at| seen.get(at)).map(|after| self.mark_us + after);
        Err(format!("the pauses between {wanted} were {pauses:?} µs"))
    }
}

/// `N` or `MIN MAX`: so many since the mark.
fn expect_count(all: &[Seen], wanted: &str, words: &[&str]) -> Result<(), String> {
    let min: usize = parse(words, 0, "count")?;
    let max = if words.len() > 1 { parse(words, 1, "count")? } else { min };
    let seen = times_of(all, wanted);
    if (min..=max).contains(&seen.len()) {
        return Ok(());
    }
    Err(format!("{wanted} was seen {} times, after {seen:?} µs", seen.len()))
}

fn times_of(all: &[Seen], wanted: &str) -> Vec<u64> {
    all.iter().filter(|(_, text)| text.starts_with(wanted)).map(|(after, _)| *after).collect()
}
