//! Staying in command for a while: keeping the link alive, and keeping setpoints fresh.

use std::ops::ControlFlow;
use std::time::Duration;

use host_protocol::{Error, Quantity, Setpoint};

use crate::client::{Client, KEEP_ALIVE_AFTER};
use crate::error::ClientError;
use crate::transport::Transport;

/// Setpoints are renewed after this part of the shortest TTL: two may get lost.
const RENEWALS_PER_TTL: u32 = 3;
/// So many setpoints in a row may miss their time or stay unanswered: this process or the line may have been held up.
/// Whether the motor goes on meanwhile is the gateway's decision. One more is an error.
const MISSES: u32 = 3;

/// An axis and what it shall keep doing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hold {
    /// The axis.
    pub axis: u8,
    /// The epoch that arming it returned.
    pub epoch: u32,
    /// What it shall do.
    pub setpoint: Setpoint,
    /// How long each setpoint is valid: the axis's TTL, or less.
    pub ttl: Duration,
}

/// What the function called in each round of a hold returns: whether to go on.
pub type Round = Result<ControlFlow<()>, ClientError>;

impl<T: Transport> Client<T> {
    /// Keeps the link alive for `duration`. Calls `each_round` at least every [`KEEP_ALIVE_AFTER`]; there the caller
    /// may read states and take events, and end the hold.
    ///
    /// # Errors
    /// Those of the pings, and of `each_round`.
    pub fn hold(
        &mut self,
        duration: Duration,
        mut each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        let end = self.now().saturating_add(duration);
        while self.now() < end {
            self.keep_alive()?;
            if each_round(self)?.is_break() {
                return Ok(());
            }
            let rest = KEEP_ALIVE_AFTER.min(end.saturating_sub(self.now()));
            self.transport_mut().sleep(rest);
        }
        Ok(())
    }

    /// Keeps setpoints in force for `duration` by sending them again before they expire, and calls `each_round` after
    /// each time. What `each_round` does has to be done well within the shortest TTL.
    ///
    /// When it returns, nothing is sent any more: stop or disarm the axes, or they trip when the last setpoint expires.
    ///
    /// # Errors
    /// The gateway's refusal of a setpoint, and those of `each_round`. A setpoint that misses its time or stays
    /// unanswered is followed by the next one; only the fourth in a row is an error.
    pub fn hold_setpoints(
        &mut self,
        holds: &[Hold],
        duration: Duration,
        mut each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        let end = self.now().saturating_add(duration);
        let period = holds
            .iter()
            .map(|hold| hold.ttl / RENEWALS_PER_TTL)
            .min()
            .unwrap_or(KEEP_ALIVE_AFTER)
            .min(KEEP_ALIVE_AFTER);
        let mut misses = 0;
        while self.now() < end {
            let next_round = self.now() + period;
            for hold in holds {
                match self.set(hold.axis, hold.epoch, hold.setpoint, hold.ttl) {
                    Ok(()) => misses = 0,
                    Err(error) if misses < MISSES && is_miss(&error) => {
                        misses += 1;
                        self.measure_clock_anew()?;
                    }
                    Err(error) => return Err(error),
                }
            }
            if each_round(self)?.is_break() {
                return Ok(());
            }
            let rest = next_round.min(end).saturating_sub(self.now());
            if !rest.is_zero() {
                self.transport_mut().sleep(rest);
            }
        }
        Ok(())
    }
}

/// Whether a setpoint only came at the wrong time, by what was known of the gateway's clock, or got lost.
fn is_miss(error: &ClientError) -> bool {
    matches!(
        error,
        ClientError::NoAnswer { .. }
            | ClientError::Gateway(
                Error::Stale { .. } | Error::OutOfRange { quantity: Quantity::Expiry, .. }
            )
    )
}
