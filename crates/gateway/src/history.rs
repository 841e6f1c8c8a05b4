//! The last trips and starts (GUARANTEES G8).

use host_protocol::replies::{IncidentPage, MAX_INCIDENTS};
use host_protocol::{Incident, MaxSize, TripReason, Vec};

/// Incidents remembered.
pub(crate) const INCIDENTS: usize = 16;

const WORD: usize = size_of::<u32>();
/// Words of an incident as they are kept over a reset: its ordinal number, then its postcard bytes.
pub(crate) const INCIDENT_WORDS: usize = 1 + Incident::MAX_SIZE.div_ceil(WORD);

/// A ring; the place of an incident follows from its ordinal number.
#[derive(Debug, Clone)]
pub(crate) struct History {
    incidents: [Option<Incident>; INCIDENTS],
    /// The ordinal number of the next.
    next: u32,
    /// Places that have not been saved. Bit 0 is place 0.
    unsaved: u16,
}

const _: () = assert!(INCIDENTS <= u16::BITS as usize, "one bit for each place");

impl History {
    pub const fn new() -> Self {
        Self { incidents: [None; INCIDENTS], next: 0, unsaved: 0 }
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
        Self { incidents, next, unsaved: 0 }
    }

    pub fn push(&mut self, incident: Incident) {
        let index = place(self.next);
        if let Some(slot) = self.incidents.get_mut(index) {
            *slot = Some(incident);
            self.unsaved |= 1 << index;
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
        let index = by_age.find(|index| self.unsaved & (1 << index) != 0)?;
        self.unsaved &= !(1 << index);
        let incident = self.incidents.get(index)?.as_ref()?;
        Some((index, to_words(self.ordinal_of(index), incident)))
    }

    /// Has those of these places saved that hold something, and returns which these are. Bit 0 is
    /// place 0.
    pub fn save_again(&mut self, places: u32) -> u32 {
        let held = |index: &usize| self.incidents.get(*index).is_some_and(Option::is_some);
        let again = (0..INCIDENTS).filter(held).fold(0, |again, index| again | 1 << index) & places;
        self.unsaved |= u16::try_from(again).unwrap_or(0);
        again
    }

    /// Whether there is more to save.
    pub fn has_unsaved(&self) -> bool {
        self.unsaved != 0
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
    let mut words = [0; INCIDENT_WORDS];
    let (chunks, _) = bytes.as_chunks::<WORD>();
    for (word, value) in words
        .iter_mut()
        .zip(core::iter::once(ordinal).chain(chunks.iter().map(|c| u32::from_le_bytes(*c))))
    {
        *word = value;
    }
    words
}

fn from_words(words: &[u32]) -> Option<(u32, Incident)> {
    let (ordinal, words) = words.split_first()?;
    let bytes: Vec<u8, { (INCIDENT_WORDS - 1) * WORD }> =
        words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let (incident, _) = postcard::take_from_bytes(&bytes).ok()?;
    Some((*ordinal, incident))
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::{BootReason, Trip};

    fn started(start: u32) -> Incident {
        Incident::Started { start, boot: BootReason::Watchdog, has_crash_report: true }
    }

    fn tripped(axis: u8, reason: TripReason) -> Incident {
        let trip = Trip {
            reason,
            time_us: 5,
            velocity_rad_s: Some(1.5),
            position_rad: None,
            current_a: None,
            unreachable: false,
        };
        Incident::Tripped { start: 1, axis, trip }
    }

    fn save(history: &mut History, saved: &mut [[u32; INCIDENT_WORDS]; INCIDENTS]) {
        while let Some((index, words)) = history.take_unsaved() {
            saved[index] = words;
        }
    }

    /// Its ordinal number, then the bytes of the host protocol: a trip after start 1, axis 2,
    /// `MotorSilent`, 5 µs, 1.5 rad/s.
    #[test]
    fn the_words_of_an_incident_are_these() {
        let words = to_words(7, &tripped(2, TripReason::MotorSilent));
        assert_eq!(words[..4], [7, 0x0202_0101, 0x0000_0105, 0x0000_3FC0]);
        assert!(words[4..].iter().all(|word| *word == 0));
    }

    #[test]
    fn the_last_sixteen_are_told_from_the_latest_in_pages() {
        let mut history = History::new();
        assert_eq!(history.page(0), IncidentPage { incidents: Vec::new(), next: None });
        for start in 0..20 {
            history.push(started(start));
        }
        assert_eq!(history.len(), 16);
        let starts = |page: &IncidentPage| -> Vec<u32, 8> {
            page.incidents
                .iter()
                .map(|incident| match incident {
                    Incident::Started { start, .. } => *start,
                    Incident::Tripped { .. } => panic!("{incident:?}"),
                })
                .collect()
        };
        let (first, second) = (history.page(0), history.page(8));
        assert_eq!(
            (starts(&first).as_slice(), first.next),
            (&[19, 18, 17, 16, 15, 14, 13, 12][..], Some(8))
        );
        assert_eq!(
            (starts(&second).as_slice(), second.next),
            (&[11, 10, 9, 8, 7, 6, 5, 4][..], None)
        );
        assert!(history.page(16).incidents.is_empty());
        assert!(history.page(255).incidents.is_empty());
    }

    #[test]
    fn what_was_saved_comes_back_in_its_order_and_goes_on() {
        let mut history = History::new();
        let mut saved = [[0; INCIDENT_WORDS]; INCIDENTS];
        for start in 0..18 {
            history.push(started(start));
            history.push(tripped(3, TripReason::MotorFault { faults: 2 }));
            save(&mut history, &mut saved);
        }
        let mut restored = History::restored(|index| Some(&saved[index]));
        assert_eq!(restored.page(0), history.page(0));
        assert_eq!(restored.page(8), history.page(8));
        assert_eq!(restored.last_trip_of(3), Some(TripReason::MotorFault { faults: 2 }));
        assert_eq!(restored.last_trip_of(2), None);
        assert_eq!(restored.take_unsaved(), None);
        restored.push(started(99));
        assert_eq!(restored.page(0).incidents[0], started(99));
        assert_eq!(restored.page(0).incidents[1], history.page(0).incidents[0]);
    }

    #[test]
    fn a_place_that_cannot_be_read_is_left_out() {
        let mut history = History::new();
        let mut saved = [[0; INCIDENT_WORDS]; INCIDENTS];
        for start in 0..4 {
            history.push(started(start));
        }
        save(&mut history, &mut saved);
        saved[1] = [1, u32::MAX, u32::MAX, u32::MAX, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        saved[2][0] = 7; // An ordinal number that belongs elsewhere.
        let restored = History::restored(|index| {
            saved.get(index).filter(|_| index < 4).map(|words| &words[..])
        });
        assert_eq!(restored.page(0).incidents.as_slice(), [started(3), started(0)]);
    }

    #[test]
    fn a_reset_while_saving_loses_the_latest_and_brings_nothing_back_that_was_replaced() {
        let mut history = History::new();
        let mut saved = [[0; INCIDENT_WORDS]; INCIDENTS];
        for start in 0..31 {
            history.push(started(start));
        }
        save(&mut history, &mut saved);
        // Numbers 31 and 32 lie in the last place and the first.
        history.push(started(31));
        history.push(started(32));
        let older = history.take_unsaved().unwrap();
        let newer = history.take_unsaved().unwrap();
        assert_eq!((older.0, newer.0), (15, 0), "the oldest first");
        let after = |(index, words): (usize, [u32; INCIDENT_WORDS])| {
            let mut memory = saved;
            memory[index] = words;
            History::restored(|index| Some(&memory[index]))
        };
        assert_eq!(after(older).page(0).incidents[..2], [started(31), started(30)]);
        // The one before the latest could not be read: what it had replaced long ago is not in its
        // place.
        assert_eq!(after(newer).page(0).incidents[..2], [started(32), started(30)]);
        assert_eq!(after(newer).len(), 15);
    }
}
