//! A link in a snapshot.

use super::Link;
use super::replies::Replies;
use serde::{Serialize, Serializer};

impl Link {
    /// Into how many pieces a snapshot divides a link.
    pub(crate) const PIECES: usize = Replies::PIECES + 2;

    /// One of them. All, one behind the other, are what its `Deserialize` reads.
    pub(crate) fn piece(&self, piece: usize) -> impl Serialize {
        Piece { link: self, piece }
    }
}

struct Piece<'a> {
    link: &'a Link,
    piece: usize,
}

/// In the order of the fields.
impl Serialize for Piece<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Link { deframer, replies, events, last_valid_us, subscription, baud } = self.link;
        let Some(behind) = self.piece.checked_sub(1) else { return deframer.serialize(to) };
        match replies.piece(behind) {
            Some(reply) => reply.serialize(to),
            None => (replies.rest(), events, last_valid_us, subscription, baud).serialize(to),
        }
    }
}
