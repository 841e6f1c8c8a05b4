//! Finds frames in a stream of bytes.

use core::marker::PhantomData;

/// How the frames of a line look, all of `LEN` bytes.
pub trait Framing<const LEN: usize> {
    /// Whether a frame stands at the start of these bytes or may still come to stand there: true of
    /// no bytes, and of `LEN` bytes or more only if the first `LEN` are a whole, valid frame.
    fn begins_frame(bytes: &[u8]) -> bool;
}

/// Finds whole, valid frames of `LEN` bytes in the bytes of a line.
///
/// It keeps one window of `LEN` bytes. When what it holds cannot be a frame, it goes on with the
/// next byte inside the window where one may begin, so no frame behind garbage is lost or comes
/// late.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = ""))]
pub struct Deframer<F: Framing<LEN>, const LEN: usize> {
    #[cfg_attr(feature = "serde", serde(with = "serde_big_array::BigArray"))]
    window: [u8; LEN],
    len: usize,
    rejected: u32,
    framing: PhantomData<F>,
}

impl<F: Framing<LEN>, const LEN: usize> Deframer<F, LEN> {
    /// An empty deframer.
    pub const fn new() -> Self {
        Deframer { window: [0; LEN], len: 0, rejected: 0, framing: PhantomData }
    }

    /// Takes the next byte of the line; yields the frame that it completes.
    #[inline]
    pub fn push(&mut self, byte: u8) -> Option<[u8; LEN]> {
        if let Some(place) = self.window.get_mut(self.len) {
            *place = byte;
            self.len += 1;
        }
        if !self.begins_frame_at(0) {
            self.drop_to_next_beginning();
        }
        if self.len < LEN {
            return None;
        }
        self.len = 0;
        Some(self.window)
    }

    /// Takes bytes of the line; yields each frame they complete. A byte is taken only when the
    /// iterator reaches it: run it to its end.
    pub fn push_slice<'a>(&'a mut self, bytes: &'a [u8]) -> impl Iterator<Item = [u8; LEN]> + 'a {
        bytes.iter().filter_map(|byte| self.push(*byte))
    }

    /// Drops a frame begun, as after a pause on the line; its bytes count as rejected.
    pub fn reset(&mut self) {
        self.count_rejected(self.len);
        self.len = 0;
    }

    /// Bytes held of a frame begun, fewer than `LEN`.
    pub fn pending(&self) -> usize {
        self.len
    }

    /// Bytes dropped since creation because no frame began with them; stays at its end value.
    pub fn rejected(&self) -> u32 {
        self.rejected
    }

    /// Whether what the window holds from a place on is a frame or can still become one.
    fn begins_frame_at(&self, start: usize) -> bool {
        self.window.get(start..self.len).is_some_and(F::begins_frame)
    }

    /// Drops the first byte and all others before the next one with which a frame may begin.
    fn drop_to_next_beginning(&mut self) {
        let dropped = (1..self.len).find(|start| self.begins_frame_at(*start)).unwrap_or(self.len);
        // Not `rotate_left`: its check of the distance stays in an image built for size, as a
        // panic.
        let mut kept = [0; LEN];
        for (place, byte) in kept.iter_mut().zip(self.window.iter().skip(dropped)) {
            *place = *byte;
        }
        self.window = kept;
        self.len -= dropped;
        self.count_rejected(dropped);
    }

    fn count_rejected(&mut self, bytes: usize) {
        self.rejected = self.rejected.saturating_add(u32::try_from(bytes).unwrap_or(u32::MAX));
    }
}

impl<F: Framing<LEN>, const LEN: usize> Default for Deframer<F, LEN> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever is not empty is no frame.
    #[derive(Debug, Clone)]
    struct Nothing;

    impl Framing<4> for Nothing {
        fn begins_frame(bytes: &[u8]) -> bool {
            bytes.is_empty()
        }
    }

    #[test]
    fn the_count_of_rejected_bytes_stays_at_its_end_value() {
        let mut deframer = Deframer::<Nothing, 4> { rejected: u32::MAX - 1, ..Deframer::new() };
        assert_eq!(deframer.push_slice(&[0, 0, 0]).count(), 0);
        assert_eq!(deframer.rejected(), u32::MAX);
    }
}
