//! Staying in command for a while: keeping the link alive, and keeping setpoints fresh.

use std::ops::ControlFlow;
use std::time::Duration;

use host_protocol::{Bytes, MAX_CAN_DATA, Setpoint};

use crate::client::Client;
use crate::error::ClientError;
use crate::stream::{Flow, Motion, RENEW_WITHIN, Stream};
use crate::transport::Transport;

/// The function called in each round of a hold is called this often.
const ROUND: Duration = RENEW_WITHIN;

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
    /// Keeps the link alive for `duration` with pings that wait for nothing. Calls `each_round`
    /// some 40 times a second; there the caller may read states and take events, and end the
    /// hold.
    ///
    /// # Errors
    /// [`ClientError::NoAnswer`] when no ping has been answered for a second, and those of
    /// `each_round`.
    pub fn hold(
        &mut self,
        duration: Duration,
        each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        self.stream(Vec::new(), duration, each_round)
    }

    /// Keeps setpoints in force for `duration`: a new one of each axis every tenth of the shortest
    /// TTL (not more often than every millisecond for each axis, nor less often than every 25
    /// ms), each with an expiry of its own, whether or not those before have been answered.
    /// Requests of `each_round`, which is called some 40 times a second, do not delay them; a pause
    /// in it that is not [`pause`](Self::pause) does.
    ///
    /// When it returns, nothing is sent any more: stop or disarm the axes, or they trip when the
    /// last setpoint expires.
    ///
    /// # Errors
    /// The gateway's refusal of a setpoint, and those of `each_round`. Setpoints that miss their
    /// time or stay unanswered are an error if the gateway has taken none of that axis for
    /// twice its TTL, 0.5 s at least and 2 s at most.
    pub fn hold_setpoints(
        &mut self,
        holds: &[Hold],
        duration: Duration,
        each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        let flow = |hold: &Hold| {
            Flow::new(hold.axis, hold.epoch, hold.ttl, Motion::Setpoint(hold.setpoint))
        };
        self.stream(holds.iter().map(flow).collect(), duration, each_round)
    }

    /// As [`hold_setpoints`](Self::hold_setpoints), for a native command that moves;
    /// [`native_reply`](Self::native_reply) is what the motor answers. Not for one that moves
    /// by a distance or starts what waits in the motor: each time it is sent it moves the motor
    /// anew.
    ///
    /// # Errors
    /// As [`hold_setpoints`](Self::hold_setpoints).
    pub fn hold_native(
        &mut self,
        hold: &NativeHold,
        duration: Duration,
        each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        let flow = Flow::new(hold.axis, hold.epoch, hold.ttl, Motion::Native(hold.data.clone()));
        self.stream(vec![flow], duration, each_round)
    }

    fn stream(
        &mut self,
        flows: Vec<Flow>,
        duration: Duration,
        each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        self.stream = Some(Stream::new(self.now(), flows));
        let held = self.rounds(duration, each_round);
        self.stream = None;
        held
    }

    fn rounds(
        &mut self,
        duration: Duration,
        mut each_round: impl FnMut(&mut Self) -> Round,
    ) -> Result<(), ClientError> {
        let end = self.now().saturating_add(duration);
        while self.now() < end {
            let next_round = self.now() + ROUND;
            self.pass_time(self.now())?;
            if each_round(self)?.is_break() {
                return Ok(());
            }
            self.pass_time(next_round.min(end))?;
            let now = self.now();
            // What a round has not told: sending has failed, or was interrupted.
            let Some(stream) = &mut self.stream else { return Err(self.ended_in_a_round()) };
            stream.check(now)?;
        }
        Ok(())
    }
}
