//! What everybody sees: one program of the server that watches, and tells all pages.

use std::collections::VecDeque;
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use host_protocol::{AxisSummary, Event, EventMessage, Incident, Subject, parameters};
use mgw_client::{Client, ClientError, Transport};
use mgw_view::foxglove;
use serde_json::{Value, json};

use super::envelope::Envelope;
use super::hub::{Hub, Part};
use super::reach::Reach;
use crate::explain::with_page;
use crate::failure::Failure;
use crate::faults::Protocols;
use crate::json;
use crate::names::Names;
use crate::record::{Encoder, Item, Schema, What};
use crate::session::EVENTS_AT_ONCE;
use crate::states;
use crate::words;

/// Between two pictures: 30 each second.
const DRAW_EVERY: Duration = Duration::from_micros(33_333);
/// Between two looks at all that samples do not tell.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Waits for events are at most so long.
const LISTEN: Duration = Duration::from_millis(5);
/// Before the server is asked again.
const AGAIN_AFTER: Duration = Duration::from_millis(300);

/// Watches until the process ends.
pub fn watch(reach: &Reach, hub: &Hub, period: Duration) {
    loop {
        let seen = reach.open().and_then(|transport| {
            let client = Client::connect(transport).map_err(Failure::from)?;
            Eye::open(client, hub, period)?.watch()
        });
        if let Err(failure) = seen {
            let link = json!({
                "event": "link", "connected": false, "message": with_page(&failure),
            });
            hub.keep(Part::Link, &link);
            thread::sleep(AGAIN_AFTER);
        }
    }
}

/// One thing to ask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Question {
    Clock,
    Axes,
    Gateway,
    Bus(u8),
    Axis(u8),
    Incidents,
}

struct Eye<'a> {
    client: Client<Box<dyn Transport>>,
    hub: &'a Hub,
    axes: Vec<AxisSummary>,
    motors: Protocols,
    names: Names,
    encoder: Encoder,
    envelope: Envelope,
    questions: VecDeque<Question>,
    start: Instant,
    /// Host time since 1970 at the start.
    since_epoch: Duration,
    /// Events that were lost before they came here.
    lost: u64,
}

impl<'a> Eye<'a> {
    fn open(
        mut client: Client<Box<dyn Transport>>,
        hub: &'a Hub,
        period: Duration,
    ) -> Result<Self, Failure> {
        hub.forget();
        let axes = client.list_axes()?;
        let motors = Protocols::new(&axes);
        let names: Names = client.names()?.into();
        let numbers: Vec<u8> = axes.iter().map(|axis| axis.axis).collect();
        if !numbers.is_empty() {
            client.subscribe(&numbers, states::ALL, period)?;
        }
        hub.offer(channels(&numbers));
        hub.keep(Part::Link, &json!({ "event": "link", "connected": true, "message": null }));
        let mut eye = Self {
            client,
            hub,
            axes,
            motors,
            names,
            encoder: Encoder::new(motors),
            envelope: Envelope::default(),
            questions: VecDeque::new(),
            start: Instant::now(),
            since_epoch: SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default(),
            lost: 0,
        };
        eye.tell_axes();
        eye.questions.push_back(Question::Incidents);
        Ok(eye)
    }

    /// Until the axes are others, which begins anew, or the connection fails.
    fn watch(&mut self) -> Result<(), Failure> {
        let (mut draw_at, mut look_at) = (Instant::now(), Instant::now());
        loop {
            self.client.keep_subscription()?;
            self.listen()?;
            let now = Instant::now();
            if now >= draw_at {
                draw_at = (draw_at + DRAW_EVERY).max(now);
                self.draw();
            }
            if now >= look_at && self.questions.is_empty() {
                look_at = now + LOOK_EVERY;
                self.ask_all();
            }
            // One at a time: samples that come meanwhile wait no longer than one answer takes.
            if let Some(question) = self.questions.pop_front()
                && self.ask(question)?
            {
                return Ok(());
            }
        }
    }

    fn listen(&mut self) -> Result<(), ClientError> {
        let mut wait = if self.questions.is_empty() { LISTEN } else { Duration::ZERO };
        for _ in 0..EVENTS_AT_ONCE {
            let Some(message) = self.client.poll_event(wait)? else { break };
            self.take(&message);
            wait = Duration::ZERO;
        }
        for _ in 0..EVENTS_AT_ONCE {
            let Some(message) = self.client.poll_cycle(Duration::ZERO)? else { break };
            self.lost += u64::from(message.dropped);
            self.envelope.take_cycle(&message);
            self.publish(What::Cycle(message));
        }
        Ok(())
    }

    fn take(&mut self, message: &EventMessage) {
        self.lost += u64::from(message.dropped);
        if !self.envelope.take(message) {
            self.hub.tell(&json!({
                "event": "told", "text": words::event(message, &self.motors),
                "what": json::event(message, &self.motors),
                "host_ms": self.host_ms(message.time_us),
            }));
            self.follow(&message.event);
        }
        self.publish(What::Event(*message));
    }

    /// What an event makes worth asking.
    fn follow(&mut self, event: &Event) {
        match event {
            Event::Tripped { axis, .. } => {
                self.want(Question::Axis(*axis));
                self.want(Question::Incidents);
            }
            Event::StateChanged { axis, .. }
            | Event::StopConfirmed { axis, .. }
            | Event::AxisUnreachable { axis, .. } => self.want(Question::Axis(*axis)),
            Event::EStopLatched {}
            | Event::EStopCleared {}
            | Event::EStopInputChanged { .. }
            | Event::EnableOutputChanged { .. } => self.want(Question::Gateway),
            Event::BusStateChanged { bus, .. } => self.want(Question::Bus(*bus)),
            _ => {}
        }
    }

    /// Before all else that is to be asked, unless it is to be asked already.
    fn want(&mut self, question: Question) {
        if !self.questions.contains(&question) {
            self.questions.push_front(question);
        }
    }

    fn publish(&mut self, what: What) {
        if !self.hub.has_foxglove() {
            return;
        }
        let at = self.start.elapsed();
        for message in self.encoder.take(Item { at, what }) {
            let since_epoch = (self.since_epoch + message.at).as_nanos();
            self.hub.publish(&message, u64::try_from(since_epoch).unwrap_or(u64::MAX));
        }
    }

    fn draw(&mut self) {
        let lost = self.lost + self.client.losses().events();
        let picture = json!({
            "event": "samples", "axes": self.envelope.draw(), "lost": lost,
            "time_us": self.client.gateway_now_us(),
        });
        self.hub.draw(picture);
    }

    /// This computer's time, ms since 1970, at a time of the gateway.
    fn host_ms(&self, gateway_us: u64) -> f64 {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let passed = self.client.gateway_now_us().saturating_sub(gateway_us);
        now.saturating_sub(Duration::from_micros(passed)).as_secs_f64() * 1e3
    }

    fn ask_all(&mut self) {
        self.questions.extend([Question::Clock, Question::Axes, Question::Gateway]);
        let buses = u8::try_from(self.client.hello().buses.len()).unwrap_or(u8::MAX);
        self.questions.extend((0..buses).map(Question::Bus));
        self.questions.extend(self.axes.iter().map(|axis| Question::Axis(axis.axis)));
    }

    /// What the gateway is, and which axes it has.
    fn tell_axes(&self) {
        let hello = self.client.hello();
        let axes = self.axes.iter().map(|axis| {
            let summary = json::axis::summary(axis, axis.missing.and_then(parameters::name));
            json::with_name(summary, self.names.axis(axis.axis))
        });
        let told = json!({
            "event": "axes", "board": hello.board.as_str(), "firmware": hello.firmware.as_str(),
            "name": self.names.of(Subject::Gateway), "axes": axes.collect::<Value>(),
        });
        self.hub.keep(Part::Axes, &told);
    }

    /// A trip or a start, also in words.
    fn incident(&self, incident: &Incident) -> Value {
        let text = match incident {
            Incident::Started { boot, .. } => format!("started: {}", words::name(boot)),
            Incident::Tripped { axis, trip, .. } => {
                words::tripped(*axis, &trip.reason, self.motors.of(*axis))
            }
        };
        let mut told = json::gateway::incident(incident, &self.motors);
        told["text"] = json!(text);
        told
    }

    /// Asks and tells; whether to begin anew.
    fn ask(&mut self, question: Question) -> Result<bool, Failure> {
        let asked = match question {
            Question::Clock => self.client.ping().map(|()| false),
            Question::Axes => self.client.list_axes().map(|axes| {
                let place = |axis: &AxisSummary| (axis.axis, axis.bus, axis.protocol, axis.node);
                !axes.iter().map(place).eq(self.axes.iter().map(place))
            }),
            Question::Gateway => self.client.gateway_status().map(|status| {
                let told = json!({
                    "event": "gateway", "status": crate::output::to_json(&status),
                    "uncertainty_us": self.client.clock_uncertainty().as_micros(),
                });
                self.hub.keep(Part::Gateway, &told);
                false
            }),
            Question::Bus(bus) => self.client.bus_status(bus).map(|report| {
                let told = json!({ "event": "bus", "bus": json::gateway::bus(bus, &report) });
                self.hub.keep(Part::Bus(bus), &told);
                false
            }),
            Question::Axis(axis) => self.client.read_state(axis).map(|report| {
                let protocol = self.motors.of(axis);
                let tripped = report.trip.map(|trip| words::tripped(axis, &trip.reason, protocol));
                let told = json!({
                    "event": "axis", "axis": json::axis::report(&report, protocol),
                    "trip_text": tripped,
                });
                self.hub.keep(Part::Axis(axis), &told);
                false
            }),
            Question::Incidents => self.client.incidents().map(|incidents| {
                let told = incidents.iter().map(|incident| self.incident(incident));
                let told = json!({ "event": "incidents", "incidents": told.collect::<Value>() });
                self.hub.keep(Part::Incidents, &told);
                false
            }),
        };
        match asked {
            // Half configured, or asked by somebody else: the next round tells.
            Err(ClientError::Gateway(_)) => Ok(false),
            asked => Ok(asked?),
        }
    }
}

/// What `mgw record` has, as channels.
fn channels(axes: &[u8]) -> Vec<foxglove::Channel> {
    let samples = axes.iter().map(|axis| (format!("/axis/{axis}/sample"), Schema::Sample));
    let others = [("/event".to_owned(), Schema::Event), ("/cycle".to_owned(), Schema::Cycle)];
    let all = samples.chain(others).zip(1..);
    all.map(|((topic, schema), id)| foxglove::Channel {
        id,
        topic,
        schema_name: schema.name(),
        schema: schema.json(),
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use std::rc::Rc;

    use mgw_sim::SimTransport;

    use super::*;
    use crate::four_motors;

    #[test]
    fn of_more_events_than_are_taken_at_once_none_is_lost() {
        let (world, configuration) = four_motors::demonstration().unwrap();
        four_motors::configure(&mut four_motors::connect(&world).unwrap(), &configuration).unwrap();
        let transport: Box<dyn Transport> = Box::new(SimTransport::new(Rc::clone(&world), 1));
        let (hub, period) = (Hub::default(), Duration::from_millis(5));
        let mut eye = Eye::open(Client::connect(transport).unwrap(), &hub, period).unwrap();
        world.borrow_mut().run_for(period * 21 - period / 4);
        (0..2).for_each(|_| eye.listen().unwrap());
        let drawn = eye.envelope.draw();
        let counts: Vec<_> = drawn.as_array().unwrap().iter().map(|of| &of["samples"]).collect();
        assert_eq!((counts, eye.lost), (vec![&json!(21); 5], 0));
    }
}
