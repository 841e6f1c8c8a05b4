//! A link in a snapshot.

use super::Link;
use serde::{Serialize, Serializer};

impl Link {
    /// Into how many pieces a snapshot divides a link.
    pub(crate) const PIECES: usize = 3;

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
        match self.piece {
            0 => deframer.serialize(to),
            1 => replies.serialize(to),
            _ => (events, last_valid_us, subscription, baud).serialize(to),
        }
    }
}
