//! What a client asks for, as far as it decides which link it gets and which it keeps.

use std::time::Duration;

use host_protocol::{Deframer, Kind, Request};

/// A request, by what it says about who sends it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// It opens a session.
    Hello,
    /// It stops something.
    Stop,
    /// It changes or moves something.
    Command,
    /// It only looks.
    Look,
}

impl Purpose {
    fn of(request: &Request) -> Self {
        match request {
            Request::Hello(_) => Self::Hello,
            Request::Stop(_) | Request::EStop(_) | Request::Disarm(_) => Self::Stop,
            Request::Ping(_)
            | Request::BusStatus(_)
            | Request::GatewayStatus(_)
            | Request::ReadAxisParameter(_)
            | Request::ListAxes(_)
            | Request::ReadState(_)
            | Request::Recognise(_)
            | Request::Subscribe(_)
            | Request::ReadIncidents(_)
            | Request::ReadCrashReport(_)
            | Request::ReadFlightRecord(_) => Self::Look,
            _ => Self::Command,
        }
    }
}

/// What a client has asked for so far.
pub(super) struct Requests {
    deframer: Deframer,
    /// It has said Hello.
    pub(super) greeted: bool,
    /// When it last stopped or commanded something.
    pub(super) acted: Option<Duration>,
}

impl Requests {
    pub(super) fn new() -> Self {
        Self { deframer: Deframer::new(), greeted: false, acted: None }
    }

    /// Takes bytes in and returns the purpose of the first request that they complete.
    pub(super) fn take(&mut self, now: Duration, bytes: &[u8]) -> Option<Purpose> {
        let mut first = None;
        for byte in bytes {
            let Some(Ok(frame)) = self.deframer.push(*byte) else { continue };
            if frame.kind != Kind::Request {
                continue;
            }
            let Ok(request) = Request::decode(frame.number, frame.body) else { continue };
            let purpose = Purpose::of(&request);
            match purpose {
                Purpose::Hello => self.greeted = true,
                Purpose::Stop | Purpose::Command => self.acted = Some(now),
                Purpose::Look => {}
            }
            first.get_or_insert(purpose);
        }
        first
    }
}
