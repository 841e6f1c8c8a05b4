//! Where everything lies among the retained words: a mark by which they are known to be ours, the
//! number of the slot that is being written, the slots.

use super::Store;
use super::slot::Slot;
use super::states::STATES_WORDS;
use super::{AXIS_WORDS, BUS_WORDS};
use crate::gateway::names::NAME_WORDS;
use crate::history::{INCIDENT_WORDS, INCIDENTS};
use crate::{MAX_AXES, MAX_BUSES};
use host_protocol::{AxisParameter, BusConfig, Incident, MaxSize, layout_of};

/// Slots in all.
pub(super) const SLOTS: usize = 1 + MAX_AXES + MAX_BUSES + INCIDENTS + 1;

/// What memory begins with that this layout was written to. Two words name it, so that the words of
/// another firmware count as none: they follow from the declarations. One word may be damaged:
/// memory that has lost its power does not have two of them by chance.
const MARK: [u32; 3] = [0x4D47_5752, LAYOUT, !LAYOUT];

/// Changed by hand where words get another meaning and every declaration stays as it is.
const MEANING: u32 = 6;

/// Names the words: how many slots there are of each kind, and what is in one.
const LAYOUT: u32 = layout_of(
    "slots: states, axes, buses, incidents, gateway",
    &[
        MEANING,
        count(STATES_WORDS),
        count(MAX_AXES),
        parameters(),
        count(MAX_BUSES),
        BusConfig::LAYOUT,
        count(INCIDENTS),
        Incident::LAYOUT,
        count(NAME_WORDS),
    ],
);

#[allow(clippy::cast_possible_truncation, reason = "words of a memory of some KiB")]
const fn count(words: usize) -> u32 {
    words as u32
}

/// The words of an axis: one for each parameter, by its number and the kind of its value.
const fn parameters() -> u32 {
    let mut layout = count(AXIS_WORDS);
    let mut rest = AxisParameter::ALL;
    while let [parameter, others @ ..] = rest {
        layout = layout_of(parameter.info().kind.name(), &[layout, parameter.number() as u32]);
        rest = others;
    }
    layout
}

/// Words of [`MARK`] that must be right.
const MARK_QUORUM: usize = 2;
/// Where the number of the slot that is being written lies, from 1; 0 while none is.
pub(super) const WRITING_AT: usize = MARK.len();

const STATES_AT: usize = WRITING_AT + 1;
const AXES_AT: usize = STATES_AT + Slot::words(STATES_WORDS);
const BUSES_AT: usize = AXES_AT + MAX_AXES * Slot::words(AXIS_WORDS);
const INCIDENTS_AT: usize = BUSES_AT + MAX_BUSES * Slot::words(BUS_WORDS);
const GATEWAY_AT: usize = INCIDENTS_AT + INCIDENTS * Slot::words(INCIDENT_WORDS);

/// Words that outlive a reset, of 32 bits.
pub const RETAINED_WORDS: usize = GATEWAY_AT + Slot::words(NAME_WORDS);

/// A slot by what it is for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    /// The states.
    States,
    /// The configuration of an axis, what was written to its motor, and its name.
    Axis(usize),
    /// The configuration of a bus, and its name.
    Bus(usize),
    /// A place of the history.
    Incident(usize),
    /// The name of the gateway.
    Gateway,
}

impl Place {
    /// Its number among all slots.
    pub const fn index(self) -> usize {
        match self {
            Self::States => 0,
            Self::Axis(axis) => 1 + axis,
            Self::Bus(bus) => 1 + MAX_AXES + bus,
            Self::Incident(place) => 1 + MAX_AXES + MAX_BUSES + place,
            Self::Gateway => SLOTS - 1,
        }
    }

    /// Its number while it is written.
    pub fn writing(self) -> u32 {
        u32::try_from(self.index() + 1).unwrap_or(u32::MAX)
    }

    /// Where it lies.
    pub const fn slot(self) -> Slot {
        let (first, nth, payload) = match self {
            Self::States => (STATES_AT, 0, STATES_WORDS),
            Self::Axis(axis) => (AXES_AT, axis, AXIS_WORDS),
            Self::Bus(bus) => (BUSES_AT, bus, BUS_WORDS),
            Self::Incident(place) => (INCIDENTS_AT, place, INCIDENT_WORDS),
            Self::Gateway => (GATEWAY_AT, 0, NAME_WORDS),
        };
        Slot { at: first + nth * Slot::words(payload), payload }
    }
}

/// Whether words were written in this layout.
pub(super) fn is_ours(words: &[u32]) -> bool {
    words.len() == RETAINED_WORDS
        && words.iter().zip(MARK).filter(|(word, mark)| **word == *mark).count() >= MARK_QUORUM
}

/// Makes words of any memory such that nothing is in them.
pub(super) fn clear(store: Store<'_>) {
    (0..RETAINED_WORDS).for_each(|index| store(index, 0));
}

/// Writes the mark.
pub(super) fn mark(store: Store<'_>) {
    MARK.iter().enumerate().for_each(|(index, word)| store(index, *word));
}

#[cfg(test)]
#[path = "../../../tests/unit/retained_layout.rs"]
mod tests;
