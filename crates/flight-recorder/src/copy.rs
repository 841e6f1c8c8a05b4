//! A copy of a core at the beginning of a half: its parts, in the order in which they were copied.
//!
//! | bytes | |
//! |---|---|
//! | 1 | the part |
//! | 2 | how many bytes follow, the lower one first |
//! | … | its encoding, each run of zeros as a zero and the length of the run: most of it is zeros |

use gateway::Part;
use postcard::ser_flavors::Flavor;
use serde::Serialize;

/// Bytes before the encoding of a part.
const HEAD: usize = 3;

/// What was a part's bytes in a copy, until others took their place.
const NO_PART: u8 = u8::MAX;
/// Room for what such a part may grow by.
const ROOM: usize = 16;

/// Writes what comes behind `skip` bytes, as far as there is room, and counts all. That no byte fails
/// saves a branch behind each field: a tenth of the image.
struct Window<'a> {
    skip: usize,
    out: &'a mut [u8],
    count: usize,
}

impl Flavor for Window<'_> {
    type Output = usize;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        let at = self.count.wrapping_sub(self.skip);
        if let Some(place) = self.out.get_mut(at) {
            *place = byte;
        }
        self.count += 1;
        Ok(())
    }

    #[inline(never)]
    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        bytes.iter().try_for_each(|byte| self.try_push(*byte))
    }

    fn finalize(self) -> postcard::Result<usize> {
        Ok(self.count)
    }
}

/// Writes an encoding from `skip` on, as far as there is room; how many bytes it has in all.
pub fn encode(value: &impl Serialize, skip: usize, out: &mut [u8]) -> usize {
    let window = Window { skip, out, count: 0 };
    postcard::serialize_with_flavor(value, window).unwrap_or_default()
}

/// Writes what has room, each run of zeros as a zero and its length.
struct Packed<'a> {
    out: &'a mut [u8],
    /// Bytes that it takes, with those that have found no room.
    length: usize,
    /// Zeros in a row that came last.
    run: u8,
    /// Bytes that came.
    count: usize,
}

impl Packed<'_> {
    fn put(&mut self, byte: u8) {
        if let Some(place) = self.out.get_mut(self.length) {
            *place = byte;
        }
        self.length += 1;
    }

    #[inline(always)]
    fn push(&mut self, byte: u8) {
        self.count += 1;
        if byte != 0 {
            self.run = 0;
            return self.put(byte);
        }
        if matches!(self.run, 0 | u8::MAX) {
            self.run = 0;
            self.put(0);
        } else {
            self.length -= 1;
        }
        self.run += 1;
        self.put(self.run);
    }
}

// Not inlined: behind each field they would make a tenth of the image.
impl Flavor for Packed<'_> {
    /// Bytes that it takes, and bytes that came.
    type Output = (usize, usize);

    #[inline(never)]
    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.push(byte);
        Ok(())
    }

    #[inline(never)]
    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        bytes.iter().for_each(|byte| self.push(*byte));
        Ok(())
    }

    fn finalize(self) -> postcard::Result<(usize, usize)> {
        Ok((self.length, self.count))
    }
}

/// Writes an encoding without its zeros; how many bytes it takes so, and how many it has with them.
/// `None` where there is too little room.
fn pack(value: &impl Serialize, out: &mut [u8]) -> Option<(usize, usize)> {
    let room = out.len();
    let packed = Packed { out, length: 0, run: 0, count: 0 };
    postcard::serialize_with_flavor(value, packed).ok().filter(|(length, _)| *length <= room)
}

/// What a copy has of a part.
fn find(mut copy: &[u8], index: usize) -> Option<&[u8]> {
    loop {
        let ([part, low, high], rest) = copy.split_first_chunk()?;
        let (bytes, behind) = rest.split_at_checked(u16::from_le_bytes([*low, *high]).into())?;
        if usize::from(*part) == index {
            return Some(bytes);
        }
        copy = behind;
    }
}

/// Where the parts of a copy that is being made begin, counted from 1.
pub type Places = [u16; Part::COUNT];

/// Writes a part behind the `length` bytes of a copy, or in the place of what that has of it. Returns
/// the bytes of the copy, and of the encoding with its zeros; `None` where there is too little room.
pub fn put(
    half: &mut [u8],
    length: usize,
    places: &mut Places,
    index: usize,
    part: &impl Serialize,
) -> Option<(usize, usize)> {
    let (copy, free) = half.split_at_mut_checked(length)?;
    let (head, out) = free.split_first_chunk_mut()?;
    let (length, bytes) = pack(part, out)?;
    Some((put_packed(copy, (head, out), places, index, length)?, bytes))
}

/// The same of a part that lies packed where there is room.
fn put_packed(
    copy: &mut [u8],
    (head, out): (&mut [u8; HEAD], &mut [u8]),
    places: &mut Places,
    index: usize,
    mut length: usize,
) -> Option<usize> {
    let place = places.get_mut(index)?;
    if let Some(begin) = usize::from(*place).checked_sub(1) {
        let (head, before) = copy.get_mut(begin..)?.split_first_chunk_mut::<HEAD>()?;
        let [number, low, high] = head;
        let before = before.get_mut(..u16::from_le_bytes([*low, *high]).into())?;
        if let Some((before, behind)) = before.split_at_mut_checked(length) {
            before.copy_from_slice(out.get(..length)?);
            // Runs of no zeros.
            behind.fill(0);
            return Some(copy.len());
        }
        *number = NO_PART;
        out.get_mut(length..length + ROOM)?.fill(0);
        length += ROOM;
    }
    *place = u16::try_from(copy.len() + 1).ok()?;
    let [low, high] = u16::try_from(length).ok()?.to_le_bytes();
    *head = [u8::try_from(index).ok()?, low, high];
    Some(copy.len() + HEAD + length)
}

/// Writes the encoding of a part in a copy from `offset` on, as far as there is room; how many bytes
/// it has in all.
pub fn read(copy: &[u8], index: usize, offset: usize, out: &mut [u8]) -> usize {
    let Some(mut bytes) = find(copy, index) else {
        return self::copy(Part::of_nothing(index), offset, out);
    };
    let mut length = 0;
    while let [byte, rest @ ..] = bytes {
        let count = if *byte == 0 { rest.first().copied().map_or(0, usize::from) } else { 1 };
        bytes = if *byte == 0 { rest.get(1..).unwrap_or_default() } else { rest };
        for at in length..length + count {
            if let Some(place) = at.checked_sub(offset).and_then(|at| out.get_mut(at)) {
                *place = *byte;
            }
        }
        length += count;
    }
    length
}

/// The same of bytes as they are.
pub fn copy(bytes: &[u8], offset: usize, out: &mut [u8]) -> usize {
    for (to, from) in out.iter_mut().zip(bytes.get(offset..).unwrap_or_default()) {
        *to = *from;
    }
    bytes.len()
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use core::array::from_fn;
    use std::vec::Vec;

    const ROOM: usize = 2_048;

    /// A half, what a copy in it takes, and where its parts are.
    struct Made([u8; ROOM], usize, Places);

    impl Made {
        fn new() -> Self {
            Self([0xEE; ROOM], 0, [0; Part::COUNT])
        }

        fn put(&mut self, index: usize, part: &impl Serialize) -> bool {
            let Self(half, length, places) = self;
            let copied = put(half, *length, places, index, part);
            *length = copied.map_or(*length, |(length, _)| length);
            copied.is_some()
        }

        #[track_caller]
        fn has(&self, index: usize, bytes: &[u8]) {
            let Self(half, length, _) = self;
            let mut out = [0xAA; ROOM];
            assert_eq!(read(&half[..*length], index, 0, &mut out), bytes.len());
            assert_eq!(&out[..bytes.len()], bytes);
            // From any place on, and no more than there is room for.
            for offset in 0..=bytes.len() {
                let mut out = [0xAA; 3];
                assert_eq!(read(&half[..*length], index, offset, &mut out), bytes.len());
                let rest = &bytes[offset..(offset + 3).min(bytes.len())];
                assert_eq!(&out[..rest.len()], rest);
                assert!(out[rest.len()..].iter().all(|byte| *byte == 0xAA));
            }
        }
    }

    #[test]
    fn a_part_is_read_as_it_was_put() {
        let mut made = Made::new();
        let (zeros, mixed, none) = ([0_u8; 30], [7_u8, 0, 0, 0, 9, 0, 5, 0], ());
        assert!(made.put(3, &zeros) && made.put(1, &mixed) && made.put(2, &none));
        made.has(3, &zeros);
        made.has(1, &mixed);
        made.has(2, &[]);
        // Golden, of this module's layout: two runs of zeros, and one of a zero.
        assert_eq!(made.0[..made.1], [3, 2, 0, 0, 30, 1, 9, 0, 7, 0, 3, 9, 0, 1, 5, 0, 1, 2, 0, 0]);
    }

    #[test]
    fn long_runs_of_zeros_are_several() {
        let mut made = Made::new();
        let longest = [[0_u8; 32]; 16];
        assert!(made.put(0, &longest));
        made.has(0, &[0; 512]);
        assert_eq!(made.0[..made.1], [0, 6, 0, 0, 255, 0, 255, 0, 2]);
    }

    #[test]
    fn a_part_takes_the_place_of_what_it_was_before_or_another_one() {
        let mut made = Made::new();
        assert!(made.put(5, &[1_u8, 2, 3, 4]) && made.put(6, &[6_u8; 4]));
        let length = made.1;
        // Shorter, and as long: in its place.
        assert!(made.put(5, &[9_u8, 0, 0, 0]));
        made.has(5, &[9, 0, 0, 0]);
        assert!(made.put(5, &[4_u8, 3, 2, 1]));
        assert_eq!(made.1, length);
        made.has(5, &[4, 3, 2, 1]);
        // Longer: behind the others, with room for more.
        assert!(made.put(5, &[1_u8, 2, 3, 4, 5]));
        assert_eq!(made.1, length + HEAD + 5 + super::ROOM);
        let length = made.1;
        assert!(made.put(5, &[8_u8; 20]));
        assert_eq!(made.1, length);
        made.has(5, &[8; 20]);
        made.has(6, &[6; 4]);
    }

    #[test]
    fn what_has_no_room_is_refused_and_what_was_there_stays() {
        let mut made = Made::new();
        assert!(made.put(5, &[[1_u8; 32]; 24]));
        let before = made.0;
        assert!(!made.put(6, &[[[2_u8; 32]; 20]; 2]));
        // A zero takes two bytes where it is alone.
        assert!(!made.put(6, &[[[2_u8, 0]; 32]; 20]));
        assert!(!made.put(6, &[[[2_u8, 0]; 32]; 14]));
        made.has(5, &[1; 768]);
        assert_eq!(made.0[..made.1], before[..made.1]);
        assert!(made.put(6, &[[[2_u8; 32]; 13]; 3]));
        made.has(6, &[2; 1_248]);
    }

    #[test]
    fn zeros_are_taken_out_or_the_part_is_refused() {
        for pattern in (0_u32..1 << 24).step_by(97) {
            let bits: [u8; 24] = from_fn(|bit| u8::from(pattern >> bit & 1 == 1));
            let mut wanted = Vec::new();
            for run in bits.chunk_by(|one, next| one == next) {
                match run {
                    [0, ..] => wanted.extend([0, u8::try_from(run.len()).unwrap()]),
                    ones => wanted.extend(ones),
                }
            }
            for room in 0..=36 {
                let mut out = [0xEE; 36];
                let packed = pack(&bits, &mut out[..room]);
                assert_eq!(packed, Some((wanted.len(), 24)).filter(|_| wanted.len() <= room));
                if packed.is_some() {
                    assert_eq!(out[..wanted.len()], wanted);
                }
                assert!(out[room..].iter().all(|byte| *byte == 0xEE));
            }
        }
    }
}
