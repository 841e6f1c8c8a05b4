//! What a flight recorder keeps of a trip is enough to do it all again: every scenario is played,
//! and then again from what was recorded of it.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::sync::{LazyLock, OnceLock};

use flight_recorder::{Recording, Unreadable};
use host_protocol::TripReason;
use host_tests::scenario;
use mgw_cli::flight::{Replayed, play};
use mgw_sim::FlightWiring;

/// The reasons that scenarios reach; not those of a start (`Reset`), which no armed axis has, of
/// the core's own mistakes (`Internal`), and of another axis's trip (`Group`), which is kept
/// instead.
const REASONS: [&str; 13] = [
    "BusOff",
    "CommandRefused",
    "EStop",
    "HostSilent",
    "LimitExceeded",
    "MotorFault",
    "MotorRestarted",
    "MotorSilent",
    "NotAcknowledged",
    "NotDelivered",
    "SetpointExpired",
    "StopUnconfirmed",
    "Uncommanded",
];

/// Of the first byte of a call: it has no time.
const SAME_TIME: u8 = 0x10;
/// What is no call.
const NO_CALL: u8 = 0x1E;

/// Where the calls of a half lie in a record.
fn calls(record: &[u8], half: usize) -> Range<usize> {
    let calls = Recording::read(record).unwrap().halves[half].bytes();
    let begin = calls.as_ptr().addr() - record.as_ptr().addr();
    begin..begin + calls.len()
}

fn text(name: &str) -> String {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenarios/{name}.txt"));
    std::fs::read_to_string(file).unwrap()
}

fn scenarios() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let texts = files.filter(|file| file.extension().is_some_and(|extension| extension == "txt"));
    texts.map(|file| file.file_stem().unwrap().to_string_lossy().into_owned()).collect()
}

/// What was recorded of a scenario, which is played once.
fn recorded(name: &str) -> &'static [u8] {
    static PLAYED: LazyLock<BTreeMap<String, OnceLock<Vec<u8>>>> =
        LazyLock::new(|| scenarios().into_iter().map(|name| (name, OnceLock::new())).collect());
    PLAYED[name].get_or_init(|| scenario::flight_recorder(&text(name), 1).unwrap())
}

/// `SetpointExpired`, without what it carries.
fn reason(reason: &TripReason) -> String {
    let text = format!("{reason:?}");
    text.split(|letter: char| !letter.is_alphanumeric()).next().unwrap().to_owned()
}

fn again(memory: &[u8]) -> Replayed {
    trips(memory).0
}

/// What led to the trip of a motor that does not tell its faults: one half, with room in it.
fn short() -> Vec<u8> {
    recorded("a_motor_that_answers_all_but_its_fault_word_trips").to_vec()
}

/// The record, with half of the calls of its first half gone.
fn cut(record: &[u8]) -> Vec<u8> {
    let mut cut = record.to_vec();
    let Range { start, end } = calls(record, 0);
    cut[start.midpoint(end)..end].fill(NO_CALL);
    cut
}

#[test]
fn every_trip_of_every_scenario_comes_again_at_the_same_microsecond() {
    let (mut reasons, mut switched) = (BTreeSet::new(), 0);
    for name in scenarios() {
        let memory = recorded(&name);
        let halves = match Recording::read(memory) {
            // Nothing was armed.
            Err(Unreadable::Nothing) => continue,
            recording => recording.unwrap().halves.len(),
        };
        let replayed = again(memory);
        assert!(replayed.is_same(), "{name}: {replayed:?}");
        if halves == 2 {
            switched += 1;
            let replayed = again(&cut(memory));
            assert!(replayed.diverged_us.is_some(), "{name}, cut: {replayed:?}");
        }
        reasons.extend(replayed.recorded.map(|(_, trip)| reason(&trip.reason)));
    }
    assert!(switched > 10, "{switched} recordings have two halves, whose states are compared");
    assert_eq!(reasons, REASONS.map(str::to_owned).into());
}

/// Bytes of each half on the NUCLEO-G474RE.
const SMALL: usize = 6_016;

/// Whether anything was kept, in one half or in two; then it is the same trip as with more memory.
fn kept_in(half: usize, turns: usize, name: &str) -> Option<usize> {
    let flight = FlightWiring { half, turns };
    let small = scenario::other_flight_recorder(&text(name), 1, flight).unwrap();
    let recording = match Recording::read(&small) {
        Err(Unreadable::Nothing) => return None,
        recording => recording.unwrap(),
    };
    // What was kept until there was no room any more led to no trip.
    recording.trip?;
    assert_eq!(recording.trip, Recording::read(recorded(name)).unwrap().trip, "{name}, {flight:?}");
    let replayed = again(&small);
    assert!(replayed.is_same(), "{name}, {flight:?}: {replayed:?}");
    Some(recording.halves.len())
}

/// A copy takes half of it.
#[test]
fn with_little_memory_less_is_kept_of_every_trip_and_it_comes_again_all_the_same() {
    let mut switched = 0;
    for name in scenarios() {
        let memory = recorded(&name);
        let has_trip = Recording::read(memory).is_ok_and(|recording| recording.trip.is_some());
        let kept = kept_in(SMALL, usize::MAX, &name);
        assert_eq!(kept.is_some(), has_trip, "{name}");
        switched += usize::from(kept == Some(2));
    }
    assert!(switched > 50, "{switched} recordings have two halves");
}

/// A gateway whose state has no room does what it does, and keeps nothing; where it grows out of
/// it, what has led to a trip stays.
#[test]
fn with_too_little_memory_nothing_is_kept_or_it_comes_again() {
    let mut some = 0;
    for name in scenarios().iter().step_by(10) {
        for half in [0, 2, 100, 500] {
            assert_eq!(kept_in(half, usize::MAX, name), None, "{name}, {half} bytes");
        }
        for half in (1_000..5_000).step_by(500) {
            some += usize::from(kept_in(half, usize::MAX, name).is_some());
        }
    }
    assert!(some > 20, "{some} were kept");
}

/// Wherever in a half it comes, and where the other one begins. (The simulator looks for trips after
/// each event: none fills a half before it is seen.)
#[test]
fn a_trip_is_kept_wherever_the_half_ends() {
    let name = "a_motor_that_answers_all_but_its_fault_word_trips";
    let halves = (2_000..4_400).step_by(8);
    let lost: Vec<usize> = halves.filter(|half| kept_in(*half, 64, name).is_none()).collect();
    assert!(lost.is_empty(), "{lost:?}");
}

/// A copy of which a few parts are made between two calls is the core all the same; one that does
/// not keep up with it is given up.
#[test]
fn a_copy_that_is_made_while_the_core_goes_on_is_whole_or_none() {
    let (mut some, mut none) = (0, 0);
    for name in scenarios().iter().step_by(6) {
        for turns in [4, 16, 32] {
            match kept_in(SMALL, turns, name) {
                Some(_) => some += 1,
                None => none += 1,
            }
        }
    }
    assert!(some > 10 && none > 10, "{some} were kept, {none} were not");
}

/// When which axes trip, as it is told; in which order at one instant is not compared.
fn trips(memory: &[u8]) -> (Replayed, Vec<(u64, String)>) {
    let mut trips = Vec::new();
    let replayed = play(&Recording::read(memory).unwrap(), |at, line| {
        if line.starts_with("axis ") {
            trips.push((at, line));
        }
    });
    trips.sort();
    (replayed.unwrap(), trips)
}

#[test]
fn no_axis_trips_otherwise_and_is_told_as_the_same() {
    let mut names = scenarios();
    names.sort();
    // One of several trips, with all that led to them in the first half.
    let found = names.iter().find_map(|name| {
        let memory = recorded(name);
        let halves = Recording::read(memory).ok()?.halves.len();
        let (replayed, recorded) = trips(memory);
        (halves == 1 && replayed.is_same() && recorded.len() > 2).then_some((memory, recorded))
    });
    let (memory, recorded) = found.expect("a scenario of several trips");
    // One bit of what led to it is another one, as if a core did otherwise.
    let Range { start: begin, end } = calls(memory, 0);
    let mut otherwise = 0;
    for at in (begin..end).step_by((end - begin) / 200 + 1) {
        let mut changed = memory.to_vec();
        changed[at] ^= 1 << (at % 8);
        let (replayed, trips) = trips(&changed);
        if trips != recorded {
            otherwise += 1;
            assert!(!replayed.is_same(), "byte {at}: {trips:?}");
        }
    }
    assert!(otherwise > 5, "{otherwise} changes had axes trip otherwise");
}

#[test]
fn a_file_that_is_damaged_anywhere_is_told_as_that() {
    let mut file = short();
    file.extend(Recording::checksum(&file));
    let read = |file: &[u8]| Recording::read_file(file).map(|recording| recording.trip);
    assert!(read(&file).unwrap().is_some());

    // Whatever happens to it: each bit of its head, one of each 97 bytes, its end, more behind it.
    let places = (0..200).chain((200..file.len()).step_by(97));
    let flips = places.flat_map(|at| [(at, 0x01), (at, 0x80)]);
    for (at, bit) in flips {
        let mut damaged = file.clone();
        damaged[at] ^= bit;
        let wanted = if at < 4 { Unreadable::Nothing } else { Unreadable::Damaged };
        assert_eq!(read(&damaged), Err(wanted), "byte {at}");
    }
    for length in (4..file.len()).step_by(997) {
        assert_eq!(read(&file[..length]), Err(Unreadable::Damaged), "{length} bytes");
    }
    assert_eq!(read(&[&file[..], &[0]].concat()), Err(Unreadable::Damaged));
}

#[test]
fn what_was_changed_is_not_taken_for_the_same() {
    let record = short();
    assert!(again(&record).is_same());
    let all = calls(&record, 0);
    let mut without_calls = record.clone();
    without_calls[all.clone()].fill(NO_CALL);
    let replayed = again(&without_calls);
    assert!(!replayed.is_same() && replayed.played.is_none(), "{replayed:?}");

    for nothing in [&[0; 4_096][..], &[]] {
        assert_eq!(Recording::read(nothing).err(), Some(Unreadable::Nothing));
    }
    // A core with bytes behind it is one of another build.
    let longer = [&record[..], &[0]].concat();
    assert!(play(&Recording::read(&longer).unwrap(), |_, _| {}).is_err());
    // A time that cannot be ends the calls.
    let mut late = record;
    late[all.start] &= !SAME_TIME;
    late[all.start + 1..][..10].fill(0xFF);
    assert_eq!(again(&late).calls, 0);
}
