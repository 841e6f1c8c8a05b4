//! The data field of a native command, decoded before anything is armed or sent: what it is, what it does, or why it is no
//! command. The gateway decides by itself.

use host_protocol::{BusKind, Error, Protocol, Setpoint};

use crate::failure::Failure;

/// A command of one of the manuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NativeRequest {
    Rmd(rmd::Request),
    Thruster(thruster::Request),
    D5(d5::Request),
}

/// Whose command it shall be.
#[derive(Debug, Clone, Copy)]
pub struct Motor {
    pub axis: u8,
    pub protocol: Protocol,
    pub node: u8,
    pub bus: BusKind,
}

/// What a command does, as far as `mgw` asks the user to say so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    /// It stops the motor.
    Stops,
    /// It moves the motor, and may be sent again and again.
    Moves(Demand),
    /// It moves the motor anew each time it is sent.
    MovesOnce(Demand),
    /// It prepares a motion in the motor, or starts what was prepared.
    Prepares,
    /// None of these: it asks, or it changes the motor.
    Other,
}

/// What a motion asks of the shaft, in SI units and in the motor's sense of rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Demand {
    /// The same as this setpoint.
    Setpoint(Setpoint),
    /// A position, at whatever speed the motor can.
    Unlimited { position_rad: f32 },
    /// A distance.
    Distance { speed_limit_rad_s: f32 },
}

impl NativeRequest {
    /// The command that the data field is, or what is wrong with it.
    pub fn decode(motor: Motor, data: &[u8]) -> Result<Self, Failure> {
        let Motor { axis, protocol, .. } = motor;
        let no_command = |text: String| Failure::Explained {
            error: Error::NotACommand { axis, protocol },
            text: format!("{text}; axis {axis} speaks {protocol}"),
        };
        let unknown = |code: String| {
            no_command(format!(
                "{code} is a command that the manual does not list (`mgw encode --protocol {} --list` lists them)",
                protocol.name()
            ))
        };
        let request = match protocol {
            Protocol::Rmd => {
                let bytes = data.try_into().map_err(|_| no_command(length(data.len(), "8")))?;
                match rmd::Request::decode(bytes) {
                    request @ rmd::Request::Unknown { .. } => {
                        return Err(unknown(format!("{:#04X}", request.command())));
                    }
                    request => Self::Rmd(request),
                }
            }
            Protocol::Thruster => match thruster::Request::decode(data) {
                Ok(request @ thruster::Request::Unknown { .. }) => {
                    return Err(unknown(format!("{:#06X}", request.command())));
                }
                Ok(request) => Self::Thruster(request),
                Err(error) => return Err(no_command(thruster_cause(&error))),
            },
            Protocol::D5 => Self::D5(d5_request(motor, data, &no_command, &unknown)?),
        };
        request.encodes(motor).map_err(|error| no_command(error.to_string()))?;
        Ok(request)
    }

    /// Whether its values are such as the manual allows.
    fn encodes(&self, motor: Motor) -> Result<(), codec::EncodeError> {
        match self {
            Self::Rmd(request) => {
                let node = rmd::Node::new(motor.node)?;
                match motor.bus {
                    BusKind::Can => rmd::can::request::<host_protocol::CanFrame>(node, request).map(drop),
                    BusKind::Rs485 => rmd::rs485::request(node, request).map(drop),
                }
            }
            Self::Thruster(request) => request.encode().map(drop),
            Self::D5(request) => {
                let address = d5::Address::Node(d5::Node::new(motor.node)?);
                d5::request_frame(address, request).map(drop)
            }
        }
    }

    /// What it does.
    pub fn effect(&self) -> Effect {
        match self {
            Self::Rmd(request) => rmd(request),
            Self::Thruster(request) => thruster(request),
            Self::D5(request) => d5(request),
        }
    }
}

fn d5_request(
    motor: Motor,
    data: &[u8],
    no_command: &dyn Fn(String) -> Failure,
    unknown: &dyn Fn(String) -> Failure,
) -> Result<d5::Request, Failure> {
    let Motor { axis, node, .. } = motor;
    let frame: &[u8; d5::FRAME_LEN] =
        data.try_into().map_err(|_| no_command(length(data.len(), "8, from D5 to the checksum")))?;
    let (address, request) =
        d5::decode_request_frame(frame).map_err(|error| no_command(error.to_string()))?;
    let to = address.id();
    if to != node {
        let whom =
            if address == d5::Address::Broadcast { "all motors".to_owned() } else { format!("node {to}") };
        return Err(Failure::Explained {
            error: Error::NotThisNode { axis, node },
            text: format!(
                "these bytes are for {whom}, and the motor of axis {axis} is node {node}; `mgw raw` reaches others"
            ),
        });
    }
    if let d5::Request::Unknown { .. } = request {
        let [_, _, _, command, ..] = frame;
        return Err(unknown(format!("{command:#04X}")));
    }
    Ok(request)
}

fn length(got: usize, allowed: &str) -> String {
    format!("{got} data bytes instead of {allowed}")
}

/// Why bytes are no frame of the thruster protocol, whose frames have two lengths.
pub fn thruster_cause(error: &thruster::DecodeError) -> String {
    match error {
        thruster::DecodeError::Length { got, .. } if !THRUSTER_LENGTHS.contains(got) => {
            length(*got, "4 or 8")
        }
        error => error.to_string(),
    }
}

/// Thruster manual §1.2.
const THRUSTER_LENGTHS: [usize; 2] = [4, 8];

/// Wire units in SI units.
fn rad(degrees: f64) -> f32 {
    single(degrees.to_radians())
}

fn rad_s_of_rpm(rpm: f64) -> f32 {
    single(rpm * std::f64::consts::TAU / 60.0)
}

fn single(value: f64) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "the gateway counts in f32 too")]
    let value = value as f32;
    value
}

/// A command of 0 is one that stops.
fn rests_or_moves(setpoint: Setpoint, is_zero: bool) -> Effect {
    if is_zero { Effect::Stops } else { Effect::Moves(Demand::Setpoint(setpoint)) }
}

fn rmd(request: &rmd::Request) -> Effect {
    use rmd::Request;
    let hundredths = |count: i32| f64::from(count) / 100.0;
    match request {
        Request::Shutdown | Request::Stop => Effect::Stops,
        Request::TorqueCurrent { current } => {
            let current_a = single(hundredths(i32::from(current.0)));
            Effect::Moves(Demand::Setpoint(Setpoint::Current { current_a }))
        }
        Request::Velocity { speed } => {
            let velocity_rad_s = rad(hundredths(speed.0));
            Effect::Moves(Demand::Setpoint(Setpoint::Velocity { velocity_rad_s }))
        }
        Request::PositionTracking { angle } => {
            Effect::Moves(Demand::Unlimited { position_rad: rad(hundredths(angle.0)) })
        }
        Request::AbsolutePosition { max_speed, angle } => {
            Effect::Moves(Demand::Setpoint(Setpoint::Position {
                position_rad: rad(hundredths(angle.0)),
                speed_limit_rad_s: rad(f64::from(max_speed.0)),
            }))
        }
        Request::LimitedPositionTracking { max_speed, angle } => {
            Effect::Moves(Demand::Setpoint(Setpoint::Position {
                position_rad: rad(hundredths(angle.0)),
                speed_limit_rad_s: rad(hundredths(i32::from(max_speed.0))),
            }))
        }
        Request::IncrementalPosition { max_speed, .. } => {
            Effect::MovesOnce(Demand::Distance { speed_limit_rad_s: rad(f64::from(max_speed.0)) })
        }
        _ => Effect::Other,
    }
}

fn thruster(request: &thruster::Request) -> Effect {
    use thruster::Request;
    match request {
        Request::EmergencyStop => Effect::Stops,
        Request::Signal { signal } => {
            let fraction = single(f64::from(signal.0) / 100.0);
            rests_or_moves(Setpoint::Signal { fraction }, signal.0 == 0)
        }
        Request::Speed { speed } => {
            let velocity_rad_s = rad_s_of_rpm(f64::from(speed.0));
            rests_or_moves(Setpoint::Velocity { velocity_rad_s }, speed.0 == 0)
        }
        Request::AbsolutePosition { speed, position } => {
            Effect::Moves(Demand::Setpoint(Setpoint::Position {
                position_rad: rad(f64::from(position.0) / 10.0),
                speed_limit_rad_s: rad_s_of_rpm(f64::from(speed.0)),
            }))
        }
        Request::RelativePosition { speed, .. } => {
            Effect::MovesOnce(Demand::Distance { speed_limit_rad_s: rad_s_of_rpm(f64::from(speed.0)) })
        }
        _ => Effect::Other,
    }
}

fn d5(request: &d5::Request) -> Effect {
    use d5::{Register, Request, Value, decode_speed};
    match request {
        Request::Write { register: Register::SPEED, value: Value::Word(word) } => {
            let speed = decode_speed(*word).0;
            let velocity_rad_s = rad(f64::from(speed));
            rests_or_moves(Setpoint::Velocity { velocity_rad_s }, speed == 0)
        }
        Request::AsyncWrite { register: Register::SPEED, .. } | Request::Execute => Effect::Prepares,
        _ => Effect::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motor(protocol: Protocol) -> Motor {
        Motor { axis: 0, protocol, node: 0x0B, bus: BusKind::Can }
    }

    fn effect(protocol: Protocol, data: &[u8]) -> Effect {
        NativeRequest::decode(motor(protocol), data).unwrap().effect()
    }

    fn why(protocol: Protocol, data: &[u8]) -> String {
        NativeRequest::decode(motor(protocol), data).unwrap_err().to_string()
    }

    /// RMD V3.6 §2; the first byte is the command.
    #[test]
    fn rmd_commands() {
        let effect = |command: u8| effect(Protocol::Rmd, &[command, 0, 0, 0, 0x64, 0, 0, 0]);
        for command in [0x80, 0x81] {
            assert_eq!(effect(command), Effect::Stops, "{command:#x}");
        }
        for command in [0xA1, 0xA2, 0xA3, 0xA4, 0xA5] {
            assert!(matches!(effect(command), Effect::Moves(_)), "{command:#x}");
        }
        assert_eq!(effect(0xA1), Effect::Moves(Demand::Setpoint(Setpoint::Current { current_a: 1.0 })));
        assert_eq!(effect(0xA8), Effect::MovesOnce(Demand::Distance { speed_limit_rad_s: 0.0 }));
        for command in [0x92, 0x9A, 0x9C, 0x64, 0x76, 0x77] {
            assert_eq!(effect(command), Effect::Other, "{command:#x}");
        }
    }

    /// Thruster manual §2.1, §4.1.
    #[test]
    fn thruster_commands() {
        let effect = |data: &[u8]| effect(Protocol::Thruster, data);
        assert_eq!(
            effect(b"TC\0\0\0\0\xFF\xFB"),
            Effect::Moves(Demand::Setpoint(Setpoint::Signal { fraction: -0.05 }))
        );
        assert_eq!(effect(b"TC\0\0\0\0\0\0"), Effect::Stops);
        assert!(matches!(effect(b"VC\0\0\0\0\x01\x2C"), Effect::Moves(_)));
        assert_eq!(effect(b"VC\0\0\0\0\0\0"), Effect::Stops);
        assert!(matches!(effect(b"LA\x01\x2C\xFF\xFF\xF8\xF9"), Effect::Moves(_)));
        assert!(matches!(effect(b"LR\x01\x2C\xFF\xFF\xF8\xF9"), Effect::MovesOnce(_)));
        assert_eq!(effect(b"QV\0\0"), Effect::Other);
    }

    /// D5 manual, common rows 2 and 3, rows 11 and 13; checksums are sums of the bytes after the first.
    #[test]
    fn d5_commands() {
        let effect = |data: [u8; 8]| effect(Protocol::D5, &data);
        let Effect::Moves(Demand::Setpoint(Setpoint::Velocity { velocity_rad_s })) =
            effect([0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D])
        else {
            panic!("600 °/s");
        };
        assert!((velocity_rad_s - 10.472).abs() < 0.001, "{velocity_rad_s}");
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x03, 0x20, 0x00, 0x00, 0x33]), Effect::Stops);
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x04, 0x20, 0x58, 0x02, 0x8E]), Effect::Prepares);
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x05, 0x00, 0x00, 0x00, 0x15]), Effect::Prepares);
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x02, 0x26, 0x00, 0x00, 0x38]), Effect::Other);
    }

    #[test]
    fn each_cause_is_named() {
        assert!(why(Protocol::Rmd, &[0x9C, 0]).starts_with("2 data bytes instead of 8; axis 0 speaks"));
        assert!(why(Protocol::Rmd, &[0xFF, 0, 0, 0, 0, 0, 0, 0]).starts_with("0xFF is a command that"));
        assert!(why(Protocol::Thruster, b"QV\0").starts_with("3 data bytes instead of 4 or 8"));
        assert!(why(Protocol::Thruster, b"TC\0\0").starts_with("4 data bytes instead of 8"));
        assert!(why(Protocol::Thruster, b"XX\0\0").starts_with("0x5858 is a command that"));
        assert!(why(Protocol::Thruster, b"TC\0\0\0\0\0\x65").starts_with("signal 101 is outside -100..=100"));
        let d5 = |bytes| why(Protocol::D5, bytes);
        assert!(
            d5(&[0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8E])
                .starts_with("checksum 0x8e instead of 0x8d")
        );
        assert!(d5(&[0xD5, 0x0C, 0x05, 0x02, 0x26, 0x00, 0x00, 0x39]).contains("for node 12"));
        assert!(d5(&[0xD5, 0xFE, 0x05, 0x05, 0x00, 0x00, 0x00, 0x08]).contains("for all motors"));
        assert!(d5(&[0xD5, 0x0B]).starts_with("2 data bytes instead of 8, from D5 to the checksum"));
    }
}
