//! Where results and events go: the host links.

use crate::link::Links;
use crate::link::Slot;
use crate::time::Instant;
use host_protocol::{Error, Event, Reply};
use serde::{Deserialize, Serialize};

/// The host links, as seen by whatever has something to tell.
pub(crate) struct Outbox<'a> {
    now: Instant,
    links: &'a mut Links,
}

/// The reply that a request is owed.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Ticket {
    /// The link the request came from.
    pub link: u8,
    /// It came for a program that only watches.
    pub watches: bool,
    /// Where the reply is kept; `None` for a stop that was executed although no slot was left.
    pub slot: Option<Slot>,
}

impl<'a> Outbox<'a> {
    pub fn new(now: Instant, links: &'a mut Links) -> Self {
        Self { now, links }
    }

    /// Answers a request.
    pub fn answer(&mut self, ticket: Ticket, result: Result<&Reply, Error>) {
        if let Some(slot) = ticket.slot {
            self.links.reply(ticket.link, slot, result);
        }
    }

    /// Tells every host, and the log.
    pub fn event(&mut self, event: &Event) {
        self.links.event(self.now.as_micros(), event);
    }
}
