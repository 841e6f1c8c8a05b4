//! A part of the gateway that knows whether it may have changed since it was copied.

use core::ops::{Deref, DerefMut};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Whoever may change it marks it stale.
#[derive(Debug, Clone)]
pub(crate) struct Tracked<T> {
    is_stale: bool,
    value: T,
}

impl<T> Tracked<T> {
    pub const fn new(value: T) -> Self {
        Self { is_stale: false, value }
    }

    /// Whether it may have changed since this was last set to false.
    pub const fn stale(&mut self) -> &mut bool {
        &mut self.is_stale
    }
}

impl<T> Deref for Tracked<T> {
    type Target = T;

    #[inline(always)]
    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Tracked<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut T {
        self.is_stale = true;
        &mut self.value
    }
}

impl<T: Serialize> Serialize for Tracked<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.value.serialize(serializer)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Tracked<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        T::deserialize(deserializer).map(Self::new)
    }
}
