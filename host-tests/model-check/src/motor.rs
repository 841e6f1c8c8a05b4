//! Motors that answer as their manuals say, unless they are told otherwise.

use crate::action::Does;
use crate::plant::Wired;
use host_protocol::{Protocol, StopAction};
use promise_model::Place;

/// How fast a shaft follows, per second.
const FOLLOWS: f64 = 200.0;
/// An RMD that restarts is silent for so long.
const RESTART_US: u64 = 700_000;

/// One motor.
#[derive(Debug, Clone)]
pub struct Motor {
    wired: Wired,
    /// D5: the id that it was asked with last, which its own frames have.
    pub own_id: u32,
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
    /// D5: it answers requests to others.
    answers_others: bool,
    /// Thruster: bytes 6 and 7 of its VM.
    returns: u16,
    /// RMD: the number of its dialect.
    dialect: u8,
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
            own_id: wired.node.into(),
            wanted: 0.0,
            speed: 0.0,
            angle: 0.0,
            seen_us: 0,
            started_us: 0,
            faults: 0,
            brake_released: wired.stop != StopAction::Brake,
            prepared: None,
            answers_others: false,
            returns: 0,
            dialect: 1,
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
                *self = Self { seen_us: now, started_us: now, ..self.without_power() }
            }
            Does::Off { for_us } => {
                let back_us = now + for_us;
                let restarted = Self { seen_us: now, started_us: back_us, ..self.without_power() };
                *self = Self { mute_until: back_us, deaf_until: back_us, ..restarted };
            }
            Does::Disobeys { for_us } => self.disobeys_until = now + for_us,
            Does::AnswersOthers { on } => self.answers_others = *on,
            Does::Waits { speed } => self.prepared = Some((*speed).into()),
            Does::Returns { mode } => self.returns = *mode,
            Does::Speaks { dialect } => self.dialect = *dialect,
            Does::Turns { speed, for_us } => {
                self.speed = (*speed).into();
                self.wanted = self.speed;
                self.disobeys_until = now + for_us;
            }
        }
    }

    /// Whether it is at this place and acknowledges in time what it is told there.
    pub fn acknowledges(&self, place: &Place) -> bool {
        const SILENT: u16 = 0x100;
        // Its rhythm and two frames of a bus for D5.
        const IN_TIME_US: u64 = 2_000;
        let Wired { bus, protocol, node, .. } = self.wired;
        let answers = match protocol {
            Protocol::Rmd => true,
            Protocol::Thruster => {
                self.returns & SILENT == 0 && u32::from(self.returns) == place.return_mode
            }
            Protocol::D5 => matches!(place.d5_ids, [None, None]),
        };
        place.wiring == [bus, protocol.number(), node].map(Some)
            && place.window_us >= IN_TIME_US
            && answers
    }

    /// It answers what is for it and obeys from now on, and has no fault.
    pub fn mend(&mut self, now: u64) {
        self.turn(now);
        *self = Self {
            wanted: self.wanted,
            speed: self.speed,
            angle: self.angle,
            seen_us: now,
            started_us: self.started_us.min(now),
            brake_released: self.brake_released,
            prepared: self.prepared,
            own_id: self.own_id,
            returns: self.returns,
            dialect: self.dialect,
            ..Self::new(self.wired)
        };
    }

    /// What it is when it is switched on again. Whether VM is kept the manual does not say: here it
    /// is.
    fn without_power(&self) -> Self {
        let Self { angle, answers_others, returns, dialect, .. } = *self;
        Self { angle, answers_others, returns, dialect, ..Self::new(self.wired) }
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
        let mut told: Vec<Vec<u8>> = match self.wired.protocol {
            Protocol::Rmd if motion_mode => {
                self.want(now, 60.0);
                vec![vec![self.wired.node, 0x80, 0, 0x80, 0x08, 0, 0, 0]]
            }
            Protocol::Rmd => self.rmd(now, data, refuses).into_iter().collect(),
            Protocol::Thruster => self
                .thruster(now, data, refuses)
                .map(|echo| self.returned(echo))
                .unwrap_or_default(),
            Protocol::D5 => self.d5(now, data, refuses).into_iter().collect(),
        };
        if now < self.mute_until || told.is_empty() {
            return Vec::new();
        }
        if let Some(lie) = self.lie.take() {
            told[0] = lie;
        }
        let after_us = self.rhythm_us() + std::mem::take(&mut self.late_us);
        let again = std::mem::take(&mut self.twice).then(|| told[0].clone());
        let answer = |after_us| move |data| Answer { data, after_us, motion_mode };
        told.into_iter().map(answer(after_us)).chain(again.map(answer(after_us + 900))).collect()
    }

    /// Hears a request to another D5 motor; what it answers: that it was not for it (D5 manual,
    /// table row 5).
    pub fn objects(&self, now: u64, data: &[u8]) -> Option<Answer> {
        let [0xD5, _, _, command, _, _, _, _] = *data else { return None };
        let hears = self.answers_others && now >= self.deaf_until && now >= self.mute_until;
        let mut data = vec![0x5D, self.wired.node, 5, command, 1, 0xEE, 0xEE];
        data.push(data[1..].iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)));
        hears.then(|| Answer { data, after_us: self.rhythm_us(), motion_mode: false })
    }

    /// Each motor has a rhythm of its own.
    fn rhythm_us(&self) -> u64 {
        120 + 17 * u64::from(self.wired.node)
    }

    /// What a thruster answers in the place of an echo, as its VM is set (Thruster manual §2.4):
    /// frames of three words with a header, one of four words without, or nothing. It refuses
    /// as ever.
    fn returned(&self, echo: Vec<u8>) -> Vec<Vec<u8>> {
        let [flags, frames] = self.returns.to_be_bytes();
        let is_signal = matches!(echo.get(..2), Some(b"TC" | b"VC"));
        if !is_signal || echo.ends_with(&[0, 0, 0xEE, 0xEE]) || flags & 3 == 0 && frames & 7 == 0 {
            return vec![echo];
        }
        let speed = i16::from_le_bytes(int16(self.speed / 6.0));
        let status = self.faults.cast_signed();
        let words = |header: [u8; 2], words: [i16; 3]| {
            header.into_iter().chain(words.into_iter().flat_map(i16::to_be_bytes)).collect()
        };
        match flags {
            _ if flags & 1 != 0 => Vec::new(),
            _ if flags & 2 != 0 => vec![words(speed.to_be_bytes(), [480, 10, status])],
            _ => [[speed, 480, 10], [status, 30, 31], [0, 0, 0]]
                .into_iter()
                .zip(1..=3)
                .filter(|(_, number)| frames >> (number - 1) & 1 != 0)
                .map(|(told, number)| words([echo[0], number], told))
                .collect(),
        }
    }

    #[allow(clippy::cast_precision_loss)] // short times
    fn rmd(&mut self, now: u64, data: &[u8], refuses: bool) -> Option<Vec<u8>> {
        let mut reply: [u8; 8] = data.try_into().ok()?;
        match data[0] {
            // Thrown back: received, not carried out.
            0xA1..=0xA8 if refuses => return Some(reply.to_vec()),
            0xA1 => self.want(now, f64::from(i16::from_le_bytes([data[4], data[5]]))),
            0xA2 => {
                self.want(
                    now,
                    f64::from(i32::from_le_bytes([data[4], data[5], data[6], data[7]])) / 100.0,
                );
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
            // By index from V4.2, V3.9 and V4.4 on; before the index is passed over.
            0x30 if self.dialect >= 4 => reply[4..].copy_from_slice(&[0, 0, 0, 0x3F]),
            0x30 => reply = [0x30, 0, 0x55, 0x19, 0x55, 0x19, 0x55, 0x19],
            0x42 if self.dialect >= 3 => reply[4..].copy_from_slice(&[0x10, 0x27, 0, 0]),
            0x42 => reply = [0x42, 0, 0, 0, 0x10, 0x27, 0, 0],
            0xB5 if self.dialect == 6 => reply[3..].copy_from_slice(b"RMD-X"),
            0xB5 => reply[1..].copy_from_slice(b"X8S2V10"),
            0x9A => {
                let [low, high] = self.faults.to_le_bytes();
                reply = [0x9A, 30, 0, u8::from(self.brake_released), 0xE5, 1, low, high];
            }
            // §2.25: no answer, silence, and output off and brake locked as when it is switched on.
            0x76 => {
                let back_us = now + RESTART_US;
                *self = Self {
                    seen_us: now,
                    deaf_until: back_us,
                    started_us: back_us,
                    ..self.without_power()
                };
                return None;
            }
            0xB1 => {
                reply[4..].copy_from_slice(&int32(now.saturating_sub(self.started_us) as f64 / 1e3))
            }
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
            b"VM" => self.returns = u16::from_be_bytes([reply[6], reply[7]]),
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
