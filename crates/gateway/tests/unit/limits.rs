//! No value on the wire is beyond a limit of its axis, whatever the rounding (GUARANTEES G2). The
//! bytes are read here as the manuals print them, by nothing that the gateway uses.

extern crate std;

use super::to_can;
use crate::config::AxisConfig;
use crate::rules;
use core::f64::consts::PI;
use host_protocol::{AxisParameter, Protocol, Setpoint, Value};
use std::vec;
use std::vec::Vec;

/// One quantity of one protocol.
struct Case {
    protocol: Protocol,
    /// Its lower and upper limit; one parameter for both where that counts to both sides of zero.
    limits: (AxisParameter, AxisParameter),
    setpoint: fn(f32) -> Setpoint,
    /// The value on the wire, in SI units and the motor's sense of rotation.
    read: fn(&[u8]) -> f64,
    /// One unit of the wire.
    unit: f64,
    largest: f32,
    /// A speed limit has no sense of rotation.
    signed: bool,
}

const DEGREE: f64 = PI / 180.0;
const RPM: f64 = PI / 30.0;

fn little_16(data: &[u8], at: usize) -> f64 {
    f64::from(u16::from_le_bytes([data[at], data[at + 1]]).cast_signed())
}

fn little_32(data: &[u8], at: usize) -> f64 {
    f64::from(u32::from_le_bytes(data[at..at + 4].try_into().unwrap()).cast_signed())
}

fn big_16(data: &[u8], at: usize) -> f64 {
    f64::from(u16::from_be_bytes([data[at], data[at + 1]]).cast_signed())
}

/// The 12 bits from a nibble on, as a fraction of their range, −1 to 1.
fn nibbles(data: &[u8], first: usize) -> f64 {
    let nibble = |at: usize| {
        u16::from(if at.is_multiple_of(2) { data[at / 2] >> 4 } else { data[at / 2] & 15 })
    };
    f64::from(nibble(first) << 8 | nibble(first + 1) << 4 | nibble(first + 2)) / 2048.0 - 1.0
}

fn position(position_rad: f32) -> Setpoint {
    Setpoint::Position { position_rad, speed_limit_rad_s: 10.0 }
}

fn speed_limit(speed_limit_rad_s: f32) -> Setpoint {
    Setpoint::Position { position_rad: 0.0, speed_limit_rad_s }
}

fn impedance(position_rad: f32, velocity_rad_s: f32, torque_nm: f32) -> Setpoint {
    Setpoint::Impedance {
        position_rad,
        velocity_rad_s,
        stiffness_nm_per_rad: 1.0,
        damping_nm_s_per_rad: 1.0,
        torque_nm,
    }
}

const POSITION: (AxisParameter, AxisParameter) =
    (AxisParameter::PositionMinRad, AxisParameter::PositionMaxRad);

fn both(parameter: AxisParameter) -> (AxisParameter, AxisParameter) {
    (parameter, parameter)
}

fn case(
    protocol: Protocol,
    limits: (AxisParameter, AxisParameter),
    setpoint: fn(f32) -> Setpoint,
    read: fn(&[u8]) -> f64,
    unit: f64,
    largest: f32,
) -> Case {
    Case { protocol, limits, setpoint, read, unit, largest, signed: true }
}

fn cases() -> Vec<Case> {
    let current = |current_a| Setpoint::Current { current_a };
    let velocity = |velocity_rad_s| Setpoint::Velocity { velocity_rad_s };
    let signal = |fraction| Setpoint::Signal { fraction };
    let speed = both(AxisParameter::VelocityLimitRadS);
    vec![
        // RMD V3.6 §2.17: 0.01 A; §2.18: 0.01 °/s; §2.20: 1 °/s and 0.01°.
        case(
            Protocol::Rmd,
            both(AxisParameter::CurrentLimitA),
            current,
            |d| little_16(d, 4) / 100.0,
            0.01,
            300.0,
        ),
        case(
            Protocol::Rmd,
            speed,
            velocity,
            |d| little_32(d, 4) * DEGREE / 100.0,
            DEGREE / 100.0,
            500.0,
        ),
        Case {
            signed: false,
            ..case(Protocol::Rmd, speed, speed_limit, |d| little_16(d, 2) * DEGREE, DEGREE, 500.0)
        },
        case(
            Protocol::Rmd,
            POSITION,
            position,
            |d| little_32(d, 4) * DEGREE / 100.0,
            DEGREE / 100.0,
            1_000.0,
        ),
        // §5: 16 bits of ±12.5 rad, 12 bits of ±45 rad/s and ±24 N·m.
        case(
            Protocol::Rmd,
            POSITION,
            |value| impedance(value, 0.0, 0.0),
            |d| (f64::from(u16::from_be_bytes([d[0], d[1]])) / 32_768.0 - 1.0) * 12.5,
            25.0 / 65_536.0,
            12.0,
        ),
        case(
            Protocol::Rmd,
            speed,
            |value| impedance(0.0, value, 0.0),
            |d| nibbles(d, 4) * 45.0,
            90.0 / 4_096.0,
            44.0,
        ),
        case(
            Protocol::Rmd,
            both(AxisParameter::TorqueLimitNm),
            |value| impedance(0.0, 0.0, value),
            |d| nibbles(d, 13) * 24.0,
            48.0 / 4_096.0,
            23.0,
        ),
        // Thruster manual §2.1: 1 %, 1 rpm; §4.1: 1 rpm and 0.1°.
        case(
            Protocol::Thruster,
            both(AxisParameter::SignalLimit),
            signal,
            |d| big_16(d, 6) / 100.0,
            0.01,
            1.0,
        ),
        case(Protocol::Thruster, speed, velocity, |d| big_16(d, 6) * RPM, RPM, 3_000.0),
        Case {
            signed: false,
            ..case(Protocol::Thruster, speed, speed_limit, |d| big_16(d, 2) * RPM, RPM, 3_000.0)
        },
        case(
            Protocol::Thruster,
            POSITION,
            position,
            |d| f64::from(i32::from_be_bytes(d[4..8].try_into().unwrap())) * DEGREE / 10.0,
            DEGREE / 10.0,
            3.1,
        ),
        // D5 manual, common commands 2: 1 °/s, bit 15 is clockwise.
        case(
            Protocol::D5,
            speed,
            velocity,
            |d| {
                let word = u16::from_le_bytes([d[5], d[6]]);
                let magnitude = f64::from(word & 0x7FFF) * DEGREE;
                if word & 0x8000 == 0 { magnitude } else { -magnitude }
            },
            DEGREE,
            500.0,
        ),
    ]
}

/// Numbers that look random.
struct Dice(fastrand::Rng);

impl Dice {
    /// From 0 to 1.
    fn roll(&mut self) -> f32 {
        self.0.f32()
    }

    /// From a fraction of the unit to the largest, small ones as often as large ones.
    fn limit(&mut self, case: &Case) -> f32 {
        #[allow(clippy::cast_possible_truncation)]
        let least = 0.3 * case.unit as f32;
        least * (case.largest / least).powf(self.roll())
    }
}

/// A limit, and a value that keeps it: the limit itself in half of all cases.
fn draw(dice: &mut Dice, case: &Case) -> ((f32, f32), f32) {
    let (mut min, mut max) = (-dice.limit(case), dice.limit(case));
    if case.limits.0 == case.limits.1 {
        min = -max;
    } else if dice.roll() < 0.5 {
        // To one side of zero.
        (min, max) = (max.min(-min), max.max(-min));
        if dice.roll() < 0.5 {
            (min, max) = (-max, -min);
        }
    }
    let value = match dice.roll() {
        at if at < 0.25 => min,
        at if at < 0.5 => max,
        _ => (min + (max - min) * dice.roll()).clamp(min, max),
    };
    ((min, max), if case.signed { value } else { value.abs() })
}

#[test]
fn no_value_on_the_wire_is_beyond_its_limit() {
    let mut dice = Dice(fastrand::Rng::with_seed(0x9E37_79B9));
    for (number, case) in cases().iter().enumerate() {
        let mut sent = [0; 2];
        for turn in 0..8_000 {
            let direction = if turn % 2 == 0 { 1 } else { -1 };
            let ((min, max), value) = draw(&mut dice, case);
            let mut config = AxisConfig::new();
            for (parameter, value) in [
                (AxisParameter::Protocol, Value::Unsigned(case.protocol.number().into())),
                (AxisParameter::Node, Value::Unsigned(11)),
                (AxisParameter::Direction, Value::Signed(direction)),
                (AxisParameter::PositionDevice, Value::Bool(true)),
                // Where one parameter is both, the upper limit is what it says.
                (
                    case.limits.0,
                    Value::Float(if case.limits.0 == case.limits.1 { max } else { min }),
                ),
                (case.limits.1, Value::Float(max)),
            ] {
                config.set(parameter, value).unwrap();
            }
            // Refused are 0 as a speed limit, fewer than 30 rpm, and a range in which no unit lies.
            let Ok(command) = rules::command(0, (case.setpoint)(value), &config) else { continue };
            let frame = to_can(&command, &config).unwrap();
            let sense = if case.signed { f64::from(direction) } else { 1.0 };
            let wire = sense * (case.read)(frame.data());
            let (min, max, value) = (f64::from(min), f64::from(max), f64::from(value));
            // The limits themselves are numbers of 24 bits; those of motion mode are compared at
            // the size of its range.
            let fine = max.abs().max(min.abs()).max(case.unit * 64.0) * 2.4e-7;
            assert!(
                wire <= max + fine && wire >= min - fine,
                "{number}: {value} of {min} to {max} goes out as {wire}"
            );
            // A speed limit of a setpoint is one itself.
            let nearest = if case.signed { case.unit * 0.51 } else { 0.0 };
            let is_nearest = (wire - value).abs() <= nearest + fine;
            let beyond = match case.signed {
                true => value + case.unit / 2.0 > max || value - case.unit / 2.0 < min,
                false => wire < value,
            };
            assert!(
                is_nearest || beyond && (wire - value).abs() <= case.unit + fine,
                "{number}: {value} as {wire}"
            );
            sent[usize::from(value < 0.0)] += 1;
        }
        assert!(sent[0] > 1_500 && (!case.signed || sent[1] > 1_500), "{number}: {sent:?}");
    }
}
