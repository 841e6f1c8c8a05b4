//! What the flight recorder has kept: a host asks the core for it, and the core its port. The
//! recorder stands beside the core, which knows nothing of recordings.

use super::Gateway;
use super::requests::Result;
use crate::outbox::Ticket;
use crate::port::{FlightPage, FlightRead, FlightReadError};
use crate::time::{Duration, Instant};
use host_protocol::{Bytes, Error, Reply, replies, requests};
use serde::{Deserialize, Serialize};

/// The port answers within this time, or the host is told that it does not.
const ANSWERED_WITHIN: Duration = Duration::from_millis(1_000);

/// Who waits for bytes of the recording, and which.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct FlightReading {
    // A [`FlightRead`] here would take 8 bytes more.
    part: u16,
    offset: u32,
    ticket: Ticket,
    is_taken: bool,
    ends: Instant,
}

impl FlightReading {
    const fn read(&self) -> FlightRead {
        FlightRead { part: self.part, offset: self.offset }
    }

    /// Whether the port has still to take it.
    pub const fn is_due(&self) -> bool {
        !self.is_taken
    }

    /// When it is given up.
    pub const fn deadline(&self) -> Instant {
        self.ends
    }
}

impl Gateway {
    /// Whether [`take_flight_read`](Self::take_flight_read) has something.
    #[must_use]
    pub fn has_flight_read(&self) -> bool {
        self.flight_reading.as_ref().is_some_and(FlightReading::is_due)
    }

    /// What a host asks the flight recorder for, once.
    /// [`Event::FlightRecord`](crate::Event::FlightRecord) answers it; the port takes no other
    /// before that.
    pub fn take_flight_read(&mut self) -> Option<FlightRead> {
        let reading = self.flight_reading.as_mut().filter(|reading| reading.is_due())?;
        reading.is_taken = true;
        Some(reading.read())
    }

    /// Has the port read; the host is answered when it has.
    pub(crate) fn read_flight_record(
        &mut self,
        now: Instant,
        request: &requests::ReadFlightRecord,
        ticket: Ticket,
    ) -> Result<()> {
        if self.flight_reading.is_some() {
            return Err(Error::FlightRecorderBusy {});
        }
        let requests::ReadFlightRecord { part, offset } = *request;
        let (ends, is_taken) = (now + ANSWERED_WITHIN, false);
        self.flight_reading = Some(FlightReading { part, offset, ticket, is_taken, ends });
        Ok(())
    }

    /// The port has answered. What comes for a reading that was given up counts for no other one:
    /// the port takes that afterwards.
    pub(crate) fn flight_record(
        &mut self,
        now: Instant,
        result: core::result::Result<FlightPage<'_>, FlightReadError>,
    ) {
        let Some(reading) = self.flight_reading.take_if(|reading| reading.is_taken) else {
            return;
        };
        let answer = match result {
            Ok(FlightPage { parts, length, .. }) if reading.read().is_beyond(parts, length) => {
                Err(Error::BeyondFlightRecord { parts, length })
            }
            Ok(FlightPage { id, parts, length, bytes }) => {
                let most = bytes.get(..replies::MAX_FLIGHT_RECORD_BYTES).unwrap_or(bytes);
                let bytes = Bytes::from_slice(most).unwrap_or_default();
                Ok(Reply::ReadFlightRecord(replies::FlightRecordPage { id, parts, length, bytes }))
            }
            Err(FlightReadError::NoRecorder) => Err(Error::NoFlightRecorder {}),
            Err(FlightReadError::Recording) => Err(Error::FlightRecording {}),
        };
        self.outbox(now).answer(reading.ticket, answer.as_ref().map_err(|error| *error));
    }

    /// Gives up a port that does not answer: the host is told, and the next one may ask.
    pub(crate) fn give_up_flight_reading(&mut self, now: Instant) {
        if let Some(reading) = self.flight_reading.take_if(|reading| reading.ends <= now) {
            self.outbox(now).answer(reading.ticket, Err(Error::FlightRecorderBusy {}));
        }
    }
}
