//! The right of one host link to command (GUARANTEES G9).

use crate::outbox::Ticket;
use crate::time::{Duration, Instant};
use host_protocol::{Error, GatewayParameter, Value};
use serde::{Deserialize, Serialize};

/// Who may command, and how long it may be silent.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Authority {
    /// The link in command.
    pub holder: Option<u8>,
    /// When the holder took authority or was last heard.
    heard_at: Instant,
    /// The silence that ends authority.
    pub silence: Duration,
}

impl Authority {
    pub const fn new() -> Self {
        let default = match GatewayParameter::LinkSilenceUs.info().default {
            Some(Value::Unsigned(us)) => us,
            _ => panic!("the parameter table gives no default for the link silence"),
        };
        Self {
            holder: None,
            heard_at: Instant::from_micros(0),
            silence: Duration::from_micros(default as u64),
        }
    }

    pub fn is_held_by(&self, link: u8) -> bool {
        self.holder == Some(link)
    }

    /// Whether a request may be carried out, or whose authority it would need. Who only watches has
    /// none, not even that of its own link.
    pub fn check(&self, ticket: Ticket) -> Result<(), Error> {
        let Ticket { link, watches, .. } = ticket;
        match self.holder {
            Some(holder) if holder != link || watches => Err(Error::NotInCommand { holder }),
            None if watches => Err(Error::NobodyInCommand {}),
            _ => Ok(()),
        }
    }

    /// Gives authority to the link of a request if it is free, as [`check`](Self::check) says.
    pub fn take(&mut self, now: Instant, ticket: Ticket) -> Result<(), Error> {
        self.check(ticket)?;
        (self.holder, self.heard_at) = (Some(ticket.link), now);
        Ok(())
    }

    /// A request that can be read came from a link, a repeated one too.
    pub fn heard(&mut self, now: Instant, link: u8) {
        if self.is_held_by(link) {
            self.heard_at = now;
        }
    }

    /// When the holder's silence becomes too long.
    pub fn deadline(&self) -> Option<Instant> {
        self.holder.map(|_| self.heard_at + self.silence)
    }
}
