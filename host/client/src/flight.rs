//! What the gateway's flight recorder has kept of a trip.

use std::time::Duration;

use host_protocol::replies::FlightRecordPage;
use host_protocol::requests as ask;
use host_protocol::{CHECKSUM, Call, Error};

use crate::client::Client;
use crate::error::ClientError;
use crate::transport::Transport;

/// The recorder has 1 s for each page.
const PAGE_DEADLINE: Duration = Duration::from_millis(1_500);
/// Where somebody else reads too, each page is asked for again so much later, and for so long.
const BUSY_PAUSE: Duration = Duration::from_millis(5);
const BUSY_FOR: Duration = Duration::from_secs(3);
/// So often it is read from the beginning, where something else is kept meanwhile.
const READINGS: usize = 3;
/// All of it is read within this time, on the slowest of links.
const READ_WITHIN: Duration = Duration::from_secs(120);
/// More than any gateway has memory, bytes.
const MOST: usize = 64 << 20;

impl<T: Transport> Client<T> {
    /// What the flight recorder has kept of a trip, as the file that `mgw replay` plays;
    /// `None` where it has kept nothing. A recorder that still adds to it does so no more.
    ///
    /// # Errors
    /// As [`request`](Self::request); [`Error::FlightRecording`] also where other trips come
    /// meanwhile, again and again.
    pub fn flight_record(&mut self) -> Result<Option<Vec<u8>>, ClientError> {
        for _ in 0..READINGS {
            match self.read_flight_record()? {
                Some(bytes) if bytes.is_empty() => return Ok(None),
                Some(mut bytes) => {
                    bytes.extend(CHECKSUM.checksum(&bytes).to_le_bytes());
                    return Ok(Some(bytes));
                }
                None => {}
            }
        }
        Err(Error::FlightRecording {}.into())
    }

    /// All that is kept, all parts; `None` where something else was kept meanwhile.
    fn read_flight_record(&mut self) -> Result<Option<Vec<u8>>, ClientError> {
        let mut page = self.flight_record_page(0, 0)?;
        let (id, parts) = (page.id, page.parts);
        let mut bytes = Vec::new();
        let end = self.now() + READ_WITHIN;
        for part in 0..parts {
            let begin = bytes.len();
            let length = page.length;
            loop {
                bytes.extend_from_slice(&page.bytes);
                let read = bytes.len() - begin;
                let is_late = self.now() > end;
                let is_over = read as u64 > length.into() || bytes.len() > MOST || is_late;
                // What does not advance, or goes on for too long, is no answer.
                if is_over || page.bytes.is_empty() && length > 0 {
                    let (request, number) = ("ReadFlightRecord", ask::ReadFlightRecord::NUMBER);
                    return Err(ClientError::UnreadableReply { request, number });
                }
                let is_whole = read as u64 == length.into();
                let (next, offset) = if is_whole { (part + 1, 0) } else { (part, read) };
                if next == parts {
                    return Ok(Some(bytes));
                }
                let offset = u32::try_from(offset).unwrap_or(u32::MAX);
                page = match self.flight_record_page(next, offset) {
                    Ok(page) if (page.id, page.parts) == (id, parts) => page,
                    Ok(_) | Err(ClientError::Gateway(Error::BeyondFlightRecord { .. })) => {
                        return Ok(None);
                    }
                    Err(error) => return Err(error),
                };
                if is_whole {
                    break;
                }
                if page.length != length {
                    return Ok(None);
                }
            }
        }
        Ok(Some(bytes))
    }

    /// Bytes of a part from an offset on, when the recorder has time for it.
    fn flight_record_page(
        &mut self,
        part: u16,
        offset: u32,
    ) -> Result<FlightRecordPage, ClientError> {
        let end = self.now() + BUSY_FOR;
        loop {
            match self.request_within(&ask::ReadFlightRecord { part, offset }, PAGE_DEADLINE) {
                Err(ClientError::Gateway(Error::FlightRecorderBusy {})) if self.now() < end => {
                    self.pause(BUSY_PAUSE)?;
                }
                answer => return answer,
            }
        }
    }
}
