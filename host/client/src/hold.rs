//! Staying in command for a while: keeping the link alive, and keeping setpoints fresh.

use std::ops::ControlFlow;
use std::time::Duration;

use host_protocol::{Bytes, Error, MAX_CAN_DATA, Quantity, Setpoint};

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

/// An axis and the native command that it shall keep carrying out.
#[derive(Debug, Clone, PartialEq)]
pub struct NativeHold {
    /// The axis.
    pub axis: u8,
    /// The epoch that arming it returned.
    pub epoch: u32,
    /// The data field of the command.
    pub data: Bytes<MAX_CAN_DATA>,
    /// How long it is valid each time: the axis's TTL, or less.
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
        each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        let ttl = holds.iter().map(|hold| hold.ttl).min().unwrap_or(Duration::MAX);
        let mut misses = 0;
        let send = |client: &mut Self| {
            for hold in holds {
                let sent = client.set(hold.axis, hold.epoch, hold.setpoint, hold.ttl);
                client.forgive(sent, &mut misses)?;
            }
            Ok(())
        };
        self.renew(ttl, duration, send, each_round)
    }

    /// As [`hold_setpoints`](Self::hold_setpoints), for a native command that moves. Not for one that moves by a distance or
    /// starts what waits in the motor: each time it is sent it moves the motor anew.
    ///
    /// # Errors
    /// As [`hold_setpoints`](Self::hold_setpoints).
    pub fn hold_native(
        &mut self,
        hold: &NativeHold,
        duration: Duration,
        each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        let mut misses = 0;
        let send = |client: &mut Self| {
            let sent = client.native(hold.axis, hold.epoch, hold.data.clone(), hold.ttl);
            client.forgive(sent.map(drop), &mut misses)
        };
        self.renew(hold.ttl, duration, send, each_round)
    }

    /// Sends at least [`RENEWALS_PER_TTL`] times within `ttl`.
    fn renew(
        &mut self,
        ttl: Duration,
        duration: Duration,
        mut send: impl FnMut(&mut Self) -> Result<(), ClientError>,
        mut each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        let end = self.now().saturating_add(duration);
        let period = (ttl / RENEWALS_PER_TTL).min(KEEP_ALIVE_AFTER);
        while self.now() < end {
            let next_round = self.now() + period;
            send(self)?;
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

    /// Takes what missed its time for done, unless it is one too many in a row.
    fn forgive(&mut self, sent: Result<(), ClientError>, misses: &mut u32) -> Result<(), ClientError> {
        match sent {
            Ok(()) => *misses = 0,
            Err(error) if *misses < MISSES && is_miss(&error) => {
                *misses += 1;
                self.measure_clock_anew()?;
            }
            Err(error) => return Err(error),
        }
        Ok(())
    }
}

/// Whether a setpoint only came at the wrong time, by what was known of the gateway's clock or by what another host had asked
/// of the motor, or got lost.
fn is_miss(error: &ClientError) -> bool {
    matches!(
        error,
        ClientError::NoAnswer { .. }
            | ClientError::Gateway(
                Error::Stale { .. }
                    | Error::Busy { .. }
                    | Error::OutOfRange { quantity: Quantity::Expiry, .. }
            )
    )
}
