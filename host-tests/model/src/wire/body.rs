//! The fields of a body (PROTOCOL.md, Bodies).

/// What is left of a body.
#[derive(Debug, Clone, Copy)]
pub struct Body<'a>(pub &'a [u8]);

impl<'a> Body<'a> {
    /// One byte.
    pub fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    /// A varint of at most `bits` bits.
    pub fn varint(&mut self, bits: u32) -> Option<u64> {
        let mut value = 0u64;
        for place in 0..bits.div_ceil(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7F).checked_shl(7 * place)?;
            if byte & 0x80 == 0 {
                let fits = bits == 64 || value >> bits == 0;
                return fits.then_some(value);
            }
        }
        None
    }

    /// A `u32`.
    pub fn u32(&mut self) -> Option<u32> {
        u32::try_from(self.varint(32)?).ok()
    }

    /// A `u32` of four bytes.
    pub fn fixed_u32(&mut self) -> Option<u32> {
        let (bytes, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u32::from_le_bytes(*bytes))
    }

    /// A `u16`.
    pub fn u16(&mut self) -> Option<u16> {
        u16::try_from(self.varint(16)?).ok()
    }

    /// An `f32`.
    pub fn f32(&mut self) -> Option<f32> {
        let (bytes, rest) = self.0.split_at_checked(4)?;
        self.0 = rest;
        Some(f32::from_le_bytes(bytes.try_into().ok()?))
    }

    /// A `bool`.
    pub fn bool(&mut self) -> Option<bool> {
        match self.byte()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }

    /// What may be missing.
    pub fn optional<T>(&mut self, read: impl FnOnce(&mut Self) -> Option<T>) -> Option<Option<T>> {
        if self.bool()? { read(self).map(Some) } else { Some(None) }
    }

    /// A list of bytes, at most `most`.
    pub fn bytes(&mut self, most: usize) -> Option<&'a [u8]> {
        let length = usize::try_from(self.varint(64)?).ok()?;
        if length > most {
            return None;
        }
        let (bytes, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(bytes)
    }

    /// `value` if nothing is left.
    pub fn end<T>(self, value: T) -> Option<T> {
        self.0.is_empty().then_some(value)
    }
}
