//! What a scenario demands of a free-running cycle.

use super::bench::Bench;
use super::words::parse;

impl Bench {
    /// `periods MIN MAX`: so many were told of since the mark; `period AXIS RESULT`: what became of
    /// the axis in the last; `overruns bus|motor|host|gateway MIN MAX`: since the cycle began.
    pub fn expect_of_cycle(&mut self, what: &str, words: &[&str]) -> Result<(), String> {
        if what == "periods" {
            let since = self.periods.iter().filter(|(at, _)| *at >= self.mark_us).count();
            return is_within(since, words, 0);
        }
        let (_, last) = self.periods.last().ok_or("no period was told of")?;
        if what == "overruns" {
            let overruns = match words.first() {
                Some(&"bus") => last.overruns.bus,
                Some(&"motor") => last.overruns.motor,
                Some(&"host") => last.overruns.host,
                Some(&"gateway") => last.overruns.gateway,
                other => return Err(format!("{other:?} overruns no period")),
            };
            return is_within(overruns, words, 1);
        }
        let axis: u8 = parse(words, 0, "axis")?;
        let wanted = words.get(1..).unwrap_or_default().join(" ");
        match last.states().find(|state| state.axis == axis) {
            Some(state) if state.result.to_string() == wanted => Ok(()),
            other => Err(format!("it was {other:?}")),
        }
    }
}

/// Whether a count is from the word at a place to the next.
fn is_within<T>(count: T, words: &[&str], at: usize) -> Result<(), String>
where
    T: PartialOrd + std::fmt::Display + std::str::FromStr<Err: std::fmt::Display>,
{
    let (min, max): (T, T) = (parse(words, at, "count")?, parse(words, at + 1, "count")?);
    if (min..=max).contains(&count) { Ok(()) } else { Err(format!("{count}")) }
}
