//! The motor's own timeout, the second layer: what is known of it, and what follows (GUARANTEES G1, G4).

use super::Axis;
use crate::motor;
use crate::time::Duration;
use host_protocol::{AxisParameter, Error, MotorTimeout, Protocol};

impl Axis {
    /// Arming without knowing it must be allowed by the configuration.
    pub fn check_motor_timeout(&self) -> Result<(), Error> {
        let axis = self.index;
        match self.motor_timeout {
            MotorTimeout::Verified | MotorTimeout::Written { .. } => Ok(()),
            _ if self.config.flag(AxisParameter::AllowUnknownMotorTimeout) => Ok(()),
            MotorTimeout::Off => Err(Error::MotorTimeoutOff { axis }),
            MotorTimeout::Unknown => Err(Error::MotorTimeoutUnknown { axis }),
        }
    }

    /// The motor is about to be changed: what was known of its timeout may no longer hold.
    pub fn forget_motor_timeout(&mut self) {
        self.motor_timeout = MotorTimeout::Unknown;
        self.timeout_unsaved |= core::mem::take(&mut self.written_timeout_ms) != 0;
    }

    /// The motor has taken a timeout. That of a D5 has a length of its own, and its switch has been read back; others count the
    /// time given.
    pub(super) fn provisioned(&mut self, timeout_ms: u32) {
        self.forget_motor_timeout();
        self.motor_timeout = match (timeout_ms, self.config.protocol()) {
            (0, _) => MotorTimeout::Off,
            (_, Some(Protocol::D5)) => MotorTimeout::Verified,
            _ => {
                self.written_timeout_ms = timeout_ms;
                self.timeout_unsaved = true;
                MotorTimeout::Written { timeout_ms }
            }
        };
    }

    /// What outlives a reset of the gateway: the timeout last written to the motor, ms; 0 where none is known.
    pub fn written_timeout_ms(&self) -> u32 {
        self.written_timeout_ms
    }

    /// Whether that has changed and has still to be saved.
    pub fn take_unsaved_timeout(&mut self) -> bool {
        core::mem::take(&mut self.timeout_unsaved)
    }

    /// What was written before the gateway was reset. The motor's power may have been off since, so arming believes it where the motor stores it;
    /// elsewhere it only says how long a silence must be for it to act.
    pub fn timeout_written_before_reset(&mut self, timeout_ms: u32) {
        self.written_timeout_ms = timeout_ms;
        if timeout_ms > 0 && self.config.protocol().is_some_and(motor::stores_its_timeout) {
            self.motor_timeout = MotorTimeout::Written { timeout_ms };
        }
    }

    /// The motor's own timeout, where the gateway has programmed one that the motor must still have. A D5's stays unknown although it can
    /// be read back: register 0x11 only switches it on and off, and no register and no page of the manual tells how long it is.
    pub(super) fn programmed_timeout(&self) -> Option<Duration> {
        match self.motor_timeout {
            MotorTimeout::Written { timeout_ms } if timeout_ms > 0 => {
                Some(Duration::from_millis(u64::from(timeout_ms)))
            }
            _ => None,
        }
    }

    /// How long an unreachable motor is left alone, so that its own timeout can act (GUARANTEES G4).
    pub(super) fn unreachable_silence(&self) -> Duration {
        match self.written_timeout_ms {
            0 => self.config.stop_repeat(),
            timeout_ms => Duration::from_millis(u64::from(timeout_ms)).and_a_half(),
        }
    }
}
