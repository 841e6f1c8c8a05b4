//! A stop that the caller asks for: the next frame written, and written again until it is answered.

use std::io;
use std::time::Duration;

use host_protocol::{Error, MAX_FRAME, Request, StopTarget, requests as ask};

use crate::baud::Baud;
use crate::error::ClientError;
use crate::inbox::{Answer, Inbox};
use crate::transport::Transport;

/// A stop is written again after this time.
pub const REPEAT_STOP_AFTER: Duration = Duration::from_millis(25);
/// How long a stop is written again and again while nothing answers.
pub const STOP_PATIENCE: Duration = Duration::from_secs(3);
/// How often a stop is written at another rate than the default before it is written at that.
const TURNS_AT_ANOTHER_RATE: u32 = 2;
/// Between two attempts to open a connection again that has failed.
const REOPEN_EVERY: Duration = Duration::from_millis(50);
/// Bytes taken from the transport at once.
const READ_BUFFER: usize = 512;

/// A stop that needs no authority and no session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopRequest {
    /// Runs the stop action of an axis, or of all.
    Stop(StopTarget),
    /// Stops everything and latches the gateway.
    EStop,
}

impl From<StopRequest> for Request {
    fn from(request: StopRequest) -> Self {
        match request {
            StopRequest::Stop(target) => Self::Stop(ask::Stop { target }),
            StopRequest::EStop => Self::EStop(ask::EStop {}),
        }
    }
}

/// One stop, and the sequence numbers under which it has been written.
struct Pending {
    request: Request,
    sequences: Vec<u16>,
}

impl Pending {
    /// Both are answered alike.
    fn read(answer: &Answer) -> Result<(), ClientError> {
        answer.read::<ask::Stop>().map(drop)
    }

    /// Each time it has a new sequence, so that no memory of an earlier one answers in its place.
    fn write(&mut self, transport: &mut impl Transport, sequence: &mut u16) -> io::Result<()> {
        let mut frame = [0; MAX_FRAME];
        let length = self.request.encode_frame(*sequence, &mut frame);
        self.sequences.push(*sequence);
        *sequence = sequence.wrapping_add(1);
        transport.send(frame.get(..length.unwrap_or(0)).unwrap_or_default())
    }
}

/// How far the stops have come.
struct Stops {
    pending: Vec<Pending>,
    refusal: Option<Error>,
    written: bool,
}

impl Stops {
    /// Writes and listens once.
    fn turn<T: Transport>(
        &mut self,
        transport: &mut T,
        inbox: &mut Inbox,
        sequence: &mut u16,
    ) -> io::Result<()> {
        for pending in &mut self.pending {
            pending.write(transport, sequence)?;
            self.written = true;
        }
        let next = transport.now() + REPEAT_STOP_AFTER;
        let mut buffer = [0; READ_BUFFER];
        while transport.now() < next && !self.pending.is_empty() {
            let count = transport.receive(&mut buffer, next.saturating_sub(transport.now()))?;
            for arrived in inbox.take_in(buffer.get(..count).unwrap_or(&buffer)) {
                let answered = self.pending.iter().position(|Pending { request, sequences }| {
                    sequences.iter().any(|sequence| arrived.answers(*sequence, request.number()))
                });
                let Some(at) = answered else {
                    inbox.count_late();
                    continue;
                };
                match Pending::read(&arrived.answer) {
                    Ok(()) => drop(self.pending.remove(at)),
                    Err(ClientError::Gateway(error)) => {
                        self.pending.remove(at);
                        self.refusal.get_or_insert(error);
                    }
                    // Whether it was taken is not known: it is written again.
                    Err(_) => inbox.count_unreadable(),
                }
            }
        }
        Ok(())
    }
}

/// Writes stops, and again until each is answered. A connection that fails is opened again;
/// `reopened` says whether it was.
pub(crate) fn until_answered<T: Transport>(
    transport: &mut T,
    inbox: &mut Inbox,
    baud: &mut Baud,
    sequence: &mut u16,
    requests: &[StopRequest],
    reopened: &mut bool,
) -> Result<(), ClientError> {
    let pending = requests
        .iter()
        .map(|request| Pending { request: (*request).into(), sequences: Vec::new() });
    let mut stops = Stops { pending: pending.collect(), refusal: None, written: false };
    let mut last_error = None::<io::Error>;
    let end = transport.now().saturating_add(STOP_PATIENCE);
    let mut turns = 0;
    while !stops.pending.is_empty() {
        if transport.now() >= end {
            return Err(match last_error {
                // The other side has no place for this host.
                Some(error)
                    if !stops.written && error.kind() == io::ErrorKind::ConnectionRefused =>
                {
                    ClientError::LinksTaken
                }
                Some(error) if !stops.written => ClientError::Transport(error),
                // What was written may have been read, however the connection ended.
                _ => ClientError::StopUnanswered { after: STOP_PATIENCE },
            });
        }
        let is_heard = turns != TURNS_AT_ANOTHER_RATE;
        turns += 1;
        let given_up = if is_heard { Ok(()) } else { baud.give_up(transport) };
        if let Err(error) = given_up.and_then(|()| stops.turn(transport, inbox, sequence)) {
            last_error = Some(error);
            let before = transport.now();
            baud.restart();
            match transport.reconnect() {
                Ok(()) if !*reopened => inbox.restart(),
                Ok(()) | Err(_) => {
                    transport.sleep(REOPEN_EVERY.saturating_sub(transport.now() - before))
                }
            }
            *reopened = true;
        }
    }
    stops.refusal.map_or(Ok(()), |error| Err(error.into()))
}

/// Writes a stop before anything else, without a session, and again until it is answered. A
/// connection that fails is opened again meanwhile.
///
/// # Errors
/// [`ClientError::Gateway`] if the gateway refuses it, [`ClientError::StopUnanswered`] if nothing
/// answers within [`STOP_PATIENCE`], or the failure of the transport if it could never be written.
pub fn stop_before_hello<T: Transport>(
    transport: &mut T,
    request: StopRequest,
) -> Result<(), ClientError> {
    let mut sequence = fastrand::u16(..);
    let (mut inbox, mut baud) = (Inbox::new(), Baud::default());
    until_answered(transport, &mut inbox, &mut baud, &mut sequence, &[request], &mut false)
}
