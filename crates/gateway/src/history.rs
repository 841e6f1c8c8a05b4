//! The last trips and starts (GUARANTEES G8).

use crate::each::Each;
use crate::filled::filled;
use crate::set::Set;
use host_protocol::replies::{IncidentPage, MAX_INCIDENTS};
use host_protocol::{Incident, MaxSize, TripReason, Vec};
use serde::{Deserialize, Serialize, Serializer};

/// Incidents remembered.
pub(crate) const INCIDENTS: usize = 16;

const WORD: usize = size_of::<u32>();
/// Words of an incident as they are kept over a reset: its ordinal number, then its postcard bytes.
pub(crate) const INCIDENT_WORDS: usize = 1 + Incident::MAX_SIZE.div_ceil(WORD);

/// A ring; the place of an incident follows from its ordinal number.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct History {
    incidents: [Option<Incident>; INCIDENTS],
    /// The ordinal number of the next.
    next: u32,
    /// Places that have not been saved.
    unsaved: Set,
}

impl History {
    /// Into how many pieces a snapshot divides it.
    pub const PIECES: usize = 2;

    /// A piece of it in a snapshot. All, one behind the other, are what its `Deserialize` reads.
    pub fn piece<S: Serializer>(&self, piece: usize, to: S) -> Result<S::Ok, S::Error> {
        const LAST: usize = History::PIECES - 1;
        const THESE: usize = INCIDENTS.div_ceil(History::PIECES);
        let History { incidents, next, unsaved } = self;
        let these = Each(|| incidents.iter().skip(piece * THESE).take(THESE));
        match piece {
            LAST => (these, next, unsaved).serialize(to),
            _ => these.serialize(to),
        }
    }

    pub const fn new() -> Self {
        Self { incidents: [None; INCIDENTS], next: 0, unsaved: Set::NONE }
    }

    /// What was saved, from the words of each place. One that a newer one should have replaced, and
    /// did not because the reset came between, is none of the last.
    pub fn restored<'a>(mut saved: impl FnMut(usize) -> Option<&'a [u32]>) -> Self {
        let known: [_; INCIDENTS] = core::array::from_fn(|index| {
            saved(index).and_then(from_words).filter(|(ordinal, _)| place(*ordinal) == index)
        });
        let next =
            known.iter().flatten().map(|(ordinal, _)| ordinal.saturating_add(1)).max().unwrap_or(0);
        let is_of_the_last =
            |(ordinal, _): &(u32, Incident)| next.abs_diff(*ordinal) as usize <= INCIDENTS;
        let incidents =
            known.map(|known| known.filter(is_of_the_last).map(|(_, incident)| incident));
        Self { incidents, next, unsaved: Set::NONE }
    }

    pub fn push(&mut self, incident: Incident) {
        let index = place(self.next);
        if let Some(slot) = self.incidents.get_mut(index) {
            *slot = Some(incident);
            self.unsaved.add(Set::of(index));
            self.next = self.next.saturating_add(1);
        }
    }

    /// How many are remembered.
    pub fn len(&self) -> u16 {
        self.latest_first().map(|_| 1).sum()
    }

    /// The next place to save, and its words: the oldest, so that a reset loses the latest only.
    pub fn take_unsaved(&mut self) -> Option<(usize, [u32; INCIDENT_WORDS])> {
        let oldest = place(self.next);
        let mut by_age = (0..INCIDENTS).map(|age| (oldest + age) % INCIDENTS);
        let index = by_age.find(|index| self.unsaved.has(*index))?;
        self.unsaved.put(Set::of(index), false);
        let incident = self.incidents.get(index)?.as_ref()?;
        Some((index, to_words(self.ordinal_of(index), incident)))
    }

    /// Has those of these places saved that hold something, and returns the others.
    pub fn save_again(&mut self, places: Set) -> Set {
        let held = |index: &usize| self.incidents.get(*index).is_some_and(Option::is_some);
        self.unsaved.add(places.into_iter().filter(held).collect());
        places.without(self.unsaved)
    }

    /// Whether there is more to save.
    pub fn has_unsaved(&self) -> bool {
        !self.unsaved.is_empty()
    }

    /// Why an axis tripped last.
    pub fn last_trip_of(&self, wanted: u8) -> Option<TripReason> {
        self.latest_first().find_map(|incident| match incident {
            Incident::Tripped { axis, trip, .. } if *axis == wanted => Some(trip.reason),
            _ => None,
        })
    }

    /// A part of the list, from `first` on; 0 is the latest.
    pub fn page(&self, first: u8) -> IncidentPage {
        let rest = || self.latest_first().skip(usize::from(first));
        let incidents: Vec<_, MAX_INCIDENTS> = rest().take(MAX_INCIDENTS).copied().collect();
        let more = rest().nth(MAX_INCIDENTS).is_some();
        let next = u8::try_from(usize::from(first) + incidents.len()).ok().filter(|_| more);
        IncidentPage { incidents, next }
    }

    fn latest_first(&self) -> impl Iterator<Item = &Incident> {
        (1..=INCIDENTS).filter_map(|back| {
            let ordinal = self.next.checked_sub(u32::try_from(back).ok()?)?;
            self.incidents.get(place(ordinal))?.as_ref()
        })
    }

    /// The ordinal number of what is in a place: the latest that belongs there.
    fn ordinal_of(&self, index: usize) -> u32 {
        let last = self.next.saturating_sub(1);
        let back = (place(last) + INCIDENTS - index) % INCIDENTS;
        last.saturating_sub(u32::try_from(back).unwrap_or(0))
    }
}

/// Where an incident lies.
fn place(ordinal: u32) -> usize {
    // Lossless: below INCIDENTS.
    #[allow(clippy::cast_possible_truncation)]
    let place = ordinal as usize % INCIDENTS;
    place
}

fn to_words(ordinal: u32, incident: &Incident) -> [u32; INCIDENT_WORDS] {
    let mut bytes = [0; (INCIDENT_WORDS - 1) * WORD];
    // It fits: MAX_SIZE is the bound of what postcard writes.
    let _ = postcard::to_slice(incident, &mut bytes);
    let (chunks, _) = bytes.as_chunks::<WORD>();
    filled(core::iter::once(ordinal).chain(chunks.iter().map(|c| u32::from_le_bytes(*c))))
}

fn from_words(words: &[u32]) -> Option<(u32, Incident)> {
    let (ordinal, words) = words.split_first()?;
    let bytes: Vec<u8, { (INCIDENT_WORDS - 1) * WORD }> =
        words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let (incident, _) = postcard::take_from_bytes(&bytes).ok()?;
    Some((*ordinal, incident))
}

#[cfg(test)]
#[path = "../tests/unit/history.rs"]
mod tests;
