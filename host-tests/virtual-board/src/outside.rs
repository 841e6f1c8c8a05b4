//! Everything outside the board as one wiring of the simulator describes it: two computers, and
//! motors on its buses.

use mgw_sim::{Injection, Motor, MotorWiring, Wiring, WiringError};

use crate::board::Board;
use crate::can_motors::CanMotor;
use crate::host_uart::HostUart;
use crate::machine::{Builder, CanNode, Line, Machine, UartPort};
use crate::rs485_line::Rs485Line;

/// Where a motor hangs.
#[derive(Clone, Copy)]
enum Place {
    Can(CanNode<CanMotor>),
    /// Its index on the RS485 line.
    Rs485(usize),
}

/// Handles to what hangs on the board's ports.
#[derive(Clone)]
pub struct Outside {
    /// The computers at host links 0 and 1.
    pub hosts: [Line<HostUart>; 2],
    /// The RS485 line.
    pub rs485: Line<Rs485Line>,
    motors: Vec<(u8, Place)>,
}

impl Outside {
    /// Hangs two computers, an RS485 line and these motors on a board. The last bus is the RS485
    /// line, the others are CAN. `seed` decides the motors' reply times.
    /// Fails if a motor cannot be connected as the wiring says.
    pub fn connect(
        board: &mut Builder,
        motors: &[MotorWiring],
        seed: u64,
    ) -> Result<Self, WiringError> {
        let (ports, rs485_bus) = (board.board().can_ports, board.board().rs485_bus());
        let mut line = Rs485Line::new();
        let mut places = Vec::with_capacity(motors.len());
        for (wiring, seed) in motors.iter().zip(seed..) {
            let place = match ports.get(usize::from(wiring.bus)) {
                Some(port) => {
                    let motor = CanMotor::new(*wiring, seed)?;
                    Place::Can(board.can_node(*port, motor, Some(wiring.bitrate)))
                }
                None if wiring.bus == rs485_bus => Place::Rs485(line.connect(*wiring, seed)?),
                None => {
                    return Err(WiringError::Bus {
                        bus: wiring.bus,
                        buses: usize::from(rs485_bus) + 1,
                    });
                }
            };
            places.push((wiring.bus, place));
        }
        let hosts =
            [UartPort::Host0, UartPort::Host1].map(|port| board.line(port, HostUart::new()));
        Ok(Self { hosts, rs485: board.line(UartPort::Rs485, line), motors: places })
    }

    /// [`Outside::connect`] with the motors of [`Wiring::four_motors`]: an RMD (node 1) and a
    /// thruster (0x0B) on bus 0, a D5 (0x0B) on bus 1, an RMD (node 1) on the RS485 line.
    pub fn four_motors(board: &mut Builder, seed: u64) -> Self {
        let motors = four_motors(board.board());
        Self::connect(board, &motors, seed).expect("a sound wiring")
    }

    /// How many motors there are.
    pub fn motors(&self) -> usize {
        self.motors.len()
    }

    /// The bus of a motor.
    /// Panics if there is none with this index.
    pub fn bus(&self, motor: usize) -> u8 {
        self.motors[motor].0
    }

    /// A motor, in the order of the wiring: its shaft, its faults, its log.
    /// Panics if there is none with this index.
    pub fn motor<'a>(&self, machine: &'a mut Machine, motor: usize) -> &'a Motor {
        match self.motors[motor].1 {
            Place::Can(node) => machine.node(node).motor(),
            Place::Rs485(index) => machine.line(self.rs485).motor(index),
        }
    }

    /// Puts a fault into a motor, or takes it out again. Unplugged, a motor on CAN acknowledges
    /// nothing either.
    /// Panics if there is none with this index.
    pub fn inject(&self, machine: &mut Machine, motor: usize, injection: Injection) {
        match self.motors[motor].1 {
            Place::Can(node) => {
                machine.drive_node(node, |motor, timeline| motor.inject(injection, timeline));
                if let Injection::Unplugged(off) = injection {
                    machine.silence_node(node, off);
                }
            }
            Place::Rs485(index) => {
                machine.drive_line(self.rs485, |line, timeline| {
                    line.inject(index, injection, timeline)
                });
            }
        }
    }

    /// Switches a motor off and on again: it has the bitrate that it was told before.
    /// Panics if there is none with this index.
    pub fn power_cycle(&self, machine: &mut Machine, motor: usize) {
        match self.motors[motor].1 {
            Place::Can(node) => {
                machine.drive_node(node, CanMotor::power_cycle);
                let bitrate = machine.node(node).bitrate();
                machine.set_node_bitrate(node, bitrate);
            }
            Place::Rs485(index) => {
                machine.drive_line(self.rs485, |line, timeline| line.power_cycle(index, timeline));
            }
        }
    }
}

/// The wiring of [`Wiring::four_motors`] with the last motor on the board's RS485 bus.
fn four_motors(board: Board) -> Vec<MotorWiring> {
    let mut motors = Wiring::four_motors().motors;
    let last = motors.last_mut().expect("four motors");
    last.bus = board.rs485_bus();
    motors
}

#[cfg(test)]
mod tests;
