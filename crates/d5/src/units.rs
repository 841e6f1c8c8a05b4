//! The manual's own raw units.

/// Speed, 1 °/s per count; positive is counter-clockwise (D5 manual, common commands, rows 2 and 3).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DegreesPerSecond(pub i16);

/// Angle, 1° per count (D5 manual, common commands, row 5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Degrees(pub i16);

/// Angle within one turn, 1° per count, 0..=360 (D5 manual, table row 14).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TurnDegrees(pub u16);

/// Temperature, 1 °C per count (D5 manual, register 0x0B).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Celsius(pub i8);
