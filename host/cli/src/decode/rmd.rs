//! RMD frames, and their direction where the frame does not say it.

use std::io::Write;

use host_protocol::CanFrame;
use rmd::rs485::FRAME_LEN;
use rmd::{Answer, DecodeError, Dialect, Function, Model, Node, Reply, Request, Target};

use super::record::{Direction, Motor as Addressee, Record};
use super::{put, put_message};
use crate::args::DirectionChoice;

const NAME: &str = "rmd";
/// One place for each id.
const PLACES: usize = Node::MAX as usize + 1;

/// Whether RMD motors use this CAN id.
pub fn has_id(id: u16) -> bool {
    use rmd::can::{
        BROADCAST_ID, CAN_ID_ID, MOTION_REPLY_BASE, MOTION_REQUEST_BASE, REPLY_BASE, REQUEST_BASE,
    };
    let of_motor = |base: u16| {
        id.checked_sub(base)
            .is_some_and(|node| (u16::from(Node::MIN)..=u16::from(Node::MAX)).contains(&node))
    };
    [REQUEST_BASE, REPLY_BASE, MOTION_REQUEST_BASE, MOTION_REPLY_BASE].into_iter().any(of_motor)
        || matches!(id, BROADCAST_ID | CAN_ID_ID)
}

/// A frame with its meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    Request(Target, Request),
    Reply(Node, Reply),
    /// Sent on the motor's own account.
    Event(Node, Reply),
    /// A closed-loop command that the motor echoes unexecuted: no state in it.
    NotExecuted(Node, Reply),
}

/// What has been asked and answered on one bus.
pub struct Conversation {
    dialect: Dialect,
    motors: Motors,
    /// The id command that waits for its reply; every motor hears it.
    id_command: Option<Request>,
}

struct Motors([Motor; PLACES]);

impl Default for Motors {
    fn default() -> Self {
        Self([Motor::default(); PLACES])
    }
}

/// What has been asked of one motor.
#[derive(Debug, Clone, Copy, Default)]
struct Motor {
    /// The latest request, until it is answered.
    pending: Option<Request>,
    /// The latest closed-loop request, until it is answered: others may have been sent since.
    closed_loop: Option<Request>,
    /// Whether a 0x9A waits for its reply.
    status_1_due: bool,
    /// The command that was answered last: the capture holds both directions.
    answered: Option<u8>,
    /// Whether it was told to report faults unasked.
    reports: bool,
}

impl Conversation {
    /// Nothing yet, between motors of this dialect.
    pub fn new(dialect: Dialect) -> Self {
        Self { dialect, motors: Motors::default(), id_command: None }
    }

    /// The message of a CAN frame. Its id says which way it goes, but for the commands that read
    /// and set the id.
    pub fn can(
        &mut self,
        frame: &CanFrame,
        choice: Option<DirectionChoice>,
    ) -> Result<Message, DecodeError> {
        let request = rmd::can::decode_any_request(frame);
        match request.map(|(target, request)| (target, self.in_dialect(request, frame.data()))) {
            Ok((target, request @ (Request::ReadCanId | Request::SetCanId { .. }))) => {
                let reply = rmd::can::decode_reply_in(self.dialect, frame);
                let is_own_form = request.encode().is_ok_and(|data| data == frame.data());
                self.either(Ok((target, request)), reply, is_own_form, choice)
            }
            Ok((target, request)) => Ok(self.request(target, request)),
            Err(DecodeError::WrongId { .. }) => {
                let reply = rmd::can::decode_reply_in(self.dialect, frame);
                reply.map(|(node, reply)| self.reply(node, reply))
            }
            Err(error) => Err(error),
        }
    }

    /// The message of an RS485 frame, which does not say which way it goes.
    pub fn rs485(
        &mut self,
        frame: &[u8; FRAME_LEN],
        choice: Option<DirectionChoice>,
    ) -> Result<Message, DecodeError> {
        let [_, _, _, data @ .., _, _] = frame;
        let request = rmd::rs485::decode_any_request(frame)
            .map(|(target, request)| (target, self.in_dialect(request, data)));
        let is_own_form =
            request.is_ok_and(|(_, request)| request.encode().is_ok_and(|own| own == *data));
        let reply = rmd::rs485::decode_reply_in(self.dialect, frame);
        self.either(request, reply, is_own_form, choice)
    }

    /// The request in these data, unless its id tells it.
    fn in_dialect(&self, request: Request, data: &[u8]) -> Request {
        match (request, data.try_into()) {
            (
                Request::MotionMode { .. }
                | Request::ReadCanId
                | Request::SetCanId { .. }
                | Request::ReadRs485Id
                | Request::SetRs485Id { .. },
                _,
            )
            | (_, Err(_)) => request,
            (_, Ok(data)) => Request::decode_in(self.dialect, data),
        }
    }

    /// A frame that may be either: a reply if it follows its own request, else a request if it has
    /// the form of one, its unused bytes zero.
    fn either(
        &mut self,
        request: Result<(Target, Request), DecodeError>,
        reply: Result<(Node, Reply), DecodeError>,
        is_own_form: bool,
        choice: Option<DirectionChoice>,
    ) -> Result<Message, DecodeError> {
        let is_request = match (choice, &reply) {
            (Some(choice), _) => choice == DirectionChoice::Request,
            (None, Err(_)) => true,
            (None, Ok((_, reply))) if reply.is_event() => false,
            (None, Ok((node, reply))) => !self.is_due(*node, reply) && is_own_form,
        };
        if is_request {
            request.map(|(target, request)| self.request(target, request))
        } else {
            reply.map(|(node, reply)| self.reply(node, reply))
        }
    }

    fn request(&mut self, target: Target, request: Request) -> Message {
        match (&request, target) {
            (
                Request::ReadCanId
                | Request::SetCanId { .. }
                | Request::ReadRs485Id
                | Request::SetRs485Id { .. },
                _,
            ) => self.id_command = Some(request),
            (_, Target::All) => self.motors.0.iter_mut().for_each(|motor| motor.ask(request)),
            (_, Target::Node(node)) => self.motor(node).ask(request),
        }
        Message::Request(target, request)
    }

    fn reply(&mut self, node: Node, reply: Reply) -> Message {
        if is_about_id(&reply) {
            self.id_command = None;
            return Message::Reply(node, reply);
        }
        if reply.is_event() {
            return Message::Event(node, reply);
        }
        self.motor(node).answer(node, reply)
    }

    /// Whether this answers what waits.
    fn is_due(&mut self, node: Node, reply: &Reply) -> bool {
        let pending = if is_about_id(reply) { self.id_command } else { self.motor(node).pending };
        pending.is_some_and(|request| answers(&request, reply))
    }

    fn motor(&mut self, node: Node) -> &mut Motor {
        let Motors(motors) = &mut self.motors;
        // An id is one of the places, so the first one, which is nobody's, is never given.
        let place = usize::from(node.get()).min(motors.len() - 1);
        &mut motors[place]
    }
}

impl Motor {
    fn ask(&mut self, request: Request) {
        if !request.is_answered() {
            return;
        }
        if rmd::command::CLOSED_LOOP.contains(&request.command()) {
            self.closed_loop = Some(request);
        }
        if let Request::Function { function: Function::ErrorReporting { enabled } } = request {
            self.reports = enabled;
        }
        self.status_1_due |= request == Request::ReadStatus1;
        self.pending = Some(request);
    }

    fn answer(&mut self, node: Node, reply: Reply) -> Message {
        if self.pending.is_some_and(|request| answers(&request, &reply)) {
            self.pending = None;
            self.answered = Some(reply.command());
        }
        if let Reply::Status1 { faults, .. } = &reply {
            let due = std::mem::take(&mut self.status_1_due);
            // Motors report faults unasked if so configured (RMD V3.6 §2.33.4). Right after an
            // answer of the same kind it may as well be another one, whose request the
            // capture has missed.
            let other_talk = self.answered.is_some_and(|command| command != reply.command());
            if !due && (self.reports || other_talk) && !faults.is_empty() {
                return Message::Event(node, reply);
            }
        }
        if let Some(request) =
            self.closed_loop.take_if(|request| request.command() == reply.command())
            && rmd::answer(&request, &reply) == Answer::NotExecuted
        {
            return Message::NotExecuted(node, reply);
        }
        Message::Reply(node, reply)
    }
}

fn answers(request: &Request, reply: &Reply) -> bool {
    match (request, reply) {
        // What the manual does not list is answered, if at all, under its own command code.
        (Request::Unknown { .. }, Reply::Unknown { .. }) => request.command() == reply.command(),
        _ => matches!(rmd::answer(request, reply), Answer::Reply(_) | Answer::NotExecuted),
    }
}

fn is_about_id(reply: &Reply) -> bool {
    matches!(
        reply,
        Reply::CanId { .. }
            | Reply::CanIdSet { .. }
            | Reply::Rs485Id { .. }
            | Reply::Rs485IdSet { .. }
    )
}

/// Writes a message, or why there is none.
pub fn write<W: Write>(message: Result<Message, DecodeError>, record: &mut Record<W>) {
    match message {
        Ok(Message::Request(target, request)) => {
            let motor = match target {
                Target::Node(node) => Addressee::Node(node.get()),
                Target::All => Addressee::All,
            };
            put_message!(
                record,
                Request,
                motor,
                request,
                request.info().is_some(),
                &of_request(&request)
            );
        }
        Ok(Message::Reply(node, reply)) => {
            let others = of_reply(&reply);
            let is_known = reply.info().is_some() && (others.is_empty() || !is_no_name(&reply));
            put_message!(record, Reply, Addressee::Node(node.get()), reply, is_known, &others);
        }
        Ok(Message::Event(node, reply)) => {
            put_message!(
                record,
                Event,
                Addressee::Node(node.get()),
                reply,
                reply.info().is_some(),
                &[]
            );
        }
        Ok(Message::NotExecuted(node, reply)) => {
            record.message(Direction::Reply, NAME, &Addressee::Node(node.get()), reply.name());
            record.boolean("not_executed", true);
        }
        Err(error) => {
            record.protocol(NAME);
            record.error(error_name(&error), &error);
        }
    }
}

/// The dialects that have a request that this one has not.
fn of_request(request: &Request) -> Vec<&'static str> {
    let Request::Unknown { data } = request else { return Vec::new() };
    Request::dialects_of(data).iter().map(Dialect::name).collect()
}

/// The dialects that have a reply that this one has not; `unknown` has every one that tells its
/// form.
fn of_reply(reply: &Reply) -> Vec<&'static str> {
    let data = match reply {
        Reply::Unknown { data } => *data,
        Reply::Model { model: Model([a, b, c, d, e, f, g]) } if is_no_name(reply) => {
            [reply.command(), *a, *b, *c, *d, *e, *f, *g]
        }
        _ => return Vec::new(),
    };
    let has = |dialect: &Dialect| {
        let read = Reply::decode_in(*dialect, &data);
        let is_read = match &read {
            Ok(Reply::Unknown { .. }) | Err(_) => false,
            Ok(read) => !is_no_name(read),
        };
        *dialect != Dialect::Unknown && is_read
    };
    Dialect::ALL.into_iter().filter(has).map(Dialect::name).collect()
}

/// Whether it is the name of a model, or a part of one, in bytes that are no text.
fn is_no_name(reply: &Reply) -> bool {
    match reply {
        Reply::Model { model } => model.as_str().is_none(),
        Reply::ModelPart { text, .. } => text.as_str().is_none(),
        _ => false,
    }
}

fn error_name(error: &DecodeError) -> &'static str {
    match error {
        DecodeError::WrongId { .. } => "wrong_id",
        DecodeError::ExtendedId { .. } => "extended_id",
        DecodeError::RemoteFrame => "remote_frame",
        DecodeError::Length { .. } => "length",
        DecodeError::Checksum { .. } => "checksum",
        DecodeError::Header { .. } => "header",
        DecodeError::Node { .. } => "node",
        DecodeError::BusId { .. } => "bus_id",
    }
}
