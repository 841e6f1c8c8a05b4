//! The motor's own timeout, the second layer: what is known of it, and what follows (GUARANTEES G1,
//! G4).

use super::identity::Identity;
use super::restart::CLOCK_PART;
use super::{Axis, JobKind};
use crate::protocol::{self, Exchange, Info, Sets};
use crate::rules;
use crate::time::{Duration, Instant};
use host_protocol::{AxisParameter, Error, MotorTimeout};

/// A timeout that acts later than this counts as off (GUARANTEES G1).
const LONGEST_TIMEOUT_MS: u32 = 60_000;
/// Bits of the retained word beside the timeout, which never reaches them, and below them the
/// motor that was told it.
const RESTART_OWED: u32 = 1 << 31;
const TIMEOUT_OFF: u32 = 1 << 30;
const TOLD_MOTOR_AT: u32 = 16;
const _: () = assert!(LONGEST_TIMEOUT_MS < 1 << TOLD_MOTOR_AT, "the timeout leaves them free");
const _: () = assert!(TIMEOUT_OFF == 1 << (TOLD_MOTOR_AT + Identity::BITS), "so does the motor");

/// The power of a motor that was not heard for so long may have been off (GUARANTEES G1).
const POWER_MAY_HAVE_BEEN_OFF: Duration = Duration::from_millis(1_000);

/// No timeout that a motor can be told acts within this.
const NONE_ACTS_WITHIN: Duration = Duration::from_millis(15);
/// A timeout of which nothing is known is taken to act behind a silence of so long.
const UNKNOWN_ACTS_AFTER: Duration = Duration::from_millis(100);

impl Axis {
    /// What is known of the timeout now. A motor that keeps it in RAM has lost it with its power.
    /// That it has none is believed on: nobody knows whether it keeps that.
    pub fn motor_timeout(&self, now: Instant) -> MotorTimeout {
        let silent = now.since(self.heard_at) >= POWER_MAY_HAVE_BEEN_OFF;
        match self.motor_timeout {
            MotorTimeout::Written { .. } if silent && !self.stores_its_timeout() => {
                MotorTimeout::Unknown
            }
            known => known,
        }
    }

    /// Whether the motor was not heard for so long that its own timeout may have acted, its clock
    /// being faster than ours.
    pub(super) fn may_have_let_go(&self, now: Instant) -> bool {
        let silent = now.since(self.heard_at);
        if silent < NONE_ACTS_WITHIN || !self.is_polled_to_hold() {
            return false;
        }
        // Where none is known nothing else would have what holds be told again.
        let guesses = self.is_held() && self.motor_timeout != MotorTimeout::Off;
        let timeout = self.programmed_timeout().or(guesses.then_some(UNKNOWN_ACTS_AFTER));
        let acts_after = |timeout: Duration| timeout - timeout.part(CLOCK_PART);
        timeout.is_some_and(|timeout| silent >= acts_after(timeout))
    }

    /// The motor has been heard.
    pub(super) fn heard(&mut self, now: Instant) {
        self.motor_timeout = self.motor_timeout(now);
        self.heard_at = now;
    }

    /// Arming without a timeout must be allowed by the configuration, and without knowing of one as
    /// well.
    pub fn check_motor_timeout(&self, now: Instant) -> Result<(), Error> {
        let axis = self.index;
        let allows = |parameter| self.config.flag(parameter);
        match self.motor_timeout(now) {
            MotorTimeout::Verified | MotorTimeout::Written { .. } => Ok(()),
            MotorTimeout::Unknown if allows(AxisParameter::AllowUnknownMotorTimeout) => Ok(()),
            MotorTimeout::Off if allows(AxisParameter::AllowNoMotorTimeout) => Ok(()),
            MotorTimeout::Off => Err(Error::MotorTimeoutOff { axis }),
            MotorTimeout::Unknown => Err(Error::MotorTimeoutUnknown { axis }),
        }
    }

    /// Refuses a timeout that would act while the axis is being armed, or while what the motor must
    /// hear `waits`: what this takes was configured since.
    pub fn check_programmed_timeout(&self, waits: Duration) -> Result<(), Error> {
        rules::check_timeout(self.index, self.written_timeout_ms, waits, &self.config)
    }

    /// Whether arming settles what is known: it asks the motor, or tells it again what was
    /// provisioned.
    pub fn arming_settles_the_timeout(&self) -> bool {
        self.tells_whether_on() || self.renewed_timeout_ms().is_some()
    }

    /// Whether the motor tells that its timeout is on, and has a length of its own.
    fn tells_whether_on(&self) -> bool {
        self.can(Exchange::TimeoutSwitch)
    }

    /// The timeout that arming writes again, ms: the one provisioned, where the motor loses it with
    /// its power.
    pub(super) fn renewed_timeout_ms(&self) -> Option<u32> {
        (self.written_timeout_ms > 0 && !self.stores_its_timeout())
            .then_some(self.written_timeout_ms)
    }

    /// What is known of the timeout once the axis is armed: what arming writes again, it has then.
    pub fn settled_timeout(&self, now: Instant) -> MotorTimeout {
        let renewed = self.renewed_timeout_ms();
        renewed.map_or(self.motor_timeout(now), |timeout_ms| MotorTimeout::Written { timeout_ms })
    }

    /// The timeout to write now, ms: the one that a host asks for, or the one that arming renews.
    pub(super) fn timeout_to_write(&self) -> Option<u32> {
        match self.job.as_ref().map(|job| job.kind) {
            Some(JobKind::Provision { timeout_ms }) => Some(timeout_ms),
            _ => self.renewed_timeout_ms(),
        }
    }

    /// The motor has taken the timeout that arming wrote again.
    pub(super) fn timeout_renewed(&mut self) {
        if let Some(timeout_ms) = self.renewed_timeout_ms() {
            self.motor_timeout = MotorTimeout::Written { timeout_ms };
        }
    }

    /// The motor is about to be changed: what was known of its timeout may no longer hold.
    pub fn forget_motor_timeout(&mut self) {
        self.timeout_is(MotorTimeout::Unknown);
        self.is_unsaved |= core::mem::take(&mut self.written_timeout_ms) != 0;
        self.told_motor = Identity::UNKNOWN;
    }

    /// A native command may change it: what that may switch off counts as off.
    pub fn may_change_timeout(&mut self, sets: Sets) {
        self.forget_motor_timeout();
        if matches!(sets, Sets::Timeout(timeout_ms) if is_as_good_as_none(timeout_ms)) {
            self.timeout_is(MotorTimeout::Off);
        }
    }

    /// Nobody knows what has become of the motor. What was provisioned stays where arming writes it
    /// again.
    pub(super) fn doubt_motor_timeout(&mut self) {
        if self.renewed_timeout_ms().is_some() {
            self.motor_timeout = MotorTimeout::Unknown;
        } else {
            self.forget_motor_timeout();
        }
    }

    /// The motor is about to be told a timeout. Until it has answered it may have the one or the
    /// other; none, where that is one of them. Who had none is still known then.
    pub(super) fn provisioning(&mut self, timeout_ms: u32) {
        self.off_is_assumed = self.motor_timeout != MotorTimeout::Off;
        if !self.off_is_assumed {
            return;
        }
        self.forget_motor_timeout();
        if is_as_good_as_none(timeout_ms) {
            self.timeout_is(MotorTimeout::Off);
        }
    }

    /// A command was taken back of which it may have been assumed that the motor has none.
    pub(super) fn timeout_not_told(&mut self) {
        if self.off_is_assumed && self.motor_timeout == MotorTimeout::Off {
            self.timeout_is(MotorTimeout::Unknown);
        }
    }

    /// This is known of the timeout now.
    pub(super) fn timeout_is(&mut self, known: MotorTimeout) {
        let before = core::mem::replace(&mut self.motor_timeout, known);
        self.is_unsaved |= (before == MotorTimeout::Off) != (known == MotorTimeout::Off);
    }

    /// The motor has taken a timeout. It was read back that it is on, or counts as long as
    /// written.
    pub(super) fn provisioned(&mut self, timeout_ms: u32) {
        let told_motor = self.job.as_ref().map_or(Identity::UNKNOWN, |job| job.identity);
        self.forget_motor_timeout();
        let known = match timeout_ms {
            0 => MotorTimeout::Off,
            _ if self.tells_whether_on() && protocol::can_confirm(&self.config) => {
                MotorTimeout::Verified
            }
            // It was not read back.
            _ if self.tells_whether_on() => MotorTimeout::Unknown,
            other if is_as_good_as_none(other) => MotorTimeout::Off,
            _ => {
                (self.written_timeout_ms, self.is_unsaved) = (timeout_ms, true);
                MotorTimeout::Written { timeout_ms }
            }
        };
        self.told_motor = told_motor;
        self.timeout_is(known);
    }

    /// What outlives a reset of the gateway: the timeout last written to the motor, ms, 0 where
    /// none is known, and which motor that was; and in the highest bits whether it owes a restart,
    /// and whether its timeout is known to be off.
    pub fn told_word(&self) -> u32 {
        let bit = |so, bit| if so { bit } else { 0 };
        let is_off = self.motor_timeout == MotorTimeout::Off;
        self.written_timeout_ms
            | self.told_motor.bits() << TOLD_MOTOR_AT
            | bit(self.owes_restart(), RESTART_OWED)
            | bit(is_off, TIMEOUT_OFF)
    }

    /// What was written before the gateway was reset. The motor's power may have been off since, so
    /// it is believed at once where the motor stores it; elsewhere arming writes it again, and
    /// until then it only says how long a silence must be for it to act. That it is off is believed
    /// of every motor.
    pub fn told_before_reset(&mut self, word: u32) {
        if word & RESTART_OWED != 0 {
            self.set_restart_owed(true);
        }
        self.told_motor = Identity::of_bits(word >> TOLD_MOTOR_AT);
        if word & TIMEOUT_OFF != 0 {
            self.motor_timeout = MotorTimeout::Off;
        }
        let timeout_ms = word & ((1 << TOLD_MOTOR_AT) - 1);
        if is_as_good_as_none(timeout_ms) {
            return;
        }
        self.written_timeout_ms = timeout_ms;
        if self.stores_its_timeout() {
            self.motor_timeout = MotorTimeout::Written { timeout_ms };
        }
    }

    /// The motor's own timeout, where the gateway has programmed one that the motor must still
    /// have, or has once it is armed. Where the motor only tells that it is on it
    /// stays unknown.
    pub(super) fn programmed_timeout(&self) -> Option<Duration> {
        let holds = !self.is_armed() || matches!(self.motor_timeout, MotorTimeout::Written { .. });
        let timeout = Duration::from_millis(u64::from(self.written_timeout_ms));
        (holds && self.written_timeout_ms > 0).then_some(timeout)
    }

    /// How long an unreachable motor is sent nothing behind two stops: one that answers and turns
    /// on, or refuses, so long that its own timeout can act, which whatever we send may be feeding;
    /// one that does not answer, as it may hear the next one, or that stands, until the stop is due
    /// again (GUARANTEES G4).
    pub(super) fn unreachable_silence(&self) -> Duration {
        let stands = self.standstill() == Some(true);
        let turns_on = self.stop().is_some_and(|stop| stop.hears && (stop.refuses || !stands));
        if self.written_timeout_ms > 0 && turns_on {
            Duration::from_millis(u64::from(self.written_timeout_ms)).and_a_half()
        } else {
            self.config.stop_repeat()
        }
    }

    /// Whether the motor was told a timeout, or none, that it keeps without power. That it has none
    /// may also be assumed, of nobody knows which motor.
    pub(super) fn keeps_what_it_was_told(&self) -> bool {
        let is_off = self.motor_timeout == MotorTimeout::Off;
        let was_told_none = is_off && self.told_motor != Identity::UNKNOWN;
        (self.written_timeout_ms > 0 || was_told_none) && self.stores_its_timeout()
    }

    fn stores_its_timeout(&self) -> bool {
        Info::of_axis(&self.config).is_some_and(|info| info.stores_timeout)
    }
}

/// Whether a timeout, ms, is off or acts too late.
fn is_as_good_as_none(timeout_ms: u32) -> bool {
    timeout_ms == 0 || timeout_ms > LONGEST_TIMEOUT_MS
}
