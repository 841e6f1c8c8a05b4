//! What a host tells the gateway of the simulator's four motors before they move.

use std::time::Duration;

use host_protocol::{AxisParameter, Protocol, ProtocolSet, Setpoint, StopAction, Value};
use mgw_client::{Client, ClientError, Transport};
use mgw_sim::MotorWiring;

use crate::board::Board;

/// How long the gateway waits for a reply.
pub const REPLY_WINDOW: Duration = Duration::from_millis(5);

/// What a host tells of an axis.
#[derive(Debug, Clone, Copy)]
pub struct Axis {
    /// Its bus.
    pub bus: u8,
    /// The protocol of its motor.
    pub protocol: Protocol,
    /// The node of its motor.
    pub node: u32,
    /// What stops it.
    pub stop_action: StopAction,
}

/// Number, bitrate and protocols of the motors' buses.
pub fn buses() -> [(u8, u32, ProtocolSet); 3] {
    [
        (0, 1_000_000, ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster])),
        (1, 210_526, ProtocolSet::of(&[Protocol::D5])),
        (Board::chosen().rs485_bus(), 115_200, ProtocolSet::of(&[Protocol::Rmd])),
    ]
}

/// The axes of the four motors.
pub fn axes() -> [Axis; 4] {
    let axis = |bus, protocol, node, stop_action| Axis { bus, protocol, node, stop_action };
    [
        axis(0, Protocol::Rmd, 0x01, StopAction::Hold),
        axis(0, Protocol::Thruster, 0x0B, StopAction::Coast),
        axis(1, Protocol::D5, 0x0B, StopAction::Hold),
        axis(Board::chosen().rs485_bus(), Protocol::Rmd, 0x01, StopAction::Hold),
    ]
}

/// What turns a motor: the thruster at a tenth of its speed, the others at 2 rad/s.
pub fn turning(protocol: Protocol) -> Setpoint {
    match protocol {
        Protocol::Thruster => Setpoint::Signal { fraction: 0.1 },
        Protocol::Rmd | Protocol::D5 => Setpoint::Velocity { velocity_rad_s: 2.0 },
    }
}

/// An RMD on a bus.
pub fn rmd(bus: u8, node: u8, bitrate: u32) -> MotorWiring {
    MotorWiring { bus, protocol: Protocol::Rmd, node, bitrate, can_id: None }
}

/// Starts a bus for RMDs.
pub fn start_rmd_bus<T: Transport>(
    client: &mut Client<T>,
    bus: u8,
    bitrate: u32,
) -> Result<(), ClientError> {
    client.configure_bus(bus, bitrate, ProtocolSet::of(&[Protocol::Rmd]), false, REPLY_WINDOW)
}

/// Sets parameters of an axis that are whole numbers.
pub fn set_axis<T: Transport>(
    client: &mut Client<T>,
    axis: u8,
    values: &[(AxisParameter, u32)],
) -> Result<(), ClientError> {
    for (parameter, value) in values {
        client.configure_axis(axis, *parameter, Value::Unsigned(*value))?;
    }
    Ok(())
}

impl Axis {
    /// An RMD of node 1 that holds when it stops.
    pub fn rmd(bus: u8) -> Self {
        Self { bus, ..axes()[0] }
    }

    /// Tells the gateway so.
    pub fn configure<T: Transport>(
        self,
        client: &mut Client<T>,
        axis: u8,
    ) -> Result<(), ClientError> {
        let values = [
            (AxisParameter::Bus, self.bus.into()),
            (AxisParameter::Protocol, self.protocol.into()),
            (AxisParameter::Node, self.node),
            (AxisParameter::StopAction, self.stop_action.into()),
        ];
        set_axis(client, axis, &values)
    }

    /// Whether its motor can be told a timeout of its own.
    pub fn has_motor_timeout(self) -> bool {
        self.protocol != Protocol::D5
    }
}
