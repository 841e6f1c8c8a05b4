//! Frames in a stream of bytes, of a framing as simple as can be.

use codec::{Deframer, Framing};
use codec_testing::{check_deframer, deframed};

const HEADER: u8 = 0xA5;

/// `A5`, two bytes, their sum.
#[derive(Debug, Clone)]
struct Summed;

impl Framing<4> for Summed {
    fn begins_frame(bytes: &[u8]) -> bool {
        match bytes {
            [HEADER, one, two, sum, ..] => one.wrapping_add(*two) == *sum,
            [] | [HEADER, ..] => true,
            _ => false,
        }
    }
}

#[test]
fn frames_are_found_whole_and_in_time() {
    check_deframer(Deframer::<Summed, 4>::new, [HEADER, 1, 2, 3], [HEADER, 0xFF, 1, 0]);
}

/// Bytes without a header are dropped at once; a header among the data of what was no frame
/// begins the next.
#[test]
fn the_window_goes_on_where_a_frame_may_begin() {
    let new = Deframer::<Summed, 4>::new;
    let frame = [HEADER, 1, 2, 3];
    let deframer = deframed(new(), &[&[0, 1, HEADER, 7], &frame], [frame]);
    assert_eq!((deframer.rejected(), deframer.pending()), (4, 0));
    let deframer = deframed(new(), &[&[HEADER; 3], &frame], [frame]);
    assert_eq!((deframer.rejected(), deframer.pending()), (3, 0));
    let deframer = deframed(new(), &[&[HEADER, 1, 2, 4]], []);
    assert_eq!((deframer.rejected(), deframer.pending()), (4, 0));
}
