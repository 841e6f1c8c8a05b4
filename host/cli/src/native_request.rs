//! Why the data field of a native command is no command to its motor, in more words than the
//! gateway's refusal has.

use host_protocol::{BusKind, Error, Protocol};
use mgw_client::ClientError;

use crate::failure::Failure;
use crate::frames;

/// RMD V3.6 §2.9, §2.10, §2.33.4; the axis is not armed before (`RestartOwed`).
const RESTART: &str = "a restart of the motor: restart it (0x76)";
/// Thruster manual §2.2.
const POWER_CYCLE: &str =
    "a power cycle: power-cycle the device, and configure the gateway for it then";

/// Whose command it shall be.
#[derive(Debug, Clone, Copy)]
pub struct Motor {
    pub axis: u8,
    pub protocol: Protocol,
    pub node: u8,
    pub bus: BusKind,
}

/// The refusal of a data field, with its cause where that can be told.
pub fn explain(motor: Motor, data: &[u8], error: Error) -> Failure {
    let Motor { axis, protocol, node, .. } = motor;
    let text = match error {
        Error::NotACommand { .. } => {
            cause(motor, data).err().map(|cause| format!("{cause}; axis {axis} speaks {protocol}"))
        }
        Error::NotThisNode { .. } => whom(data).map(|whom| {
            format!(
                "these bytes are for {whom}, and the motor of axis {axis} is node {node}; `mgw \
                raw` reaches others"
            )
        }),
        _ => None,
    };
    match text {
        Some(text) => Failure::Explained { error, text },
        None => ClientError::Gateway(error).into(),
    }
}

/// What has to happen before a command acts that was carried out, where something has to.
pub fn acts_after(motor: Motor, data: &[u8]) -> Option<&'static str> {
    let restart =
        || rmd::Request::decode(data.try_into().ok()?).acts_after_restart().then_some(RESTART);
    let power_cycle =
        || thruster::Request::decode(data).ok()?.acts_after_power_cycle().then_some(POWER_CYCLE);
    match motor.protocol {
        Protocol::Rmd => restart(),
        Protocol::Thruster => power_cycle(),
        Protocol::D5 => None,
    }
}

/// What keeps a data field from being a command of the motor's manual.
fn cause(motor: Motor, data: &[u8]) -> Result<(), String> {
    let encodes = match motor.protocol {
        Protocol::Rmd => {
            let bytes = data.try_into().map_err(|_| length(data.len(), "8"))?;
            let request = rmd::Request::decode(bytes);
            if let rmd::Request::Unknown { .. } = request {
                return Err(unlisted(motor, &format!("{:#04X}", request.command())));
            }
            rmd::Node::new(motor.node)
                .and_then(|node| frames::to_rmd(motor.bus, node, &request))
                .map(drop)
        }
        Protocol::Thruster => {
            let request =
                thruster::Request::decode(data).map_err(|error| thruster_cause(&error))?;
            if let thruster::Request::Unknown { .. } = request {
                return Err(unlisted(motor, &format!("{:#06X}", request.command())));
            }
            request.encode().map(drop)
        }
        Protocol::D5 => {
            let frame: &[u8; d5::FRAME_LEN] =
                data.try_into().map_err(|_| length(data.len(), "8, from D5 to the checksum"))?;
            let (address, request) =
                d5::decode_request_frame(frame).map_err(|error| error.to_string())?;
            if let d5::Request::Unknown { .. } = request {
                let [_, _, _, command, ..] = frame;
                return Err(unlisted(motor, &format!("{command:#04X}")));
            }
            d5::request_frame(address, &request).map(drop)
        }
    };
    encodes.map_err(|error| error.to_string())
}

fn unlisted(motor: Motor, code: &str) -> String {
    let protocol = motor.protocol.name();
    format!(
        "{code} is a command that the manual does not list (`mgw encode --protocol {protocol} \
            --list` lists them)"
    )
}

/// Whom the frame of a D5 motor is for.
fn whom(data: &[u8]) -> Option<String> {
    let (address, _) = d5::decode_request_frame(data.try_into().ok()?).ok()?;
    Some(match address {
        d5::Address::Broadcast => "all motors".to_owned(),
        d5::Address::Node(node) => format!("node {}", node.get()),
    })
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
