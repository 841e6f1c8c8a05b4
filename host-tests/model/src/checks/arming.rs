//! Arming: what the motor must have been asked, and how it must have answered (G1).

use crate::axis::Axis;
use crate::motor::{Protocol, Question, Returns, Timeout};

/// What an arming under way has asked and been told. Allowance: a reply answers every request that
/// it can be the answer to, and one good answer is enough, whatever else comes: which of two
/// identical requests a reply belongs to, nobody can tell.
#[derive(Debug, Clone, Default)]
pub(crate) struct Arming {
    since_us: u64,
    /// Requests that have left since it began.
    asked: Vec<Vec<u8>>,
    stops: u32,
    /// Stops that were answered.
    stopped: u32,
    faults_read: bool,
    /// After the latest stop, or before it where the manual's order is that.
    faultless: bool,
    /// RMD: seen open (§2.12, byte 3).
    brake_open: bool,
    /// Speed read behind the latest stop.
    stands: bool,
    record_read: bool,
    /// D5: registers that were read, with their values.
    registers: Vec<(u8, u8)>,
    overwritten: bool,
    /// RMD: the read of what tells the dialect that was asked last, until when its answer is one,
    /// and its first answer while it was, with its time.
    dialect_read: Option<(Vec<u8>, u64, FirstAnswer)>,
    /// Those that were answered before the next request was handed over: the read, and a bit for
    /// each dialect whose motors answer so.
    dialects: Vec<(Vec<u8>, u8)>,
}

/// When a read was first answered, and the dialects whose motors answer so.
type FirstAnswer = Option<(u64, u8)>;

/// D5 registers: acknowledge level, switch of the timeout, whether the brake holds, whether an
/// asynchronous write waits.
const ACK_LEVEL: u8 = 0x10;
const TIMEOUT_SWITCH: u8 = 0x11;
const BRAKE: u8 = 0x2B;
const WRITE_WAITS: u8 = 0x2C;
/// RMD V3.6 §2.26.
const FREE_BRAKE: u8 = 0x77;

impl Arming {
    pub fn new(now: u64) -> Self {
        Self { since_us: now, ..Self::default() }
    }

    /// A request has left that was handed over at a time, and is answered until another.
    pub fn left(&mut self, protocol: Protocol, handed_us: u64, until_us: u64, data: &[u8]) {
        if handed_us < self.since_us {
            return;
        }
        if let Some((read, _, Some((at, dialects)))) = self.dialect_read.take()
            && at <= handed_us
        {
            self.dialects.push((read, dialects));
        }
        match protocol.question(data) {
            Some(Question::Dialect) => self.dialect_read = Some((data.to_vec(), until_us, None)),
            Some(Question::Stop) => {
                self.stops += 1;
                self.stands = false;
                self.faultless &= protocol == Protocol::D5;
            }
            Some(Question::Overwrite) => self.overwritten = true,
            _ => {}
        }
        if !self.asked.iter().any(|asked| asked == data) {
            self.asked.push(data.to_vec());
        }
    }

    /// The motor says something; `still` is the speed below which it stands, `warnings` are faults
    /// that bar nothing.
    pub fn answered(
        &mut self,
        now: u64,
        protocol: Protocol,
        returns: Returns,
        reply: &[u8],
        still: f64,
        warnings: u16,
    ) {
        if let Some((read, until_us, answer @ None)) = &mut self.dialect_read
            && now <= *until_us
        {
            *answer = protocol.dialects(read, reply).map(|dialects| (now, dialects));
        }
        for asked in &self.asked {
            let Some(reading) = protocol.answer(returns, asked, reply) else { continue };
            match protocol.question(asked) {
                Some(Question::Stop) => self.stopped += u32::from(reading.stops),
                Some(Question::Speed) => {
                    self.stands |= reading.speed.is_some_and(|speed| speed <= still)
                }
                Some(Question::Faults) => {
                    self.faults_read = true;
                    self.brake_open |= reading.locked == Some(false);
                    self.faultless |= reading.faults.is_some_and(|word| word & !warnings == 0);
                }
                Some(Question::Record) => self.record_read = true,
                Some(Question::Register(register)) => {
                    self.registers.extend(reading.register.map(|value| (register, value)));
                }
                Some(Question::Overwrite | Question::Dialect) | None => {}
            }
        }
    }

    /// Whether each read that was answered twice leaves it possible that the motor speaks the
    /// dialect with this number; 0 says nothing.
    fn may_speak(&self, dialect: u32) -> bool {
        let agrees = |(read, dialects): &(Vec<u8>, u8)| {
            let mut again = self.dialects.iter().filter(|(other, _)| other == read);
            let is_possible = dialects.checked_shr(dialect).is_some_and(|bit| bit & 1 != 0);
            again.clone().count() < 2 || is_possible && again.all(|(_, other)| other == dialects)
        };
        dialect == 0 || self.dialects.iter().all(agrees)
    }

    /// What is missing before the axis may be armed.
    pub fn missing(&self, axis: &Axis) -> Option<&'static str> {
        let read = |register, fits: &dyn Fn(u8) -> bool| {
            self.registers.iter().any(|(read, value)| *read == register && fits(*value))
        };
        let freed = self.asked.iter().any(|asked| asked.first() == Some(&FREE_BRAKE));
        let open = self.brake_open || freed && axis.allows_unverified_brake();
        let level = axis.d5_ack_level();
        let wanted: &[(bool, &'static str)] = match axis.protocol()? {
            // The first may be ignored.
            Protocol::Rmd => &[
                (self.stopped >= 2, "two stops"),
                (self.stands, "standstill"),
                (self.faultless, "no fault"),
                (open || !axis.has_brake(), "an open brake"),
                (self.may_speak(axis.dialect()), "a dialect that its motor does not contradict"),
                (axis.allows(axis.timeout), "the motor's timeout"),
            ],
            Protocol::Thruster => &[
                (self.faults_read, "the faults"),
                (self.record_read, "the record of faults"),
                (self.stopped >= 1, "a stop"),
                (self.faultless, "no fault"),
                (self.stands, "standstill"),
                (axis.allows(axis.timeout), "the motor's timeout"),
            ],
            Protocol::D5 => &[
                (
                    level > 0 && read(ACK_LEVEL, &|value| u32::from(value) == level),
                    "the acknowledge level",
                ),
                (read(TIMEOUT_SWITCH, &|_| true), "the switch of the timeout"),
                (self.faultless, "no fault"),
                (read(BRAKE, &|value| value == 0), "the brake"),
                (read(WRITE_WAITS, &|value| value == 0 || self.overwritten), "what waits"),
                (self.stops >= 1 && (self.stopped >= 1 || level < 2), "a stop"),
                (self.stands, "standstill"),
                (
                    read(TIMEOUT_SWITCH, &|value| value != 0) || axis.allows(Timeout::Off),
                    "the motor's timeout",
                ),
            ],
        };
        wanted.iter().find(|(there, _)| !there).map(|(_, what)| *what)
    }
}
