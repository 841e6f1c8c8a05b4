//! The setpoint in force: a mailbox for the latest one.

use super::Axis;
use crate::motor::{self, Command, Exchange};
use crate::outbox::Outbox;
use crate::time::{Duration, Instant};
use host_protocol::{AxisParameter, AxisState, Error, Quantity, Setpoint, TripReason};

/// A setpoint and the command that carries it out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    pub command: Command,
    /// When the permission to move ends; `None` only where the axis is configured without expiry, which is unsafe.
    expires: Option<Instant>,
    /// When it is to be sent next.
    pub due: Instant,
}

impl Motion {
    pub fn deadline(&self) -> Option<Instant> {
        self.expires
    }
}

/// The largest lead of an expiry that can be told from one in the past: half of what 32 bits of microseconds count.
const HALF_RANGE: u32 = 1 << 31;

impl Axis {
    /// Takes a setpoint from the host, or says why not.
    pub fn set(
        &mut self,
        now: Instant,
        epoch: u32,
        expires_at_us: u32,
        setpoint: Setpoint,
        out: &mut Outbox<'_>,
    ) -> Result<(), Error> {
        let axis = self.index;
        match (self.state, &self.trip) {
            (AxisState::Armed | AxisState::Active, _) => {}
            (AxisState::Tripped { .. }, Some(trip)) => {
                return Err(Error::Tripped { axis, reason: trip.reason });
            }
            (state, _) => return Err(Error::NotArmed { axis, state }),
        }
        if epoch != self.epoch {
            return Err(Error::StaleEpoch { current: Some(self.epoch) });
        }
        let expires = self.expiry(now, expires_at_us)?;
        self.check_limits(setpoint)?;
        let command = motor::motion(axis, setpoint, &self.config)?;
        self.motion = Some(Motion { command, expires, due: now });
        if self.state == AxisState::Armed {
            self.enter(AxisState::Active, out);
        }
        Ok(())
    }

    /// The expiry as a point in gateway time: later than now, and not later than the axis's TTL allows.
    fn expiry(&self, now: Instant, expires_at_us: u32) -> Result<Option<Instant>, Error> {
        if self.config.flag(AxisParameter::UnsafeInfiniteTtl) {
            return Ok(None);
        }
        let now_us = now.low_bits();
        let lead = expires_at_us.wrapping_sub(now_us);
        if lead == 0 || lead >= HALF_RANGE {
            return Err(Error::Stale { now_us, expires_at_us });
        }
        let ttl_us = self.config.ttl().as_micros_u32();
        if lead > ttl_us {
            let (value, max) = (micros(lead), micros(ttl_us));
            return Err(Error::OutOfRange { quantity: Quantity::Expiry, value, min: 0.0, max });
        }
        Ok(Some(now + Duration::from_micros(u64::from(lead))))
    }

    /// Trips when the setpoint in force has expired.
    pub fn expire_motion(&mut self, now: Instant, out: &mut Outbox<'_>) {
        let expired = self.motion.as_ref().and_then(Motion::deadline).is_some_and(|at| at <= now);
        if expired && self.state == AxisState::Active {
            self.trip(now, TripReason::SetpointExpired, out);
        }
    }

    pub(super) fn resend_motion(&mut self, now: Instant) {
        if let Some(motion) = &mut self.motion {
            motion.due = now;
        }
    }

    /// How often the state is polled: a holding motor without a setpoint must hear something as often as a setpoint would
    /// tell it.
    pub(super) fn state_poll(&self) -> Duration {
        let configured = self.config.state_poll();
        if self.must_hold() && self.motion.is_none() { configured.min(self.refresh()) } else { configured }
    }

    /// Plans what comes after an exchange that the bus has just taken.
    pub(super) fn note_handed(&mut self, now: Instant, exchange: Exchange) {
        let refresh = self.refresh();
        self.motion_had_its_turn = exchange == Exchange::Motion;
        self.job_handed(exchange);
        match exchange {
            Exchange::Motion => {
                if let Some(motion) = &mut self.motion {
                    motion.due = now + refresh;
                }
            }
            Exchange::Faults => self.fault_poll_at = now + self.config.fault_poll(),
            _ => {}
        }
        if let Some(stop) = &mut self.stop {
            stop.handed(now, exchange, &self.config);
        } else if self.job.is_none() && exchange != Exchange::Motion && exchange != Exchange::Faults {
            self.state_poll_at = now + self.state_poll();
            self.poll_turn = self.poll_turn.wrapping_add(1);
        }
    }
}

/// Microseconds for an error message; the precision of f32 is enough for it.
fn micros(us: u32) -> f32 {
    #[allow(clippy::cast_precision_loss)]
    let value = us as f32;
    value
}
