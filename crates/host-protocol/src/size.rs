//! How long a value can become in a body: the bound behind the assertion that every message fits
//! into [`MAX_MESSAGE`].
//!
//! [`MAX_MESSAGE`]: crate::MAX_MESSAGE

use crate::text::{Text, Vec};

/// The largest number of bytes that a value of this type takes in a postcard body.
pub trait MaxSize {
    /// Bytes.
    const MAX_SIZE: usize;
    /// A number that another declaration changes: the names, the order and the types of its fields
    /// and variants, and theirs in turn. What stores such values knows by it whether a value
    /// was stored by the same declaration.
    const LAYOUT: u32;
}

/// FNV-1a, 32 bits.
const FNV_OFFSET: u32 = 0x811C_9DC5;
const FNV_PRIME: u32 = 0x0100_0193;

/// A number for a declaration: its text, and the numbers of the types in it.
#[must_use]
pub const fn layout_of(text: &str, parts: &[u32]) -> u32 {
    let mut hash = FNV_OFFSET;
    let mut bytes = text.as_bytes();
    while let [byte, rest @ ..] = bytes {
        hash = (hash ^ *byte as u32).wrapping_mul(FNV_PRIME);
        bytes = rest;
    }
    let mut rest = parts;
    while let [part, others @ ..] = rest {
        hash = (hash ^ *part).wrapping_mul(FNV_PRIME);
        rest = others;
    }
    hash
}

/// A length among the numbers of [`layout_of`].
#[expect(clippy::cast_possible_truncation, reason = "lengths of messages")]
const fn length(count: usize) -> u32 {
    count as u32
}

/// Bits of payload in one byte of a postcard varint.
const VARINT_BITS: u32 = 7;

/// Bytes of the varint of `value`.
pub(crate) const fn varint_size(value: usize) -> usize {
    let bits = usize::BITS - value.leading_zeros();
    if bits == 0 { 1 } else { bits.div_ceil(VARINT_BITS) as usize }
}

/// The largest of `sizes`, 0 of none.
pub(crate) const fn largest(sizes: &[usize]) -> usize {
    let mut largest = 0;
    let mut rest = sizes;
    while let [first, others @ ..] = rest {
        if *first > largest {
            largest = *first;
        }
        rest = others;
    }
    largest
}

macro_rules! fixed_sizes {
    ($($type:ty: $size:expr),* $(,)?) => { $(impl MaxSize for $type {
            const MAX_SIZE: usize = $size;
            const LAYOUT: u32 = layout_of(stringify!($type), &[]);
        })* };
}

fixed_sizes! {
    bool: 1,
    u8: 1,
    u16: u16::BITS.div_ceil(VARINT_BITS) as usize,
    u32: u32::BITS.div_ceil(VARINT_BITS) as usize,
    u64: u64::BITS.div_ceil(VARINT_BITS) as usize,
    // Signed numbers are zigzag varints of the same width.
    i32: i32::BITS.div_ceil(VARINT_BITS) as usize,
    f32: size_of::<f32>(),
}

impl<T: MaxSize> MaxSize for Option<T> {
    const MAX_SIZE: usize = 1 + T::MAX_SIZE;
    const LAYOUT: u32 = layout_of("option", &[T::LAYOUT]);
}

impl<const N: usize> MaxSize for [u32; N] {
    const MAX_SIZE: usize = N * u32::MAX_SIZE;
    const LAYOUT: u32 = layout_of("array", &[u32::LAYOUT, length(N)]);
}

impl<const N: usize> MaxSize for [u8; N] {
    const MAX_SIZE: usize = N;
    const LAYOUT: u32 = layout_of("array", &[u8::LAYOUT, length(N)]);
}

impl<T: MaxSize, const N: usize> MaxSize for Vec<T, N> {
    const MAX_SIZE: usize = varint_size(N) + N * T::MAX_SIZE;
    const LAYOUT: u32 = layout_of("list", &[T::LAYOUT, length(N)]);
}

impl<const N: usize> MaxSize for Text<N> {
    const MAX_SIZE: usize = varint_size(N) + N;
    const LAYOUT: u32 = layout_of("text", &[length(N)]);
}

/// Defines types of the wire: the derives that all of them have, and [`MaxSize`] from the same list
/// of fields.
macro_rules! wire {
    () => {};
    (
        $(#[$meta:meta])*
        pub struct $name:ident { $($(#[$field_meta:meta])* pub $field:ident: $type:ty),* $(,)? }
        $($rest:tt)*
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $name { $(
            $(#[$field_meta])*
            #[doc = $crate::field_doc::field_doc!($field $(#[$field_meta])*)]
            pub $field: $type
        ),* }

        impl $crate::MaxSize for $name {
            const MAX_SIZE: usize = 0 $(+ <$type as $crate::MaxSize>::MAX_SIZE)*;
            const LAYOUT: u32 = $crate::size::layout_of(
                stringify!($name $($field)*),
                &[$(<$type as $crate::MaxSize>::LAYOUT),*],
            );
        }

        #[cfg(test)]
        impl $crate::largest::Largest for $name {
            fn largest() -> Self {
                Self { $($field: $crate::largest::Largest::largest()),* }
            }
        }

        $crate::size::wire! { $($rest)* }
    };
    (
        $(#[$meta:meta])*
        pub enum $name:ident {
            $(
                $(#[$variant_meta:meta])*
                $variant:ident
                $(($($inner:ty),+))?
                $({ $($(#[$field_meta:meta])* $field:ident: $type:ty),+ $(,)? })?
            ),+ $(,)?
        }
        $($rest:tt)*
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[serde(rename_all = "snake_case")]
        pub enum $name {
            $(
                $(#[$variant_meta])*
                $variant $(($($inner),+))? $({ $($(#[$field_meta])* $field: $type),+ })?
            ),+
        }

        impl $crate::MaxSize for $name {
            const MAX_SIZE: usize = {
                let variants = [
                    $(0 $($(+ <$inner as $crate::MaxSize>::MAX_SIZE)+)?
                        $($(+ <$type as $crate::MaxSize>::MAX_SIZE)+)?),+
                ];
                $crate::size::varint_size(variants.len() - 1) + $crate::size::largest(&variants)
            };
            const LAYOUT: u32 = $crate::size::layout_of(
                stringify!($name $($variant $(($($inner),+))? $({ $($field)+ })?)+),
                &[$(
                    $($(<$inner as $crate::MaxSize>::LAYOUT,)+)?
                    $($(<$type as $crate::MaxSize>::LAYOUT,)+)?
                )+],
            );
        }

        #[cfg(test)]
        impl $crate::largest::Largest for $name {
            fn largest() -> Self {
                $crate::largest::of_variants(&[$((
                    0 $($(+ <$inner as $crate::MaxSize>::MAX_SIZE)+)?
                        $($(+ <$type as $crate::MaxSize>::MAX_SIZE)+)?,
                    || Self::$variant
                        $(($(<$inner as $crate::largest::Largest>::largest()),+))?
                        $({ $($field: $crate::largest::Largest::largest()),+ })?,
                )),+])
            }
        }

        $crate::size::wire! { $($rest)* }
    };
}
pub(crate) use wire;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_varint_takes_one_byte_for_each_seven_bits() {
        let sizes = [(0, 1), (127, 1), (128, 2), (16_383, 2), (16_384, 3)];
        for (value, size) in sizes {
            assert_eq!(varint_size(value), size, "{value}");
        }
        assert_eq!((u16::MAX_SIZE, u32::MAX_SIZE, u64::MAX_SIZE, i32::MAX_SIZE), (3, 5, 10, 5));
    }

    #[test]
    fn another_declaration_has_another_layout() {
        mod first {
            crate::size::wire! {
                /// A.
                pub struct A { /// 1.
                    pub x: u8, /// 2.
                    pub y: u16 }
                /// B.
                pub enum B { /// 1.
                    P, /// 2.
                    Q { /// The value.
                        a: super::Inner } }
            }
        }
        mod second {
            crate::size::wire! {
                /// A.
                pub struct A { /// 2.
                    pub y: u16, /// 1.
                    pub x: u8 }
                /// B.
                pub enum B { /// 2.
                    Q { /// The value.
                        a: super::Inner }, /// 1.
                    P }
            }
        }
        assert_ne!(first::A::LAYOUT, second::A::LAYOUT);
        assert_ne!(first::B::LAYOUT, second::B::LAYOUT);
        // What a type is made of counts too.
        assert_ne!(layout_of("Q a", &[u8::LAYOUT]), layout_of("Q a", &[u16::LAYOUT]));
        assert_ne!(<Option<u8>>::LAYOUT, u8::LAYOUT);
        assert_ne!(<[u8; 2]>::LAYOUT, <[u8; 3]>::LAYOUT);
    }

    wire! {
        /// Inside of others.
        pub struct Inner {
            /// A value.
            pub value: u8,
        }
    }

    #[test]
    fn the_bounds_of_numbers_are_reached() {
        let mut out = [0; 16];
        assert_eq!(postcard::to_slice(&u16::MAX, &mut out).unwrap().len(), u16::MAX_SIZE);
        assert_eq!(postcard::to_slice(&u32::MAX, &mut out).unwrap().len(), u32::MAX_SIZE);
        assert_eq!(postcard::to_slice(&u64::MAX, &mut out).unwrap().len(), u64::MAX_SIZE);
        assert_eq!(postcard::to_slice(&i32::MIN, &mut out).unwrap().len(), i32::MAX_SIZE);
        assert_eq!(postcard::to_slice(&f32::MAX, &mut out).unwrap().len(), f32::MAX_SIZE);
        assert_eq!(postcard::to_slice(&[0xFFu8; 8], &mut out).unwrap().len(), <[u8; 8]>::MAX_SIZE);
    }
}
