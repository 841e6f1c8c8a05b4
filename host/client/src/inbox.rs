//! What arrived from the gateway: bytes become frames, events wait in order, answers go to the call
//! that asked.

use std::collections::VecDeque;

use host_protocol::messages::{DecodeError, request_name};
use host_protocol::{
    Call, CycleEvent, CycleMessage, Deframer, Error, EventMessage, Frame, Kind, requests::Hello,
};

use crate::error::ClientError;

/// Events that wait for the user; later ones are dropped and counted.
const MAX_EVENTS: usize = 1_024;
/// More than half of what a number of an event can be: it is an old one, or the gateway has begun
/// to count anew.
const BACKWARDS: u16 = 1 << 15;

/// How the gateway answered.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Answer {
    /// The body of a reply.
    Reply {
        /// Its number.
        number: u16,
        /// Not yet decoded.
        body: Vec<u8>,
    },
    /// An error.
    Error(Error),
}

impl Answer {
    /// The reply to a request of this kind: its whole body, as bytes left over belong to another
    /// type.
    pub(crate) fn read<C: Call>(&self) -> Result<C::Reply, ClientError> {
        match self {
            Self::Error(error) => Err((*error).into()),
            Self::Reply { number, body } => match postcard::take_from_bytes(body) {
                Ok((reply, [])) => Ok(reply),
                _ => {
                    let request = request_name(C::NUMBER).unwrap_or("a request");
                    Err(ClientError::UnreadableReply { request, number: *number })
                }
            },
        }
    }
}

/// An answer, and the sequence number of the request it belongs to.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Arrived {
    sequence: u16,
    pub(crate) answer: Answer,
}

impl Arrived {
    /// Whether it answers the request `number` of this sequence. Another number under the same
    /// sequence belongs to a session before this one.
    pub(crate) fn answers(&self, sequence: u16, number: u16) -> bool {
        let fits = match &self.answer {
            Answer::Reply { number: of, .. } => *of == number,
            Answer::Error(_) => true,
        };
        self.sequence == sequence && fits
    }
}

/// What was lost or ignored on the way from the gateway.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Losses {
    /// Frames that arrived damaged.
    pub damaged: u64,
    /// Answers to requests that are no longer awaited: second answers to repeated requests,
    /// mostly; and events that came twice.
    pub late: u64,
    /// Events that got lost on the way: their numbers are missing.
    pub events_lost: u64,
    /// Events that did not fit into the queue of this client.
    pub events_dropped: u64,
    /// Messages that this version cannot read.
    pub unreadable: u64,
}

impl Losses {
    /// Events that came from the gateway and not to the user.
    #[must_use]
    pub fn events(&self) -> u64 {
        self.events_lost + self.events_dropped
    }
}

pub(crate) struct Inbox {
    deframer: Deframer,
    events: VecDeque<EventMessage>,
    cycles: VecDeque<CycleMessage>,
    /// The number that the next event has if none gets lost; `None` before the first.
    next_event: Option<u16>,
    /// The sequence number of the hello that was answered last.
    hello: Option<u16>,
    losses: Losses,
    /// How many bytes have arrived, and how many whole frames.
    bytes: u64,
    frames: u64,
}

impl Inbox {
    pub(crate) fn new() -> Self {
        Self {
            deframer: Deframer::new(),
            events: VecDeque::new(),
            cycles: VecDeque::new(),
            next_event: None,
            hello: None,
            losses: Losses::default(),
            bytes: 0,
            frames: 0,
        }
    }

    /// Takes in bytes and returns the answers among them.
    pub(crate) fn take_in(&mut self, bytes: &[u8]) -> Vec<Arrived> {
        self.bytes = self.bytes.saturating_add(bytes.len() as u64);
        let Self { deframer, events, cycles, next_event, hello, losses, frames, .. } = self;
        let mut answers = Vec::new();
        for byte in bytes {
            let frame = match deframer.push(*byte) {
                None => continue,
                Some(Err(_)) => {
                    losses.damaged += 1;
                    continue;
                }
                Some(Ok(frame)) => frame,
            };
            *frames += u64::from(frame.kind != Kind::Request);
            match frame.kind {
                Kind::Event if is_new(next_event, frame.sequence, losses) => {
                    let is_cycle = frame.number == CycleEvent::NUMBER;
                    if is_cycle {
                        keep(cycles, losses, CycleMessage::decode(frame.body));
                    } else {
                        keep(events, losses, EventMessage::decode(frame.number, frame.body));
                    }
                }
                Kind::Event => losses.late += 1,
                Kind::Reply | Kind::Error => {
                    let is_hello = frame.kind == Kind::Reply && frame.number == Hello::NUMBER;
                    if is_hello && hello.replace(frame.sequence) != Some(frame.sequence) {
                        // A session begins, and its events are counted from 0.
                        *next_event = Some(0);
                    }
                    answers.push(arrived(&frame));
                }
                // Only a gateway is sent requests: our own ones come back from a loop in the
                // wiring.
                Kind::Request | Kind::WatcherRequest => losses.unreadable += 1,
            }
        }
        answers
    }

    pub(crate) fn next_event(&mut self) -> Option<EventMessage> {
        self.events.pop_front()
    }

    pub(crate) fn next_cycle(&mut self) -> Option<CycleMessage> {
        self.cycles.pop_front()
    }

    pub(crate) fn has_cycle(&self) -> bool {
        !self.cycles.is_empty()
    }

    pub(crate) fn has_event(&self) -> bool {
        !self.events.is_empty()
    }

    /// How many bytes have arrived.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// How many whole frames have arrived.
    pub(crate) fn frames(&self) -> u64 {
        self.frames
    }

    pub(crate) fn losses(&self) -> Losses {
        self.losses
    }

    /// Nobody awaits this answer.
    pub(crate) fn count_late(&mut self) {
        self.losses.late += 1;
    }

    /// This answer says nothing that this version can read.
    pub(crate) fn count_unreadable(&mut self) {
        self.losses.unreadable += 1;
    }

    /// Forgets the frame that was arriving; the events stay, they have happened.
    pub(crate) fn restart(&mut self) {
        self.deframer = Deframer::new();
        self.next_event = None;
    }
}

/// Whether an event has not come before. Counts those that are missing before it.
fn is_new(next_event: &mut Option<u16>, sequence: u16, losses: &mut Losses) -> bool {
    let missing = next_event.map_or(0, |next| sequence.wrapping_sub(next));
    if missing == u16::MAX {
        return false;
    }
    if missing < BACKWARDS {
        losses.events_lost += u64::from(missing);
    }
    *next_event = Some(sequence.wrapping_add(1));
    true
}

fn keep<E>(events: &mut VecDeque<E>, losses: &mut Losses, event: Result<E, DecodeError>) {
    match event {
        Ok(_) if events.len() >= MAX_EVENTS => losses.events_dropped += 1,
        Ok(event) => events.push_back(event),
        Err(_) => losses.unreadable += 1,
    }
}

fn arrived(frame: &Frame<'_>) -> Arrived {
    let answer = if frame.kind == Kind::Error {
        // Data that cannot be read leaves the number, which says enough.
        Answer::Error(
            Error::decode(frame.number, frame.body)
                .unwrap_or(Error::Unknown { number: frame.number }),
        )
    } else {
        Answer::Reply { number: frame.number, body: frame.body.to_vec() }
    };
    Arrived { sequence: frame.sequence, answer }
}
