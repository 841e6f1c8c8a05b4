//! The value of a parameter, and the names of the things that can be out of range.

use core::fmt;

use crate::errors::Error;
use crate::parameters;
use crate::size::wire;

wire! {
    /// The value of a parameter.
    #[derive(Copy)]
    pub enum Value {
        /// True or false.
        Bool(bool),
        /// A number from 0, an enum's number too.
        Unsigned(u32),
        /// A whole number with sign.
        Signed(i32),
        /// A quantity in SI units.
        Float(f32),
    }

    /// What an error speaks about.
    #[derive(Copy, Eq)]
    pub enum Quantity {
        /// Fraction of the full signal, −1 to 1.
        Signal,
        /// A.
        Current,
        /// rad/s.
        Velocity,
        /// rad/s.
        SpeedLimit,
        /// rad.
        Position,
        /// V.
        Voltage,
        /// °C.
        Temperature,
        /// bit/s.
        Bitrate,
        /// µs.
        ReplyWindow,
        /// ms.
        MotorTimeout,
        /// µs from now.
        Expiry,
        /// The number of an axis.
        Axis,
        /// The number of a bus.
        Bus,
        /// A node's id on its bus.
        Node,
        /// The parameter with this number, in its own unit.
        Parameter(u16),
        /// Data bytes of a raw frame.
        FrameLength,
        /// The id of a CAN frame.
        CanId,
        /// N·m.
        Torque,
        /// N·m/rad.
        Stiffness,
        /// N·m·s/rad.
        Damping,
        /// µs.
        Period,
        /// StateFields, as their byte.
        Fields,
    }
}

impl Quantity {
    /// Its unit; empty where it has none.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Current => "A",
            Self::Velocity | Self::SpeedLimit => "rad/s",
            Self::Position => "rad",
            Self::Voltage => "V",
            Self::Temperature => "°C",
            Self::Bitrate => "bit/s",
            Self::ReplyWindow | Self::Expiry | Self::Period => "µs",
            Self::Torque => "N·m",
            Self::Stiffness => "N·m/rad",
            Self::Damping => "N·m·s/rad",
            Self::MotorTimeout => "ms",
            Self::FrameLength => "bytes",
            Self::Parameter(number) => parameters::unit(number).unwrap_or(""),
            Self::Signal | Self::Axis | Self::Bus | Self::Node | Self::CanId | Self::Fields => "",
        }
    }

    /// Refuses a count that is not in a range, both ends of which belong to it.
    ///
    /// # Errors
    /// [`Error::OutOfRange`]: its numbers are for people to read, for whom an f32 is precise enough.
    #[allow(clippy::cast_precision_loss)]
    pub fn check(self, count: u32, (min, max): (u32, u32)) -> Result<(), Error> {
        if (min..=max).contains(&count) {
            return Ok(());
        }
        let [value, min, max] = [count, min, max].map(|count| count as f32);
        Err(Error::OutOfRange { quantity: self, value, min, max })
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Signal => "signal",
            Self::Current => "current",
            Self::Velocity => "velocity",
            Self::SpeedLimit => "speed limit",
            Self::Position => "position",
            Self::Voltage => "voltage",
            Self::Temperature => "temperature",
            Self::Bitrate => "bitrate",
            Self::ReplyWindow => "reply window",
            Self::MotorTimeout => "motor timeout",
            Self::Expiry => "expiry of the setpoint",
            Self::Axis => "axis",
            Self::Bus => "bus",
            Self::Node => "node",
            Self::FrameLength => "length of the frame",
            Self::CanId => "CAN id",
            Self::Torque => "torque",
            Self::Stiffness => "stiffness",
            Self::Damping => "damping",
            Self::Period => "period",
            Self::Fields => "fields",
            Self::Parameter(number) => {
                return match parameters::name(*number) {
                    Some(name) => f.write_str(name),
                    None => write!(f, "parameter {number}"),
                };
            }
        })
    }
}

impl Value {
    /// The number, if it is one from 0.
    #[must_use]
    pub const fn as_unsigned(self) -> Option<u32> {
        match self {
            Self::Unsigned(number) => Some(number),
            Self::Bool(_) | Self::Signed(_) | Self::Float(_) => None,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => value.fmt(f),
            Self::Unsigned(value) => value.fmt(f),
            Self::Signed(value) => value.fmt(f),
            Self::Float(value) => value.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_range_of_counts_are_in_it() {
        let out = |value| {
            let (quantity, min, max) = (Quantity::Period, 250.0, 20_000.0);
            Err(Error::OutOfRange { quantity, value, min, max })
        };
        let cases = [(249, out(249.0)), (250, Ok(())), (20_000, Ok(())), (20_001, out(20_001.0))];
        for (count, result) in cases {
            assert_eq!(Quantity::Period.check(count, (250, 20_000)), result);
        }
    }
}
