//! What a motor itself saw and did: the proof of a stop that does not pass through the gateway.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

/// Entries kept; the oldest go first.
const KEPT: usize = 10_000;

/// Something that happened in a motor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub enum MotorEvent {
    /// A command other than a read arrived. Repeats of the same command are not logged.
    CommandReceived {
        /// The manual's code and a word or two.
        name: &'static str,
    },
    /// A command arrived and was not carried out. Repeats are not logged.
    CommandIgnored {
        /// The manual's code and a word or two.
        name: &'static str,
        /// Why not.
        because: &'static str,
    },
    /// The shaft began to turn.
    Moving {
        /// Speed, rad/s.
        speed_rad_s: f64,
    },
    /// The shaft came to rest.
    Stopped {
        /// Speed, rad/s: 0 or nearly so.
        speed_rad_s: f64,
    },
    /// The motor's own communication timeout struck.
    Timeout {
        /// The timeout, ms.
        after_ms: u32,
    },
    /// Its fault word changed.
    Faults {
        /// The new word, bits as its manual numbers them; 0 = none.
        word: u16,
    },
    /// Its firmware was told to start anew.
    Restarted,
    /// Its brake was locked.
    BrakeLocked,
    /// Its brake was released.
    BrakeReleased,
}

/// One line of a motor's log.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "snapshot", serde(bound(deserialize = "'de: 'static")))]
pub struct LogEntry {
    /// When, in µs of the simulated time.
    pub time_us: u64,
    /// What.
    pub what: MotorEvent,
}

/// The log of one motor.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct MotorLog {
    entries: VecDeque<LogEntry>,
    /// Entries that have been dropped.
    dropped: usize,
    last_command: Option<&'static str>,
    last_ignored: Option<(&'static str, &'static str)>,
}

impl MotorLog {
    /// The entries, oldest first; at most the last 10 000.
    pub fn entries(&self) -> impl DoubleEndedIterator<Item = &LogEntry> {
        self.entries.iter()
    }

    /// The entries after the first `seen` ones of the motor's life, and how many there are by now
    /// in all.
    pub fn since(&self, seen: usize) -> (impl Iterator<Item = &LogEntry>, usize) {
        let total = self.dropped + self.entries.len();
        (self.entries.iter().skip(seen.saturating_sub(self.dropped)), total)
    }

    pub(super) fn add(&mut self, now: Duration, what: MotorEvent) {
        self.push(now, what);
        // Motion is what a command is for; anything else makes a repeated command worth a line.
        if !matches!(what, MotorEvent::Moving { .. } | MotorEvent::Stopped { .. }) {
            (self.last_command, self.last_ignored) = (None, None);
        }
    }

    pub(super) fn command(&mut self, now: Duration, name: &'static str) {
        if self.last_command != Some(name) {
            self.push(now, MotorEvent::CommandReceived { name });
            (self.last_command, self.last_ignored) = (Some(name), None);
        }
    }

    pub(super) fn ignored(&mut self, now: Duration, name: &'static str, because: &'static str) {
        if self.last_ignored != Some((name, because)) {
            self.push(now, MotorEvent::CommandIgnored { name, because });
            self.last_ignored = Some((name, because));
        }
    }

    fn push(&mut self, now: Duration, what: MotorEvent) {
        if self.entries.len() == KEPT {
            self.entries.pop_front();
            self.dropped += 1;
        }
        let time_us = u64::try_from(now.as_micros()).unwrap_or(u64::MAX);
        self.entries.push_back(LogEntry { time_us, what });
    }
}

impl fmt::Display for MotorEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MotorEvent::CommandReceived { name } => write!(f, "command {name}"),
            MotorEvent::CommandIgnored { name, because } => {
                write!(f, "command {name} ignored: {because}")
            }
            MotorEvent::Moving { speed_rad_s } => {
                write!(f, "moving  speed {:.2} rad/s", shown(*speed_rad_s))
            }
            MotorEvent::Stopped { speed_rad_s } => {
                write!(f, "stopped  speed {:.2} rad/s", shown(*speed_rad_s))
            }
            MotorEvent::Timeout { after_ms } => {
                write!(f, "own timeout after {after_ms} ms without a command")
            }
            MotorEvent::Faults { word: 0 } => write!(f, "no fault any more"),
            MotorEvent::Faults { word } => write!(f, "fault {word:#06x}"),
            MotorEvent::Restarted => write!(f, "restarts"),
            MotorEvent::BrakeLocked => write!(f, "brake locked"),
            MotorEvent::BrakeReleased => write!(f, "brake released"),
        }
    }
}

/// To two digits, and never −0.
fn shown(speed: f64) -> f64 {
    (speed * 100.0).round() / 100.0 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_command_is_one_line_until_something_happens() {
        let mut log = MotorLog::default();
        for ms in 0..10 {
            log.command(Duration::from_millis(ms), "A2 speed");
        }
        log.add(Duration::from_millis(10), MotorEvent::Moving { speed_rad_s: 1.0 });
        log.command(Duration::from_millis(11), "A2 speed");
        log.add(Duration::from_millis(12), MotorEvent::Timeout { after_ms: 100 });
        log.command(Duration::from_millis(13), "A2 speed");
        let times: Vec<_> = log.entries().map(|entry| entry.time_us).collect();
        assert_eq!(times, [0, 10_000, 12_000, 13_000]);
    }

    #[test]
    fn a_repeated_refusal_is_one_line_too() {
        let mut log = MotorLog::default();
        for ms in 0..10 {
            log.command(Duration::from_millis(ms), "TC 0");
            log.ignored(Duration::from_millis(ms), "TC 0", "fault");
        }
        let lines: Vec<_> = log.entries().map(|entry| entry.what.to_string()).collect();
        assert_eq!(lines, ["command TC 0", "command TC 0 ignored: fault"]);
    }

    #[test]
    fn a_speed_of_nearly_zero_has_no_sign() {
        assert_eq!(
            MotorEvent::Stopped { speed_rad_s: -0.004 }.to_string(),
            "stopped  speed 0.00 rad/s"
        );
    }

    #[test]
    fn the_oldest_entries_go_first_and_readers_keep_their_place() {
        let mut log = MotorLog::default();
        for us in 0..10_005 {
            log.add(Duration::from_micros(us), MotorEvent::BrakeLocked);
        }
        assert_eq!(log.entries().count(), 10_000);
        let (new, seen) = log.since(10_003);
        assert_eq!(new.map(|entry| entry.time_us).collect::<Vec<_>>(), [10_003, 10_004]);
        assert_eq!(seen, 10_005);
        assert_eq!(log.since(seen).0.count(), 0);
    }
}
