//! What everybody sees: a program of the server that watches, and publishes. It commands nothing,
//! and what it asks keeps nobody in command.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use host_protocol::{AxisSummary, Event, EventMessage, StateField, StateFields, Subject};
use mgw_cli::programs::{self, Motors};
use mgw_client::{Client, ClientError, Transport};
use serde_json::{Value, json};
use zenoh::bytes::Encoding;
use zenoh::qos::Priority;
use zenoh::query::Query;
use zenoh::{Session, Wait};

use crate::clock::GatewayTime;
use crate::door::{refuse, reply};
use crate::keys::Keys;
use crate::reach::Reach;
use crate::refusal::Refusal;
use crate::state::{Known, Part};

/// Between two looks at all that samples do not tell.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Waits for events are at most so long.
const LISTEN: Duration = Duration::from_millis(2);
/// Events taken between two questions.
const EVENTS_AT_ONCE: usize = 64;
/// Before the server is asked again.
const AGAIN_AFTER: Duration = Duration::from_millis(300);

/// What is needed to watch.
pub struct Sight {
    /// The way to the gateway.
    pub reach: Reach,
    /// Where it is published.
    pub session: Session,
    /// Under which keys.
    pub keys: Keys,
    /// Between two samples of an axis.
    pub period: Duration,
    /// Where the gateway's time is told.
    pub time: GatewayTime,
    /// Those who ask how something is.
    pub queries: Receiver<Query>,
}

impl Sight {
    /// Watches until the process ends. `found` and `lost` tell the user.
    pub fn watch(&self, mut told: impl FnMut(Result<&str, &str>)) {
        let mut last = None::<String>;
        loop {
            let opened = self
                .reach
                .open()
                .and_then(|transport| Eye::open(self, Client::connect(transport)?));
            let seen = opened.and_then(|mut eye| {
                last = None;
                told(Ok(&eye.board()));
                self.tell_link(None);
                eye.watch()
            });
            self.time.forget();
            let Err(error) = seen else { continue };
            let message = error.to_string();
            self.tell_link(Some(&message));
            if last.as_ref() != Some(&message) {
                told(Err(&message));
                last = Some(message.clone());
            }
            self.wait(&message);
        }
    }

    /// Until the server is asked again; who asks meanwhile is told that there is nothing to tell.
    fn wait(&self, message: &str) {
        let end = Instant::now() + AGAIN_AFTER;
        loop {
            match self.queries.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(query) => {
                    let key = self.keys.state("link");
                    if intersects(&query, &key) {
                        reply(&query, &key, &link(Some(message)));
                    } else {
                        refuse(&query, &Refusal::GatewayAway.to_json());
                    }
                }
                Err(RecvTimeoutError::Timeout) => return,
                Err(RecvTimeoutError::Disconnected) => {
                    return std::thread::sleep(end.saturating_duration_since(Instant::now()));
                }
            }
        }
    }

    fn tell_link(&self, message: Option<&str>) {
        self.publish(&self.keys.state("link"), &link(message), Priority::InteractiveHigh);
    }

    /// To all who have subscribed. One that does not read loses some and holds up nobody.
    /// Events go before samples and states.
    fn publish(&self, key: &str, value: &Value, priority: Priority) {
        let put = self.session.put(key, value.to_string()).encoding(Encoding::APPLICATION_JSON);
        // Without a network nobody hears it.
        drop(put.priority(priority).wait());
    }
}

fn link(message: Option<&str>) -> Value {
    json!({ "event": "link", "connected": message.is_none(), "message": message })
}

fn intersects(query: &Query, key: &str) -> bool {
    zenoh::key_expr::KeyExpr::try_from(key).is_ok_and(|key| query.key_expr().intersects(&key))
}

struct Eye<'a, T: Transport> {
    client: Client<T>,
    sight: &'a Sight,
    axes: Vec<AxisSummary>,
    parts: Vec<Part>,
    known: Known,
    questions: VecDeque<Part>,
}

impl<'a, T: Transport> Eye<'a, T> {
    fn open(sight: &'a Sight, mut client: Client<T>) -> Result<Self, ClientError> {
        let axes = client.list_axes()?;
        let known = Known { motors: Motors::new(&axes), names: client.names()? };
        let numbers: Vec<u8> = axes.iter().map(|axis| axis.axis).collect();
        if !numbers.is_empty() {
            client.subscribe(&numbers, StateFields::of(StateField::ALL), sight.period)?;
        }
        sight.time.set(client.gateway_now_us());
        let parts = Part::all(client.hello().buses.len(), &axes);
        Ok(Self { client, sight, axes, parts, known, questions: VecDeque::new() })
    }

    fn board(&self) -> String {
        let hello = self.client.hello();
        format!("{}, firmware {}, {} axes", hello.board, hello.firmware, self.axes.len())
    }

    /// Until the axes are others, which begins anew, or the connection fails.
    fn watch(&mut self) -> Result<(), ClientError> {
        let mut look_at = Instant::now();
        loop {
            self.client.keep_subscription()?;
            self.listen()?;
            self.sight.time.set(self.client.gateway_now_us());
            if let Ok(query) = self.sight.queries.try_recv() {
                self.answer(&query)?;
            }
            let now = Instant::now();
            if now >= look_at && self.questions.is_empty() {
                look_at = now + LOOK_EVERY;
                self.client.ping()?;
                if self.has_changed()? {
                    return Ok(());
                }
                self.questions.extend(&self.parts);
            }
            // One at a time: samples that come meanwhile wait no longer than one answer takes.
            if let Some(part) = self.questions.pop_front() {
                self.tell(part)?;
            }
        }
    }

    /// Whether the gateway has other axes or names than at the beginning.
    fn has_changed(&mut self) -> Result<bool, ClientError> {
        let place = |axis: &AxisSummary| (axis.axis, axis.bus, axis.protocol, axis.node);
        let axes = self.client.list_axes()?;
        let same = axes.iter().map(place).eq(self.axes.iter().map(place));
        Ok(!same || self.client.names()? != self.known.names)
    }

    fn listen(&mut self) -> Result<(), ClientError> {
        let mut wait = if self.questions.is_empty() { LISTEN } else { Duration::ZERO };
        for _ in 0..EVENTS_AT_ONCE {
            let Some(message) = self.client.poll_event(wait)? else { break };
            self.take(&message);
            wait = Duration::ZERO;
        }
        // Periods of a cycle are for who runs it; they must not pile up here.
        for _ in 0..EVENTS_AT_ONCE {
            if self.client.poll_cycle(Duration::ZERO)?.is_none() {
                break;
            }
        }
        Ok(())
    }

    fn take(&mut self, message: &EventMessage) {
        let mut value = programs::event(message, &self.known.motors);
        if let Event::Sample { axis, .. } = message.event {
            value["name"] = json!(self.known.name(Subject::Axis(axis)));
            return self.sight.publish(&self.sight.keys.samples(axis), &value, Priority::Data);
        }
        self.sight.publish(&self.sight.keys.events(), &value, Priority::InteractiveHigh);
        let part = match message.event {
            Event::Tripped { axis, .. }
            | Event::StateChanged { axis, .. }
            | Event::StopConfirmed { axis, .. }
            | Event::AxisUnreachable { axis, .. } => Part::Axis(axis),
            Event::BusStateChanged { bus, .. } => Part::Bus(bus),
            Event::EStopLatched {}
            | Event::EStopCleared {}
            | Event::EStopInputChanged { .. }
            | Event::EnableOutputChanged { .. } => Part::Gateway,
            _ => return,
        };
        if !self.questions.contains(&part) {
            self.questions.push_front(part);
        }
    }

    /// Asks how something is, and publishes it.
    fn tell(&mut self, part: Part) -> Result<(), ClientError> {
        match self.known.ask(&mut self.client, part) {
            Ok(state) => {
                self.sight.publish(&self.sight.keys.state(&part.text()), &state, Priority::Data);
                Ok(())
            }
            // Half configured, or asked by somebody else: the next round tells.
            Err(ClientError::Gateway(_)) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// Answers one who asks, with what is now.
    fn answer(&mut self, query: &Query) -> Result<(), ClientError> {
        let link_key = self.sight.keys.state("link");
        let mut is_known = intersects(query, &link_key);
        if is_known {
            reply(query, &link_key, &link(None));
        }
        for part in self.parts.clone() {
            let key = self.sight.keys.state(&part.text());
            if !intersects(query, &key) {
                continue;
            }
            is_known = true;
            match self.known.ask(&mut self.client, part) {
                Ok(state) => reply(query, &key, &state),
                Err(error @ ClientError::Gateway(_)) => refuse(query, &programs::error(error)),
                Err(error) => {
                    refuse(query, &Refusal::GatewayAway.to_json());
                    return Err(error);
                }
            }
        }
        if !is_known && !query.key_expr().as_str().contains('*') {
            let parts: Vec<String> = self.parts.iter().map(|part| part.text()).collect();
            let known = format!("{} with link, {}", self.sight.keys.state(""), parts.join(", "));
            let key = query.key_expr().as_str().to_owned();
            refuse(query, &Refusal::UnknownKey { key, known }.to_json());
        }
        Ok(())
    }
}
