//! Which parts of a gateway have changed, for whoever copies it while it goes on: a copy in one
//! piece takes longer than a stop may wait.
//!
//! Parts are copied one by one, and again where a call has changed one meanwhile; when none is left,
//! those that each call changes are copied with the last one, and the copy is what the gateway is
//! then.

use super::Gateway;
use super::snapshot::Part;
use crate::set::Set;
use crate::tracked::Tracked;
use core::ops::Range;
use core::ptr::from_ref;

impl Gateway {
    /// A copy begins: nothing has been copied.
    pub fn begin_copy(&mut self) {
        self.axes.all_stale();
        self.links.stale = (0..self.links.len()).collect();
        self.tracked().for_each(|(_, is_stale)| *is_stale = true);
    }

    /// Parts that may have changed since they were given before, and may be copied one after the
    /// other, when [`next_deadline`](Self::next_deadline) has worked out what they have; `None`
    /// where there are none, and [those that each call changes](Part::LAST) complete the copy.
    pub fn next_to_copy(&mut self) -> Option<Range<usize>> {
        if let Some(axis) = take_one(&mut self.axes.stale) {
            return Some(Part::of_axis(axis));
        }
        if let Some((parts, is_stale)) = self.tracked().find(|(_, is_stale)| **is_stale) {
            *is_stale = false;
            return Some(parts);
        }
        take_one(&mut self.links.stale).map(Part::of_link)
    }

    /// Whether there are any.
    pub fn has_more_to_copy(&mut self) -> bool {
        !self.axes.stale.is_empty()
            || !self.links.stale.is_empty()
            || self.tracked().any(|(_, is_stale)| *is_stale)
    }

    /// The parts that are neither axes nor links, and whether they are stale.
    fn tracked(&mut self) -> impl Iterator<Item = (Range<usize>, &mut bool)> {
        let Self { buses, links, history, draft, stored, image, names, .. } = self;
        let buses = (Part::BUSES..).map(Part::alone).zip(buses.iter_mut().map(Tracked::stale));
        buses.chain([
            (Part::OF_RING, &mut links.is_ring_stale),
            (Part::OF_HISTORY, history.stale()),
            (Part::OF_DRAFT, draft.stale()),
            (Part::alone(Part::STORED), stored.stale()),
            (Part::alone(Part::IMAGE), image.stale()),
            (Part::OF_NAMES, names.stale()),
        ])
    }
}

/// Bytes of a gateway, counted from its first.
type Bytes = Range<usize>;

/// For whoever has room for the gateway as it lies in memory. It owns no other memory and needs no
/// end, so these bytes, and they alone, are another one.
impl Gateway {
    /// Those to be copied with a part: all of an axis or a link with its first, and what else there
    /// is with the last of all.
    pub fn bytes_of(&self, part: usize) -> [Bytes; 3] {
        let (axes, links) = (self.axes.iter().as_slice(), &*self.links);
        if let Some(axis) = Part::axis_that_begins(part) {
            return [self.bytes_at(axes.get(axis..=axis)), 0..0, 0..0];
        }
        if let Some(link) = Part::link_that_begins(part) {
            return [self.bytes_at(links.get(link..=link)), 0..0, 0..0];
        }
        if Part::LAST.last() != Some(&part) {
            return [0..0, 0..0, 0..0];
        }
        let mut taken = [self.bytes_at(Some(axes)), self.bytes_at(Some(links))];
        taken.sort_unstable_by_key(|bytes| bytes.start);
        let [first, second] = taken;
        [0..first.start, first.end..second.start, second.end..size_of::<Self>()]
    }

    fn bytes_at<T>(&self, elements: Option<&[T]>) -> Bytes {
        let Some(elements) = elements else { return 0..0 };
        let start = elements.as_ptr().addr() - from_ref(self).addr();
        start..start + size_of_val(elements)
    }
}

fn take_one(set: &mut Set) -> Option<usize> {
    let one = set.lowest();
    set.put(one, false);
    one.into_iter().next()
}
