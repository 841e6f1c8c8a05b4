//! Motors that answer as their manuals say, unless they are told otherwise.

use crate::action::Does;
use crate::plant::Wired;
use host_protocol::{Protocol, StopAction};

/// How fast a shaft follows, per second.
const FOLLOWS: f64 = 200.0;
/// An RMD that restarts is silent for so long.
const RESTART_US: u64 = 700_000;

/// One motor.
#[derive(Debug, Clone)]
pub struct Motor {
    wired: Wired,
    /// Degrees a second.
    wanted: f64,
    speed: f64,
    /// Degrees.
    angle: f64,
    seen_us: u64,
    /// When it was switched on, or has restarted.
    started_us: u64,
    faults: u16,
    brake_released: bool,
    /// D5: speed that waits for an execute command.
    prepared: Option<f64>,
    mute_until: u64,
    deaf_until: u64,
    disobeys_until: u64,
    late_us: u64,
    twice: bool,
    lie: Option<Vec<u8>>,
    refuses: bool,
}

/// An answer: its data and when it is ready, µs after the request.
pub struct Answer {
    pub data: Vec<u8>,
    pub after_us: u64,
    pub motion_mode: bool,
}

impl Motor {
    pub fn new(wired: Wired) -> Self {
        Self {
            wired,
            wanted: 0.0,
            speed: 0.0,
            angle: 0.0,
            seen_us: 0,
            started_us: 0,
            faults: 0,
            brake_released: wired.stop != StopAction::Brake,
            prepared: None,
            mute_until: 0,
            deaf_until: 0,
            disobeys_until: 0,
            late_us: 0,
            twice: false,
            lie: None,
            refuses: false,
        }
    }

    pub fn does(&mut self, now: u64, does: &Does) {
        self.turn(now);
        match does {
            Does::Mute { for_us } => self.mute_until = now + for_us,
            Does::Deaf { for_us } => self.deaf_until = now + for_us,
            Does::Late { by_us } => self.late_us = *by_us,
            Does::Twice => self.twice = true,
            Does::Lies { data } => self.lie = Some(data.clone()),
            Does::Refuses => self.refuses = true,
            Does::Faults { word } => self.faults = *word,
            Does::Restarts => {
                *self = Self { seen_us: now, started_us: now, angle: self.angle, ..Self::new(self.wired) }
            }
            Does::Off { for_us } => {
                let restarted = Self {
                    seen_us: now,
                    started_us: now + for_us,
                    angle: self.angle,
                    ..Self::new(self.wired)
                };
                *self = Self { mute_until: now + for_us, deaf_until: now + for_us, ..restarted };
            }
            Does::Disobeys { for_us } => self.disobeys_until = now + for_us,
            Does::Turns { speed, for_us } => {
                self.speed = (*speed).into();
                self.wanted = self.speed;
                self.disobeys_until = now + for_us;
            }
        }
    }

    fn turn(&mut self, now: u64) {
        #[allow(clippy::cast_precision_loss)] // short times
        let seconds = now.saturating_sub(self.seen_us) as f64 * 1e-6;
        self.seen_us = now;
        self.speed += (self.wanted - self.speed) * (seconds * FOLLOWS).min(1.0);
        self.angle += self.speed * seconds;
    }

    fn want(&mut self, now: u64, speed: f64) {
        if now >= self.disobeys_until {
            self.wanted = speed;
        }
    }

    /// Hears a request; what it answers.
    pub fn hear(&mut self, now: u64, data: &[u8], motion_mode: bool) -> Vec<Answer> {
        self.turn(now);
        if now < self.deaf_until {
            return Vec::new();
        }
        let refuses = std::mem::take(&mut self.refuses);
        let answer = match self.wired.protocol {
            Protocol::Rmd if motion_mode => {
                self.want(now, 60.0);
                Some(vec![self.wired.node, 0x80, 0, 0x80, 0x08, 0, 0, 0])
            }
            Protocol::Rmd => self.rmd(now, data, refuses),
            Protocol::Thruster => self.thruster(now, data, refuses),
            Protocol::D5 => self.d5(now, data, refuses),
        };
        let Some(data) = answer.filter(|_| now >= self.mute_until) else { return Vec::new() };
        let data = self.lie.take().unwrap_or(data);
        // Each motor has a rhythm of its own.
        let after_us = 120 + 17 * u64::from(self.wired.node) + std::mem::take(&mut self.late_us);
        let mut answers = vec![Answer { data: data.clone(), after_us, motion_mode }];
        if std::mem::take(&mut self.twice) {
            answers.push(Answer { data, after_us: after_us + 900, motion_mode });
        }
        answers
    }

    #[allow(clippy::cast_precision_loss)] // short times
    fn rmd(&mut self, now: u64, data: &[u8], refuses: bool) -> Option<Vec<u8>> {
        let mut reply: [u8; 8] = data.try_into().ok()?;
        match data[0] {
            // Thrown back: received, not carried out.
            0xA1..=0xA8 if refuses => return Some(reply.to_vec()),
            0xA1 => self.want(now, f64::from(i16::from_le_bytes([data[4], data[5]]))),
            0xA2 => {
                self.want(now, f64::from(i32::from_le_bytes([data[4], data[5], data[6], data[7]])) / 100.0);
            }
            0xA3..=0xA8 => self.want(now, f64::from(data[2]).max(10.0)),
            0x80 | 0x81 if refuses => return None,
            0x80 | 0x81 => self.want(now, 0.0),
            0x77 => self.brake_released = true,
            0x78 if now < self.disobeys_until => {}
            0x78 => {
                self.brake_released = false;
                self.speed = 0.0;
                self.wanted = 0.0;
            }
            0x92 => reply[4..].copy_from_slice(&int32(self.angle * 100.0)),
            0x9A => {
                let [low, high] = self.faults.to_le_bytes();
                reply = [0x9A, 30, 0, u8::from(self.brake_released), 0xE5, 1, low, high];
            }
            // §2.25: no answer, silence, and output off and brake locked as when it is switched on.
            0x76 => {
                let restarted = Self { seen_us: now, angle: self.angle, ..Self::new(self.wired) };
                let back_us = now + RESTART_US;
                *self = Self { deaf_until: back_us, started_us: back_us, ..restarted };
                return None;
            }
            0xB1 => reply[4..].copy_from_slice(&int32(now.saturating_sub(self.started_us) as f64 / 1e3)),
            _ => {}
        }
        if matches!(data[0], 0x9C | 0xA1..=0xA8) {
            let [low, high] = int16(self.speed);
            reply = [data[0], 30, 10, 0, low, high, 1, 0];
        }
        Some(reply.to_vec())
    }

    fn thruster(&mut self, now: u64, data: &[u8], refuses: bool) -> Option<Vec<u8>> {
        let mut reply = data.to_vec();
        reply.resize(8, 0);
        let value = i16::from_be_bytes([reply[6], reply[7]]);
        let mut word = None;
        match data.get(..2)? {
            b"TC" | b"VC" | b"LA" | b"LR" if refuses || self.faults & 0x0442 != 0 && value != 0 => {
                reply[4..].copy_from_slice(&[0, 0, 0xEE, 0xEE]);
            }
            b"TC" => self.want(now, f64::from(value) * 10.0),
            b"VC" => self.want(now, f64::from(value) * 6.0),
            b"LA" | b"LR" => self.want(now, 30.0),
            b"LS" => self.want(now, 0.0),
            // 1 rpm is 6° a second
            b"QV" => word = Some(int16(self.speed / 6.0)),
            b"EF" => word = Some(self.faults.to_le_bytes()),
            b"CF" => self.faults = 0,
            _ => {}
        }
        if let Some([low, high]) = word {
            reply[4..].copy_from_slice(&[0, 0, high, low]);
        }
        Some(reply)
    }

    fn d5(&mut self, now: u64, data: &[u8], refuses: bool) -> Option<Vec<u8>> {
        let mut reply: [u8; 8] = data.try_into().ok()?;
        let [_, _, _, command, address, low, high, _] = reply;
        let value = u16::from_le_bytes([low, high]);
        let speed = f64::from(value & 0x7FFF) * if value & 0x8000 == 0 { 1.0 } else { -1.0 };
        match (command, address) {
            (3 | 4, 0x20) if refuses => return None,
            (3, 0x20) => self.want(now, speed),
            (4, 0x20) => self.prepared = Some(speed),
            (5, _) => {
                if let Some(speed) = self.prepared.take() {
                    self.want(now, speed);
                }
            }
            (3, 0x19) => self.faults = 0,
            (2, _) => {
                let told = match address {
                    0x10 => 2,
                    0x11 => 1,
                    0x12 => self.faults & 0xFF,
                    0x20 => sign_magnitude(self.wanted),
                    0x26 => sign_magnitude(self.speed),
                    0x2C => u16::from(self.prepared.is_some()),
                    _ => 0,
                };
                [reply[5], reply[6]] = told.to_le_bytes();
            }
            _ => {}
        }
        reply[0] = 0x5D;
        reply[7] = reply[1..7].iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
        Some(reply.to_vec())
    }
}

#[allow(clippy::cast_possible_truncation)] // saturates
fn int16(value: f64) -> [u8; 2] {
    (value.round() as i16).to_le_bytes()
}

#[allow(clippy::cast_possible_truncation)] // saturates
fn int32(value: f64) -> [u8; 4] {
    (value.round() as i32).to_le_bytes()
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
fn sign_magnitude(speed: f64) -> u16 {
    let magnitude = (speed.abs().round() as u16).min(0x7FFF);
    if speed < 0.0 && magnitude != 0 { magnitude | 0x8000 } else { magnitude }
}
