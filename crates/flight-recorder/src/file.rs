//! What a file of a recorder begins with.
//!
//! | from byte | |
//! |---|---|
//! | 0 | `MGFR` |
//! | 4 | [`Head`] |
//! | then | the calls of the first half, those of the second, the copy of the core at the beginning of the first, that of the second |
//! | last | four bytes: checksum of all before |

use crate::board::RecordedBoard;
use gateway::Instant;
use heapless::Vec;
use host_protocol::{CHECKSUM, Trip};
use serde::{Deserialize, Serialize};

/// What a file begins with.
pub const MARK: [u8; 4] = *b"MGFR";

/// What a file has, and how much of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Head<'a> {
    /// The first axis that tripped, and its trip.
    pub trip: Option<(u8, Trip)>,
    /// The halves, the older one first.
    pub halves: Vec<HalfHead, 2>,
    #[serde(borrow)]
    pub board: RecordedBoard<'a>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct HalfHead {
    /// When the copy was made.
    pub since: Instant,
    /// Bytes of calls.
    pub calls: u32,
}

/// What a file ends with.
pub fn checksum(file: &[u8]) -> [u8; 4] {
    CHECKSUM.checksum(file).to_le_bytes()
}
