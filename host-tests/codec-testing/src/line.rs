//! What must hold of a deframer, whatever the framing.

use codec::{Deframer, Framing};

/// Pushes the parts in order, expects exactly these frames and returns the deframer after them.
#[track_caller]
pub fn deframed<F: Framing<LEN>, const LEN: usize, const N: usize>(
    mut deframer: Deframer<F, LEN>,
    parts: &[&[u8]],
    frames: [[u8; LEN]; N],
) -> Deframer<F, LEN> {
    let mut expected = frames.iter();
    for part in parts {
        for frame in deframer.push_slice(part) {
            assert_eq!(Some(&frame), expected.next());
        }
    }
    assert_eq!(expected.next(), None, "a frame was lost");
    deframer
}

/// Checks deframers made by `new` with two valid frames, neither of which holds a header byte but
/// its first and a valid frame when bit 4 of one of its bytes is flipped.
pub fn check_deframer<F: Framing<LEN>, const LEN: usize>(
    new: fn() -> Deframer<F, LEN>,
    request: [u8; LEN],
    reply: [u8; LEN],
) {
    back_to_back(new(), request, reply);
    a_frame_is_yielded_with_its_last_byte(new(), reply);
    a_cut_frame_does_not_cost_the_next(new, reply, request);
    a_damaged_byte_costs_one_frame(new, reply, request);
    reset_drops_a_frame_begun(new(), reply);
}

fn back_to_back<F: Framing<LEN>, const LEN: usize>(
    deframer: Deframer<F, LEN>,
    request: [u8; LEN],
    reply: [u8; LEN],
) {
    let deframer = deframed(deframer, &[&request, &reply, &request], [request, reply, request]);
    assert_eq!((deframer.rejected(), deframer.pending()), (0, 0));
}

fn a_frame_is_yielded_with_its_last_byte<F: Framing<LEN>, const LEN: usize>(
    mut deframer: Deframer<F, LEN>,
    frame: [u8; LEN],
) {
    let (last, begun) = frame.split_last().expect("a frame has bytes");
    for (count, byte) in begun.iter().enumerate() {
        assert_eq!(deframer.push(*byte), None);
        assert_eq!(deframer.pending(), count + 1);
    }
    assert_eq!(deframer.push(*last), Some(frame));
    assert_eq!(deframer.pending(), 0);
}

/// A frame cut short: the next one begins inside the window.
fn a_cut_frame_does_not_cost_the_next<F: Framing<LEN>, const LEN: usize>(
    new: fn() -> Deframer<F, LEN>,
    frame: [u8; LEN],
    next: [u8; LEN],
) {
    for cut in 1..LEN {
        let deframer = deframed(new(), &[&frame[..cut], &next], [next]);
        assert_eq!(deframer.rejected(), u32::try_from(cut).expect("small"), "cut after {cut}");
        assert_eq!(deframer.pending(), 0);
    }
}

fn a_damaged_byte_costs_one_frame<F: Framing<LEN>, const LEN: usize>(
    new: fn() -> Deframer<F, LEN>,
    frame: [u8; LEN],
    other: [u8; LEN],
) {
    for at in 0..LEN {
        let mut damaged = frame;
        damaged[at] ^= 0x10;
        let deframer = deframed(new(), &[&other, &damaged, &other], [other, other]);
        assert_eq!(deframer.rejected(), u32::try_from(LEN).expect("small"), "byte {at}");
    }
}

fn reset_drops_a_frame_begun<F: Framing<LEN>, const LEN: usize>(
    deframer: Deframer<F, LEN>,
    frame: [u8; LEN],
) {
    let begun = LEN / 2;
    let mut deframer = deframed(deframer, &[&frame[..begun]], []);
    deframer.reset();
    let rejected = u32::try_from(begun).expect("small");
    assert_eq!((deframer.rejected(), deframer.pending()), (rejected, 0));
    assert!(deframer.push_slice(&frame).eq([frame]));
    deframer.reset();
    assert_eq!(deframer.rejected(), rejected);
}
