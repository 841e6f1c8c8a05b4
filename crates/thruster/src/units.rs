//! The manual's own raw units: one count of the wire each, nothing scaled.

/// Control signal, 1 % per count, −100..=100; the sign gives the direction (Thruster manual §2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Percent(pub i16);

/// Signed speed, 1 rpm per count (Thruster manual §2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rpm(pub i16);

/// Unsigned speed of a position move, 1 rpm per count; 0 does not start the move (Thruster manual §4.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RpmLimit(pub u16);

/// Current, 0.1 A per count (Thruster manual §2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Deciamps(pub i16);

/// Voltage, 0.1 V per count (Thruster manual §2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Decivolts(pub u16);

/// Temperature, 1 °C per count (Thruster manual §2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Celsius(pub i16);

/// Position, 0.1° per count (Thruster manual §4.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Decidegrees(pub i32);

/// Limit of the absolute position, 0.1° per count (Thruster manual §4.1, SPLA and RPLA).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LimitDecidegrees(pub i16);

/// Bitrate as CB carries it: kbit/s without its fraction (Thruster manual §2.2); see [`BITRATES`](crate::BITRATES).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Kilobits(pub u16);

/// Time, 1 ms per count (Thruster manual §2.3, §2.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Milliseconds(pub u16);
