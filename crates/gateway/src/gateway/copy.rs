//! What of a gateway's memory has changed, for whoever copies it while it goes on: a copy in one
//! piece takes longer than a stop may wait.
//!
//! Axes and links are copied one by one, and again where a call has changed one meanwhile; when none
//! is left, what remains is copied with the last one, and the copy is what the gateway is then. A
//! gateway owns no other memory and needs no end, so its bytes, and they alone, are the copy.

use super::Gateway;
use crate::set::Set;
use core::ops::Range;
use core::ptr::from_ref;

/// Bytes of a gateway, counted from its first.
type Bytes = Range<usize>;

impl Gateway {
    /// A copy begins: nothing has been copied.
    pub fn begin_copy(&mut self) {
        *self.axes.stale() = first(self.axes.iter().len());
        *self.links.stale() = first(self.links.len());
    }

    /// An axis or a link that may have changed since its bytes were given before; `None` where
    /// there is none, and the [rest](Self::rest_to_copy) completes the copy.
    pub fn next_to_copy(&mut self) -> Option<Bytes> {
        if let Some(index) = take_one(self.axes.stale()) {
            return self.axes.get(index).map(|axis| self.bytes_of(axis));
        }
        let index = take_one(self.links.stale())?;
        self.links.get(index).map(|link| self.bytes_of(link))
    }

    /// Whether there is one.
    pub fn has_more_to_copy(&mut self) -> bool {
        !self.axes.stale().is_empty() || !self.links.stale().is_empty()
    }

    /// Everything but the axes and the links.
    pub fn rest_to_copy(&self) -> [Bytes; 3] {
        let mut taken =
            [self.bytes_of_all(self.axes.iter().as_slice()), self.bytes_of_all(&self.links)];
        if taken[1].start < taken[0].start {
            taken.swap(0, 1);
        }
        let [first, second] = taken;
        [0..first.start, first.end..second.start, second.end..size_of::<Self>()]
    }

    fn bytes_of<T>(&self, part: &T) -> Bytes {
        self.bytes_of_all(core::slice::from_ref(part))
    }

    fn bytes_of_all<T>(&self, parts: &[T]) -> Bytes {
        let start = parts.as_ptr().addr() - from_ref(self).addr();
        start..start + size_of_val(parts)
    }
}

fn first(count: usize) -> Set {
    (0..count).fold(Set::NONE, |set, index| set.with(Set::of(index)))
}

fn take_one(set: &mut Set) -> Option<usize> {
    let one = set.lowest();
    set.put(one, false);
    one.into_iter().next()
}
