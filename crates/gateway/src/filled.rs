//! Arrays made of what may be shorter.

/// What an iterator gives, as much as there is room for, and zeros behind it.
pub(crate) fn filled<T: Copy + Default, const N: usize>(
    values: impl IntoIterator<Item = T>,
) -> [T; N] {
    let mut array = [T::default(); N];
    array.iter_mut().zip(values).for_each(|(place, value)| *place = value);
    array
}
