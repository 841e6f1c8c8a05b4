//! Byte positions and limits of the eight data bytes.

/// Every request and reply has eight data bytes, on CAN and on RS485 (RMD V3.6 §1.1.2, §1.2.2).
pub const DATA_LEN: usize = 8;

/// Lowest acceleration of 0x42 and 0x43, dps/s (RMD V3.6 §2.4.3, §2.5.1).
pub(crate) const ACCELERATION_MIN: u32 = 100;
/// Highest acceleration of 0x42 and 0x43, dps/s (RMD V3.6 §2.4.3, §2.5.1).
pub(crate) const ACCELERATION_MAX: u32 = 60_000;

/// The `N` data bytes from byte `AT` on.
///
/// A position outside the data does not compile, so reading and writing cannot fail.
#[derive(Clone, Copy)]
pub(crate) struct Field<const AT: usize, const N: usize>;

impl<const AT: usize, const N: usize> Field<AT, N> {
    const FITS: () = assert!(AT + N <= DATA_LEN);

    pub(crate) fn get(self, data: &[u8; DATA_LEN]) -> [u8; N] {
        let () = Self::FITS;
        data.get(AT..).and_then(<[u8]>::first_chunk).copied().unwrap_or([0; N])
    }

    pub(crate) fn put(self, data: &mut [u8; DATA_LEN], bytes: [u8; N]) {
        let () = Self::FITS;
        if let Some(place) = data.get_mut(AT..).and_then(<[u8]>::first_chunk_mut) {
            *place = bytes;
        }
    }
}
