//! The rate of a line that is a UART: asked for, used while the gateway is heard at it, given up
//! for the default when it is not.

use std::time::Duration;

use host_protocol::{DEFAULT_BAUD, requests::SetBaud};

use crate::client::Client;
use crate::error::ClientError;
use crate::transport::Transport;

/// At another rate than the default, what has been unanswered for so long asks for a ping: the
/// motor may be slow, the gateway is not.
const DOUBT_AFTER: Duration = Duration::from_millis(80);
/// After this silence of the gateway the line is at its default rate again.
const GIVE_UP_AFTER: Duration = Duration::from_millis(200);
/// Between the reply and what is sent at the new rate: the gateway changes when its last bit has
/// left.
const CHANGE: Duration = Duration::from_millis(2);
/// How long the reply is waited for.
const REPLY: Duration = Duration::from_millis(300);
/// How long the first ping at the new rate is: two of them. A third that the gateway cannot read
/// would bring it back to the default, where an adapter that does not follow is heard.
const CONFIRMATION: Duration = Duration::from_millis(150);
/// How often a change is tried.
const TRIES: u32 = 3;

/// The rate of a line, and whether the gateway is heard at it.
#[derive(Debug, Default)]
pub(crate) struct Baud {
    /// Another rate than the default.
    other: Option<u32>,
    /// Since when something has been sent and nothing heard, at that rate.
    unanswered_since: Option<Duration>,
}

impl Baud {
    /// Something valid came.
    pub(crate) fn heard(&mut self) {
        self.unanswered_since = None;
    }

    /// Something is about to be sent. Whether it is time for the default rate.
    fn sends(&mut self, now: Duration) -> bool {
        let since = *self.unanswered_since.get_or_insert(now);
        self.other.is_some() && now >= since + GIVE_UP_AFTER
    }

    /// Whether a ping must tell if the gateway is heard at all.
    pub(crate) fn is_in_doubt(&self, now: Duration) -> bool {
        self.other.is_some() && self.unanswered_since.is_some_and(|at| now >= at + DOUBT_AFTER)
    }

    /// Back to the default, where the line was at another rate.
    pub(crate) fn give_up<T: Transport>(&mut self, transport: &mut T) -> std::io::Result<()> {
        if self.other.take().is_some() {
            transport.set_baud(DEFAULT_BAUD)?;
        }
        Ok(())
    }

    /// The connection was opened again.
    pub(crate) fn restart(&mut self) {
        *self = Self::default();
    }
}

impl<T: Transport> Client<T> {
    /// Has the line run at another rate, if it is a UART and both ends can. It goes back to the
    /// default by itself when the gateway is not heard for 200 ms; the gateway does so when it has
    /// heard nothing valid for 5 s, or three frames in a row that it cannot read.
    ///
    /// # Errors
    /// The gateway's `BaudNotOffered` names the rates that it offers, `LinkHasNoBaud` is USB's;
    /// [`ClientError::BaudFailed`] where the gateway is not heard at the new rate, or the port
    /// cannot run at it: the line then runs at the default.
    pub fn set_baud(&mut self, baud: u32) -> Result<(), ClientError> {
        // A port that has no rate is not asked for one.
        if let Err(source) = self.transport.set_baud(self.baud()) {
            return Err(ClientError::BaudFailed { baud, source: Some(source) });
        }
        let mut failure = ClientError::BaudFailed { baud, source: None };
        for _ in 0..TRIES {
            match self.request_within(&SetBaud { baud }, REPLY) {
                // The gateway may have changed: it does not understand what is repeated.
                Err(error @ ClientError::NoAnswer { .. }) => {
                    failure = error;
                    continue;
                }
                other => other?,
            };
            if let Err(source) = self.transport.set_baud(baud) {
                self.transport.set_baud(DEFAULT_BAUD)?;
                return Err(ClientError::BaudFailed { baud, source: Some(source) });
            }
            self.baud.restart();
            self.baud.other = Some(baud).filter(|baud| *baud != DEFAULT_BAUD);
            self.pause(CHANGE)?;
            match self.ping_within(CONFIRMATION) {
                Ok(()) if self.baud() == baud => return Ok(()),
                Ok(()) | Err(ClientError::NoAnswer { .. }) => {}
                Err(error) => return Err(error),
            }
            failure = ClientError::BaudFailed { baud, source: None };
            let Self { baud, transport, .. } = self;
            baud.give_up(transport)?;
        }
        Err(failure)
    }

    /// The rate of the line, as far as it has one.
    pub fn baud(&self) -> u32 {
        self.baud.other.unwrap_or(DEFAULT_BAUD)
    }

    /// Asks for the rate that the transport's user wants.
    pub(crate) fn negotiate(&mut self) -> Result<(), ClientError> {
        match self.transport().wanted_baud() {
            Some(baud) => self.set_baud(baud),
            None => Ok(()),
        }
    }

    /// Before each frame: whether the gateway still hears this rate.
    pub(crate) fn heed_baud(&mut self) -> Result<(), ClientError> {
        let now = self.now();
        if self.baud.sends(now) {
            let Self { baud, transport, .. } = self;
            baud.give_up(transport)?;
        }
        Ok(())
    }
}
