//! A few bytes of a long encoding, which needs no memory for the others.

use postcard::ser_flavors::Flavor;
use serde::Serialize;

/// Writes what comes behind `skip` bytes, as far as there is room, and counts all.
struct Window<'a> {
    skip: usize,
    out: &'a mut [u8],
    count: usize,
}

impl Flavor for Window<'_> {
    type Output = usize;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        let begin = self.skip.saturating_sub(self.count);
        let at = (self.count + begin).saturating_sub(self.skip);
        copy(bytes, begin, self.out.get_mut(at..).unwrap_or_default());
        self.count += bytes.len();
        Ok(())
    }

    fn finalize(self) -> postcard::Result<usize> {
        Ok(self.count)
    }
}

/// Writes bytes of an encoding from `offset` on; how many it has in all.
pub fn encode(value: &impl Serialize, offset: usize, out: &mut [u8]) -> usize {
    let window = Window { skip: offset, out, count: 0 };
    postcard::serialize_with_flavor(value, window).unwrap_or_default()
}

/// The same of bytes that are there.
pub fn copy(bytes: &[u8], offset: usize, out: &mut [u8]) -> usize {
    for (to, from) in out.iter_mut().zip(bytes.get(offset..).unwrap_or_default()) {
        *to = *from;
    }
    bytes.len()
}
