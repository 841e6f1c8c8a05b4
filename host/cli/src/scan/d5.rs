//! D5 motors of a bus: every id is asked, as a query of all is answered by all at once.

use std::collections::BTreeMap;

use d5::serial::Deframer;
use d5::{Node, Register, Reply, Request, Value, Width};
use host_protocol::{BusKind, Protocol, RawFrame};

use super::open_bus::{Hear, OpenBus};
use super::{Doubled, Found};
use crate::failure::Failure;
use crate::frames;

/// What a motor that answers is asked further; each register is a byte.
const REGISTERS: [Register; 4] =
    [Register::VERSION, Register::ACK_LEVEL, Register::TIMEOUT_SWITCH, Register::MOTOR_TEMPERATURE];

/// What has been heard of the motors of one bus.
pub struct Motors {
    kind: BusKind,
    deframer: Deframer,
    /// The answers to reads, by id: register and value.
    heard: BTreeMap<u8, Vec<(Register, u8)>>,
    asked: BTreeMap<u8, usize>,
    /// How fast they turn, rad/s, one after the other.
    speeds: Vec<(u8, f32)>,
}

impl Hear for Motors {
    fn hear(&mut self, frame: &RawFrame) {
        match frame {
            RawFrame::Can(frame) => {
                if let Ok((node, reply)) = d5::can::decode_reply(frame) {
                    self.take(node, &reply);
                }
            }
            RawFrame::Serial(bytes) => {
                for byte in bytes {
                    let Some(frame) = self.deframer.push(*byte) else { continue };
                    if let Ok((node, reply)) = d5::decode_reply_frame(&frame) {
                        self.take(node, &reply);
                    }
                }
            }
        }
    }
}

impl Motors {
    pub fn new(kind: BusKind) -> Self {
        let (heard, asked) = (BTreeMap::new(), BTreeMap::new());
        Self { kind, deframer: Deframer::new(), heard, asked, speeds: Vec::new() }
    }

    fn take(&mut self, node: Node, reply: &Reply) {
        match *reply {
            Reply::Read { register, value: Value::Byte(value) } => {
                self.heard.entry(node.get()).or_default().push((register, value));
            }
            Reply::Read { register: Register::CURRENT_SPEED, value: Value::Word(word) } => {
                let speed = f32::from(d5::decode_speed(word).0).to_radians();
                self.speeds.push((node.get(), speed));
            }
            _ => {}
        }
    }

    /// Asks every id, then those that answer for what they are; `false` where nobody acknowledges.
    pub fn find(&mut self, bus: &mut OpenBus<'_>) -> Result<bool, Failure> {
        for node in (Node::MIN..=Node::MAX).filter_map(|node| Node::new(node).ok()) {
            if !self.ask(bus, node, Register::STATUS)? {
                return Ok(false);
            }
        }
        bus.listen(bus.answer_within, self)?;
        let nodes: Vec<Node> = self.heard.keys().filter_map(|node| Node::new(*node).ok()).collect();
        for node in nodes {
            for register in REGISTERS {
                let before = self.answers_of(node);
                self.ask(bus, node, register)?;
                bus.await_answer(self, |all| all.answers_of(node) > before)?;
            }
            let before = self.speeds.len();
            self.read(bus, node, Register::CURRENT_SPEED, Width::Word)?;
            bus.await_answer(self, |all| all.speeds.len() > before)?;
        }
        Ok(true)
    }

    /// A read of the first id, for a bus where it is not known whether anybody is there.
    pub fn first_read() -> Option<RawFrame> {
        let node = Node::new(Node::MIN).ok()?;
        let request = Request::Read { register: Register::STATUS, width: Width::Byte };
        frames::to_d5(BusKind::Can, node, &request).ok()
    }

    fn ask(
        &mut self,
        bus: &mut OpenBus<'_>,
        node: Node,
        register: Register,
    ) -> Result<bool, Failure> {
        *self.asked.entry(node.get()).or_default() += 1;
        self.read(bus, node, register, Width::Byte)
    }

    fn read(
        &mut self,
        bus: &mut OpenBus<'_>,
        node: Node,
        register: Register,
        width: Width,
    ) -> Result<bool, Failure> {
        let request = Request::Read { register, width };
        let Ok(frame) = frames::to_d5(self.kind, node, &request) else { return Ok(true) };
        bus.send(&frame, self)
    }

    fn answers_of(&self, node: Node) -> usize {
        self.heard.get(&node.get()).map_or(0, Vec::len)
    }

    /// The motors that answered.
    pub fn found(&self) -> Vec<Found> {
        self.heard.iter().map(|(node, answers)| self.one(*node, answers)).collect()
    }

    fn one(&self, node: u8, answers: &[(Register, u8)]) -> Found {
        let of = |wanted: Register| {
            answers.iter().find(|(register, _)| *register == wanted).map(|(_, value)| *value)
        };
        let asked = self.asked.get(&node).copied().unwrap_or(0);
        Found {
            asked: true,
            firmware: of(Register::VERSION).map(|version| version.to_string()),
            temperature_c: of(Register::MOTOR_TEMPERATURE)
                .map(|raw| d5::decode_temperature(raw).0.into()),
            faults: of(Register::STATUS).map(u16::from),
            timeout_on: of(Register::TIMEOUT_SWITCH).map(|switch| switch == 1),
            ack_level: of(Register::ACK_LEVEL),
            velocity_rad_s: self.speeds.iter().find(|(of, _)| *of == node).map(|(_, rad_s)| *rad_s),
            // A motor answers each read once.
            doubled: (answers.len() > asked).then_some(Doubled::TwoReplies),
            ..Found::new(Protocol::D5, node)
        }
    }
}
