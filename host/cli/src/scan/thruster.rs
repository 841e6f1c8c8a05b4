//! Thrusters of a bus: those that send by themselves are heard. They are asked only on request: any
//! command may end the timeout that keeps one at rest.

use std::collections::BTreeMap;

use host_protocol::{CanFrame, Protocol, RawFrame};
use thruster::{Node, Reply, Request};

use super::open_bus::{Hear, OpenBus};
use super::{Doubled, Found};
use crate::failure::Failure;

const RAD_S_PER_RPM: f32 = core::f32::consts::TAU / 60.0;

/// What has been heard of the thrusters of one bus.
#[derive(Default)]
pub struct Motors {
    heard: BTreeMap<u8, Heard>,
    asked_faults: usize,
}

#[derive(Default)]
struct Heard {
    voltage_v: Option<f32>,
    temperature_c: Option<i16>,
    faults: Option<u16>,
    velocity_rad_s: Option<f32>,
    /// Answers to EF, which a thruster sends only when it is asked.
    answers: usize,
}

impl Hear for Motors {
    fn hear(&mut self, frame: &RawFrame) {
        let RawFrame::Can(frame) = frame else { return };
        let Some(node) = thruster::can::node_of_reply_id(frame.id()) else { return };
        let heard = self.heard.entry(node.get()).or_default();
        match Reply::decode(frame.data()) {
            Ok(Reply::Faults { faults }) => {
                heard.faults = Some(faults.bits());
                heard.answers += 1;
            }
            Ok(Reply::Voltage { voltage }) => heard.voltage_v = Some(f32::from(voltage.0) / 10.0),
            Ok(Reply::MeasuredSpeed { speed }) => {
                heard.velocity_rad_s = Some(f32::from(speed.0) * RAD_S_PER_RPM);
            }
            Ok(Reply::MotorTemperature { temperature }) => {
                heard.temperature_c = Some(temperature.0);
            }
            _ => {}
        }
    }
}

impl Motors {
    /// Asks every id for its faults, which are told once only, then those that answer for more;
    /// `false` where nobody acknowledges.
    pub fn find(&mut self, bus: &mut OpenBus<'_>) -> Result<bool, Failure> {
        for node in (Node::MIN..=Node::MAX).filter_map(|node| Node::new(node).ok()) {
            if !self.ask(bus, node, &Request::ReadFaults)? {
                return Ok(false);
            }
        }
        self.asked_faults = 1;
        bus.listen(bus.answer_within, self)?;
        let nodes: Vec<Node> = self.heard.keys().filter_map(|node| Node::new(*node).ok()).collect();
        for node in nodes {
            self.ask(bus, node, &Request::ReadVoltage)?;
            self.ask(bus, node, &Request::ReadMotorTemperature)?;
            self.ask(bus, node, &Request::ReadSpeed)?;
        }
        bus.listen(bus.answer_within, self)?;
        Ok(true)
    }

    fn ask(
        &mut self,
        bus: &mut OpenBus<'_>,
        node: Node,
        request: &Request,
    ) -> Result<bool, Failure> {
        match thruster::can::request::<CanFrame>(node, request) {
            Ok(frame) => bus.send(&RawFrame::Can(frame), self),
            Err(_) => Ok(true),
        }
    }

    /// The thrusters that answered, or that were heard.
    pub fn found(&self) -> Vec<Found> {
        let one = |(node, heard): (&u8, &Heard)| Found {
            asked: heard.answers > 0,
            voltage_v: heard.voltage_v,
            temperature_c: heard.temperature_c,
            faults: heard.faults,
            velocity_rad_s: heard.velocity_rad_s,
            doubled: (heard.answers > self.asked_faults).then_some(Doubled::TwoReplies),
            ..Found::new(Protocol::Thruster, *node)
        };
        self.heard.iter().map(one).collect()
    }
}
