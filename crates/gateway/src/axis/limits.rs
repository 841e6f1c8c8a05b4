//! What a motor measures against the limits of its axis: beyond them it trips.

use super::Axis;
use super::state::State;
use crate::measured::Observation;
use crate::outbox::Outbox;
use crate::protocol;
use crate::time::{Duration, Instant};
use host_protocol::{AxisParameter, Error, Quantity, StateField, TripReason};

/// How long a turning motor that nobody here moves is left alone where its own timeout is not
/// known.
const UNKNOWN_TIMEOUT_PAUSE: Duration = Duration::from_millis(5_000);
/// Between two readings that show a motor turning without a setpoint lies at least this (GUARANTEES
/// G1).
const UNCOMMANDED_FOR: Duration = Duration::from_millis(20);

impl Axis {
    /// Takes in what a reply tells, and trips an armed axis on a fault or a limit.
    pub(super) fn observe(&mut self, now: Instant, seen: &Observation, out: &mut Outbox<'_>) {
        self.measured.update(now, seen);
        self.track_angle(now, seen, out);
        if seen.faults.is_some() {
            self.faults_unread = 0;
        }
        if let Some(waits) = seen.write_pending {
            self.write_waits = waits;
        }
        match self.state {
            // A motor that should hold turns. Going on with the polls would keep its own timeout
            // from stopping it.
            State::Holding if self.still(seen) == Some(false) => {
                self.halt(now, out);
                if let Some(stop) = self.stop_mut() {
                    stop.from_rest = false;
                }
                return;
            }
            // Something else has set it in motion. Reading on for a host that watches would do the
            // same.
            State::Idle if self.still(seen) == Some(false) => self.begin_pause(now),
            _ => {}
        }
        if !self.is_armed() {
            return self.note_refusal(seen);
        }
        if let Some(faults) = self.barring(seen) {
            self.trip(now, TripReason::MotorFault { faults }, out);
        } else if let Some(reason) = self.exceeded(seen) {
            self.trip(now, reason, out);
        } else if let Some(velocity_rad_s) = seen.velocity_rad_s {
            self.watch_uncommanded(now, velocity_rad_s, out);
        }
    }

    /// The motor's fault word, if a bit of it bars motion.
    pub(super) fn barring(&self, seen: &Observation) -> Option<u16> {
        seen.faults.filter(|faults| *faults != protocol::warnings(*faults, &self.config))
    }

    /// Without a setpoint an armed axis stands. One reading may be noise: the next one decides, and
    /// is asked for early.
    fn watch_uncommanded(&mut self, now: Instant, velocity_rad_s: f32, out: &mut Outbox<'_>) {
        let turns = velocity_rad_s.abs() > self.config.uncommanded_rad_s();
        let allowed = self.config.flag(AxisParameter::AllowUncommanded);
        let moves = matches!(self.state, State::Active(..));
        let Some(armed) = self.armed_mut() else { return };
        if moves || !turns || allowed {
            armed.uncommanded_since = None;
            return;
        }
        let since = *armed.uncommanded_since.get_or_insert(now);
        if now.since(since) >= UNCOMMANDED_FOR {
            self.trip(now, TripReason::Uncommanded, out);
        } else {
            self.state_poll_at = self.state_poll_at.min(since + UNCOMMANDED_FOR);
        }
    }

    /// A motor that turns at rest is left to its own timeout from now on.
    fn begin_pause(&mut self, now: Instant) {
        let pause = self.programmed_timeout().map_or(UNKNOWN_TIMEOUT_PAUSE, Duration::and_a_half);
        self.state_poll_at = now + pause;
    }

    /// Something has left for the motor: as more than one value may be read for a question, the
    /// pause of one that is left alone begins behind the last.
    pub(super) fn prolong_pause(&mut self, now: Instant) {
        let is_asked = matches!(self.state, State::Idle) && self.job.is_some();
        if is_asked && self.left_alone_at_rad_s(now).is_some() {
            self.begin_pause(now);
        }
    }

    /// How fast a motor at rest turned when it was last read, while it is left to its own timeout:
    /// nobody may ask it anything.
    pub fn left_alone_at_rad_s(&self, now: Instant) -> Option<f32> {
        let is_left_alone = match &self.state {
            State::Idle => now < self.state_poll_at,
            State::Tripped(_, stop) => stop.is_left_alone(now),
            _ => false,
        };
        let velocity = self.measured.number(StateField::Velocity)?;
        let turns = !self.is_standstill(velocity) && self.programmed_timeout().is_some();
        (is_left_alone && turns).then_some(velocity)
    }

    /// Whether what has just been read still is what the axis tripped for. A position stays where
    /// it is until a setpoint or a hand moves it, so it bars nothing: the next arming watches it
    /// again.
    pub(super) fn check_limit_cause(
        &self,
        tripped: TripReason,
        seen: &Observation,
    ) -> Result<(), Error> {
        let TripReason::LimitExceeded { quantity, .. } = tripped else { return Ok(()) };
        match self.exceeded(&Observation { position_rad: None, ..*seen }) {
            Some(reason @ TripReason::LimitExceeded { quantity: still, .. })
                if still == quantity =>
            {
                Err(Error::CauseRemains { axis: self.index, reason })
            }
            _ => Ok(()),
        }
    }

    /// The first limit that a reading exceeds. Noise and overshoot have the axis's margin.
    fn exceeded(&self, seen: &Observation) -> Option<TripReason> {
        let margin = self.config.limit_margin();
        let beyond = |quantity, value: Option<f32>, min: f32, max: f32| {
            let value = value?;
            let limit = if value > max { max } else { min };
            (value > max || value < min).then_some(TripReason::LimitExceeded {
                quantity,
                value,
                limit,
            })
        };
        // A limit of zero has a margin too.
        let slack =
            |limit: f32| if limit.is_finite() { limit.abs().max(1.0) * margin } else { 0.0 };
        let velocity = self.config.limit(AxisParameter::VelocityLimitRadS) * (1.0 + margin);
        let current = self.config.limit(AxisParameter::CurrentLimitA) * (1.0 + margin);
        let torque = self.config.limit(AxisParameter::TorqueLimitNm) * (1.0 + margin);
        let hottest = self.config.limit(AxisParameter::TemperatureLimitC);
        let hot = |value| beyond(Quantity::Temperature, value, f32::NEG_INFINITY, hottest);
        let (lowest, highest) = self.config.position_range();
        let (lowest, highest) = (lowest - slack(lowest), highest + slack(highest));
        beyond(Quantity::Velocity, seen.velocity_rad_s, -velocity, velocity)
            .or_else(|| beyond(Quantity::Current, seen.current_a, -current, current))
            .or_else(|| beyond(Quantity::Torque, seen.torque_nm, -torque, torque))
            .or_else(|| beyond(Quantity::Position, seen.position_rad, lowest, highest))
            .or_else(|| hot(seen.motor_temperature_c))
            .or_else(|| hot(seen.driver_temperature_c))
    }
}
