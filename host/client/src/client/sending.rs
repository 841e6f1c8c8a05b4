//! The one place where a client writes and waits: each time it looks for an interrupt, then sends
//! what is due, then listens.

use std::time::Duration;

use host_protocol::messages::request_name;
use host_protocol::requests::{self as ask, Ping};
use host_protocol::{Call, DEFAULT_BAUD, Kind, MAX_FRAME};

use super::Client;
use crate::error::ClientError;
use crate::inbox::Answer;
use crate::kinds::{acts_each_time, moves, stops};
use crate::stream::{Motion, Stream};
use crate::transport::Transport;

/// An interrupt is looked for at least this often.
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// Requests among which the gateway knows a repeated one.
const REMEMBERED: u64 = 8;
/// Bytes taken from the transport at once.
const READ_BUFFER: usize = 512;

impl<T: Transport> Client<T> {
    /// Sends a request until it is answered or the deadline has passed. Returns the reply, and when
    /// the request was sent for the first time.
    pub(crate) fn exchange<C: Call>(
        &mut self,
        request: &C,
        deadline: Duration,
        repeat_after: Duration,
    ) -> Result<(C::Reply, Duration), ClientError> {
        let name = request_name(C::NUMBER).unwrap_or("a request");
        let start = self.transport.now();
        let (end, mut next_sending) = (start.saturating_add(deadline), start);
        let (mut first, mut own) = (None, 0);
        let mut frame = [0; MAX_FRAME];
        loop {
            self.heed_interrupt(C::NUMBER)?;
            self.send_due()?;
            let now = self.transport.now();
            if now >= end {
                return Err(ClientError::NoAnswer { request: name, after: deadline });
            }
            let (sequence, length, sent, order) = match first {
                Some(first) => first,
                None => {
                    let sequence = self.next_sequence();
                    let length = host_protocol::encode(
                        Kind::Request,
                        sequence,
                        C::NUMBER,
                        request,
                        &mut frame,
                    )
                    .map_err(|_| ClientError::TooLong { request: name })?;
                    *first.insert((sequence, length, now, self.written))
                }
            };
            // Among so many others the gateway would take it for a new one.
            let is_known = self.written - order - own < REMEMBERED || !acts_each_time(C::NUMBER);
            if now >= next_sending {
                if is_known {
                    self.write(C::NUMBER, frame.get(..length).unwrap_or(&frame))?;
                    own += 1;
                }
                if self.baud.is_in_doubt(now) {
                    self.post(&Ping {})?;
                }
                next_sending = now + repeat_after;
            }
            let until =
                if is_known || self.baud() != DEFAULT_BAUD { next_sending.min(end) } else { end };
            match self.listen(until, Some((sequence, C::NUMBER)))? {
                None => {}
                Some(answer) => return answer.read::<C>().map(|reply| (reply, sent)),
            }
        }
    }

    fn next_sequence(&mut self) -> u16 {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        sequence
    }

    /// The one place where requests are written; the stops that follow an interrupt are written by
    /// themselves.
    fn write(&mut self, number: u16, frame: &[u8]) -> Result<(), ClientError> {
        // Right before each frame: it may have come since the loop looked, and among several frames
        // that are due.
        self.heed_interrupt(number)?;
        self.heed_baud()?;
        self.transport.send(frame)?;
        self.written += 1;
        self.last_sent = self.transport.now();
        Ok(())
    }

    /// Writes a request whose answer nobody waits for.
    fn post<C: Call>(&mut self, request: &C) -> Result<u16, ClientError> {
        let sequence = self.next_sequence();
        let mut frame = [0; MAX_FRAME];
        let length = host_protocol::encode(Kind::Request, sequence, C::NUMBER, request, &mut frame)
            .map_err(|_| ClientError::TooLong {
                request: request_name(C::NUMBER).unwrap_or("a request"),
            })?;
        self.write(C::NUMBER, frame.get(..length).unwrap_or(&frame))?;
        Ok(sequence)
    }

    /// Reads once what has arrived, or arrives before something is to be sent, or an interrupt to
    /// be looked for.
    pub(super) fn listen(
        &mut self,
        until: Duration,
        awaited: Option<(u16, u16)>,
    ) -> Result<Option<Answer>, ClientError> {
        let now = self.transport.now();
        let due = self.stream.as_ref().map_or(until, Stream::due);
        let wait = until.min(due).min(now + LOOK_EVERY).saturating_sub(now);
        let mut buffer = [0; READ_BUFFER];
        let count = self.transport.receive(&mut buffer, wait)?;
        let now = self.transport.now();
        let mut found = None;
        let frames = self.inbox.frames();
        let answers = self.inbox.take_in(buffer.get(..count).unwrap_or(&buffer));
        if self.inbox.frames() != frames {
            self.baud.heard();
        }
        for arrived in answers {
            let is_awaited =
                awaited.is_some_and(|(sequence, number)| arrived.answers(sequence, number));
            if is_awaited && found.is_none() {
                found = Some(arrived.answer);
            } else if !self
                .stream
                .as_mut()
                .is_some_and(|stream| stream.take(now, &arrived, &mut self.clock))
            {
                self.inbox.count_late();
            }
        }
        Ok(found)
    }

    /// Sends the setpoints and the ping that are due.
    pub(super) fn send_due(&mut self) -> Result<(), ClientError> {
        let now = self.transport.now();
        // Taken out while it is sent from; a failure to write ends it.
        let Some(mut stream) = self.stream.take() else { return Ok(()) };
        // First: it measures the clock, and waits behind nothing.
        if stream.takes_ping(now) {
            let sequence = self.post(&Ping {})?;
            stream.pinged(sequence, now);
        }
        if stream.takes_turn(now) {
            for index in 0..stream.flows.len() {
                let Some(flow) = stream.flows.get(index) else { break };
                let (axis, epoch, expires_at_us) =
                    (flow.axis, flow.epoch, self.expiry(flow.lead()));
                let sequence = match &flow.motion {
                    Motion::Setpoint(setpoint) => self.post(&ask::Setpoint {
                        axis,
                        epoch,
                        expires_at_us,
                        setpoint: *setpoint,
                    })?,
                    Motion::Native(data) => {
                        self.post(&ask::Native { axis, epoch, expires_at_us, data: data.clone() })?
                    }
                };
                stream.sent(index, sequence);
            }
        }
        self.stream = Some(stream);
        Ok(())
    }

    /// Lets time pass, at least one look at what has arrived, and sends meanwhile what is due.
    pub(crate) fn pass_time(&mut self, until: Duration) -> Result<(), ClientError> {
        loop {
            self.heed_interrupt(Ping::NUMBER)?;
            self.send_due()?;
            self.listen(until, None)?;
            if self.transport.now() >= until {
                return Ok(());
            }
        }
    }

    /// Lets time pass. Setpoints that are held are sent meanwhile, and an interrupt is followed.
    ///
    /// # Errors
    /// [`ClientError::Interrupted`], or the failure of the transport.
    pub fn pause(&mut self, duration: Duration) -> Result<(), ClientError> {
        let until = self.transport.now().saturating_add(duration);
        self.pass_time(until)
    }

    /// Lets time pass where the connection has failed, and so nothing is heard or sent.
    pub fn pause_unconnected(&mut self, duration: Duration) {
        self.transport.sleep(duration);
    }

    /// The first time that the interrupt is seen: stops, before anything else is written. Later:
    /// refuses what moves.
    pub(crate) fn heed_interrupt(&mut self, number: u16) -> Result<(), ClientError> {
        if !self.interrupt.is_raised() {
            return Ok(());
        }
        if !self.interrupted {
            self.interrupted = true;
            self.stop_armed()?;
            // The stop that follows an interrupt is not interrupted itself.
            return if stops(number) { Ok(()) } else { Err(self.ended_early()) };
        }
        if moves(number) { Err(self.ended_early()) } else { Ok(()) }
    }

    /// The stops of an interrupt that no call has followed yet. The next call follows it all the
    /// same, and tells: with the stops that nothing has answered.
    pub(crate) fn stop_if_interrupted(&mut self) -> Result<(), ClientError> {
        if self.interrupt.is_raised() && !self.interrupted { self.stop_armed() } else { Ok(()) }
    }

    /// Goes on after an interrupt that has been followed: what is armed from now on may move, until
    /// the interrupt is raised again. Before it was followed, it is followed first.
    ///
    /// # Errors
    /// As [`stop_armed`](Self::stop_armed).
    pub fn resume(&mut self) -> Result<(), ClientError> {
        self.stop_if_interrupted()?;
        self.interrupt.lower();
        (self.interrupted, self.has_stopped) = (false, false);
        Ok(())
    }

    /// Why nothing is sent any more that was to be kept up.
    pub(crate) fn ended_in_a_round(&self) -> ClientError {
        if self.interrupted {
            return self.ended_early();
        }
        let ended = "sending has failed in this round, and what was kept up has ended";
        ClientError::Transport(std::io::Error::new(std::io::ErrorKind::NotConnected, ended))
    }

    fn ended_early(&self) -> ClientError {
        ClientError::Interrupted { armed: self.has_stopped }
    }
}
