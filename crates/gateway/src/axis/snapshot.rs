//! An axis in a snapshot.

use super::Axis;
use serde::{Serialize, Serializer};

impl Axis {
    /// Into how many pieces a snapshot divides an axis.
    pub const PIECES: usize = 4;

    /// One of them. All, one behind the other, are what its `Deserialize` reads.
    pub fn piece<S: Serializer>(&self, piece: usize, to: S) -> Result<S::Ok, S::Error> {
        let Self {
            index,
            config,
            state,
            cycling,
            part,
            job,
            transactions,
            silence,
            faults_unread,
            run_time_unread,
            state_poll_at,
            poll_index,
            watched,
            measured,
            angle,
            motor_timeout,
            written_timeout_ms,
            told_motor,
            off_is_assumed,
            heard_at,
            run_time,
            restarts_until,
            restart_owed,
            given_up_at,
            write_waits,
            first_stop,
            evidence,
            is_unsaved,
            row_was_told,
            telemetry,
        } = self;
        match piece {
            // It is used.
            0 => to.serialize_some(&(index, config)),
            1 => (state, cycling, part, job).serialize(to),
            2 => {
                let unread = (faults_unread, run_time_unread);
                let polls = (state_poll_at, poll_index, watched);
                (transactions, silence, unread, polls, measured).serialize(to)
            }
            _ => {
                let told = (written_timeout_ms, told_motor, off_is_assumed);
                let timeout = (motor_timeout, told, heard_at, run_time);
                let restart = (restarts_until, restart_owed, given_up_at);
                let flags = (restart, write_waits, first_stop);
                let rest = (evidence, is_unsaved, row_was_told);
                (angle, timeout, flags, rest, telemetry).serialize(to)
            }
        }
    }
}
