//! A request of a program, by what it does.

use host_protocol::{Call, Frame, Kind, Request, requests as ask};

/// A request as it came.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Ask {
    /// The program's own.
    pub sequence: u16,
    pub number: u16,
    pub body: Vec<u8>,
    /// Its program says itself that it only watches: a server behind this one.
    pub watches: bool,
}

impl Ask {
    /// That of a frame, if it is a request.
    pub fn of(frame: &Frame<'_>) -> Option<Self> {
        let watches = match frame.kind {
            Kind::Request => false,
            Kind::WatcherRequest => true,
            Kind::Reply | Kind::Error | Kind::Event => return None,
        };
        let Frame { sequence, number, body, .. } = *frame;
        Some(Self { sequence, number, body: body.to_vec(), watches })
    }

    /// Executed each time it comes, goes first, and is always admitted. One that cannot be read is
    /// refused by the gateway: it waits like anything else.
    pub fn stops(&self) -> bool {
        [ask::EStop::NUMBER, ask::Stop::NUMBER, ask::Disarm::NUMBER].contains(&self.number)
            && self.is_readable()
    }

    /// Whether another one, of whatever number, asks for the same.
    pub fn is_like(&self, other: &Self) -> bool {
        (self.number, &self.body) == (other.number, &other.body)
    }

    /// The cable's rate is the server's business: its end has to follow.
    pub fn sets_baud(&self) -> bool {
        self.number == ask::SetBaud::NUMBER
    }

    /// A hello; one that cannot be read is refused by the gateway and opens nothing.
    pub fn opens_session(&self) -> bool {
        self.number == ask::Hello::NUMBER && self.is_readable()
    }

    fn is_readable(&self) -> bool {
        Request::decode(self.number, &self.body).is_ok()
    }
}
