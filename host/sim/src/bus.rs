//! What CAN buses and RS485 lines have in common: who is on them, what travels, how they break, how
//! long a bit takes.

use std::fmt;
use std::time::Duration;

use host_protocol::CanFrame;

/// Who sends or listens on a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Station {
    /// The gateway under simulation.
    Gateway,
    /// The motor with this index in the wiring.
    Motor(usize),
    /// A foreign station, with nothing but a transmitter.
    Stranger,
}

/// What one station sends at once.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub enum Wire {
    /// A CAN frame.
    Can(CanFrame),
    /// Bytes on a serial line, without pause between them.
    Serial(Vec<u8>),
}

/// As candump writes a CAN frame; plain hexadecimal for serial bytes.
impl fmt::Display for Wire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Wire::Can(frame) => write!(f, "{frame}"),
            Wire::Serial(bytes) => bytes.iter().try_for_each(|byte| write!(f, "{byte:02X}")),
        }
    }
}

/// What is wrong with the cable of a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub enum BusFault {
    /// Nothing.
    #[default]
    None,
    /// Cut at the gateway: it is alone, the motors are among themselves.
    Cut,
    /// Both wires touch: nobody hears anything, and a CAN controller that sends runs into bus-off.
    Short,
}

/// How long `bits` bits take at `rate` bits per second, to the nearest nanosecond.
pub(crate) fn bit_time(bits: u64, rate: u32) -> Duration {
    const NANOS_PER_S: u64 = 1_000_000_000;
    let rate = u64::from(rate.max(1));
    Duration::from_nanos((bits * NANOS_PER_S + rate / 2) / rate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_take_their_time() {
        assert_eq!(bit_time(111, 1_000_000), Duration::from_micros(111));
        assert_eq!(bit_time(135, 210_526), Duration::from_nanos(641_251));
        assert_eq!(bit_time(130, 115_200), Duration::from_nanos(1_128_472));
    }

    #[test]
    fn wires_print_as_candump_and_hex() {
        let frame = CanFrame::standard(0x141, &[0xA1, 0, 0, 0, 0x64, 0, 0, 0]).unwrap();
        assert_eq!(Wire::Can(frame).to_string(), "141#A100000064000000");
        assert_eq!(Wire::Serial(vec![0x3E, 0x01, 0x08]).to_string(), "3E0108");
    }
}
