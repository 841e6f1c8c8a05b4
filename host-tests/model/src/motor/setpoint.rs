//! What a motion frame asks for, in SI units: what the motor makes of its bytes, not what the host
//! had asked.

use super::Protocol;
use std::f64::consts::PI;

/// What a motion frame asks for; magnitudes but for the position.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Goal {
    /// rad/s, also where it only limits a move.
    pub speed: Option<f64>,
    /// A
    pub current: Option<f64>,
    /// rad, in the motor's sense of rotation.
    pub position: Option<f64>,
    /// Of the full signal.
    pub signal: Option<f64>,
}

const DEGREE: f64 = PI / 180.0;
const RPM: f64 = PI / 30.0;

impl Protocol {
    /// What the bytes of a motion ask for.
    pub fn goal(self, data: &[u8]) -> Goal {
        match self {
            Self::Rmd => rmd(data),
            Self::Thruster => thruster(data),
            Self::D5 => d5(data),
        }
        .unwrap_or_default()
    }
}

/// §2.17 to §2.20, §2.22: 0.01 A, 0.01 degrees a second, 0.01 degrees, and 1 degree a second where
/// it limits a move.
fn rmd(data: &[u8]) -> Option<Goal> {
    let none = Goal::default();
    let word = |at: usize| Some(u16::from_le_bytes([*data.get(at)?, *data.get(at + 1)?]));
    let long = || Some(f64::from(i32::from_le_bytes(data.get(4..8)?.try_into().ok()?)) / 100.0);
    Some(match data.first()? {
        0xA1 => Goal { current: Some(f64::from(word(4)?.cast_signed()).abs() / 100.0), ..none },
        0xA2 => Goal { speed: Some(long()?.abs() * DEGREE), ..none },
        0xA4 | 0xA9 => Goal {
            speed: Some(f64::from(word(2)?) * DEGREE),
            position: Some(long()? * DEGREE),
            ..none
        },
        0xA8 => Goal { speed: Some(f64::from(word(2)?) * DEGREE), ..none },
        _ => none,
    })
}

/// §2.1, §4: per cent, 1 rpm, 0.1 degrees.
fn thruster(data: &[u8]) -> Option<Goal> {
    let none = Goal::default();
    let word = |at: usize| Some(u16::from_be_bytes([*data.get(at)?, *data.get(at + 1)?]));
    let value = || Some(f64::from(word(6)?.cast_signed()).abs());
    let long = || Some(f64::from(i32::from_be_bytes(data.get(4..8)?.try_into().ok()?)) / 10.0);
    Some(match data.get(..2)? {
        b"TC" => Goal { signal: Some(value()? / 100.0), ..none },
        b"VC" => Goal { speed: Some(value()? * RPM), ..none },
        b"LA" => Goal {
            speed: Some(f64::from(word(2)?) * RPM),
            position: Some(long()? * DEGREE),
            ..none
        },
        b"LR" => Goal { speed: Some(f64::from(word(2)?) * RPM), ..none },
        _ => none,
    })
}

/// Table, 0x20: 1 degree a second with the direction in bit 15.
fn d5(data: &[u8]) -> Option<Goal> {
    let [_, _, 5, 0x03 | 0x04, 0x20, low, high, _] = *data else { return None };
    let speed = f64::from(u16::from_le_bytes([low, high & 0x7F])) * DEGREE;
    Some(Goal { speed: Some(speed), ..Goal::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_units_of_the_manuals() {
        let near = |value: Option<f64>, wanted: f64| (value.unwrap() - wanted).abs() < 1e-9;
        assert!(near(Protocol::Rmd.goal(&[0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]).speed, 100.0 * DEGREE));
        assert!(near(Protocol::Rmd.goal(&[0xA1, 0, 0, 0, 0x9C, 0xFF, 0, 0]).current, 1.0));
        let moved = Protocol::Rmd.goal(&[0xA4, 0, 0xF4, 1, 0xA0, 0x8C, 0, 0]);
        assert!(near(moved.speed, 500.0 * DEGREE) && near(moved.position, 360.0 * DEGREE));
        // V4.3 0xA9: the same, its byte 1 a torque cap
        assert_eq!(moved, Protocol::Rmd.goal(&[0xA9, 30, 0xF4, 1, 0xA0, 0x8C, 0, 0]));
        assert!(near(Protocol::Thruster.goal(&[0x54, 0x43, 0, 0, 0, 0, 0xFF, 0xFB]).signal, 0.05));
        assert!(near(Protocol::Thruster.goal(&[0x56, 0x43, 0, 0, 0, 0, 1, 0x2C]).speed, 10.0 * PI));
        assert!(near(
            Protocol::D5.goal(&[0xD5, 0x0A, 5, 3, 0x20, 0x58, 0x82, 0]).speed,
            600.0 * DEGREE
        ));
    }
}
