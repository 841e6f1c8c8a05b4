//! Tests of `history.rs`.

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
    assert_eq!((starts(&second).as_slice(), second.next), (&[11, 10, 9, 8, 7, 6, 5, 4][..], None));
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
    let restored =
        History::restored(|index| saved.get(index).filter(|_| index < 4).map(|words| &words[..]));
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
