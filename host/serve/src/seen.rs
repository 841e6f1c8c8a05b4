//! What crosses the cable, for who records it.

use host_protocol::{Frame, Kind};

use crate::cable::{Asker, Cable};
use crate::multiplexer::ProgramId;

/// The program that is no program: the server itself.
pub const SERVER: ProgramId = 0;

/// A frame of the cable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// The program that has asked, [`SERVER`] for what the server asks by itself; none for an
    /// event, and for an answer that nobody waits for any more.
    pub program: Option<ProgramId>,
    /// Requests go to the gateway, everything else comes from it.
    pub kind: Kind,
    /// As on the cable; an event's counts the events of the cable.
    pub sequence: u16,
    /// Which request, reply, error or event.
    pub number: u16,
    /// The postcard body.
    pub body: Vec<u8>,
}

/// The copies that were not fetched yet; nothing is copied for nobody.
#[derive(Debug, Default)]
pub(crate) struct Copies {
    pub is_wanted: bool,
    kept: Vec<Seen>,
}

impl Copies {
    pub fn keep(&mut self, cable: &Cable, frame: &Frame<'_>) {
        if !self.is_wanted {
            return;
        }
        let asked = match frame.kind {
            Kind::Event => None,
            _ => cable.asked(frame.sequence),
        };
        let program = asked.map(|asked| match asked.asker {
            Asker::Program { id, .. } => id,
            Asker::Server => SERVER,
        });
        let Frame { kind, sequence, number, body, .. } = *frame;
        self.kept.push(Seen { program, kind, sequence, number, body: body.to_vec() });
    }

    pub fn take(&mut self) -> Vec<Seen> {
        std::mem::take(&mut self.kept)
    }
}
