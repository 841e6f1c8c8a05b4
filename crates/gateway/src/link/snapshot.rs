//! A link in a snapshot.

use super::Link;
use super::replies::Replies;
use serde::{Serialize, Serializer};

impl Link {
    /// Into how many pieces a snapshot divides a link.
    pub(crate) const PIECES: usize = Replies::PIECES + 2;

    /// One of them. All, one behind the other, are what its `Deserialize` reads.
    pub(crate) fn piece<S: Serializer>(&self, piece: usize, to: S) -> Result<S::Ok, S::Error> {
        let Self { deframer, replies, events, last_valid_us, subscription, baud } = self;
        let Some(behind) = piece.checked_sub(1) else { return deframer.serialize(to) };
        match replies.piece(behind) {
            Some(reply) => reply.serialize(to),
            None => (replies.rest(), events, last_valid_us, subscription, baud).serialize(to),
        }
    }
}
