//! The far end of the RS485 port: the transceiver's echo, and RMD motors.

mod sampler;

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use mgw_sim::{BusFault, Injection, Motor, MotorWiring, Outgoing, Wire, WiringError};
use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::snapshot::store;
use rigless::time::{EventId, VirtualNanos};
use serde::{Deserialize, Serialize};

pub(crate) use self::sampler::BITS_PER_BYTE;
use self::sampler::{Sampled, Sampler};
use crate::nodes::{Alarm, catch_up, since_start};
use virtual_stm32::serial_port::{FarEnd, Settings};

const PICOS_PER_NANO: u64 = 1_000;
const PICOS_PER_SECOND: u64 = 1_000_000_000_000;
/// A sender's last byte is complete for a receiver at another rate after so many bits of the
/// receiver.
const SETTLE_BITS: u64 = 2 * BITS_PER_BYTE;

/// A byte that the port has sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SentByte {
    /// When its start bit began, to the nanosecond.
    pub first_bit: Duration,
    /// When its stop bit ended.
    pub end: Duration,
    /// The byte.
    pub byte: u8,
    /// The transceiver drove the line: the port had its driver-enable output on. Otherwise nobody
    /// heard the byte, and there was no echo.
    pub driven: bool,
}

/// What the port has sent without a pause between its bytes.
pub fn messages(sent: &[SentByte]) -> impl Iterator<Item = &[SentByte]> {
    sent.chunk_by(|one, next| next.first_bit < one.end + (one.end - one.first_bit) / 2)
}

/// What a motor has sent in one go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reply {
    /// When its first start bit began.
    pub first_bit: Duration,
    /// When its last stop bit ended.
    pub end: Duration,
}

/// Where a byte on its way to the port comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Source {
    Echo,
    Motor,
    Noise,
}

/// A byte on its way to the port.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Arriving {
    source: Source,
    start_ps: u64,
    end_ps: u64,
    byte: u8,
    damaged: bool,
}

/// A motor and its receiver.
#[derive(Serialize, Deserialize)]
#[serde(bound(deserialize = "'de: 'static"))]
struct LineMotor {
    motor: Motor,
    ear: Sampler,
    /// Until then it sends and hears nothing.
    sends_until_ps: u64,
}

/// A half-duplex line: the transceiver at the port, whose receiver is always on, and motors, each
/// at its own rate.
///
/// The port hears each byte that it sends, as the emulator hands words over, one byte time later
/// than on a real line. A motor at another rate than the port's hears garbage, and is heard as
/// garbage. What overlaps is garbled, as far as the port's receiver has not taken it yet. A
/// snapshot keeps everything.
#[derive(Default, Serialize, Deserialize)]
#[serde(bound(deserialize = "'de: 'static"))]
pub struct Rs485Line {
    motors: Vec<LineMotor>,
    fault: BusFault,
    settings: Settings,
    sent: Vec<SentByte>,
    replies: Vec<Reply>,
    /// In the order of their starts.
    arriving: VecDeque<Arriving>,
    /// What the port's receiver took last.
    taken: Option<Arriving>,
    alarm: Alarm,
}

store!(Rs485Line);

impl Rs485Line {
    /// A line with nobody else on it.
    pub fn new() -> Self {
        Self::default()
    }

    /// Connects a motor at its own rate; its index here. `seed` decides its reply times and its
    /// garbage.
    /// Fails if its protocol has no such node, or the simulator has it on CAN only.
    pub fn connect(&mut self, wiring: MotorWiring, seed: u64) -> Result<usize, WiringError> {
        let motor = Motor::on_rs485(wiring, seed)?;
        let ear = Sampler::new(motor_bit_ps(&motor));
        self.motors.push(LineMotor { motor, ear, sends_until_ps: 0 });
        Ok(self.motors.len() - 1)
    }

    /// A motor: its shaft, its faults, its log.
    /// Panics if there is none with this index.
    pub fn motor(&self, index: usize) -> &Motor {
        &self.motors[index].motor
    }

    /// How many motors there are.
    pub fn motors(&self) -> usize {
        self.motors.len()
    }

    /// Puts a fault into a motor, or takes it out again.
    /// Panics if there is no such motor.
    pub fn inject(&mut self, motor: usize, injection: Injection, timeline: &mut Timeline<'_, '_>) {
        let now = since_start(timeline.now());
        self.live(timeline);
        self.motors[motor].motor.inject(now, injection);
        self.live(timeline);
    }

    /// Switches a motor off and on again: what it was about to send is lost.
    /// Panics if there is no such motor.
    pub fn power_cycle(&mut self, motor: usize, timeline: &mut Timeline<'_, '_>) {
        let now = since_start(timeline.now());
        self.live(timeline);
        let LineMotor { motor, ear, .. } = &mut self.motors[motor];
        motor.power_cycle(now);
        *ear = Sampler::new(motor_bit_ps(motor));
        self.live(timeline);
    }

    /// Breaks the line beside the transceiver, or mends it. Cut, the port hears itself only. Short,
    /// all that it sends comes back as zeros without stop bits.
    pub fn set_fault(&mut self, fault: BusFault) {
        self.fault = fault;
    }

    /// Puts noise on the line from now on, one byte after the other; with `damaged`, without stop
    /// bits. Only the port hears it.
    pub fn disturb(&mut self, bytes: &[u8], damaged: bool, timeline: &mut Timeline<'_, '_>) {
        self.disturb_at(timeline.now(), bytes, damaged, timeline);
    }

    /// [`Rs485Line::disturb`] from an instant on.
    pub fn disturb_at(
        &mut self,
        begin: VirtualNanos,
        bytes: &[u8],
        damaged: bool,
        timeline: &mut Timeline<'_, '_>,
    ) {
        let (begin_ps, length_ps) = (picos(begin), self.settings.bit_ps * BITS_PER_BYTE);
        for (start_ps, byte) in (0..).map(|nth| begin_ps + nth * length_ps).zip(bytes) {
            let end_ps = start_ps + length_ps;
            self.arrive(Arriving { source: Source::Noise, start_ps, end_ps, byte: *byte, damaged });
        }
        self.live(timeline);
    }

    /// What the port has sent since the start or the last [`Rs485Line::clear_sent`].
    pub fn sent(&self) -> &[SentByte] {
        &self.sent
    }

    /// What motors have sent since the start or the last [`Rs485Line::clear_sent`].
    pub fn replies(&self) -> &[Reply] {
        &self.replies
    }

    /// Forgets what the port and the motors have sent.
    pub fn clear_sent(&mut self) {
        self.sent.clear();
        self.replies.clear();
    }

    /// How the firmware has set the port up.
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Lets the motors live up to the present, puts what they send on the line, and waits for what
    /// comes next.
    fn live(&mut self, timeline: &mut Timeline<'_, '_>) {
        let now = since_start(timeline.now());
        for at in 0..self.motors.len() {
            let mut messages = Vec::new();
            let LineMotor { motor, .. } = &mut self.motors[at];
            catch_up(motor, now, |message| messages.push(message));
            if !motor.is_unplugged() {
                messages.into_iter().for_each(|message| self.speak(at, &message));
            }
        }
        let awaited = self
            .arriving
            .iter()
            .map(|byte| starts_at(byte.start_ps))
            .find(|at| *at > timeline.now());
        let motors = self.motors.iter().filter_map(|motor| motor.motor.next_event());
        let next = motors.chain(awaited.map(since_start)).min();
        self.alarm.set(next, timeline);
    }

    /// A motor sends: the port hears it bit by bit, and so do the other motors.
    fn speak(&mut self, from: usize, message: &Outgoing) {
        // A motor made for the line sends nothing else.
        let Wire::Serial(bytes) = &message.wire else { return };
        let bit_ps = motor_bit_ps(&self.motors[from].motor);
        let start_ps = u64::try_from(message.at.as_nanos()).unwrap_or(u64::MAX / PICOS_PER_NANO)
            * PICOS_PER_NANO;
        let starts = (0..).map(|nth| start_ps + nth * BITS_PER_BYTE * bit_ps);
        let bytes: Vec<(u64, u8)> = starts.zip(bytes.iter().copied()).collect();
        let end_ps = start_ps + bytes.len() as u64 * BITS_PER_BYTE * bit_ps;
        self.motors[from].sends_until_ps = end_ps;
        let end = Duration::from_nanos(end_ps / PICOS_PER_NANO);
        self.replies.push(Reply { first_bit: message.at, end });
        for (start_ps, byte) in &bytes {
            self.motors_hear(*start_ps, bit_ps, *byte, message.at);
        }
        if self.settings.bit_ps == 0 || self.fault != BusFault::None {
            return;
        }
        let mut port = Sampler::new(self.settings.bit_ps);
        let mut heard = Vec::new();
        for (start_ps, byte) in &bytes {
            port.hear(*start_ps, bit_ps, *byte, &mut heard);
        }
        port.rest(end_ps + SETTLE_BITS * self.settings.bit_ps, &mut heard);
        // A receiver is ready for the next byte in the middle of the stop bit: a sender that is a
        // little faster reaches into it.
        let nexts =
            heard.iter().skip(1).map(|next| next.start_ps).chain([u64::MAX]).collect::<Vec<_>>();
        for (Sampled { start_ps, byte, damaged }, next_ps) in heard.into_iter().zip(nexts) {
            let end_ps = next_ps.min(start_ps + BITS_PER_BYTE * self.settings.bit_ps);
            self.arrive(Arriving { source: Source::Motor, start_ps, end_ps, byte, damaged });
        }
    }

    /// Every motor that does not send itself sees a byte on the line.
    fn motors_hear(&mut self, start_ps: u64, bit_ps: u64, byte: u8, now: Duration) {
        for LineMotor { motor, ear, sends_until_ps } in &mut self.motors {
            if start_ps < *sends_until_ps || motor.is_unplugged() {
                continue;
            }
            let mut heard = Vec::new();
            ear.hear(start_ps, bit_ps, byte, &mut heard);
            heard.iter().for_each(|sampled| motor.hear_byte(now, sampled.byte));
        }
    }

    /// Puts a byte on its way to the port. Beside another one that has not been taken it is lost,
    /// and garbles it: a zero wins, bit by bit.
    fn arrive(&mut self, byte: Arriving) {
        if let Some(other) = self.arriving.iter_mut().find(|other| other.is_beside(&byte)) {
            other.byte &= byte.byte;
            other.damaged = true;
        } else {
            self.queue(byte);
        }
    }

    fn queue(&mut self, byte: Arriving) {
        let at = self.arriving.partition_point(|other| other.start_ps <= byte.start_ps);
        self.arriving.insert(at, byte);
    }

    /// What became of a byte that the port has sent while others were on the line; what of theirs
    /// the port has not taken yet, nobody hears separately any more. `None` if it was alone.
    fn garbled_by_others(&mut self, sent: &Arriving) -> Option<u8> {
        let taken = self.taken.filter(|taken| taken.is_beside(sent));
        let mut garbled = taken.map(|taken| sent.byte & taken.byte);
        self.arriving.retain(|other| {
            let beside = other.is_beside(sent);
            if beside {
                garbled = Some(garbled.unwrap_or(sent.byte) & other.byte);
            }
            !beside
        });
        garbled
    }
}

impl Arriving {
    /// Whether somebody else than the port sends it while `other` is on the line.
    fn is_beside(&self, other: &Self) -> bool {
        self.source != Source::Echo && self.start_ps < other.end_ps && other.start_ps < self.end_ps
    }
}

fn motor_bit_ps(motor: &Motor) -> u64 {
    PICOS_PER_SECOND / u64::from(motor.bitrate().max(1))
}

fn picos(at: VirtualNanos) -> u64 {
    at.0.saturating_mul(PICOS_PER_NANO)
}

fn starts_at(start_ps: u64) -> VirtualNanos {
    VirtualNanos(start_ps.div_ceil(PICOS_PER_NANO))
}

impl Peer for Rs485Line {
    fn receive(&mut self, word: u16, timeline: &mut Timeline<'_, '_>) {
        let [byte, _] = word.to_le_bytes();
        let now = timeline.now();
        let bit_ps = self.settings.bit_ps;
        let (start_ps, end_ps) = (picos(now).saturating_sub(BITS_PER_BYTE * bit_ps), picos(now));
        let driven = self.settings.driver_enable.is_some();
        let first_bit = since_start(VirtualNanos(start_ps / PICOS_PER_NANO));
        self.sent.push(SentByte { first_bit, end: since_start(now), byte, driven });
        self.live(timeline);
        if !driven {
            return;
        }
        let mut echo = Arriving { source: Source::Echo, start_ps, end_ps, byte, damaged: false };
        if let Some(garbled) = self.garbled_by_others(&echo) {
            (echo.byte, echo.damaged) = (garbled, true);
        }
        if self.fault == BusFault::Short {
            (echo.byte, echo.damaged) = (0, true);
        }
        if self.fault == BusFault::None {
            self.motors_hear(start_ps, bit_ps, echo.byte, since_start(now));
        }
        match &mut self.taken {
            // The receiver is in the middle of what the port has spoken into.
            Some(taken) if taken.source != Source::Echo && taken.end_ps > end_ps => {
                taken.damaged = true
            }
            // The emulator times the whole word again.
            _ => self.queue(Arriving {
                start_ps: end_ps,
                end_ps: end_ps + (end_ps - start_ps),
                ..echo
            }),
        }
        self.live(timeline);
    }

    fn on_event(&mut self, event: EventId, timeline: &mut Timeline<'_, '_>) {
        if self.alarm.take(event) {
            self.live(timeline);
        }
    }

    fn restarted(&mut self, timeline: &mut Timeline<'_, '_>) {
        self.alarm.lost();
        self.live(timeline);
    }

    fn transmit(&mut self, now: VirtualNanos) -> Option<u16> {
        self.taken = self.arriving.pop_front_if(|byte| starts_at(byte.start_ps) <= now);
        self.taken.map(|byte| u16::from(byte.byte))
    }
}

impl FarEnd for Rs485Line {
    fn port_set_up(&mut self, settings: Settings) {
        self.settings = settings;
    }

    fn damages(&mut self) -> bool {
        self.taken.is_some_and(|byte| byte.damaged)
    }
}

/// Names the motors; their inside is the simulator's.
impl fmt::Debug for Rs485Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let motors: Vec<String> = self.motors.iter().map(|motor| motor.motor.to_string()).collect();
        f.debug_struct("Rs485Line")
            .field("motors", &motors)
            .field("fault", &self.fault)
            .field("settings", &self.settings)
            .field("sent", &self.sent.len())
            .field("arriving", &self.arriving)
            .field("alarm", &self.alarm)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests;
