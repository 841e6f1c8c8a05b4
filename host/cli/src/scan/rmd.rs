//! RMD motors of a bus: which ids answer, and which dialect they speak.

use std::collections::{BTreeMap, BTreeSet};

use embedded_can::Frame;
use host_protocol::{BusKind, Protocol, RawFrame};
use rmd::rs485::Deframer;
use rmd::{Dialect, Node, PROBES, Recognised, Reply, Request};

use super::open_bus::{Hear, OpenBus};
use super::{Doubled, Evidence, Found};
use crate::failure::Failure;
use crate::frames;

/// Data bytes of an answer.
type Data = [u8; rmd::DATA_LEN];

/// The sweep is repeated for ids that have not answered: an answer may get lost.
const SWEEPS: usize = 2;
/// Each probe is asked so often: its answers must agree.
const ROUNDS: usize = 2;
/// One motor answers each question once: three answers to two questions are those of two motors.
const DOUBLED: (usize, usize) = (3, 2);

/// What has been heard of the motors of one bus.
pub struct Motors {
    kind: BusKind,
    deframer: Deframer,
    heard: BTreeMap<u8, Heard>,
    /// How often each id was asked.
    asked: BTreeMap<u8, usize>,
    /// Nothing has been asked yet: what comes is sent by itself.
    listening: bool,
}

/// What has been heard of one id.
#[derive(Default)]
struct Heard {
    answers: Vec<Data>,
    /// The commands of what it sent before it was asked.
    unasked: BTreeSet<u8>,
    timed_out: bool,
}

impl Hear for Motors {
    fn hear(&mut self, frame: &RawFrame) {
        match frame {
            RawFrame::Can(frame) => {
                if let Some(node) = rmd::can::node_of_reply_id(frame.id())
                    && !frame.is_remote_frame()
                {
                    self.take(node, frame.data());
                }
            }
            RawFrame::Serial(bytes) => {
                for byte in bytes {
                    let Some(frame) = self.deframer.push(*byte) else { continue };
                    let (node, [_, _, _, data @ .., _, _]) =
                        (rmd::rs485::decode_reply(&frame), frame);
                    if let Ok((node, _)) = node {
                        self.take(node, &data);
                    }
                }
            }
        }
    }
}

impl Motors {
    pub fn new(kind: BusKind) -> Self {
        let (heard, asked) = (BTreeMap::new(), BTreeMap::new());
        Self { kind, deframer: Deframer::new(), heard, asked, listening: true }
    }

    fn take(&mut self, node: Node, data: &[u8]) {
        let listening = self.listening;
        let heard = self.heard.entry(node.get()).or_default();
        let notice = matches!(Reply::decode(data), Ok(Reply::TimeoutNotice { .. }));
        heard.timed_out |= notice;
        match (data.first(), data.try_into()) {
            (Some(command), _) if listening => drop(heard.unasked.insert(*command)),
            (_, Ok(data)) if !notice => heard.answers.push(data),
            _ => {}
        }
    }

    /// Asks every id, then those that answer for what they are; `false` where nobody acknowledges.
    pub fn find(&mut self, bus: &mut OpenBus<'_>) -> Result<bool, Failure> {
        self.listening = false;
        for _ in 0..SWEEPS {
            for node in (Node::MIN..=Node::MAX).filter_map(|node| Node::new(node).ok()) {
                if self.answers_of(node) == 0 && !self.ask(bus, node, &Request::ReadStatus1)? {
                    return Ok(false);
                }
            }
            bus.listen(bus.answer_within, self)?;
        }
        let nodes: Vec<Node> = self.heard.keys().filter_map(|node| Node::new(*node).ok()).collect();
        for node in nodes {
            self.question(bus, node)?;
            // Two motors tell different speeds, and different answers under one id are a collision.
            if !self.may_be_two(node) {
                self.ask_and_wait(bus, node, &Request::ReadStatus2)?;
            }
        }
        Ok(true)
    }

    /// A known read stands between two probes: what a motor does not know it may answer with a copy
    /// of its last reply.
    fn question(&mut self, bus: &mut OpenBus<'_>, node: Node) -> Result<(), Failure> {
        for _ in 0..ROUNDS {
            for probe in &PROBES {
                self.ask_and_wait(bus, node, &Request::ReadVersionDate)?;
                self.ask_and_wait(bus, node, probe)?;
            }
            self.ask_and_wait(bus, node, &Request::ReadStatus1)?;
        }
        let is_v4_4 = self.heard.get(&node.get()).is_some_and(|heard| !heard.parts().is_empty());
        if is_v4_4 {
            for part in [2, 3] {
                self.ask_and_wait(bus, node, &Request::ReadModelPart { part })?;
            }
        }
        Ok(())
    }

    fn ask_and_wait(
        &mut self,
        bus: &mut OpenBus<'_>,
        node: Node,
        request: &Request,
    ) -> Result<(), Failure> {
        let before = self.answers_of(node);
        self.ask(bus, node, request)?;
        bus.await_answer(self, |motors| motors.answers_of(node) > before)
    }

    /// The first read is about to be sent: what comes now may be its answer.
    pub fn asks_first(&mut self) {
        self.listening = false;
    }

    /// A read of the first id, for a bus where it is not known whether anybody is there.
    pub fn first_read() -> Option<RawFrame> {
        let node = Node::new(Node::MIN).ok()?;
        frames::to_rmd(BusKind::Can, node, &Request::ReadStatus1).ok()
    }

    fn ask(
        &mut self,
        bus: &mut OpenBus<'_>,
        node: Node,
        request: &Request,
    ) -> Result<bool, Failure> {
        let Ok(frame) = frames::to_rmd(self.kind, node, request) else { return Ok(true) };
        *self.asked.entry(node.get()).or_default() += 1;
        bus.send(&frame, self)
    }

    fn may_be_two(&self, node: Node) -> bool {
        let asked = self.asked.get(&node.get()).copied().unwrap_or(0);
        self.heard.get(&node.get()).is_some_and(|heard| {
            heard.doubled(asked).is_some() || heard.recognise().0 == Recognised::Contradicted
        })
    }

    fn answers_of(&self, node: Node) -> usize {
        self.heard.get(&node.get()).map_or(0, |heard| heard.answers.len())
    }

    /// The motors that answered, or that were heard.
    pub fn found(&self) -> Vec<Found> {
        let asked = |node| self.asked.get(node).copied().unwrap_or(0);
        self.heard.iter().map(|(node, heard)| heard.found(*node, asked(node))).collect()
    }
}

impl Heard {
    fn found(&self, node: u8, asked: usize) -> Found {
        let mut found = Found {
            asked: !self.answers.is_empty(),
            model: self.model(),
            firmware: self.dates().first().map(u32::to_string),
            doubled: self.doubled(asked),
            timed_out: self.timed_out,
            unasked: self.unasked.iter().map(|command| format!("{command:02X}")).collect(),
            ..Found::new(Protocol::Rmd, node)
        };
        let status = self.answers.iter().rev().find_map(|data| match Reply::decode(data) {
            Ok(Reply::Status1 { temperature, voltage, faults, .. }) => {
                Some((temperature, voltage, faults))
            }
            _ => None,
        });
        if let Some((temperature, voltage, faults)) = status {
            found.temperature_c = Some(temperature.0.into());
            found.voltage_v = Some(f32::from(voltage.0) / 10.0);
            found.faults = Some(faults.bits());
        }
        found.velocity_rad_s =
            self.answers.iter().rev().find_map(|data| match Reply::decode(data) {
                Ok(Reply::Status2 { motion }) => Some(f32::from(motion.speed.0).to_radians()),
                _ => None,
            });
        let (recognised, evidence) = self.recognise();
        (found.recognised, found.evidence) = (Some(recognised), evidence);
        // One motor answers the same read in one way.
        if recognised == Recognised::Contradicted {
            found.doubled = found.doubled.or(Some(Doubled::DifferentAnswers));
        }
        found
    }

    /// Each probe tells what all its answers tell, if there are two or more of them.
    fn recognise(&self) -> (Recognised, Vec<Evidence>) {
        let (mut told, mut evidence, mut torn) = (Vec::new(), Vec::new(), false);
        for probe in &PROBES {
            let answers = self
                .answers
                .iter()
                .filter_map(|data| rmd::tells(probe, data).map(|dialects| (*data, dialects)));
            let answers: Vec<_> = answers.collect();
            let Some((data, first)) = answers.first().copied() else { continue };
            torn |= answers.iter().any(|(_, dialects)| *dialects != first);
            if answers.len() >= ROUNDS {
                told.push(first);
            }
            let request = probe.encode().unwrap_or_default();
            let dialects = first.iter().filter(|dialect| *dialect != Dialect::Unknown);
            evidence.push(Evidence { request, answer: data, dialects: dialects.collect() });
        }
        let recognised = if torn { Recognised::Contradicted } else { Recognised::by(&told) };
        (recognised, evidence)
    }

    /// The dates that it told, each once. An echo is none.
    fn dates(&self) -> Vec<u32> {
        let dates = self.answers.iter().filter(|data| !rmd::is_echo_of_version(data));
        let dates: BTreeSet<u32> = dates
            .filter_map(|data| match Reply::decode(data) {
                Ok(Reply::VersionDate { date }) => Some(date.0),
                _ => None,
            })
            .collect();
        dates.into_iter().collect()
    }

    /// The parts of its name in their order, as a V4.4 motor tells them.
    fn parts(&self) -> Vec<String> {
        let part = |wanted: u8| {
            self.answers.iter().find_map(|data| match Reply::decode_in(Dialect::V4_4, data) {
                Ok(Reply::ModelPart { part, text }) if part == wanted => {
                    text.as_str().map(str::to_owned)
                }
                _ => None,
            })
        };
        [1, 2, 3].into_iter().map_while(part).collect()
    }

    fn model(&self) -> Option<String> {
        let name = self.parts().concat();
        if !name.is_empty() {
            return Some(name);
        }
        let name = self.answers.iter().find_map(|data| match Reply::decode(data) {
            Ok(Reply::Model { model }) => model.as_str().map(|name| name.trim().to_owned()),
            _ => None,
        });
        name.filter(|name| !name.is_empty())
    }

    /// Whether two motors may have the id.
    fn doubled(&self, asked: usize) -> Option<Doubled> {
        let is_asked = |data: &&Data| data.first().is_some_and(|c| !self.unasked.contains(c));
        let answers = self.answers.iter().filter(is_asked).count();
        if asked > 1 && answers * DOUBLED.1 >= asked * DOUBLED.0 {
            return Some(Doubled::TwoReplies);
        }
        (self.dates().len() > 1).then_some(Doubled::DifferentAnswers)
    }
}
