//! The names of a gateway, asked for without a session: for a stop of something by its name, and to
//! tell several gateways apart.

use std::time::Duration;

use host_protocol::{Call, Kind, MAX_FRAME, Named, Subject, requests as ask};

use crate::commands::each_page;
use crate::error::ClientError;
use crate::inbox::Inbox;
use crate::stopping::REPEAT_STOP_AFTER;
use crate::transport::Transport;

/// Bytes taken from the transport at once.
const READ_BUFFER: usize = 512;

/// The names of the gateway, its buses and its axes, asked for before anything else, and again
/// until each part of the list is answered.
///
/// # Errors
/// [`ClientError::NoAnswer`] if not all is told within `patience`, [`ClientError::Gateway`] if the
/// gateway refuses, or the failure of the transport.
pub fn names_before_hello<T: Transport>(
    transport: &mut T,
    patience: Duration,
) -> Result<Vec<Named>, ClientError> {
    let (mut inbox, mut sequence) = (Inbox::new(), fastrand::u16(..));
    let mut names = Vec::new();
    let end = transport.now().saturating_add(patience);
    each_page(Subject::Gateway, |first| {
        let page = page(transport, &mut inbox, sequence, first, end)?
            .ok_or(ClientError::NoAnswer { request: "ReadNames", after: patience })?;
        sequence = sequence.wrapping_add(1);
        names.extend(page.names);
        Ok(page.next)
    })?;
    Ok(names)
}

/// One part of the list; nothing if it is not told until `end`.
fn page<T: Transport>(
    transport: &mut T,
    inbox: &mut Inbox,
    sequence: u16,
    first: Subject,
    end: Duration,
) -> Result<Option<<ask::ReadNames as Call>::Reply>, ClientError> {
    let (mut frame, mut buffer) = ([0; MAX_FRAME], [0; READ_BUFFER]);
    let number = ask::ReadNames::NUMBER;
    let request = ask::ReadNames { first };
    let length = host_protocol::encode(Kind::Request, sequence, number, &request, &mut frame);
    let request = frame.get(..length.unwrap_or(0)).unwrap_or_default();
    while transport.now() < end {
        transport.send(request)?;
        let next = end.min(transport.now() + REPEAT_STOP_AFTER);
        while transport.now() < next {
            let count = transport.receive(&mut buffer, next.saturating_sub(transport.now()))?;
            for arrived in inbox.take_in(buffer.get(..count).unwrap_or(&buffer)) {
                if arrived.answers(sequence, number) {
                    return arrived.answer.read::<ask::ReadNames>().map(Some);
                }
            }
        }
    }
    Ok(None)
}
