//! Where each slot lies among the retained words.

use super::slot::Slot;
use super::states::STATES_WORDS;
use super::{AXIS_WORDS, BUS_WORDS};
use crate::history::{INCIDENT_WORDS, INCIDENTS};
use crate::{MAX_AXES, MAX_BUSES};

/// Slots in all.
pub(super) const SLOTS: usize = 1 + MAX_AXES + MAX_BUSES + INCIDENTS;

const AXES_AT: usize = Slot::words(STATES_WORDS);
const BUSES_AT: usize = AXES_AT + MAX_AXES * Slot::words(AXIS_WORDS);
const INCIDENTS_AT: usize = BUSES_AT + MAX_BUSES * Slot::words(BUS_WORDS);

/// Words that outlive a reset, of 32 bits.
pub const RETAINED_WORDS: usize = INCIDENTS_AT + INCIDENTS * Slot::words(INCIDENT_WORDS);

/// A slot by what it is for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    /// The states.
    States,
    /// The configuration of an axis, and what was written to its motor.
    Axis(usize),
    /// The configuration of a bus.
    Bus(usize),
    /// A place of the history.
    Incident(usize),
}

impl Place {
    /// Its number among all slots.
    pub const fn index(self) -> usize {
        match self {
            Self::States => 0,
            Self::Axis(axis) => 1 + axis,
            Self::Bus(bus) => 1 + MAX_AXES + bus,
            Self::Incident(place) => 1 + MAX_AXES + MAX_BUSES + place,
        }
    }

    /// Where it lies.
    pub const fn slot(self) -> Slot {
        let (first, nth, payload) = match self {
            Self::States => (0, 0, STATES_WORDS),
            Self::Axis(axis) => (AXES_AT, axis, AXIS_WORDS),
            Self::Bus(bus) => (BUSES_AT, bus, BUS_WORDS),
            Self::Incident(place) => (INCIDENTS_AT, place, INCIDENT_WORDS),
        };
        Slot { at: first + nth * Slot::words(payload), payload }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_lie_side_by_side_and_fill_the_memory() {
        let places = core::iter::once(Place::States)
            .chain((0..MAX_AXES).map(Place::Axis))
            .chain((0..MAX_BUSES).map(Place::Bus))
            .chain((0..INCIDENTS).map(Place::Incident));
        let mut next = 0;
        for (index, place) in places.enumerate() {
            assert_eq!((place.index(), place.slot().at), (index, next));
            next += Slot::words(place.slot().payload);
        }
        assert_eq!(next, RETAINED_WORDS);
    }
}
