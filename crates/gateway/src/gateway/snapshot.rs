//! The whole state as bytes: a core that goes on from them does what this one would have done, to
//! the microsecond.
//!
//! Left out is what follows from the rest: the board, the tables of the protocols, and the words
//! that are kept so that nothing is searched. And what whoever takes snapshots asks of a gateway.

use crate::axis::Is;
use crate::bus::Bus;
use crate::gateway::Gateway;
use crate::link::Link;
use crate::port::Board;
use crate::set::Set;
use crate::{MAX_AXES, MAX_BUSES, MAX_LINKS};
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
    /// How many there are; that of a bus which the board lacks is empty.
    pub const COUNT: usize = 4 + MAX_AXES + MAX_BUSES + MAX_LINKS;

    /// Each in its order, when [`Gateway::next_deadline`] has worked out what the next event would
    /// have to.
    pub fn of(gateway: &'a Gateway, index: usize) -> Option<Self> {
        (index < Self::COUNT).then_some(Self { gateway, index })
    }
}

/// What is not there has no bytes.
struct Maybe<T>(Option<T>);

impl<T: Serialize> Serialize for Maybe<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0 {
            Some(value) => value.serialize(serializer),
            None => serializer.serialize_unit(),
        }
    }
}

/// In the order of the fields of [`Gateway`], as its `Deserialize` reads them.
impl Serialize for Part<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        const AXES: usize = 1;
        const AXES_END: usize = AXES + MAX_AXES;
        const BUSES: usize = AXES_END + 1;
        const BUSES_END: usize = BUSES + MAX_BUSES;
        const LINKS: usize = BUSES_END + 1;
        const LINKS_END: usize = LINKS + MAX_LINKS;
        let Gateway { axes, buses, links, .. } = self.gateway;
        match self.index {
            0 => axes.head().serialize(serializer),
            index @ AXES..AXES_END => Maybe(axes.get(index - AXES)).serialize(serializer),
            AXES_END => buses.len().serialize(serializer),
            index @ BUSES..BUSES_END => Maybe(buses.get(index - BUSES)).serialize(serializer),
            BUSES_END => links.head().serialize(serializer),
            index @ LINKS..LINKS_END => Maybe(links.get(index - LINKS)).serialize(serializer),
            _ => self.gateway.rest().serialize(serializer),
        }
    }
}

impl Gateway {
    /// What is neither an axis nor a bus nor a link.
    fn rest(&self) -> impl Serialize {
        let Self {
            board: _,
            axes: _,
            buses: _,
            links: _,
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
            history,
            retention,
            draft,
            stored,
            image,
            flight_reading,
            names,
            now,
            latest,
            touched_buses,
            unwatched_buses,
            changed_buses,
            crowded_buses,
            served_buses,
        } = self;
        (
            (authority, epoch, e_stopped, unstopped, e_stop_input_open, enabled, link_lost, starts),
            (together, arming, cycle, running, history, retention, draft, stored, image),
            (flight_reading, names),
            (now, latest, touched_buses, unwatched_buses, changed_buses, crowded_buses),
            served_buses,
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
        links.each(board, Link::attach);
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
        self.buses.iter().all(Bus::has_nothing_out)
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
