//! Pointers from C. The functions of this library state what callers promise of them.

use std::ffi::{CStr, c_char};
use std::slice;

use crate::error::Failure;

/// A text.
///
/// # Safety
/// `text` is null or a text with a zero behind it that nobody changes meanwhile.
pub(crate) unsafe fn text<'a>(text: *const c_char) -> Result<Option<&'a str>, Failure> {
    if text.is_null() {
        return Ok(None);
    }
    // Safety: as promised.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(Some).map_err(|_| Failure::argument("the text is no UTF-8"))
}

/// Elements that are read, `most` of them at most: none is looked at where there are more.
///
/// # Safety
/// `first` is null or the first of so many that nobody changes meanwhile.
pub(crate) unsafe fn elements<'a, T>(
    first: *const T,
    count: usize,
    most: usize,
    what: &str,
) -> Result<&'a [T], Failure> {
    match count {
        0 => Err(Failure::argument(format!("{what}: 1 at least"))),
        _ if count > most => {
            Err(Failure::argument(format!("{what}: {count} are too many, {most} at most")))
        }
        _ if first.is_null() => Err(Failure::argument(format!("{what}: the pointer is null"))),
        // Safety: as promised.
        _ => Ok(unsafe { slice::from_raw_parts(first, count) }),
    }
}

/// Writes a result, where it is wanted.
///
/// # Safety
/// `place` is null or a place for it that nobody else uses meanwhile.
pub(crate) unsafe fn put<T>(place: *mut T, value: T) {
    if !place.is_null() {
        // Safety: as promised.
        unsafe { place.write(value) }
    }
}
