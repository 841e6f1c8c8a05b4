//! The whole state as bytes: a core that goes on from them does what this one would have done, to
//! the microsecond.
//!
//! Left out is what follows from the rest: the board, the tables of the protocols, and the words
//! that are kept so that nothing is searched. And what whoever takes snapshots asks of a gateway.

use crate::axis::Is;
use crate::gateway::Gateway;
use crate::port::Board;
use crate::set::Set;
use crate::{MAX_AXES, MAX_LINKS};
use host_protocol::Trip;

/// No snapshot takes more bytes.
pub const MAX_SNAPSHOT: usize = 64 * 1024;

/// Why no gateway goes on from a snapshot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResumeError {
    /// The bytes are none of this build: too few, too many, or of another layout.
    Unreadable,
    /// It is one of a board with other buses.
    OtherBoard,
}

impl Gateway {
    /// Writes a snapshot to `out`, and returns the bytes that it takes; `None` where they are more.
    ///
    /// It is taken between two calls, and settles what the next one would have: this gateway goes
    /// on as the one that [resumes](Self::resume).
    pub fn snapshot<'a>(&mut self, out: &'a mut [u8]) -> Option<&'a [u8]> {
        self.next_deadline();
        postcard::to_slice(self, out).ok().map(|taken| &*taken)
    }

    /// The gateway of a snapshot, on a board with the same buses and links. The bytes must be those
    /// that a [snapshot](Self::snapshot) of the same build wrote: a build may lay them out
    /// otherwise.
    ///
    /// # Errors
    /// See [`ResumeError`].
    pub fn resume(board: &'static Board, snapshot: &[u8]) -> Result<Self, ResumeError> {
        let (mut gateway, behind) =
            postcard::take_from_bytes::<Self>(snapshot).map_err(|_| ResumeError::Unreadable)?;
        let Self { axes, buses, links, now, .. } = &mut gateway;
        if !behind.is_empty() || axes.iter().len() != MAX_AXES || links.len() != MAX_LINKS {
            return Err(ResumeError::Unreadable);
        }
        if buses.len() != board.buses.len() {
            return Err(ResumeError::OtherBoard);
        }
        axes.attach(*now);
        for (bus, port) in buses.iter_mut().zip(board.buses) {
            bus.attach(*port);
        }
        for (link, port) in links.iter_mut().zip(board.links) {
            link.attach(port.bauds);
        }
        gateway.board = board;
        Ok(gateway)
    }

    /// The axes that are arming, armed, active or stopping, as of the latest event.
    #[must_use]
    pub fn moving(&self) -> Set {
        self.axes.which(Is::Moving).without(self.tripped())
    }

    /// The axes that have tripped and have not been cleared, as of the latest event.
    #[must_use]
    pub fn tripped(&self) -> Set {
        self.axes.which(Is::Tripped)
    }

    /// The trips of those of these axes that have tripped.
    pub fn trips(&self, axes: Set) -> impl Iterator<Item = (u8, Trip)> {
        self.axes.of(axes).filter_map(|axis| Some((axis.index, axis.tripped()?)))
    }

    /// The board that it runs on.
    #[must_use]
    pub const fn board(&self) -> &'static Board {
        self.board
    }
}
