//! What a live view of a gateway shows: axes with state and trip, buses with load and errors, the
//! trips and events of late. It reads no clock and asks nothing: it is told, and drawn by others.

mod axis;
mod bus;
mod log;
mod rate;

use std::time::Duration;

use host_protocol::replies::{BusReport, GatewayReport, HelloReply};
use host_protocol::{AxisSummary, Event, EventMessage, Incident, Subject};

use crate::faults::Protocols;
use crate::names::Names;
use crate::words;

pub use axis::Axis;
pub use bus::Bus;
pub use log::Log;
use rate::Rate;

/// Whether the gateway is heard.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Link {
    /// It is.
    #[default]
    Up,
    /// It is not, and why; it is tried again.
    Lost { why: String },
}

/// A gateway as it is now, as far as it has told.
#[derive(Debug, Default)]
pub struct Live {
    /// The port that leads to it.
    pub port: String,
    /// What it said when the session was opened.
    pub hello: Option<HelloReply>,
    /// Its own name.
    pub name: Option<String>,
    /// Whether it is heard.
    pub link: Link,
    /// How the gateway itself is: who commands, e-stop, enable output.
    pub status: Option<GatewayReport>,
    /// The program of a server that commands.
    pub commander: Option<String>,
    /// The axes that have a parameter, by their numbers.
    pub axes: Vec<Axis>,
    /// The buses of the board, by their numbers.
    pub buses: Vec<Bus>,
    /// Trips and events.
    pub log: Log,
    /// Samples and events that were lost, here and on the way.
    pub lost: u64,
    /// Samples that have come.
    pub samples: Rate,
    motors: Protocols,
}

impl Live {
    /// Nothing is known yet.
    pub fn of(port: &str) -> Self {
        Self { port: port.to_owned(), ..Self::default() }
    }

    /// A session has been opened. What axes and buses tell is asked for anew.
    pub fn connected(&mut self, hello: HelloReply, now: Duration) {
        if matches!(self.link, Link::Lost { .. }) {
            self.log.note("connected again");
        }
        let kinds = hello.buses.iter().map(|bus| bus.kind);
        self.buses = (0..).zip(kinds).map(|(number, kind)| Bus::new(number, kind)).collect();
        for axis in &mut self.axes {
            axis.restart();
        }
        self.samples = Rate::from(now);
        self.link = Link::Up;
        self.hello = Some(hello);
    }

    /// The gateway is not heard any more.
    pub fn lost(&mut self, why: &str) {
        if self.link == Link::Up {
            self.log.note(&format!("connection lost: {why}"));
        }
        self.link = Link::Lost { why: why.to_owned() };
    }

    /// The list of the axes.
    pub fn list(&mut self, axes: &[AxisSummary]) {
        self.motors = Protocols::new(axes);
        self.axes.retain(|axis| axes.iter().any(|summary| summary.axis == axis.number));
        for summary in axes {
            match self.axes.iter_mut().find(|axis| axis.number == summary.axis) {
                Some(axis) => axis.list(summary),
                None => self.axes.push(Axis::new(summary)),
            }
        }
        self.axes.sort_by_key(|axis| axis.number);
    }

    /// The names that there are.
    pub fn named(&mut self, names: &Names) {
        let name = |of| names.of(of).map(str::to_owned);
        self.name = name(Subject::Gateway);
        for axis in &mut self.axes {
            axis.name = name(Subject::Axis(axis.number));
        }
        for bus in &mut self.buses {
            bus.name = name(Subject::Bus(bus.number));
        }
    }

    /// How a bus is.
    pub fn bus(&mut self, number: u8, report: BusReport, now: Duration) {
        if let Some(bus) = self.buses.iter_mut().find(|bus| bus.number == number) {
            bus.take(report, now);
        }
    }

    /// What the gateway remembers of trips and starts, the latest first. A tripped axis of which
    /// nobody has heard why has its reason here.
    pub fn incidents(&mut self, incidents: &[Incident]) {
        for axis in &mut self.axes {
            axis.explain(incidents);
        }
        self.log.incidents(incidents, &self.motors);
    }

    /// A sample or another event.
    pub fn event(&mut self, message: &EventMessage, now: Duration) {
        self.lost += u64::from(message.dropped);
        let of = match message.event {
            Event::Sample { axis, .. }
            | Event::Tripped { axis, .. }
            | Event::StateChanged { axis, .. }
            | Event::StopConfirmed { axis, .. } => Some(axis),
            _ => None,
        };
        if let Some(axis) = self.axes.iter_mut().find(|axis| Some(axis.number) == of) {
            axis.take(&message.event, now);
        }
        match message.event {
            Event::Sample { .. } => self.samples.count(),
            Event::Tripped { axis, trip } => {
                self.log.tripped(axis, &trip, words::event(message, &self.motors));
            }
            _ => {
                self.log.push(words::event(&EventMessage { dropped: 0, ..*message }, &self.motors))
            }
        }
    }

    /// Time has passed: the rate is that of the last second.
    pub fn tick(&mut self, now: Duration) {
        self.samples.tick(now);
    }
}

#[cfg(test)]
mod tests;
