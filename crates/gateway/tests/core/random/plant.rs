//! The axes, their buses and their motors: ten axes of every protocol and stop action, and what
//! their motors answer.

use super::dice::Dice;
use crate::motors::crc16_modbus;
use embedded_can::Id;
use gateway::Outgoing;
use host_protocol::{Protocol, StopAction};

pub const BUSES: usize = 3;
pub const AXES: usize = 10;

/// Bitrate and protocols of each bus of the rig's board.
pub const BUS_SETUP: [(u32, &[Protocol]); BUSES] = [
    (1_000_000, &[Protocol::Rmd, Protocol::Thruster]),
    (210_526, &[Protocol::D5]),
    (2_000_000, &[Protocol::Rmd]),
];

pub struct Motor {
    pub bus: u8,
    pub protocol: Protocol,
    pub node: u8,
    pub stop: StopAction,
    /// Arbitration ids of requests and replies; none on RS485.
    ids: Option<(u16, u16)>,
}

const fn motor(
    bus: u8,
    protocol: Protocol,
    node: u8,
    stop: StopAction,
    request: u16,
    reply: u16,
) -> Motor {
    Motor { bus, protocol, node, stop, ids: Some((request, reply)) }
}

const fn serial_motor(node: u8) -> Motor {
    Motor { bus: 2, protocol: Protocol::Rmd, node, stop: StopAction::Hold, ids: None }
}

pub const MOTORS: [Motor; AXES] = [
    motor(0, Protocol::Rmd, 1, StopAction::Coast, 0x141, 0x241),
    motor(0, Protocol::Rmd, 2, StopAction::Hold, 0x142, 0x242),
    motor(0, Protocol::Rmd, 3, StopAction::Brake, 0x143, 0x243),
    motor(0, Protocol::Thruster, 0x0E, StopAction::Coast, 0x30E, 0x28E),
    motor(0, Protocol::Thruster, 0x0F, StopAction::Coast, 0x30F, 0x28F),
    motor(0, Protocol::Thruster, 0x10, StopAction::Coast, 0x310, 0x290),
    motor(1, Protocol::D5, 0x26, StopAction::Hold, 0x26, 0x26),
    motor(1, Protocol::D5, 0x27, StopAction::Hold, 0x27, 0x27),
    serial_motor(1),
    serial_motor(2),
];

/// The thruster with a position controller.
pub const POSITION_DEVICE: u8 = 5;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    Motion,
    Stop,
    Other,
}

/// A request to a motor, read from the wire.
#[derive(Debug, Clone)]
pub struct ToMotor {
    pub axis: usize,
    /// Under the id of RMD motion mode.
    motion_mode: bool,
    pub data: Vec<u8>,
}

impl ToMotor {
    /// `None` for raw frames, which go to no motor.
    pub fn read(bus: u8, frame: &Outgoing) -> Option<Self> {
        let of_bus = |motor: &Motor| motor.bus == bus;
        match frame {
            Outgoing::Can(frame) => {
                let Id::Standard(id) = frame.id() else { return None };
                let motion_mode = |motor: &Motor| {
                    motor.protocol == Protocol::Rmd && u16::from(motor.node) + 0x400 == id.as_raw()
                };
                let is_for = |motor: &Motor| {
                    motor.ids.is_some_and(|ids| ids.0 == id.as_raw() || motion_mode(motor))
                };
                let axis = MOTORS.iter().position(|motor| of_bus(motor) && is_for(motor))?;
                let motion_mode = motion_mode(&MOTORS[axis]);
                Some(Self { axis, motion_mode, data: frame.data().to_vec() })
            }
            Outgoing::Serial(bytes) => {
                let [0x3E, node, 8, data @ .., _, _] = bytes.as_slice() else { return None };
                let axis = MOTORS.iter().position(|motor| of_bus(motor) && motor.node == *node)?;
                Some(Self { axis, motion_mode: false, data: data.to_vec() })
            }
        }
    }

    pub fn purpose(&self) -> Purpose {
        match (MOTORS[self.axis].protocol, self.data.as_slice()) {
            _ if self.motion_mode => Purpose::Motion,
            (Protocol::Rmd, [0xA1..=0xA8, ..]) => Purpose::Motion,
            (Protocol::Rmd, [0x80 | 0x81, ..]) => Purpose::Stop,
            (Protocol::Thruster, [b'T', b'C', _, _, 0, 0, 0, 0]) => Purpose::Stop,
            (
                Protocol::Thruster,
                [b'T' | b'V', b'C', _, _, _, _, _, _] | [b'L', b'A' | b'R', ..],
            ) => Purpose::Motion,
            (Protocol::D5, [_, _, _, 3, 0x20, 0, 0, _]) => Purpose::Stop,
            // The stop sequence overwrites what waits by speed 0.
            (Protocol::D5, [_, _, _, 4, 0x20, 0, 0, _]) => Purpose::Other,
            (Protocol::D5, [_, _, _, 3 | 4, 0x20, ..] | [_, _, _, 5, ..]) => Purpose::Motion,
            _ => Purpose::Other,
        }
    }

    /// What the motor answers: now and then a fault, a refusal, a speed that is not 0, or nothing.
    pub fn reply(&self, now_us: u64, dice: &mut Dice) -> Option<FromMotor> {
        let mut data = self.data.clone();
        match MOTORS[self.axis].protocol {
            // Nothing turns and nothing pulls (RMD V3.6 §5.3).
            _ if self.motion_mode => {
                data = vec![MOTORS[self.axis].node, 0x80, 0, 0x80, 0x08, 0, 0, 0]
            }
            Protocol::Rmd => rmd_reply(&mut data, now_us, dice),
            Protocol::Thruster => thruster_reply(&mut data, dice),
            Protocol::D5 => d5_reply(&mut data, dice),
        }
        (!dice.one_in(300)).then_some(FromMotor {
            axis: self.axis,
            motion_mode: self.motion_mode,
            data,
        })
    }
}

fn rmd_reply(data: &mut [u8], now_us: u64, dice: &mut Dice) {
    match data[0] {
        0x9A => {
            let brake = u8::from(dice.percent(50));
            let faults = if dice.one_in(3_000) { 4 } else { 0 };
            data.copy_from_slice(&[0x9A, 30, 0, brake, 0xE5, 1, faults, 0]);
        }
        // It has run for as long as the gateway.
        0xB1 => {
            data[4..].copy_from_slice(&u32::try_from(now_us / 1_000).unwrap_or(0).to_le_bytes())
        }
        // Thrown back: received, not carried out.
        0xA1..=0xA8 if dice.one_in(1_000) => {}
        command @ (0x9C | 0xA1..=0xA8) => {
            let speed: u16 = if dice.one_in(60) { 500 } else { 0 };
            let [low, high] = speed.to_le_bytes();
            data.copy_from_slice(&[command, 30, 0, 0, low, high, 0, 0]);
        }
        _ => {}
    }
}

fn thruster_reply(data: &mut Vec<u8>, dice: &mut Dice) {
    if data.len() == 4 {
        data.extend([0, 0, 0, u8::from(dice.one_in(3_000))]);
    } else if dice.one_in(1_000) {
        data[4..].copy_from_slice(&[0, 0, 0xEE, 0xEE]);
    }
}

fn d5_reply(data: &mut [u8], dice: &mut Dice) {
    data[0] = 0x5D;
    if data[3] == 2 {
        let protection = if dice.one_in(3_000) { 4 } else { 0 };
        let write_waits = u8::from(dice.one_in(30));
        let value = match data[4] {
            0x10 => 2,
            0x11 => 1,
            0x12 => protection,
            0x2C => write_waits,
            _ => 0,
        };
        data[5..7].copy_from_slice(&[value, 0]);
    }
    data[7] = data[1..7].iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
}

/// A reply on its way.
#[derive(Debug, Clone)]
pub struct FromMotor {
    pub axis: usize,
    motion_mode: bool,
    pub data: Vec<u8>,
}

impl FromMotor {
    pub fn bus(&self) -> u8 {
        MOTORS[self.axis].bus
    }

    /// Arbitration id of the reply; `None` on RS485.
    pub fn id(&self) -> Option<u16> {
        let motor = &MOTORS[self.axis];
        let usual = motor.ids.map(|(_, reply)| reply)?;
        Some(if self.motion_mode { 0x500 + u16::from(motor.node) } else { usual })
    }

    /// The reply as it goes over RS485.
    pub fn serial(&self) -> Vec<u8> {
        let mut bytes = vec![0x3E, MOTORS[self.axis].node, 8];
        bytes.extend(&self.data);
        bytes.extend(crc16_modbus(&bytes).to_le_bytes());
        bytes
    }
}
