//! Elements of a list in a snapshot.

use serde::ser::SerializeTuple;
use serde::{Serialize, Serializer};

/// Those that this gives, one behind the other, without how many they are.
pub(crate) struct Each<F>(pub F);

impl<F: Fn() -> I, I: Iterator<Item: Serialize>> Serialize for Each<F> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut each = to.serialize_tuple(0)?;
        (self.0)().try_for_each(|element| each.serialize_element(&element))?;
        each.end()
    }
}
