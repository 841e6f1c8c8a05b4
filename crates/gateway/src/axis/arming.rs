//! What each step of a job must show before it goes on: above all, before an axis is armed.

use super::{Axis, JobKind};
use crate::measured::Observation;
use crate::protocol::{Exchange, Sets};
use crate::time::Instant;
use host_protocol::{AxisParameter, Error, MotorTimeout, Quantity, TogetherBar, TripReason};

impl Axis {
    pub(super) fn check_step(
        &mut self,
        exchange: Exchange,
        seen: &Observation,
    ) -> Result<(), Error> {
        let axis = self.index;
        let refused = Error::Refused { axis, faults: self.measured.fault_word() };
        match self.job_kind() {
            Some(JobKind::Arm { .. }) => self.check_arming_step(exchange, seen),
            Some(JobKind::Clear | JobKind::Restart) => {
                match (self.barring(seen), seen.velocity_rad_s, self.trip_reason()) {
                    (Some(faults), ..) => {
                        Err(Error::CauseRemains { axis, reason: TripReason::MotorFault { faults } })
                    }
                    (_, Some(velocity), Some(_))
                        if self.must_stand() && !self.is_standstill(velocity) =>
                    {
                        Err(Error::StopNotConfirmed { axis })
                    }
                    (.., Some(reason)) => self.check_limit_cause(reason, seen),
                    _ => Ok(()),
                }
            }
            Some(JobKind::Native { command, .. })
                if exchange == Exchange::AckLevel
                    && seen
                        .ack_level
                        .is_some_and(|level| command.sets() != Sets::AckLevel(level)) =>
            {
                Err(refused)
            }
            Some(JobKind::Prepare { .. }) if seen.write_pending == Some(false) => Err(refused),
            Some(JobKind::StandBy { .. })
                if seen.write_pending == Some(true) && !self.comes_again(exchange) =>
            {
                Err(Error::CannotStartTogether { axis, reason: TogetherBar::WriteWaits })
            }
            Some(JobKind::Provision { timeout_ms }) if seen.timeout_on == Some(timeout_ms == 0) => {
                Err(refused)
            }
            _ => Ok(()),
        }
    }

    fn check_arming_step(&mut self, exchange: Exchange, seen: &Observation) -> Result<(), Error> {
        let axis = self.index;
        // It answers: a restart that it was told of before is over, or not under way.
        self.restarts_until = Instant::default();
        if let Some(level) = seen.ack_level {
            self.check_ack_level(level)?;
        }
        if let Some(on) = seen.timeout_on {
            self.timeout_is(if on { MotorTimeout::Verified } else { MotorTimeout::Off });
        }
        if exchange == Exchange::BrakeSwitch && seen.brake_locked == Some(true) {
            return Err(Error::BrakeOn { axis });
        }
        if exchange == Exchange::RenewTimeout {
            self.timeout_renewed();
        }
        if seen.commanded_zero == Some(false) {
            // The motor has acknowledged speed 0 and keeps another one.
            return Err(Error::CannotConfirm { axis });
        }
        if let Some(faults) = self.barring(seen)
            && exchange == Exchange::Faults
            && !self.comes_again(exchange)
        {
            return Err(Error::MotorFault { axis, faults });
        }
        if seen.run_time_ms.is_some() && self.owes_restart() {
            return Err(Error::RestartOwed { axis });
        }
        // A motion against a locked brake ends in a stall.
        if seen.brake_locked == Some(true)
            && !self.brake_is_freed_unseen()
            && self.config.has_brake()
        {
            return Err(Error::BrakeLocked { axis });
        }
        match seen.velocity_rad_s {
            Some(velocity_rad_s)
                if exchange == Exchange::Velocity && !self.is_standstill(velocity_rad_s) =>
            {
                Err(Error::NotStandstill { axis, velocity_rad_s })
            }
            _ => Ok(()),
        }
    }

    /// Whether the job has freed the brake of a motor that need not show it.
    pub(super) fn brake_is_freed_unseen(&self) -> bool {
        let freed = self.job.as_ref().is_some_and(|job| job.brake_freed);
        freed && !self.config.verifies_brake()
    }

    /// A level other than the configured one would make every write look lost, or answers
    /// unexpected.
    fn check_ack_level(&self, level: u8) -> Result<(), Error> {
        let configured = self.config.unsigned(AxisParameter::D5AckLevel).unwrap_or(0);
        let quantity = Quantity::Parameter(AxisParameter::D5AckLevel.number());
        quantity.check(level.into(), (configured, configured))
    }

    /// Whether a later step of the job asks the same, so that the first answer is only for the
    /// record.
    fn comes_again(&self, exchange: Exchange) -> bool {
        self.job.as_ref().is_some_and(|job| job.sequence.comes_again(exchange))
    }
}
