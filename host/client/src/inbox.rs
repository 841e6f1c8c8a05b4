//! What arrived from the gateway: bytes become frames, events wait in order, and the one awaited answer is picked out.

use std::collections::VecDeque;

use host_protocol::{Deframer, Error, EventMessage, Frame, Kind};

/// Events that wait for the user; later ones are dropped and counted.
const MAX_EVENTS: usize = 1_024;

/// The request whose answer is awaited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Awaited {
    pub(crate) sequence: u16,
    pub(crate) number: u16,
}

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

/// What was lost or ignored on the way from the gateway.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Losses {
    /// Frames that arrived damaged.
    pub damaged: u64,
    /// Answers to requests that are no longer awaited: second answers to repeated requests, mostly.
    pub late: u64,
    /// Events that did not fit into the queue of this client.
    pub events_dropped: u64,
    /// Messages that this version cannot read.
    pub unreadable: u64,
}

pub(crate) struct Inbox {
    deframer: Deframer,
    events: VecDeque<EventMessage>,
    losses: Losses,
}

impl Inbox {
    pub(crate) fn new() -> Self {
        Self { deframer: Deframer::new(), events: VecDeque::new(), losses: Losses::default() }
    }

    /// Takes in bytes and returns the answer to `awaited`, if it is among them.
    pub(crate) fn take_in(&mut self, bytes: &[u8], awaited: Option<Awaited>) -> Option<Answer> {
        let Self { deframer, events, losses } = self;
        let mut answer = None;
        for byte in bytes {
            let frame = match deframer.push(*byte) {
                None => continue,
                Some(Err(_)) => {
                    losses.damaged += 1;
                    continue;
                }
                Some(Ok(frame)) => frame,
            };
            match frame.kind {
                Kind::Event => keep_event(events, losses, &frame),
                Kind::Reply | Kind::Error => match answer_to(awaited, &frame) {
                    Some(found) if answer.is_none() => answer = Some(found),
                    _ => losses.late += 1,
                },
                // Only a gateway is sent requests: our own ones come back from a loop in the wiring.
                Kind::Request => losses.unreadable += 1,
            }
        }
        answer
    }

    pub(crate) fn next_event(&mut self) -> Option<EventMessage> {
        self.events.pop_front()
    }

    pub(crate) fn has_event(&self) -> bool {
        !self.events.is_empty()
    }

    pub(crate) fn losses(&self) -> Losses {
        self.losses
    }

    /// Forgets the frame that was arriving; the events stay, they have happened.
    pub(crate) fn restart(&mut self) {
        self.deframer = Deframer::new();
    }
}

fn keep_event(events: &mut VecDeque<EventMessage>, losses: &mut Losses, frame: &Frame<'_>) {
    match EventMessage::decode(frame.number, frame.body) {
        Ok(_) if events.len() >= MAX_EVENTS => losses.events_dropped += 1,
        Ok(event) => events.push_back(event),
        Err(_) => losses.unreadable += 1,
    }
}

fn answer_to(awaited: Option<Awaited>, frame: &Frame<'_>) -> Option<Answer> {
    let awaited = awaited.filter(|awaited| awaited.sequence == frame.sequence)?;
    if frame.kind == Kind::Error {
        // Data that cannot be read leaves the number, which says enough.
        let error =
            Error::decode(frame.number, frame.body).unwrap_or(Error::Unknown { number: frame.number });
        return Some(Answer::Error(error));
    }
    // Another number under the same sequence belongs to a session before this one.
    (frame.number == awaited.number)
        .then(|| Answer::Reply { number: frame.number, body: frame.body.to_vec() })
}
