//! What was seen becomes messages of a recording. Pure: no clock, no file.

use std::collections::HashMap;
use std::time::Duration;

use host_protocol::{
    CycleEvent, CycleMessage, Error, Event, EventMessage, Kind, RawFrame, ReceivedFrame, Reply,
    Request, messages::request_name, requests as ask,
};
use mgw_serve::{SERVER, Seen};
use serde_json::{Value, json};

use super::item::{Item, What};
use super::schemas::Schema;
use crate::faults::Protocols;
use crate::json;
use crate::output::to_json;
use crate::words;

/// Requests for raw frames whose answers are awaited. Older ones are lost.
const AWAITED: usize = 64;
/// A number of an event that is further ahead is an old one.
const BACKWARDS: u16 = 1 << 15;

/// A message as it is written.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    pub topic: String,
    pub schema: Schema,
    /// Host time since the recording began.
    pub at: Duration,
    /// Time of the gateway, µs since its start; none before anything has told it.
    pub gateway_us: Option<u64>,
    /// An object without any null: readers of MCAP take one type for each field.
    pub value: Value,
}

/// What a recording has not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Losses {
    /// Samples and events for which the gateway, or a server, had no room.
    pub by_gateway: u64,
    /// Samples and events whose numbers are missing, or that were too many on the way.
    pub on_the_way: u64,
    /// What found the queue of the recording full.
    pub unwritten: u64,
}

impl Losses {
    /// For programs.
    pub fn fields(&self) -> Value {
        let Self { by_gateway, on_the_way, unwritten } = self;
        json!({
            "lost_by_gateway": by_gateway, "lost_on_the_way": on_the_way,
            "lost_unwritten": unwritten,
        })
    }
}

/// Makes messages.
pub struct Encoder {
    motors: Protocols,
    /// When the gateway's time was told last, and what it was.
    told: Option<(Duration, u64)>,
    /// The number that the next event of the cable has.
    next_event: Option<u16>,
    /// The buses of the requests for raw frames that are under way.
    asked_of: HashMap<u16, u8>,
    /// Events of the cable that found the queue full and whose numbers are not missed yet: they
    /// count as unwritten.
    unqueued: u64,
    losses: Losses,
    /// Those that are in the recording.
    losses_told: Losses,
}

impl Encoder {
    pub fn new(motors: Protocols) -> Self {
        Self {
            motors,
            told: None,
            next_event: None,
            asked_of: HashMap::new(),
            unqueued: 0,
            losses: Losses::default(),
            losses_told: Losses::default(),
        }
    }

    /// So many more events of the cable have found the queue full.
    pub fn not_queued(&mut self, events: u64) {
        self.unqueued += events;
    }

    /// What is lost so far.
    pub fn lost(&self) -> Losses {
        self.losses
    }

    /// The message that tells what is lost, where that has changed.
    pub fn losses(&mut self, at: Duration, unwritten: u64) -> Option<Message> {
        self.losses.unwritten = unwritten;
        if self.losses == self.losses_told {
            return None;
        }
        self.losses_told = self.losses;
        let value = json::line("lost", self.losses.fields());
        Some(self.message("/recording".to_owned(), Schema::Recording, at, None, value))
    }

    /// The messages of what was seen.
    pub fn take(&mut self, Item { at, what }: Item) -> Vec<Message> {
        match what {
            What::Event(message) => vec![self.event(at, &message)],
            What::Cycle(message) => vec![self.cycle(at, &message)],
            What::Frame { bus, frame } => vec![self.frame(at, bus, &frame)],
            What::Seen(seen) => self.seen(at, &seen),
            What::Lost { on_the_way } => {
                self.losses.on_the_way = on_the_way;
                Vec::new()
            }
        }
    }

    /// `time_us` where the message has a time of its own; else the last one told and what has
    /// passed since.
    fn message(
        &self,
        topic: String,
        schema: Schema,
        at: Duration,
        time_us: Option<u64>,
        mut value: Value,
    ) -> Message {
        let since = |(told, us): (Duration, u64)| {
            us.saturating_add(u64::try_from(at.saturating_sub(told).as_micros()).unwrap_or(0))
        };
        let gateway_us = time_us.or_else(|| self.told.map(since));
        value["time_us"] = json!(gateway_us);
        remove_nulls(&mut value);
        Message { topic, schema, at, gateway_us, value }
    }

    fn event(&mut self, at: Duration, message: &EventMessage) -> Message {
        self.told = Some((at, message.time_us));
        self.losses.by_gateway += u64::from(message.dropped);
        let mut value = json::event(message, &self.motors);
        if let Event::Sample { axis, .. } = message.event {
            let topic = format!("/axis/{axis}/sample");
            return self.message(topic, Schema::Sample, at, Some(message.time_us), value);
        }
        let alone = EventMessage { dropped: 0, ..*message };
        value["text"] = json!(words::event(&alone, &self.motors));
        self.message("/event".to_owned(), Schema::Event, at, Some(message.time_us), value)
    }

    fn cycle(&mut self, at: Duration, message: &CycleMessage) -> Message {
        self.told = Some((at, message.time_us));
        self.losses.by_gateway += u64::from(message.dropped);
        let value = json::cycle::told(message, &self.motors);
        self.message("/cycle".to_owned(), Schema::Cycle, at, Some(message.time_us), value)
    }

    fn frame(&mut self, at: Duration, bus: u8, received: &ReceivedFrame) -> Message {
        let time_us = Some(received.time_us);
        self.raw(at, bus, &received.frame, time_us, "received")
    }

    fn raw(
        &self,
        at: Duration,
        bus: u8,
        frame: &RawFrame,
        time_us: Option<u64>,
        direction: &str,
    ) -> Message {
        let mut value = json::line("frame", json::raw_frame(bus, frame));
        value["direction"] = json!(direction);
        self.message(format!("/frame/{bus}"), Schema::Frame, at, time_us, value)
    }

    fn seen(&mut self, at: Duration, seen: &Seen) -> Vec<Message> {
        match seen.kind {
            Kind::Event => vec![self.told_by_cable(at, seen)],
            Kind::Request | Kind::WatcherRequest => self.request(at, seen),
            Kind::Reply => self.reply(at, seen),
            Kind::Error => vec![self.refusal(at, seen)],
        }
    }

    fn told_by_cable(&mut self, at: Duration, seen: &Seen) -> Message {
        let missing = self.next_event.map_or(0, |next| seen.sequence.wrapping_sub(next));
        if missing < BACKWARDS {
            let unqueued = self.unqueued.min(missing.into());
            self.unqueued -= unqueued;
            self.losses.on_the_way += u64::from(missing) - unqueued;
        }
        self.next_event = Some(seen.sequence.wrapping_add(1));
        let decoded = if seen.number == CycleEvent::NUMBER {
            CycleMessage::decode(&seen.body).map(|message| self.cycle(at, &message))
        } else {
            EventMessage::decode(seen.number, &seen.body).map(|message| self.event(at, &message))
        };
        decoded.unwrap_or_else(|_| {
            let text = format!("an event {} that cannot be read", seen.number);
            let fields = json!({ "number": seen.number, "text": text });
            let value = json::line("unknown", fields);
            self.message("/event".to_owned(), Schema::Event, at, None, value)
        })
    }

    fn request(&mut self, at: Duration, seen: &Seen) -> Vec<Message> {
        let request = Request::decode(seen.number, &seen.body);
        let (name, body) = match &request {
            Ok(request) => (json::snake(request.name()), body_of(request)),
            Err(_) => ("unknown".to_owned(), json!({ "data": words::hex(&seen.body) })),
        };
        let mut value = asked("request", seen, &name);
        let more = json!({ "watches": seen.kind == Kind::WatcherRequest, "body": body });
        json::extend(&mut value, more);
        let topic = "/request".to_owned();
        let mut messages = vec![self.message(topic, Schema::Request, at, None, value)];
        match request {
            Ok(Request::RawReceive(ask::RawReceive { bus })) => {
                if self.asked_of.len() >= AWAITED {
                    self.asked_of.clear();
                }
                self.asked_of.insert(seen.sequence, bus);
            }
            Ok(Request::RawSend(ask::RawSend { bus, frame })) => {
                messages.push(self.raw(at, bus, &frame, None, "sent"));
            }
            _ => {}
        }
        messages
    }

    fn reply(&mut self, at: Duration, seen: &Seen) -> Vec<Message> {
        let reply = Reply::decode(seen.number, &seen.body);
        match &reply {
            Ok(Reply::Hello(hello)) => {
                // A session of the cable begins, and its events are counted from 0. The hello of a
                // program opens none there.
                if seen.program == Some(SERVER) {
                    (self.next_event, self.unqueued) = (Some(0), 0);
                }
                self.told = Some((at, hello.time_us));
            }
            Ok(Reply::Ping(pong)) => self.told = Some((at, pong.time_us)),
            Ok(Reply::ListAxes(list)) => self.motors = Protocols::new(&list.axes),
            _ => {}
        }
        let (name, body) = match &reply {
            Ok(reply) => (json::snake(reply.name()), body_of(reply)),
            Err(_) => (name_of(seen.number), json!({ "data": words::hex(&seen.body) })),
        };
        let mut value = asked("reply", seen, &name);
        json::extend(&mut value, json!({ "body": body }));
        let topic = "/reply".to_owned();
        let mut messages = vec![self.message(topic, Schema::Reply, at, None, value)];
        if let Ok(Reply::RawReceive(received)) = &reply
            && let Some(bus) = self.asked_of.remove(&seen.sequence)
        {
            let frames = received.frames.iter();
            messages.extend(frames.map(|received| self.frame(at, bus, received)));
        }
        messages
    }

    fn refusal(&mut self, at: Duration, seen: &Seen) -> Message {
        self.asked_of.remove(&seen.sequence);
        let error = Error::decode(seen.number, &seen.body)
            .unwrap_or(Error::Unknown { number: seen.number });
        let mut value = asked("refusal", seen, "");
        let more = json!({
            "request": null, "error": json::snake(error.name()), "error_number": seen.number,
            "message": error.to_string(),
        });
        json::extend(&mut value, more);
        self.message("/reply".to_owned(), Schema::Reply, at, None, value)
    }
}

/// What every frame that is asked or answered has in common.
fn asked(event: &str, seen: &Seen, name: &str) -> Value {
    let by_server = seen.program.map(|program| program == SERVER);
    let program = seen.program.filter(|program| *program != SERVER);
    json!({
        "event": event, "program": program, "by_server": by_server,
        "sequence": seen.sequence, "request": name,
    })
}

fn name_of(number: u16) -> String {
    request_name(number).map_or("unknown".to_owned(), json::snake)
}

/// The fields of a request or a reply, without its name.
fn body_of(message: &impl serde::Serialize) -> Value {
    match to_json(message) {
        Value::Object(named) => named.into_iter().next().map_or(Value::Null, |(_, body)| body),
        _ => Value::Null,
    }
}

fn remove_nulls(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            fields.retain(|_, field| !field.is_null());
            fields.values_mut().for_each(remove_nulls);
        }
        Value::Array(items) => {
            items.retain(|item| !item.is_null());
            items.iter_mut().for_each(remove_nulls);
        }
        _ => {}
    }
}
