//! What a scenario does.

use super::bench::Bench;
use super::words::{duration, parse, setpoint};
use mgw_client::ClientError;
use mgw_sim::BusFault;
use std::time::Duration;

impl Bench {
    /// One line of a scenario.
    pub fn step(&mut self, words: &[&str]) -> Result<(), String> {
        let (verb, rest) = words.split_first().ok_or("an empty step")?;
        let result = match *verb {
            "run" => self.run(duration(rest, 0)?),
            "silence" => {
                self.silence(duration(rest, 0)?);
                Ok(())
            }
            "until" => {
                let now = self.client.now();
                self.silence(duration(rest, 0)?.saturating_sub(now));
                Ok(())
            }
            "mark" => {
                self.mark();
                Ok(())
            }
            "keep" => {
                let axis = parse(rest, 0, "axis")?;
                self.kept.retain(|(kept, _)| *kept != axis);
                self.kept.push((axis, setpoint(rest, 1)?));
                self.run(Duration::ZERO)
            }
            "drop" => {
                let axis: u8 = parse(rest, 0, "axis")?;
                self.kept.retain(|(kept, _)| *kept != axis);
                Ok(())
            }
            "await" => self.wait_for(rest),
            "repeat" => self.repeat(rest),
            "as" => self.as_other(rest),
            "unanswered" => self.unanswered(duration(rest, 0)?, rest.get(2..).unwrap_or_default()),
            "refused" => self.refused(rest),
            "expect" => self.expect(rest),
            "inject" => self.inject(rest),
            "power" => self.power(rest),
            "foreign" => self.foreign(rest),
            "babble" => self.babble(rest),
            "hush" => self.hush(rest),
            "bus-cut" => self.disturb(rest, BusFault::Cut),
            "bus-short" => self.disturb(rest, BusFault::Short),
            "bus-join" => self.disturb(rest, BusFault::None),
            "hang" => {
                self.world.borrow_mut().hang();
                Ok(())
            }
            "reset" => self.reset(rest),
            "images" => self.images(),
            "e-stop-input" => self.e_stop_input(rest),
            "bytes" => self.bytes(rest),
            "flood" => self.flood(rest),
            "backlog" => self.grow_backlog(rest),
            "release-backlog" => self.release_backlog(),
            "host-reads" => self.host_reads(rest),
            _ => self.request(words).map_err(|error| error.to_string()),
        };
        self.collect();
        result
    }

    /// `repeat N TIME STEP ; …`: the steps, then a silence, so often.
    fn repeat(&mut self, words: &[&str]) -> Result<(), String> {
        let times: usize = parse(words, 0, "count")?;
        let pause = duration(words, 1)?;
        for _ in 0..times {
            for step in words.get(3..).unwrap_or_default().split(|word| *word == ";") {
                self.step(step)?;
            }
            self.silence(pause);
        }
        Ok(())
    }

    /// `unanswered TIME STEP`: the host waits for the answer so long, in vain, and goes on.
    fn unanswered(&mut self, wait: Duration, words: &[&str]) -> Result<(), String> {
        self.patience = Some(wait);
        let result = self.request(words);
        self.patience = None;
        match result {
            Err(StepError::Client(ClientError::NoAnswer { .. })) => Ok(()),
            Err(error) => Err(error.to_string()),
            Ok(()) => Err("it was answered".to_string()),
        }
    }

    /// `refused ERROR STEP…`: the step must be answered with that error of the host protocol.
    fn refused(&mut self, words: &[&str]) -> Result<(), String> {
        let (wanted, step) = words.split_first().ok_or("refused needs the error's name")?;
        match self.request(step) {
            Err(StepError::Client(ClientError::Gateway(error))) if error.name() == *wanted => {
                self.refusal = Some(error);
                Ok(())
            }
            Err(error) => Err(format!("expected {wanted}, got {error}")),
            Ok(()) => Err(format!("expected {wanted}, but it was done")),
        }
    }
}

/// Why a step was not done.
pub enum StepError {
    /// The scenario is wrong.
    Script(String),
    /// The gateway or the way to it.
    Client(ClientError),
}

impl From<String> for StepError {
    fn from(error: String) -> Self {
        Self::Script(error)
    }
}

impl From<ClientError> for StepError {
    fn from(error: ClientError) -> Self {
        Self::Client(error)
    }
}

impl std::fmt::Display for StepError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Script(error) => error.fmt(f),
            Self::Client(ClientError::Gateway(error)) => write!(f, "{}: {error}", error.name()),
            Self::Client(error) => error.fmt(f),
        }
    }
}
