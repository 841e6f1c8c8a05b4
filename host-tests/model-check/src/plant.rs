//! The board, its buses, and the motors on them.

use gateway::{Board, BusPort, LinkPort};
use host_protocol::{BootReason, BusKind, DEFAULT_BAUD, Protocol, StopAction};
use promise_model::EXTENDED;

/// Host links.
pub const LINKS: u8 = 3;
/// The link whose host only listens: it has said hello, and reads everything at once.
pub const LISTENER: u8 = 2;
/// Buses.
pub const BUSES: u8 = 4;
/// The serial line among them.
pub const LINE: u8 = 2;
/// The others.
pub const CAN_BUSES: [u8; 3] = [0, 1, 3];
/// Those at a rate for D5 motors.
pub const D5_BUSES: [u8; 2] = [1, 3];

/// The board.
pub static BOARD: Board = BOARD_OF_A_START;

const BOARD_OF_A_START: Board = Board {
    name: "model-check",
    firmware: "0.1.0",
    build_id: "model-check",
    boot: BootReason::Simulated,
    buses: &[
        BusPort { kind: BusKind::Can, bitrates: &[1_000_000] },
        BusPort { kind: BusKind::Can, bitrates: &[210_526] },
        BusPort { kind: BusKind::Rs485, bitrates: &[2_000_000] },
        BusPort { kind: BusKind::Can, bitrates: &[210_526] },
    ],
    bus_limit: None,
    links: &[LinkPort { bauds: &[DEFAULT_BAUD, 2_000_000] }; LINKS as usize],
    crash_report: "",
    e_stop_input: true,
    enable_output: true,
};

/// The board when the watchdog has reset it.
pub static BOARD_AGAIN: Board = Board {
    boot: BootReason::Watchdog,
    crash_report: "no check-in from bus 0",
    ..BOARD_OF_A_START
};

/// The buses as the model knows them.
pub const KINDS: [promise_model::BusKind; BUSES as usize] = {
    use promise_model::BusKind::{Can, Rs485};
    [Can, Can, Rs485 { echo: true }, Can]
};

/// Bitrate of each bus, and the protocols of its motors: bits 0 to 2 are RMD, thruster, D5.
pub const BUS_SETUP: [(u32, u8); BUSES as usize] =
    [(1_000_000, 0b011), (210_526, 0b100), (2_000_000, 0b001), (210_526, 0b100)];
/// The protocols that share a CAN bus.
pub const RMD_AND_THRUSTER: u8 = 0b011;

/// A motor, and how its axis stops it.
#[derive(Debug, Clone, Copy)]
pub struct Wired {
    /// Its bus.
    pub bus: u8,
    /// What it speaks.
    pub protocol: Protocol,
    /// Its id.
    pub node: u8,
    /// The stop action of its axis.
    pub stop: StopAction,
}

const fn wired(bus: u8, protocol: Protocol, node: u8, stop: StopAction) -> Wired {
    Wired { bus, protocol, node, stop }
}

/// The id of 29 bits on which a D5 listens beside that of 11, its node, and answers what it is
/// asked there. Those of 11 bits win against it up to its node, and no further.
pub const fn extended_id(node: u8) -> u32 {
    const BEHIND: u32 = 18;
    EXTENDED | (node as u32) << BEHIND | 1
}

/// Motor n is that of axis n.
pub const MOTORS: [Wired; 11] = [
    wired(0, Protocol::Rmd, 1, StopAction::Coast),
    wired(0, Protocol::Rmd, 2, StopAction::Hold),
    wired(0, Protocol::Rmd, 3, StopAction::Brake),
    wired(0, Protocol::Thruster, 0x0E, StopAction::Coast),
    wired(0, Protocol::Thruster, 0x0F, StopAction::Coast),
    wired(0, Protocol::Thruster, 0x10, StopAction::Coast),
    wired(1, Protocol::D5, 0x26, StopAction::Hold),
    wired(1, Protocol::D5, 0x27, StopAction::Hold),
    wired(2, Protocol::Rmd, 1, StopAction::Hold),
    wired(2, Protocol::Rmd, 2, StopAction::Coast),
    wired(1, Protocol::D5, 0x28, StopAction::Hold),
];
/// Axes of D5 motors.
pub const D5_AXES: [u8; 3] = [6, 7, 10];
/// Axes.
pub const AXES: u8 = 11;
/// Bit 0 is axis 0.
pub const ALL_AXES: u32 = (1 << AXES) - 1;
const _: () = assert!(MOTORS.len() == AXES as usize);

/// Motors that no axis is configured for at first: an axis that is moved finds them.
pub const SPARES: [Wired; 8] = [
    wired(0, Protocol::Thruster, 0x12, StopAction::Coast),
    wired(0, Protocol::Rmd, 20, StopAction::Hold),
    wired(1, Protocol::Rmd, 1, StopAction::Coast),
    wired(1, Protocol::Thruster, 0x0E, StopAction::Coast),
    wired(1, Protocol::D5, 0x29, StopAction::Hold),
    wired(3, Protocol::D5, 0x26, StopAction::Hold),
    wired(3, Protocol::D5, 0x27, StopAction::Hold),
    wired(2, Protocol::Rmd, 3, StopAction::Hold),
];

/// Every motor: those of the axes first.
pub fn all_motors() -> impl Iterator<Item = Wired> {
    MOTORS.into_iter().chain(SPARES)
}

/// The thruster with an encoder.
pub const POSITION_DEVICE: u8 = 5;
