//! One gain with its number, as motors from V4.2 on have them.

use core::convert::Infallible;

use codec::{BuildError, Decode, Encode, FieldInfo, FieldKind, Fields, Visit};

use crate::error::EncodeError;
use crate::field::{DATA_LEN, Field};
use crate::payload::Payload;

/// Index of a gain (V4.2 0x30 to 0x32); other values than the listed ones are kept as received and
/// never encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gain(pub u8);

impl Gain {
    /// The listed gains; 3 and 6 have no meaning.
    pub const ALL: [(Gain, &str); 7] = [
        (Gain(1), "current_kp"),
        (Gain(2), "current_ki"),
        (Gain(4), "speed_kp"),
        (Gain(5), "speed_ki"),
        (Gain(7), "position_kp"),
        (Gain(8), "position_ki"),
        (Gain(9), "position_kd"),
    ];

    /// Name of a listed gain.
    pub fn name(self) -> Option<&'static str> {
        Gain::ALL.iter().find(|(gain, _)| *gain == self).map(|(_, name)| *name)
    }

    const INDEX: FieldInfo = FieldInfo::integer("index", "", 1, 9);
    const NAME: FieldInfo = FieldInfo::other(FieldKind::Text, "index_name");
    pub(crate) const FIELDS: &[FieldInfo] = &[Gain::INDEX];

    pub(crate) fn build(fields: &Fields<'_>) -> Result<Gain, BuildError> {
        fields.count(&Gain::INDEX).map(Gain)
    }

    pub(crate) fn visit(self, visit: &mut Visit<'_>) {
        Gain::INDEX.visit_integer(visit, self.0);
        Gain::NAME.visit_name(visit, self.name());
    }
}

impl Decode<Payload> for Gain {
    fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<Gain, Infallible> {
        u8::get::<AT>(data).map(Gain)
    }
}

impl Encode<Payload> for Gain {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        self.0.put::<AT>(data);
    }

    fn check(&self) -> Result<(), EncodeError> {
        if self.name().is_some() {
            return Ok(());
        }
        Err(EncodeError::Forbidden {
            field: "index",
            value: i64::from(self.0),
            reason: "no gain has this index",
        })
    }
}

/// A gain and its value, a real number in the motor's own unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GainValue {
    /// Which gain.
    pub gain: Gain,
    /// The bits of the value, an IEEE 754 number of 32 bits.
    pub bits: u32,
}

/// Where the value stands.
const VALUE: Field<4, 4> = Field;

impl GainValue {
    /// A gain with a value.
    pub const fn new(gain: Gain, value: f32) -> GainValue {
        GainValue { gain, bits: value.to_bits() }
    }

    /// The value.
    pub const fn value(self) -> f32 {
        f32::from_bits(self.bits)
    }

    const AMOUNT: FieldInfo = FieldInfo::physical("value", "", (0, i64::MAX), 1.0);
    pub(crate) const FIELDS: &[FieldInfo] = &[Gain::INDEX, GainValue::AMOUNT];
    pub(crate) const SHOWN: &[FieldInfo] = &[Gain::INDEX, Gain::NAME, GainValue::AMOUNT];

    #[allow(clippy::cast_possible_truncation)] // the wire has 32 bits
    pub(crate) fn build(fields: &Fields<'_>) -> Result<GainValue, BuildError> {
        Ok(GainValue::new(Gain::build(fields)?, fields.any(&GainValue::AMOUNT)? as f32))
    }

    pub(crate) fn visit(self, visit: &mut Visit<'_>) {
        self.gain.visit(visit);
        GainValue::AMOUNT.visit_physical(visit, f64::from(self.value()));
    }
}

impl Decode<Payload> for GainValue {
    fn get<const AT: usize>(data: &[u8; DATA_LEN]) -> Result<GainValue, Infallible> {
        let bits = u32::from_le_bytes(VALUE.get(data));
        Gain::get::<AT>(data).map(|gain| GainValue { gain, bits })
    }
}

impl Encode<Payload> for GainValue {
    fn put<const AT: usize>(&self, data: &mut [u8; DATA_LEN]) {
        self.gain.put::<AT>(data);
        VALUE.put(data, self.bits.to_le_bytes());
    }

    /// A gain is a finite number of at least 0.
    fn check(&self) -> Result<(), EncodeError> {
        self.gain.check()?;
        if (0.0..=f32::MAX).contains(&self.value()) {
            return Ok(());
        }
        Err(EncodeError::Forbidden {
            field: "value",
            value: i64::from(self.bits),
            reason: "a gain is a finite number of at least 0",
        })
    }
}
