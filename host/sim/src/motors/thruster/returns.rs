//! What a thruster returns for TC and VC instead of the echo (VM), and what it sends unasked (SR,
//! ML, MM).

use std::time::Duration;

use thruster::{
    Celsius, Deciamps, Decidegrees, Decivolts, Faults, Headerless, Milliseconds, Payload, Reply,
    Request, ReturnFlags, ReturnFrames, ReturnSource, Returned, ReturnedFrame, Rpm,
};

/// Period of ML and of MM (Thruster manual §2.1).
const LOW_SPEED: Duration = Duration::from_secs(1);
const MEDIUM_SPEED: Duration = Duration::from_millis(100);

/// What the frames tell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Readings {
    pub speed: Rpm,
    pub voltage: Decivolts,
    pub current: Deciamps,
    pub faults: Faults,
    pub motor: Celsius,
    pub driver: Celsius,
    pub absolute: Decidegrees,
    pub relative: Decidegrees,
}

impl Readings {
    /// A frame by its place among those of a mask. Frame 3 as it is assumed to be: both positions
    /// as words, the rest 0.
    fn frame(&self, which: ReturnFrames) -> ReturnedFrame {
        match which {
            ReturnFrames::MOTION => ReturnedFrame::Motion {
                speed: self.speed,
                voltage: self.voltage,
                current: self.current,
            },
            ReturnFrames::CONDITION => ReturnedFrame::Condition {
                faults: self.faults,
                motor_temperature: self.motor,
                driver_temperature: self.driver,
            },
            _ => {
                let word = |position: Decidegrees| {
                    i16::try_from(position.0).unwrap_or(i16::MAX).to_be_bytes()
                };
                let ([a0, a1], [r0, r1]) = (word(self.absolute), word(self.relative));
                ReturnedFrame::Position { raw: [a0, a1, r0, r1, 0, 0] }
            }
        }
    }

    fn frames(&self, source: ReturnSource, frames: ReturnFrames) -> Vec<Payload> {
        let all = [ReturnFrames::MOTION, ReturnFrames::CONDITION, ReturnFrames::POSITION];
        let asked = all.into_iter().filter(|which| frames.contains(*which));
        asked
            .filter_map(|which| {
                Reply::Returned(Returned { source, frame: self.frame(which) }).encode().ok()
            })
            .collect()
    }
}

/// Something that is sent again and again.
#[derive(Debug, Clone, Copy, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
struct Repeated {
    /// Zero: not sent.
    period: Duration,
    at: Duration,
}

impl Repeated {
    fn every(period: Duration, now: Duration) -> Self {
        Self { period, at: now + period }
    }

    fn due_at(&self) -> Option<Duration> {
        (!self.period.is_zero()).then_some(self.at)
    }

    /// Whether it is due; then it is again a period later.
    fn is_due(&mut self, now: Duration) -> bool {
        let due = self.due_at().is_some_and(|at| at <= now);
        if due {
            self.at = now + self.period;
        }
        due
    }
}

/// What VM, SR, ML, MM and MQ have set.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Returns {
    /// VM, bytes 6 and 7. Whether it is kept without power is not given: here it is.
    flags: u8,
    frames: u8,
    /// SR, byte 5, kept without power (Thruster manual §2.5).
    streamed: u8,
    stream: Repeated,
    /// ML and MM.
    automatic: Repeated,
}

impl Returns {
    pub(super) fn configure(&mut self, flags: ReturnFlags, frames: ReturnFrames) {
        (self.flags, self.frames) = (flags.bits(), frames.bits());
    }

    pub(super) fn stream(&mut self, frames: ReturnFrames, interval: Milliseconds, now: Duration) {
        self.streamed = frames.bits();
        let period = Duration::from_millis(u64::from(interval.0));
        self.stream =
            if frames.is_empty() { Repeated::default() } else { Repeated::every(period, now) };
    }

    /// MQ, ML, MM.
    pub(super) fn set_mode(&mut self, request: &Request, now: Duration) -> Reply {
        let (period, reply) = match request {
            Request::LowSpeedMode => (LOW_SPEED, Reply::LowSpeedMode),
            Request::MediumSpeedMode => (MEDIUM_SPEED, Reply::MediumSpeedMode),
            _ => (Duration::ZERO, Reply::RequestMode),
        };
        self.automatic = Repeated::every(period, now);
        reply
    }

    pub(super) fn after_power_cycle(&self) -> Self {
        Self { automatic: Repeated::default(), ..self.clone() }
    }

    /// What answers a request. A refusal has its header in every mode, or so it is assumed.
    pub(super) fn in_place_of(
        &self,
        request: &Request,
        reply: &Reply,
        readings: &Readings,
    ) -> Vec<Payload> {
        let source = match request {
            Request::Signal { .. } => ReturnSource::Signal,
            Request::Speed { .. } => ReturnSource::Speed,
            _ => return reply.encode().into_iter().collect(),
        };
        let (flags, frames) = (
            ReturnFlags::from_bits_truncate(self.flags),
            ReturnFrames::from_bits_truncate(self.frames),
        );
        if flags.contains(ReturnFlags::NO_RETURN) {
            Vec::new()
        } else if matches!(reply, Reply::Refused { .. }) {
            reply.encode().into_iter().collect()
        } else if flags.contains(ReturnFlags::NO_HEADER) {
            let Readings { speed, voltage, current, faults, .. } = *readings;
            vec![Headerless { speed, voltage, current, faults }.encode()]
        } else if frames.is_empty() {
            reply.encode().into_iter().collect()
        } else {
            readings.frames(source, frames)
        }
    }

    /// When it sends something unasked.
    pub(super) fn due_at(&self) -> Option<Duration> {
        [self.stream.due_at(), self.automatic.due_at()].into_iter().flatten().min()
    }

    /// What it sends unasked now.
    pub(super) fn due(&mut self, now: Duration, readings: &Readings) -> Vec<Payload> {
        let mut sent = Vec::new();
        if self.stream.is_due(now) {
            sent.extend(
                readings
                    .frames(ReturnSource::Stream, ReturnFrames::from_bits_truncate(self.streamed)),
            );
        }
        if self.automatic.is_due(now) {
            // Current and speed (Thruster manual §2.1), in the form of their queries' answers.
            let told = [
                Reply::Current { current: readings.current },
                Reply::MeasuredSpeed { speed: readings.speed },
            ];
            sent.extend(told.iter().filter_map(|reply| reply.encode().ok()));
        }
        sent
    }
}
