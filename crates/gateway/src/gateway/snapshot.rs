//! The whole state as bytes: a core that goes on from them does what this one would have done, to
//! the microsecond.
//!
//! Left out is what follows from the rest: the board, the tables of the protocols, and the words
//! that are kept so that nothing is searched. And what whoever takes snapshots asks of a gateway.

use crate::axis::{Axis, Is};
use crate::gateway::Gateway;
use crate::gateway::names::Names;
use crate::gateway::requests::Draft;
use crate::history::History;
use crate::link::{Link, Links};
use crate::port::Board;
use crate::set::Set;
use crate::{MAX_AXES, MAX_BUSES, MAX_LINKS};
use core::ops::Range;
use host_protocol::Trip;
use serde::{Serialize, Serializer};

/// No snapshot takes more bytes.
pub const MAX_SNAPSHOT: usize = 64 * 1024;

/// Why no gateway goes on from a snapshot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResumeError {
    /// The bytes are none of this build: too few, or of another layout.
    Unreadable,
    /// It is one of a board with other buses.
    OtherBoard,
}

/// A part of a snapshot: the parts one behind the other are the whole. Whoever may not work on a
/// whole one in one piece writes them one by one.
#[derive(Clone, Copy)]
pub struct Part<'a> {
    gateway: &'a Gateway,
    index: usize,
}

impl<'a> Part<'a> {
    /// The first of an axis, bus and link, each behind what a snapshot has before them.
    const AXES: usize = 1;
    pub(super) const BUSES: usize = Self::AXES + MAX_AXES * Axis::PIECES + 1;
    const RING: usize = Self::BUSES + MAX_BUSES;
    const LINKS: usize = Self::RING + Links::RING_PIECES + 1;
    const HISTORY: usize = Self::LINKS + MAX_LINKS * Link::PIECES;
    const DRAFT: usize = Self::HISTORY + History::PIECES;
    pub(super) const STORED: usize = Self::DRAFT + Draft::PIECES;
    pub(super) const IMAGE: usize = Self::STORED + 1;
    const NAMES: usize = Self::IMAGE + 1;
    const REST: usize = Self::NAMES + Names::PIECES;
    /// How many there are; that of a bus which the board lacks is empty.
    pub const COUNT: usize = Self::REST + 1;
    /// Those that each call changes: they go last into a copy.
    pub const LAST: [usize; 4] = [0, Self::BUSES - 1, Self::LINKS - 1, Self::REST];

    /// Each in its order, when [`Gateway::next_deadline`] has worked out what the next event would
    /// have to.
    pub fn of(gateway: &'a Gateway, index: usize) -> Option<Self> {
        (index < Self::COUNT).then_some(Self { gateway, index })
    }

    /// The bytes of one that is never [to be copied](Gateway::next_to_copy): an axis that is as it
    /// was made, or a bus that there is none.
    #[must_use]
    pub fn of_nothing(index: usize) -> &'static [u8] {
        const NO_AXIS: &[u8] = &[0];
        if Self::axis_that_begins(index).is_some() { NO_AXIS } else { &[] }
    }

    /// Those of an axis.
    pub(super) const fn of_axis(axis: usize) -> Range<usize> {
        let first = Self::AXES + axis * Axis::PIECES;
        first..first + Axis::PIECES
    }

    /// The axis of which this is the first piece.
    pub(super) fn axis_that_begins(index: usize) -> Option<usize> {
        let at = index.checked_sub(Self::AXES).filter(|at| at.is_multiple_of(Axis::PIECES))?;
        Some(at / Axis::PIECES).filter(|axis| *axis < MAX_AXES)
    }

    /// The link of which this is the first piece.
    pub(super) fn link_that_begins(index: usize) -> Option<usize> {
        let at = index.checked_sub(Self::LINKS).filter(|at| at.is_multiple_of(Link::PIECES))?;
        Some(at / Link::PIECES).filter(|link| *link < MAX_LINKS)
    }

    /// Those of what has happened.
    pub(super) const OF_RING: Range<usize> = Self::RING..Self::LINKS - 1;
    pub(super) const OF_HISTORY: Range<usize> = Self::HISTORY..Self::DRAFT;
    pub(super) const OF_DRAFT: Range<usize> = Self::DRAFT..Self::STORED;
    pub(super) const OF_NAMES: Range<usize> = Self::NAMES..Self::REST;

    /// The one with this number alone.
    pub(super) const fn alone(index: usize) -> Range<usize> {
        index..index + 1
    }

    /// Those of a link.
    pub(super) const fn of_link(link: usize) -> Range<usize> {
        let first = Self::LINKS + link * Link::PIECES;
        first..first + Link::PIECES
    }
}

/// In the order of the fields of [`Gateway`], as its `Deserialize` reads them.
impl Serialize for Part<'_> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        const AXES_END: usize = Part::BUSES - 1;
        const LINKS_HEAD: usize = Part::LINKS - 1;
        let Gateway { axes, buses, links, history, draft, stored, image, names, .. } = self.gateway;
        match self.index {
            0 => axes.head().serialize(to),
            index @ Part::AXES..AXES_END => {
                let piece = (index - Part::AXES) % Axis::PIECES;
                match axes.used((index - Part::AXES) / Axis::PIECES) {
                    Some(axis) => axis.piece(piece, to),
                    None if piece == 0 => to.serialize_none(),
                    None => to.serialize_unit(),
                }
            }
            AXES_END => buses.len().serialize(to),
            index @ Part::BUSES..Part::RING => match buses.get(index - Part::BUSES) {
                Some(bus) => bus.serialize(to),
                None => to.serialize_unit(),
            },
            index @ Part::RING..LINKS_HEAD => links.ring.piece(index - Part::RING, to),
            LINKS_HEAD => links.head().serialize(to),
            index @ Part::LINKS..Part::HISTORY => {
                match links.get((index - Part::LINKS) / Link::PIECES) {
                    Some(link) => link.piece((index - Part::LINKS) % Link::PIECES, to),
                    None => to.serialize_unit(),
                }
            }
            index @ Part::HISTORY..Part::DRAFT => history.piece(index - Part::HISTORY, to),
            index @ Part::DRAFT..Part::STORED => draft.piece(index - Part::DRAFT, to),
            Part::STORED => stored.serialize(to),
            Part::IMAGE => image.serialize(to),
            index @ Part::NAMES..Part::REST => names.piece(index - Part::NAMES, to),
            _ => self.gateway.rest().serialize(to),
        }
    }
}

impl Gateway {
    /// What each call may change.
    fn rest(&self) -> impl Serialize {
        let Self {
            board: _,
            axes: _,
            buses: _,
            links: _,
            history: _,
            draft: _,
            stored: _,
            image: _,
            names: _,
            authority,
            epoch,
            e_stopped,
            unstopped,
            e_stop_input_open,
            enabled,
            link_lost,
            starts,
            together,
            arming,
            cycle,
            running,
            retention,
            flight_reading,
            now,
            latest,
            touched_buses,
            first_bus_due: _,
            unwatched_buses,
            changed_buses,
            crowded_buses,
        } = self;
        (
            (authority, epoch, e_stopped, unstopped, e_stop_input_open, enabled, link_lost, starts),
            (together, arming, cycle, running, retention, flight_reading),
            (now, latest, touched_buses, unwatched_buses, changed_buses, crowded_buses),
        )
    }

    /// Writes a snapshot to `out`, and returns the bytes that it takes; `None` where they are more.
    ///
    /// It is taken between two calls, and settles what the next one would have: this gateway goes
    /// on as the one that [resumes](Self::resume).
    pub fn snapshot<'a>(&mut self, out: &'a mut [u8]) -> Option<&'a [u8]> {
        self.next_deadline();
        let mut length = 0;
        for part in (0..Part::COUNT).filter_map(|index| Part::of(self, index)) {
            length += postcard::to_slice(&part, out.get_mut(length..)?).ok()?.len();
        }
        out.get(..length)
    }

    /// The gateway of a snapshot, on a board with the same buses and links, and the bytes behind
    /// the snapshot. It must be one of the same build: another may lay it out otherwise.
    ///
    /// # Errors
    /// See [`ResumeError`].
    pub fn resume<'a>(
        board: &'static Board,
        bytes: &'a [u8],
    ) -> Result<(Self, &'a [u8]), ResumeError> {
        let (mut gateway, behind) =
            postcard::take_from_bytes::<Self>(bytes).map_err(|_| ResumeError::Unreadable)?;
        let Self { axes, buses, links, now, .. } = &mut gateway;
        if axes.iter().len() != MAX_AXES || links.len() != MAX_LINKS {
            return Err(ResumeError::Unreadable);
        }
        if buses.len() != board.buses.len() {
            return Err(ResumeError::OtherBoard);
        }
        axes.attach(*now);
        for (bus, port) in buses.iter_mut().zip(board.buses) {
            bus.attach(*port);
        }
        links.attach(board);
        gateway.board = board;
        Ok((gateway, behind))
    }

    /// Whose ports run the buses of `other` goes on with this core, which is
    /// [resumed](Self::resume): nothing is started anew for that alone, and each is asked again.
    pub fn run_as(&mut self, other: &Self) {
        for (index, (bus, running)) in self.buses.iter_mut().zip(&other.buses).enumerate() {
            bus.runs_as(running);
            self.changed_buses.add(Set::of(index));
        }
    }

    /// Whether no port holds a frame of it.
    #[must_use]
    pub fn has_nothing_out(&self) -> bool {
        self.buses.iter().all(|bus| bus.nothing_in_flight())
    }

    /// The axes that are arming, armed, active or stopping, as of the latest event.
    #[must_use]
    pub fn moving(&self) -> Set {
        self.axes.which(Is::Moving).without(self.tripped())
    }

    /// Those of them that are not stopping.
    #[must_use]
    pub fn armed(&self) -> Set {
        self.axes.which(Is::Moving).without(self.axes.which(Is::Stopping))
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
