//! Which motor was told its own timeout, as far as its answers tell: the firmware and the model of
//! a motor that keeps its timeout without power (GUARANTEES G1).

use super::state::State;
use super::{Axis, JobKind};
use crate::measured::Versions;
use crate::protocol::{self, Exchange};
use crate::time::Instant;
use host_protocol::{CHECKSUM, Error};
use serde::{Deserialize, Serialize};

/// The read that tells the model, or its first part.
const MODEL: u8 = 1;

/// What is kept of the answers: a digest of a few bits, which share a word with the timeout.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Identity(u32);

impl Identity {
    /// It has told nothing.
    pub const UNKNOWN: Self = Self(0);
    /// So many bits of the word above the timeout.
    pub const BITS: u32 = 14;

    /// The same, and one more answer.
    fn and(self, answer: &[u8]) -> Self {
        let digest = CHECKSUM.checksum(answer) ^ self.0.rotate_left(1);
        Self(Self::folded(digest))
    }

    const fn folded(digest: u32) -> u32 {
        (digest ^ digest >> Self::BITS ^ digest >> (2 * Self::BITS)) & ((1 << Self::BITS) - 1)
    }

    pub const fn bits(self) -> u32 {
        self.0
    }

    pub const fn of_bits(bits: u32) -> Self {
        Self(bits & ((1 << Self::BITS) - 1))
    }
}

impl Axis {
    /// Which of the reads that tell the version an answer belongs to: the model is asked as one of
    /// them, and when the axis is armed the answer counts with those before.
    pub(super) fn version_told(&self, exchange: Exchange) -> Option<u8> {
        match exchange {
            Exchange::Version(read) => Some(read),
            Exchange::Identity(MODEL) if matches!(self.state, State::Arming) => Some(MODEL),
            _ => None,
        }
    }

    /// The motor has answered a step of the job.
    pub(super) fn note_identity(&mut self, exchange: Exchange, versions: Versions, data: &[u8]) {
        if let Exchange::Identity(_) = exchange
            && let Some(job) = &mut self.job
        {
            job.identity = job.identity.and(data);
            job.model_goes_on |= protocol::is_part_of_model(versions);
        }
    }

    /// Whether the job passes over a read that tells which motor it is: there is nothing to compare
    /// it with, or the model was told as a whole.
    pub(super) fn needs_no_identity(&self, read: u8) -> bool {
        self.job.as_ref().is_some_and(|job| {
            let arms = matches!(job.kind, JobKind::Arm { .. });
            arms && !self.keeps_what_it_was_told() || read > MODEL && !job.model_goes_on
        })
    }

    /// Arming needs a known timeout. What another motor than the one that answers was told tells
    /// nothing of its own.
    pub(super) fn check_told_timeout(&mut self, now: Instant) -> Result<(), Error> {
        let answers = self.job.as_ref().map_or(Identity::UNKNOWN, |job| job.identity);
        if self.keeps_what_it_was_told() && answers != self.told_motor {
            self.forget_motor_timeout();
        }
        self.check_motor_timeout(now)
    }
}
