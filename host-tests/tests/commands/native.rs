//! What the gateway does with the bytes of a native command.

use host_protocol::{AxisState, Bytes, Protocol, StopAction};
use mgw_client::ClientError;
use mgw_sim::Wire;
use std::time::Duration;

use crate::lab::{AXIS, Lab};

/// How long what moves may last.
const TTL: Duration = Duration::from_millis(90);
/// Some times the period in which a setpoint is sent again, and within its life.
const WATCHED: Duration = Duration::from_millis(70);

/// What became of a native command.
struct Outcome {
    error: Option<&'static str>,
    /// How often its frame left.
    sent: usize,
    state: AxisState,
}

/// How the gateway treats the data of a frame, given as a native command to an idle and to an armed
/// axis.
pub fn treatment(protocol: Protocol, frame: &Wire) -> String {
    let (idle, armed) = (outcome(protocol, frame, false), outcome(protocol, frame, true));
    let known = match (idle.sent, armed.sent) {
        (0, 0) => None,
        (0, 1) => Some("motion once"),
        (0, _) => Some("motion"),
        (_, 0) if armed.error == Some("NotIdle") => Some("provisioning"),
        (_, 1..) if armed.state == AxisState::Armed => Some("read"),
        _ if matches!(armed.state, AxisState::Idle | AxisState::Holding | AxisState::Stopping) => {
            Some("stop")
        }
        _ => None,
    };
    match (known, idle.error, armed.error) {
        (Some(known), _, _) => known.into(),
        // An axis that is not idle is refused before the value is looked at.
        (None, Some(error), Some(again)) if error == again || again == "NotIdle" => {
            format!("refused {error}")
        }
        (None, ..) => format!(
            "unclear: idle {:?}, sent {}; armed {:?}, sent {}, then {:?}",
            idle.error, idle.sent, armed.error, armed.sent, armed.state
        ),
    }
}

fn outcome(protocol: Protocol, frame: &Wire, armed: bool) -> Outcome {
    let stop = if protocol == Protocol::Thruster { StopAction::Coast } else { StopAction::Hold };
    let mut lab = Lab::quiet(protocol, matches!(frame, Wire::Serial(_)), stop);
    let epoch = if armed { lab.arm() } else { 0 };
    lab.frames();
    let error = match lab.client.native(AXIS, epoch, data(frame), TTL) {
        Ok(_) => None,
        Err(ClientError::Gateway(error)) => Some(error.name()),
        Err(error) => panic!("{frame}: {error}"),
    };
    lab.pass(WATCHED);
    let sent = lab.frames().iter().filter(|sent| *sent == frame).count();
    Outcome { error, sent, state: lab.state() }
}

/// The data field, without CAN id or serial framing.
fn data(frame: &Wire) -> Bytes<8> {
    const RS485_HEAD: usize = 3;
    const RS485_CHECKSUM: usize = 2;
    let data = match frame {
        Wire::Can(frame) => frame.data(),
        Wire::Serial(bytes) => &bytes[RS485_HEAD..bytes.len() - RS485_CHECKSUM],
    };
    Bytes::from_slice(data).unwrap()
}
