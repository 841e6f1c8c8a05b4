//! Thruster frames: the id says which way they go; what was asked before tells answers from what
//! comes unasked.

use std::io::Write;

use embedded_can::Id;
use host_protocol::CanFrame;
use thruster::{
    DecodeError, Headerless, Node, Reply, Request, ReturnFlags, ReturnSource, Returned, command,
};

use super::record::{Direction, Motor, Record};
use super::{put, put_message};
use crate::native_request::thruster_cause;

const NAME: &str = "thruster";
/// One place for each id.
const PLACES: usize = Node::MAX as usize + 1;
/// Requests to one device that may wait for their replies at once.
const MOST_PENDING: usize = 4;

/// Whether thrusters use this CAN id.
pub fn has_id(id: Id) -> bool {
    thruster::can::node_of_request_id(id).or_else(|| thruster::can::node_of_reply_id(id)).is_some()
}

/// A frame with its meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    Request(Node, Request),
    Reply(Node, Reply),
    /// Sent on the device's own account.
    Event(Node, Reply),
    /// What TC and VC return from a device set to leave headers out.
    Headerless(Node, Headerless),
}

/// What has been asked and answered on one bus.
pub struct Conversation([Device; PLACES]);

/// What has been asked of one device.
#[derive(Debug, Clone, Copy, Default)]
struct Device {
    /// Command words of requests without their reply; 0 is none.
    pending: [u16; MOST_PENDING],
    /// Where the next one goes.
    next: usize,
    /// Whether ML or MM made it return speed and current by itself (Thruster manual §2.1).
    returns_by_itself: bool,
    /// Whether it returns frames without a header (Thruster manual §2.4).
    headerless: bool,
}

impl Conversation {
    /// Nothing asked yet; `headerless` if the devices return frames without a header.
    pub fn new(headerless: bool) -> Self {
        Self([Device { headerless, ..Device::default() }; PLACES])
    }

    /// The message of a frame.
    pub fn can(&mut self, frame: &CanFrame) -> Result<Message, DecodeError> {
        match thruster::can::decode_request(frame) {
            Ok((node, request)) => {
                self.device(node).ask(&request);
                Ok(Message::Request(node, request))
            }
            Err(DecodeError::WrongId { .. }) => self.reply(frame),
            Err(error) => Err(error),
        }
    }

    fn reply(&mut self, frame: &CanFrame) -> Result<Message, DecodeError> {
        let decoded = thruster::can::decode_reply(frame);
        if let Ok((node, values)) = thruster::can::decode_headerless(frame)
            && self.device(node).returns_headerless(decoded.as_ref().ok().map(|(_, reply)| reply))
        {
            return Ok(Message::Headerless(node, values));
        }
        let (node, reply) = decoded?;
        Ok(if self.device(node).is_asked_for(&reply) {
            Message::Reply(node, reply)
        } else {
            Message::Event(node, reply)
        })
    }

    fn device(&mut self, node: Node) -> &mut Device {
        let Conversation(devices) = self;
        // An id is one of the places.
        let place = usize::from(node.get()).min(devices.len() - 1);
        &mut devices[place]
    }
}

impl Device {
    fn ask(&mut self, request: &Request) {
        match request {
            Request::LowSpeedMode | Request::MediumSpeedMode => self.returns_by_itself = true,
            Request::RequestMode => self.returns_by_itself = false,
            Request::ConfigureReturn { flags, .. } => {
                self.headerless = flags.contains(ReturnFlags::NO_HEADER);
            }
            _ => {}
        }
        if self.is_pending(request.command()) {
            return;
        }
        if let Some(place) = self.pending.get_mut(self.next) {
            *place = request.command();
        }
        self.next = (self.next + 1) % MOST_PENDING;
    }

    /// Whether a frame, read as `reply` where it has a header, is one without.
    fn returns_headerless(&mut self, reply: Option<&Reply>) -> bool {
        if !self.headerless {
            return false;
        }
        let is_meant = match reply {
            None | Some(Reply::Unknown { .. }) => true,
            // A device that leaves headers out refuses TC and VC with one (an assumption).
            Some(Reply::Refused { .. } | Reply::Returned(_)) => false,
            Some(reply) => {
                !self.is_pending(reply.command())
                    && (self.is_pending(command::SIGNAL) || self.is_pending(command::SPEED))
            }
        };
        if is_meant && !self.settle(command::SIGNAL) {
            self.settle(command::SPEED);
        }
        is_meant
    }

    /// Whether a request may have asked for this.
    fn is_asked_for(&mut self, reply: &Reply) -> bool {
        match reply {
            Reply::Returned(Returned { source: ReturnSource::Stream, .. }) => false,
            Reply::MeasuredSpeed { .. } | Reply::Current { .. } => {
                self.settle(reply.command()) || !self.returns_by_itself
            }
            _ => {
                self.settle(reply.command());
                true
            }
        }
    }

    fn is_pending(&self, command: u16) -> bool {
        self.pending.contains(&command)
    }

    /// Takes a request as answered; whether there was one.
    fn settle(&mut self, command: u16) -> bool {
        let place = self.pending.iter_mut().find(|pending| **pending == command);
        place.map(|place| *place = 0).is_some()
    }
}

/// Writes a message, or why there is none.
pub fn write<W: Write>(message: Result<Message, DecodeError>, record: &mut Record<W>) {
    match message {
        Ok(Message::Request(node, request)) => {
            let (motor, is_known) = (Motor::Node(node.get()), request.info().is_some());
            put_message!(record, Request, motor, request, is_known, &[]);
        }
        Ok(Message::Reply(node, reply)) => {
            let (motor, is_known) = (Motor::Node(node.get()), reply.info().is_some());
            put_message!(record, Reply, motor, reply, is_known, &[]);
        }
        Ok(Message::Event(node, reply)) => {
            let (motor, is_known) = (Motor::Node(node.get()), reply.info().is_some());
            put_message!(record, Event, motor, reply, is_known, &[]);
        }
        Ok(Message::Headerless(node, values)) => {
            record.message(Direction::Reply, NAME, &Motor::Node(node.get()), Headerless::NAME);
            values.visit_fields(&mut put(record));
        }
        Err(error) => {
            record.protocol(NAME);
            record.error(error_name(&error), &thruster_cause(&error));
        }
    }
}

fn error_name(error: &DecodeError) -> &'static str {
    match error {
        DecodeError::WrongId { .. } => "wrong_id",
        DecodeError::ExtendedId { .. } => "extended_id",
        DecodeError::RemoteFrame => "remote_frame",
        DecodeError::Length { .. } => "length",
        DecodeError::UpperHalf { .. } => "upper_half",
        DecodeError::FixedByte { .. } => "fixed_byte",
    }
}
