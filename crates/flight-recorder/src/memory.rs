//! Where everything lies in the memory.

use gateway::Instant;
use host_protocol::{CHECKSUM, Trip};

/// Bytes before the halves, for the trip.
const TRIP_AREA: usize = 128;
/// What a memory, and a file of it, begins with.
const MARK: [u8; 4] = *b"MGFR";
/// Mark, length and checksum of the trip.
const TRIP_HEAD: usize = 4 + 2 + 4;
/// Number, since when, lengths of board, snapshot and calls, checksum.
const HEAD: usize = 4 + 8 + 4 + 4 + 4 + 4;
/// Where in the head the length of the calls stands: it changes with each call, and the checksum
/// leaves it out.
const CALLS_AT: usize = 20;

/// What the head of a half says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Head {
    /// Counts the halves that were begun; one that is no successor of the one before begins anew.
    pub number: u32,
    pub since: Instant,
    /// Bytes of each.
    pub board: usize,
    pub snapshot: usize,
    pub calls: usize,
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|word| u32::from_le_bytes(*word))
}

fn length(bytes: &[u8], at: usize) -> Option<usize> {
    word(bytes, at).and_then(|length| usize::try_from(length).ok())
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    if let Some(place) = at.checked_add(value.len()).and_then(|end| bytes.get_mut(at..end)) {
        place.copy_from_slice(value);
    }
}

fn put_length(bytes: &mut [u8], at: usize, length: usize) {
    put(bytes, at, &u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
}

/// Of what the checksum of a half is made: the head without the calls and itself, board, snapshot.
fn checksum(half: &[u8], contents: usize) -> Option<u32> {
    let mut digest = CHECKSUM.digest();
    digest.update(half.get(..CALLS_AT)?);
    digest.update(half.get(HEAD..)?.get(..contents)?);
    Some(digest.finalize())
}

/// A half of the memory.
pub fn half(memory: &[u8], index: usize) -> &[u8] {
    let halves = memory.get(TRIP_AREA..).unwrap_or_default();
    let (first, second) = halves.split_at(halves.len() / 2);
    if index == 0 { first } else { second }
}

pub fn half_mut(memory: &mut [u8], index: usize) -> &mut [u8] {
    let halves = memory.get_mut(TRIP_AREA..).unwrap_or_default();
    let (first, second) = halves.split_at_mut(halves.len() / 2);
    if index == 0 { first } else { second }
}

/// What follows the head.
pub fn contents(half: &[u8]) -> &[u8] {
    half.get(HEAD..).unwrap_or_default()
}

pub fn contents_mut(half: &mut [u8]) -> &mut [u8] {
    half.get_mut(HEAD..).unwrap_or_default()
}

/// The head of a half, if all that it says is there.
pub fn head(half: &[u8]) -> Option<Head> {
    let since = u64::from_le_bytes(*half.get(4..)?.first_chunk()?);
    let head = Head {
        number: word(half, 0)?,
        since: Instant::from_micros(since),
        board: length(half, 12)?,
        snapshot: length(half, 16)?,
        calls: length(half, CALLS_AT)?,
    };
    let fixed = head.board.checked_add(head.snapshot)?;
    contents(half).get(..fixed.checked_add(head.calls)?)?;
    (word(half, CALLS_AT + 4)? == checksum(half, fixed)?).then_some(head)
}

/// Writes the head of a half whose board and snapshot are written.
pub fn put_head(half: &mut [u8], head: &Head) {
    put(half, 0, &head.number.to_le_bytes());
    put(half, 4, &head.since.as_micros().to_le_bytes());
    put_length(half, 12, head.board);
    put_length(half, 16, head.snapshot);
    put_calls(half, head.calls);
    let checksum = checksum(half, head.board + head.snapshot).unwrap_or_default();
    put(half, CALLS_AT + 4, &checksum.to_le_bytes());
}

/// A call has been written behind the others: it counts from here on.
pub fn put_calls(half: &mut [u8], calls: usize) {
    put_length(half, CALLS_AT, calls);
}

/// Whether a memory was written at all.
pub fn is_marked(memory: &[u8]) -> bool {
    memory.starts_with(&MARK)
}

/// Moves what a memory holds together, as a file is to have it; its length then.
pub fn trim(memory: &mut [u8]) -> usize {
    let used = |index| {
        head(half(memory, index)).map_or(0, |head| HEAD + head.board + head.snapshot + head.calls)
    };
    let each = used(0).max(used(1));
    let second = TRIP_AREA + half(memory, 0).len();
    let end = TRIP_AREA + 2 * each;
    if end <= memory.len() {
        memory.copy_within(second..second + each, TRIP_AREA + each);
    }
    end.min(memory.len())
}

/// The axis that tripped first, and its trip, of a recorder's memory; without reading the rest.
pub fn trip(memory: &[u8]) -> Option<(u8, Trip)> {
    whole_trip(memory).flatten()
}

/// The same; `None` where it is damaged.
pub fn whole_trip(memory: &[u8]) -> Option<Option<(u8, Trip)>> {
    let length = usize::from(u16::from_le_bytes(*memory.get(4..)?.first_chunk()?));
    let trip = memory.get(TRIP_HEAD..TRIP_AREA)?.get(..length)?;
    if word(memory, 6)? != CHECKSUM.checksum(trip) {
        return None;
    }
    if trip.is_empty() { Some(None) } else { postcard::from_bytes(trip).ok().map(Some) }
}

/// What a file of a memory ends with: the checksum of all before it.
pub fn file_checksum(memory: &[u8]) -> [u8; 4] {
    CHECKSUM.checksum(memory).to_le_bytes()
}

/// Writes a trip, or that there is none.
pub fn put_trip(memory: &mut [u8], trip: Option<(u8, Trip)>) {
    let Some(area) = memory.get_mut(..TRIP_AREA) else { return };
    area.fill(0);
    put(area, 0, &MARK);
    let Some(trip) = trip else {
        put(area, 6, &CHECKSUM.checksum(&[]).to_le_bytes());
        return;
    };
    let place = area.get_mut(TRIP_HEAD..).unwrap_or_default();
    let Ok(written) = postcard::to_slice(&trip, place) else { return };
    let (length, checksum) = (written.len(), CHECKSUM.checksum(written));
    put(area, 4, &u16::try_from(length).unwrap_or_default().to_le_bytes());
    put(area, 6, &checksum.to_le_bytes());
}
