//! Which motors hang on which bus of which board.

use std::error::Error;
use std::fmt;

use gateway::{Board, BusPort, LinkPort, MAX_LINKS};
use host_protocol::{BootReason, BusKind, CanId, DEFAULT_BAUD, Protocol};

/// Bitrate of RMD and thruster motors on CAN.
const MBIT: u32 = 1_000_000;
/// Bitrate of D5 motors on CAN, the middle of 200001..=222222 bit/s (D5 manual, point 3).
const D5_BITRATE: u32 = 210_526;
/// Default baud rate of RMD motors on RS485 (RMD V3.6 §1.2.1). The D5 manual gives none; that its
/// motors have the same is an assumption.
const BAUD: u32 = 115_200;

/// A host link: the rates of both boards.
const UART: LinkPort =
    LinkPort { bauds: &[DEFAULT_BAUD, 1_000_000, 1_500_000, 2_000_000, 3_000_000] };

const LINE: BusPort =
    BusPort { kind: BusKind::Rs485, bitrates: &[BAUD, 500_000, MBIT, 1_500_000, 2_000_000] };

/// The board that the simulator plays: two CAN controllers, two RS485 ports that hear themselves,
/// and all host links.
pub static BOARD: Board = Board {
    name: "simulated",
    firmware: env!("CARGO_PKG_VERSION"),
    build_id: "simulator",
    boot: BootReason::Simulated,
    crash_report: "",
    e_stop_input: true,
    enable_output: true,
    buses: &[
        BusPort { kind: BusKind::Can, bitrates: &[MBIT, 500_000, 250_000, D5_BITRATE] },
        BusPort { kind: BusKind::Can, bitrates: &[MBIT, 500_000, 250_000, D5_BITRATE] },
        LINE,
        LINE,
    ],
    bus_limit: None,
    links: &[UART; MAX_LINKS],
};

/// One motor and where it is connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct MotorWiring {
    /// Index of the bus.
    pub bus: u8,
    /// What the motor speaks.
    pub protocol: Protocol,
    /// Its id there.
    pub node: u8,
    /// Its bitrate, bit/s.
    pub bitrate: u32,
    /// The CAN id on which a D5 listens and answers, where that is not its node. It hears 0xFE as
    /// well in frames of the same type.
    pub can_id: Option<CanId>,
}

/// A board, its motors and the seed of everything random.
#[derive(Debug, Clone)]
pub struct Wiring {
    /// The board.
    pub board: &'static Board,
    /// The motors. Their place in the list is their index everywhere else.
    pub motors: Vec<MotorWiring>,
    /// Two worlds with the same wiring, seed and input run alike.
    pub seed: u64,
    /// What the board's random generator gives at the first start, from which epochs count; each
    /// later start gets another number. Nothing: it fails.
    pub random_number: Option<u32>,
    /// The gateway's flight recorder.
    pub flight: FlightWiring,
}

/// What a flight recorder has.
#[derive(Debug, Clone, Copy)]
pub struct FlightWiring {
    /// Bytes of each half of its memory.
    pub half: usize,
    /// Its turns after each call to the core.
    pub turns: usize,
}

impl FlightWiring {
    /// Seconds of a busy bus, and as many turns as it takes.
    const ENOUGH: Self = Self { half: 192 * 1024, turns: usize::MAX };
}

/// A motor that cannot be connected as asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WiringError {
    /// The board has no such bus.
    Bus {
        /// The bus asked for.
        bus: u8,
        /// How many there are.
        buses: usize,
    },
    /// The protocol has no such id.
    Node {
        /// The protocol.
        protocol: Protocol,
        /// The id asked for.
        node: u8,
    },
    /// The protocol's manual says on which CAN ids its motors listen.
    CanId {
        /// The protocol.
        protocol: Protocol,
    },
    /// The simulator has this motor on CAN only.
    NotOnSerial {
        /// The protocol.
        protocol: Protocol,
    },
}

impl Wiring {
    /// A board without motors.
    pub fn on(board: &'static Board) -> Self {
        let flight = FlightWiring::ENOUGH;
        Self { board, motors: Vec::new(), seed: 1, random_number: Some(0), flight }
    }

    /// Connects a motor, at the bitrate usual for it.
    #[must_use]
    pub fn with(self, bus: u8, protocol: Protocol, node: u8) -> Self {
        let kind = self.board.buses.get(usize::from(bus)).map(|port| port.kind);
        let bitrate = match (kind, protocol) {
            (Some(BusKind::Rs485), _) => BAUD,
            (_, Protocol::D5) => D5_BITRATE,
            (_, Protocol::Rmd | Protocol::Thruster) => MBIT,
        };
        self.with_motor(MotorWiring { bus, protocol, node, bitrate, can_id: None })
    }

    /// Connects a motor.
    #[must_use]
    pub fn with_motor(mut self, motor: MotorWiring) -> Self {
        self.motors.push(motor);
        self
    }

    /// [`BOARD`] with an RMD (node 1) and a thruster (0x0B) on bus 0, a D5 (0x0B) on bus 1, an RMD
    /// (node 1) on bus 2.
    pub fn four_motors() -> Self {
        Self::on(&BOARD)
            .with(0, Protocol::Rmd, 0x01)
            .with(0, Protocol::Thruster, 0x0B)
            .with(1, Protocol::D5, 0x0B)
            .with(2, Protocol::Rmd, 0x01)
    }

    /// [`four_motors`](Self::four_motors), and a D5 (0x0C) on bus 3.
    pub fn five_motors() -> Self {
        Self::four_motors().with(3, Protocol::D5, 0x0C)
    }
}

/// Protocol and node, as in `rmd 1` or `thruster 0x0B`.
impl fmt::Display for MotorWiring {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.protocol {
            Protocol::Rmd => write!(f, "{} {}", self.protocol, self.node),
            Protocol::Thruster | Protocol::D5 => write!(f, "{} 0x{:02X}", self.protocol, self.node),
        }
    }
}

impl fmt::Display for WiringError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WiringError::Bus { bus, buses } => {
                write!(f, "there is no bus {bus}: the board has {buses}")
            }
            WiringError::Node { protocol, node } => {
                write!(f, "no {protocol} motor can have the id {node}")
            }
            WiringError::CanId { protocol } => {
                write!(f, "a {protocol} motor listens on the CAN ids of its manual")
            }
            WiringError::NotOnSerial { protocol } => {
                write!(f, "the simulated {protocol} motor speaks CAN only")
            }
        }
    }
}

impl Error for WiringError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motors_get_the_bitrate_of_their_kind_and_bus() {
        let rates: Vec<_> =
            Wiring::five_motors().motors.iter().map(|motor| motor.bitrate).collect();
        assert_eq!(rates, [1_000_000, 1_000_000, 210_526, 115_200, 115_200]);
    }

    #[test]
    fn motors_are_called_by_protocol_and_node() {
        let names: Vec<_> = Wiring::four_motors().motors.iter().map(ToString::to_string).collect();
        assert_eq!(names, ["rmd 1", "thruster 0x0B", "d5 0x0B", "rmd 1"]);
    }
}
