//! Which motors a cycle has, on how many buses, and in which period.

use std::fmt;
use std::time::Duration;

use host_protocol::{Protocol, Setpoint, StateField, StateFields, StopAction};
use mgw_sim::MotorWiring;

use crate::board::Board;

/// Axes of a bus at most.
pub(super) const PER_BUS: u8 = 4;
/// Between two frames on CAN.
pub(super) const INTERMISSION_BITS: u32 = 3;
/// Idle bits with which the gateway keeps two messages on RS485 apart.
pub(super) const GAP_BITS: u32 = 20;
/// C: bits of a message of 13 bytes on RS485.
pub(super) const MESSAGE_BITS: u32 = 130;
/// DE: the driver is on for a bit before a message and for one behind it.
const DRIVER_ENABLE_BITS: u32 = 2;
/// The shortest period that there is.
const LEAST_PERIOD_US: u32 = 250;
/// RMD V3.6 §2.20: a velocity setpoint.
const RMD_VELOCITY: u8 = 0xA2;
/// Thruster manual §1.3: a signal.
const THRUSTER_SIGNAL: [u8; 2] = *b"TC";
/// D5 manual, quick start 5: a speed, behind header and node.
const D5_SPEED: [u8; 3] = [0x05, 0x03, 0x20];

/// The motors of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motors {
    /// RMDs on CAN at 1 Mbit/s.
    Rmd,
    /// The same, and RMDs on RS485 at 2 Mbaud.
    RmdEverywhere,
    /// RMDs on RS485, at so many baud.
    Rs485(u32),
    /// D5 motors on CAN at 210526 bit/s.
    D5,
    /// Thrusters on CAN at 1 Mbit/s, which echo what they are told.
    Thruster,
}

impl Motors {
    /// Every kind, each of which takes a board of its own.
    pub(super) const ALL: [Self; 6] = [
        Self::Rmd,
        Self::RmdEverywhere,
        Self::Rs485(115_200),
        Self::Rs485(2_000_000),
        Self::D5,
        Self::Thruster,
    ];

    pub(super) fn protocol(self) -> Protocol {
        match self {
            Self::D5 => Protocol::D5,
            Self::Thruster => Protocol::Thruster,
            Self::Rmd | Self::RmdEverywhere | Self::Rs485(_) => Protocol::Rmd,
        }
    }

    /// Buses with such motors, from the first, and their rates.
    pub(super) fn buses(self) -> Vec<(u8, u32)> {
        let board = Board::chosen();
        let rs485 = board.rs485_bus();
        let can = |bitrate| (0..rs485).map(move |bus| (bus, bitrate));
        match self {
            Self::Rmd | Self::Thruster => can(1_000_000).collect(),
            Self::D5 => can(210_526).collect(),
            Self::RmdEverywhere => can(1_000_000).chain([(rs485, 2_000_000)]).collect(),
            Self::Rs485(baud) => vec![(rs485, baud)],
        }
    }

    /// All of a board.
    pub(super) fn wiring(self) -> Vec<MotorWiring> {
        let protocol = self.protocol();
        let of_bus = |(bus, bitrate)| {
            (1..=PER_BUS).map(move |node| MotorWiring {
                bus,
                protocol,
                node,
                bitrate,
                can_id: None,
            })
        };
        self.buses().into_iter().flat_map(of_bus).collect()
    }

    pub(super) fn stop_action(self) -> StopAction {
        if self == Self::Thruster { StopAction::Coast } else { StopAction::Hold }
    }

    /// What the host is told of every axis: of a D5 or a thruster nothing, as what they answer to
    /// setpoints says no number, and each would be read beside them.
    pub(super) fn fields(self) -> StateFields {
        match self.protocol() {
            Protocol::Rmd => {
                StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current])
            }
            Protocol::D5 | Protocol::Thruster => StateFields::NONE,
        }
    }

    pub(super) fn setpoint(self) -> Setpoint {
        match self.protocol() {
            Protocol::Thruster => Setpoint::Signal { fraction: 0.1 },
            Protocol::Rmd | Protocol::D5 => Setpoint::Velocity { velocity_rad_s: 2.0 },
        }
    }

    /// Whether these data bytes are a setpoint.
    pub(super) fn is_setpoint(self, data: &[u8]) -> bool {
        match self.protocol() {
            Protocol::Rmd => data.first() == Some(&RMD_VELOCITY),
            Protocol::Thruster => data.starts_with(&THRUSTER_SIGNAL),
            Protocol::D5 => data.get(2..).is_some_and(|data| data.starts_with(&D5_SPEED)),
        }
    }

    /// Bits of a request and its reply on the wire, on CAN as they are stuffed on average: what the
    /// limits are worked out from. A line says what its own took.
    pub(super) fn exchange_bits(self) -> u32 {
        match self {
            Self::Rmd | Self::RmdEverywhere => 236,
            Self::D5 => 238,
            Self::Thruster => 241,
            Self::Rs485(_) => 2 * MESSAGE_BITS,
        }
    }
}

/// A line of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Situation {
    /// What is on the buses.
    pub motors: Motors,
    /// Axes on each bus.
    pub per_bus: u8,
    /// Buses, from the first with such motors.
    pub buses: u8,
    /// What a motor takes to begin its reply.
    pub delay: Duration,
    /// The period is so much of the shortest that the wire allows, percent.
    pub period_percent: u32,
    /// The host gives every axis a new setpoint in each period.
    pub has_setpoints: bool,
}

impl Situation {
    /// As many axes as a board has here, whose motors answer at once.
    pub(super) fn usual(motors: Motors) -> Self {
        Self {
            motors,
            per_bus: PER_BUS,
            buses: u8::try_from(motors.buses().len()).expect("a few"),
            delay: Duration::ZERO,
            period_percent: 105,
            has_setpoints: false,
        }
    }

    /// All of a board.
    pub(super) fn all() -> Vec<Self> {
        let usual = Self::usual(Motors::Rmd);
        let delayed = Duration::from_micros(200);
        let mut all = Vec::new();
        // One axis a bus is served most often in these periods: in longer ones it waits for them.
        for (delay, period_percent) in [(Duration::ZERO, 107), (delayed, 103)] {
            all.push(Self { per_bus: 1, buses: 1, delay, period_percent, ..usual });
            all.push(Self { per_bus: 1, delay, period_percent, ..usual });
            all.push(Self { buses: 1, delay, ..usual });
            all.push(Self { delay, ..usual });
        }
        all.push(Self { per_bus: 2, buses: 1, period_percent: 100, ..usual });
        all.push(Self { buses: 1, period_percent: 100, ..usual });
        all.push(Self { period_percent: 100, ..usual });
        all.push(Self { period_percent: 125, ..usual });
        all.push(Self { has_setpoints: true, ..usual });
        all.push(Self::usual(Motors::RmdEverywhere));
        all.push(Self::usual(Motors::Rs485(115_200)));
        let fast_line = Self::usual(Motors::Rs485(2_000_000));
        all.extend([fast_line, Self { delay: delayed, ..fast_line }]);
        let others = [Motors::D5, Motors::Thruster].map(Self::usual);
        all.extend(others.map(|usual| Self { period_percent: 100, ..usual }));
        all
    }

    /// The rate of the slowest bus is that of its first: those beside it have time left.
    fn bitrate(&self) -> u32 {
        self.motors.buses()[0].1
    }

    /// The shortest period that the wire allows. On CAN: frames one behind the other, and behind a
    /// single request the motor's own time. On RS485: 2C + W + DE for each axis.
    pub(super) fn wire_us(&self) -> u32 {
        let Self { motors, delay, .. } = *self;
        let us = |bits: u32| {
            let bits = u64::from(bits) * 1_000_000;
            u32::try_from(bits.div_ceil(self.bitrate().into())).expect("short")
        };
        let delay = u32::try_from(delay.as_micros()).expect("short");
        let (exchange, axes) = (motors.exchange_bits(), u32::from(self.per_bus));
        match motors {
            Motors::Rs485(_) => us((exchange + DRIVER_ENABLE_BITS) * axes) + delay * axes,
            _ => (us(exchange) + delay).max(us(exchange * axes)),
        }
    }

    pub(super) fn period_us(&self) -> u32 {
        (self.wire_us() * self.period_percent).div_ceil(100).max(LEAST_PERIOD_US)
    }

    /// Whether the period leaves the buses no time: then a request is always due where none waits
    /// for its reply. On RS485 the idle bits take more than what it leaves.
    pub(super) fn is_always_due(&self) -> bool {
        let is_line = matches!(self.motors, Motors::Rs485(_));
        self.delay.is_zero() && (is_line || self.period_percent <= 100 || self.per_bus == 1)
    }

    pub(super) fn axes(&self) -> Vec<u8> {
        let of_bus = |bus| (0..self.per_bus).map(move |place| bus * PER_BUS + place);
        (0..self.buses).flat_map(of_bus).collect()
    }
}

impl fmt::Display for Situation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { motors, per_bus, buses, delay, period_percent, has_setpoints } = self;
        match motors {
            Motors::Rmd | Motors::RmdEverywhere => {}
            Motors::Rs485(baud) => write!(f, "RS485 {baud} ")?,
            Motors::D5 => f.write_str("D5 ")?,
            Motors::Thruster => f.write_str("thruster ")?,
        }
        let (buses, beside) = match motors {
            Motors::RmdEverywhere => (buses - 1, " + RS485"),
            _ => (*buses, ""),
        };
        let delay = delay.as_micros();
        write!(f, "{per_bus} x {buses}{beside}, {delay} us, period {period_percent} %")?;
        f.write_str(if *has_setpoints { ", setpoints" } else { "" })
    }
}
