//! Frames of the motor buses, read and made with the codecs of the gateway.

use codec::EncodeError;
use host_protocol::{BusKind, Bytes, CanFrame, Protocol, ProtocolSet, RawFrame};
use mgw_sim::Wire;

use crate::commands::motor_name;
use crate::decode::fields;

/// A request of any protocol.
#[derive(Debug, Clone, PartialEq)]
pub enum Request {
    Rmd(rmd::Request),
    Thruster(thruster::Request),
    D5(d5::Request),
}

/// A reply of any protocol.
#[derive(Debug, Clone, PartialEq)]
pub enum Reply {
    Rmd(rmd::Reply),
    Thruster(thruster::Reply),
    D5(d5::Reply),
}

/// What requests and replies of every protocol tell of themselves.
macro_rules! of_any_protocol {
    ($name:ident) => {
        impl $name {
            /// Whose it is.
            pub fn protocol(&self) -> Protocol {
                match self {
                    Self::Rmd(_) => Protocol::Rmd,
                    Self::Thruster(_) => Protocol::Thruster,
                    Self::D5(_) => Protocol::D5,
                }
            }

            /// As the codec calls it.
            pub fn name(&self) -> &'static str {
                match self {
                    Self::Rmd(message) => message.name(),
                    Self::Thruster(message) => message.name(),
                    Self::D5(message) => message.name(),
                }
            }

            /// Its name and its values in the units of the manual.
            fn text(&self) -> String {
                let fields = fields(|visit| match self {
                    Self::Rmd(message) => message.visit_fields(visit),
                    Self::Thruster(message) => message.visit_fields(visit),
                    Self::D5(message) => message.visit_fields(visit),
                });
                format!("{} {fields}", self.name()).trim_end().to_owned()
            }
        }
    };
}

of_any_protocol!(Request);
of_any_protocol!(Reply);

impl Request {
    /// Whether this may be the reply of the motor with the id `node` that was asked.
    pub fn is_answered_by(&self, node: u8, reply: &Reply) -> bool {
        match (self, reply) {
            (Self::Rmd(request), Reply::Rmd(reply)) => {
                matches!(rmd::answer(request, reply), rmd::Answer::Reply(_))
            }
            (Self::Thruster(request), Reply::Thruster(reply)) => {
                matches!(thruster::answer(request, reply), thruster::Answer::Reply(_))
            }
            (Self::D5(request), Reply::D5(reply)) => {
                let Ok(node) = d5::Node::new(node) else { return false };
                matches!(d5::answer(request, node, node, reply), d5::Answer::Reply(_))
            }
            _ => false,
        }
    }

    /// Whether it asks a motor to stop.
    fn is_stop(&self) -> bool {
        match self {
            Self::Rmd(request) => {
                matches!(request, rmd::Request::Stop | rmd::Request::Shutdown)
            }
            Self::Thruster(request) => {
                *request == thruster::Request::Signal { signal: thruster::Percent(0) }
            }
            Self::D5(request) => {
                let (register, value) = (d5::Register::SPEED, d5::Value::Word(0));
                *request == d5::Request::Write { register, value }
            }
        }
    }
}

/// What a frame may be as a request, and to which motor; none: to all.
pub fn requests(frame: &RawFrame) -> impl Iterator<Item = (Option<u8>, Request)> {
    let (rmd, thruster, d5) = match frame {
        RawFrame::Can(frame) => (
            rmd::can::decode_request(frame).ok(),
            thruster::can::decode_request(frame).ok(),
            d5::can::decode_request(frame).ok(),
        ),
        RawFrame::Serial(bytes) => (
            whole(bytes).and_then(|frame| rmd::rs485::decode_request(frame).ok()),
            None,
            whole(bytes).and_then(|frame| d5::decode_request_frame(frame).ok()),
        ),
    };
    let of_d5 = |address| match address {
        d5::Address::Node(node) => Some(node.get()),
        d5::Address::Broadcast => None,
    };
    let rmd = rmd.map(|(node, request)| (Some(node.get()), Request::Rmd(request)));
    let thruster = thruster.map(|(node, request)| (Some(node.get()), Request::Thruster(request)));
    let d5 = d5.map(|(address, request)| (of_d5(address), Request::D5(request)));
    rmd.into_iter().chain(thruster).chain(d5)
}

/// What a frame may be as a reply, and of which motor.
pub fn replies(frame: &RawFrame) -> impl Iterator<Item = (u8, Reply)> {
    let (rmd, thruster, d5) = match frame {
        RawFrame::Can(frame) => (
            rmd::can::decode_reply(frame).ok(),
            thruster::can::decode_reply(frame).ok(),
            d5::can::decode_reply(frame).ok(),
        ),
        RawFrame::Serial(bytes) => (
            whole(bytes).and_then(|frame| rmd::rs485::decode_reply(frame).ok()),
            None,
            whole(bytes).and_then(|frame| d5::decode_reply_frame(frame).ok()),
        ),
    };
    let rmd = rmd.map(|(node, reply)| (node.get(), Reply::Rmd(reply)));
    let thruster = thruster.map(|(node, reply)| (node.get(), Reply::Thruster(reply)));
    let d5 = d5.map(|(node, reply)| (node.get(), Reply::D5(reply)));
    rmd.into_iter().chain(thruster).chain(d5)
}

/// The bytes, if they are as many as a frame has.
fn whole<const LEN: usize>(bytes: &[u8]) -> Option<&[u8; LEN]> {
    bytes.try_into().ok()
}

/// What a frame asks of one motor.
pub fn request_to_one(frame: &RawFrame) -> Option<(u8, Request)> {
    requests(frame).find_map(|(node, request)| Some((node?, request)))
}

/// What a frame asks of whom, whatever values come with it: protocol, id and command. `None` where no
/// codec knows it as a request.
pub fn asks(frame: &RawFrame) -> Option<(&'static str, u8, &'static str)> {
    request_to_one(frame).map(|(node, request)| (request.protocol().name(), node, request.name()))
}

/// Whether one frame may be the reply to another, as the codecs match them.
pub fn may_answer(asked: &RawFrame, came: &RawFrame) -> bool {
    let Some((node, request)) = request_to_one(asked) else { return false };
    replies(came).any(|(from, reply)| from == node && request.is_answered_by(node, &reply))
}

/// A request to an RMD as a frame of such a bus.
pub fn to_rmd(
    bus: BusKind,
    node: rmd::Node,
    request: &rmd::Request,
) -> Result<RawFrame, EncodeError> {
    Ok(match bus {
        BusKind::Can => RawFrame::Can(rmd::can::request::<CanFrame>(node, request)?),
        BusKind::Rs485 => serial(&rmd::rs485::request(node, request)?),
    })
}

/// A request to a D5, which listens on CAN on the id that is its node, as a frame of such a bus.
pub fn to_d5(bus: BusKind, node: d5::Node, request: &d5::Request) -> Result<RawFrame, EncodeError> {
    let (id, address) = (d5::can::default_request_id(node), d5::Address::Node(node));
    Ok(match bus {
        BusKind::Can => RawFrame::Can(d5::can::request::<CanFrame>(id, address, request)?),
        BusKind::Rs485 => serial(&d5::request_frame(address, request)?),
    })
}

fn serial(bytes: &[u8]) -> RawFrame {
    // Frames are shorter than what a gateway takes.
    RawFrame::Serial(Bytes::from_slice(bytes).unwrap_or_default())
}

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
    let frame = match wire {
        Wire::Can(frame) => RawFrame::Can(*frame),
        Wire::Serial(bytes) => RawFrame::Serial(Bytes::from_slice(bytes).ok()?),
    };
    if from_gateway {
        let is_spoken = |(_, request): &(_, Request)| protocols.contains(request.protocol());
        let (node, request) = requests(&frame).find(is_spoken)?;
        let protocol = request.protocol();
        let motor = node.map_or_else(|| format!("every {protocol}"), |n| motor_name(protocol, n));
        return Some(Meaning { motor, text: request.text(), is_stop: request.is_stop() });
    }
    let is_spoken = |(_, reply): &(_, Reply)| protocols.contains(reply.protocol());
    let (node, reply) = replies(&frame).find(is_spoken)?;
    let motor = motor_name(reply.protocol(), node);
    Some(Meaning { motor, text: reply.text(), is_stop: false })
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
    fn what_no_protocol_of_the_bus_knows_has_no_meaning() {
        assert_eq!(read(&can(0x7FF, &[]), true, RMD_AND_THRUSTER), None);
        assert_eq!(read(&Wire::Serial(vec![0x3E, 0x01]), true, RMD_AND_THRUSTER), None);
    }
}
