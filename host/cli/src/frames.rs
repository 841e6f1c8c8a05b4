//! Frames of a motor bus in words, read with the codecs of the gateway.

use host_protocol::{Protocol, ProtocolSet};
use mgw_sim::Wire;

use crate::decode::fields;

/// What a frame means.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Meaning {
    /// The motor it is for or from, as `rmd 1`.
    pub motor: String,
    /// The command or reply with its values in the units of the manual.
    pub text: String,
    /// Whether it asks a motor to stop.
    pub is_stop: bool,
}

/// Reads a frame of a bus that speaks `protocols`; `None` if none of them knows it.
pub fn read(wire: &Wire, from_gateway: bool, protocols: ProtocolSet) -> Option<Meaning> {
    protocols.iter().find_map(|protocol| match (protocol, from_gateway) {
        (Protocol::Rmd, true) => rmd_request(wire),
        (Protocol::Rmd, false) => rmd_reply(wire),
        (Protocol::Thruster, true) => thruster_request(wire),
        (Protocol::Thruster, false) => thruster_reply(wire),
        (Protocol::D5, true) => d5_request(wire),
        (Protocol::D5, false) => d5_reply(wire),
    })
}

fn meaning(motor: String, is_stop: bool, command: &str, fields: &str) -> Option<Meaning> {
    let text = format!("{command} {fields}").trim_end().to_owned();
    Some(Meaning { motor, text, is_stop })
}

/// The meaning of a request or a reply of any codec.
macro_rules! meaning {
    ($motor:expr, $is_stop:expr, $message:expr) => {
        meaning($motor, $is_stop, $message.name(), &fields(|visit| $message.visit_fields(visit)))
    };
}

fn rmd_request(wire: &Wire) -> Option<Meaning> {
    let (node, request) = match wire {
        Wire::Can(frame) => rmd::can::decode_request(frame).ok()?,
        Wire::Serial(bytes) => {
            rmd::rs485::decode_request(bytes.as_slice().try_into().ok()?).ok()?
        }
    };
    let is_stop = matches!(request, rmd::Request::Stop | rmd::Request::Shutdown);
    meaning!(format!("rmd {}", node.get()), is_stop, request)
}

fn rmd_reply(wire: &Wire) -> Option<Meaning> {
    let (node, reply) = match wire {
        Wire::Can(frame) => rmd::can::decode_reply(frame).ok()?,
        Wire::Serial(bytes) => rmd::rs485::decode_reply(bytes.as_slice().try_into().ok()?).ok()?,
    };
    meaning!(format!("rmd {}", node.get()), false, reply)
}

fn thruster_request(wire: &Wire) -> Option<Meaning> {
    let Wire::Can(frame) = wire else { return None };
    let (node, request) = thruster::can::decode_request(frame).ok()?;
    let is_stop = matches!(request, thruster::Request::Signal { signal: thruster::Percent(0) });
    meaning!(format!("thruster 0x{:02X}", node.get()), is_stop, request)
}

fn thruster_reply(wire: &Wire) -> Option<Meaning> {
    let Wire::Can(frame) = wire else { return None };
    let (node, reply) = thruster::can::decode_reply(frame).ok()?;
    meaning!(format!("thruster 0x{:02X}", node.get()), false, reply)
}

fn d5_request(wire: &Wire) -> Option<Meaning> {
    let (address, request) = match wire {
        Wire::Can(frame) => d5::can::decode_request(frame).ok()?,
        Wire::Serial(bytes) => d5::decode_request_frame(bytes.as_slice().try_into().ok()?).ok()?,
    };
    let motor = match address {
        d5::Address::Node(node) => d5_name(node),
        d5::Address::Broadcast => "every d5".to_owned(),
    };
    let is_stop = matches!(
        request,
        d5::Request::Write { register: d5::Register::SPEED, value: d5::Value::Word(0) }
    );
    meaning!(motor, is_stop, request)
}

fn d5_reply(wire: &Wire) -> Option<Meaning> {
    let (node, reply) = match wire {
        Wire::Can(frame) => d5::can::decode_reply(frame).ok()?,
        Wire::Serial(bytes) => d5::decode_reply_frame(bytes.as_slice().try_into().ok()?).ok()?,
    };
    meaning!(d5_name(node), false, reply)
}

fn d5_name(node: d5::Node) -> String {
    format!("d5 0x{:02X}", node.get())
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::CanFrame;

    const RMD_AND_THRUSTER: ProtocolSet = ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster]);

    fn can(id: u16, data: &[u8]) -> Wire {
        Wire::Can(CanFrame::standard(id, data).unwrap())
    }

    #[test]
    fn a_shared_bus_is_told_apart_by_its_ids() {
        let rmd =
            read(&can(0x141, &[0xA1, 0, 0, 0, 0x64, 0, 0, 0]), true, RMD_AND_THRUSTER).unwrap();
        assert_eq!(
            (rmd.motor.as_str(), rmd.text.as_str()),
            ("rmd 1", "torque_current current_a=1")
        );
        let thruster =
            read(&can(0x30B, &[0x54, 0x43, 0, 0, 0, 0, 0xFF, 0xFB]), true, RMD_AND_THRUSTER)
                .unwrap();
        assert_eq!(
            (thruster.motor.as_str(), thruster.text.as_str()),
            ("thruster 0x0B", "signal signal_percent=-5")
        );
    }

    #[test]
    fn each_protocols_stop_is_known() {
        assert!(
            read(&can(0x141, &[0x81, 0, 0, 0, 0, 0, 0, 0]), true, RMD_AND_THRUSTER)
                .unwrap()
                .is_stop
        );
        assert!(
            read(&can(0x30B, &[0x54, 0x43, 0, 0, 0, 0, 0, 0]), true, RMD_AND_THRUSTER)
                .unwrap()
                .is_stop
        );
        let d5 = ProtocolSet::of(&[Protocol::D5]);
        // Sum of 0B 05 03 20 00 00.
        assert!(
            read(&can(0x00B, &[0xD5, 0x0B, 0x05, 0x03, 0x20, 0x00, 0x00, 0x33]), true, d5)
                .unwrap()
                .is_stop
        );
        let turning =
            read(&can(0x00B, &[0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D]), true, d5).unwrap();
        assert_eq!(
            (turning.is_stop, turning.text.as_str()),
            (false, "write register=32 register_name=speed speed_dps=600")
        );
    }

    #[test]
    fn a_register_is_called_by_its_name() {
        let d5 = ProtocolSet::of(&[Protocol::D5]);
        // Sum of 0B 05 02 26 00 00, and of 0B 05 02 26 9E 01.
        let request =
            read(&can(0x00B, &[0xD5, 0x0B, 0x05, 0x02, 0x26, 0x00, 0x00, 0x38]), true, d5).unwrap();
        assert_eq!(request.text, "read register=38 register_name=current_speed bytes=2");
        let reply = read(&can(0x00B, &[0x5D, 0x0B, 0x05, 0x02, 0x26, 0x9E, 0x01, 0xD7]), false, d5)
            .unwrap();
        assert_eq!(reply.text, "read register=38 register_name=current_speed speed_dps=414");
    }

    #[test]
    fn what_no_protocol_of_the_bus_knows_has_no_meaning() {
        assert_eq!(read(&can(0x7FF, &[]), true, RMD_AND_THRUSTER), None);
        assert_eq!(read(&Wire::Serial(vec![0x3E, 0x01]), true, RMD_AND_THRUSTER), None);
    }
}
