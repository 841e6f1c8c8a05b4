//! Which of the four accelerations 0x43 writes.

use core::convert::Infallible;

use codec::{BuildError, Decode, Encode, FieldInfo, FieldKind, Fields, Visit, check_range};

use crate::error::EncodeError;
use crate::field::DATA_LEN;
use crate::payload::Payload;

/// Index of an acceleration or deceleration (RMD V3.6 §2.5.4); other values than the four are kept
/// as received.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Ramp(pub u8);

impl Ramp {
    /// Speeding up in position moves.
    pub const POSITION_ACCELERATION: Ramp = Ramp(0);
    /// Slowing down in position moves.
    pub const POSITION_DECELERATION: Ramp = Ramp(1);
    /// Speeding up to a commanded velocity, in either direction.
    pub const VELOCITY_ACCELERATION: Ramp = Ramp(2);
    /// Slowing down to a commanded velocity of the same direction.
    pub const VELOCITY_DECELERATION: Ramp = Ramp(3);

    /// Name of the four the manual lists.
    pub const fn name(self) -> Option<&'static str> {
        match self {
            Ramp::POSITION_ACCELERATION => Some("position_acceleration"),
            Ramp::POSITION_DECELERATION => Some("position_deceleration"),
            Ramp::VELOCITY_ACCELERATION => Some("velocity_acceleration"),
            Ramp::VELOCITY_DECELERATION => Some("velocity_deceleration"),
            Ramp(_) => None,
        }
    }

    const MIN: i64 = Ramp::POSITION_ACCELERATION.0 as i64;
    const MAX: i64 = Ramp::VELOCITY_DECELERATION.0 as i64;
    const INDEX: FieldInfo = FieldInfo::integer("index", "", Ramp::MIN, Ramp::MAX);
    const NAME: FieldInfo = FieldInfo::other(FieldKind::Text, "index_name");
    pub(crate) const FIELDS: &[FieldInfo] = &[Ramp::INDEX];
    pub(crate) const SHOWN: &[FieldInfo] = &[Ramp::INDEX, Ramp::NAME];

    pub(crate) fn build(fields: &Fields<'_>) -> Result<Ramp, BuildError> {
        fields.count(&Ramp::INDEX).map(Ramp)
    }

    pub(crate) fn visit(self, visit: &mut Visit<'_>) {
        Ramp::INDEX.visit_integer(visit, self.0);
        Ramp::NAME.visit_name(visit, self.name());
    }
}

impl Decode<Payload> for Ramp {
    fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<Ramp, Infallible> {
        u8::get::<AT>(data).map(Ramp)
    }
}

impl Encode<Payload> for Ramp {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        self.0.put::<AT>(data);
    }

    fn check(&self) -> Result<(), EncodeError> {
        check_range("index", i64::from(self.0), Ramp::MIN, Ramp::MAX)
    }
}
