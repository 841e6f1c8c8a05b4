//! A bus that is open for raw frames, which only read.

use std::time::Duration;

use host_protocol::replies::BusReport;
use host_protocol::{BusConfig, BusMode, Error, RawFrame, ReceivedFrame};
use mgw_client::{Client, ClientError, Transport};

use crate::failure::Failure;
use crate::session::Session;

/// Between two looks at what has arrived.
const LOOK_EVERY: Duration = Duration::from_millis(2);
/// The same while nothing is asked.
const LISTEN_EVERY: Duration = Duration::from_millis(10);
/// A frame that the bus does not take for so long is not acknowledged by anybody. A line is kept by
/// each unanswered read for its reply window, which has at most 200 ms.
const PATIENCE: Duration = Duration::from_millis(500);
/// At a bitrate that nobody runs at every frame is an error to those who are there.
const KNOCKS: u32 = 2;
/// An answer is waited for at least so long: this computer and its link take their time too.
const ANSWER_WITHIN: Duration = Duration::from_millis(30);
/// Of the frames that the gateway keeps for us, as many replies as there may be between two looks.
const SENT_BETWEEN_LOOKS: u32 = 3;

/// Batches of frames that are fetched in one go.
const BATCHES_AT_ONCE: usize = 8;

/// What takes in the frames of a bus.
pub trait Hear {
    /// A frame has arrived.
    fn hear(&mut self, frame: &RawFrame);
}

/// A bus of the gateway, open for raw frames.
pub struct OpenBus<'a> {
    session: &'a mut Session,
    bus: u8,
    unseen: u32,
    /// How long an answer is waited for.
    pub answer_within: Duration,
    /// Frames that the gateway could not keep until they were fetched.
    pub lost: u32,
}

impl<'a> OpenBus<'a> {
    /// Opens it. Refused while an axis on it is not idle.
    pub fn open(session: &'a mut Session, bus: u8, window: Duration) -> Result<Self, Failure> {
        session.client.raw_open(bus)?;
        Ok(Self::opened(session, bus, window))
    }

    /// Runs a bus without axes otherwise than it is configured, until it is closed.
    pub fn open_at(
        session: &'a mut Session,
        bus: u8,
        config: &BusConfig,
        mode: BusMode,
    ) -> Result<Self, Failure> {
        let BusConfig { bitrate, protocols, reply_window_us, .. } = *config;
        session.client.raw_open_at(bus, bitrate, protocols, reply_window_us, mode)?;
        Ok(Self::opened(session, bus, Duration::from_micros(reply_window_us.into())))
    }

    fn opened(session: &'a mut Session, bus: u8, window: Duration) -> Self {
        // Two frames may wait in the gateway, on a line each for the answer to the one before.
        let answer_within = ANSWER_WITHIN.max(window * 3);
        Self { session, bus, unseen: 0, answer_within, lost: 0 }
    }

    /// How it is.
    pub fn status(&mut self) -> Result<BusReport, Failure> {
        Ok(self.session.client.bus_status(self.bus)?)
    }

    /// Whether anybody acknowledges a frame, which is sent once or, as noise may have hit it,
    /// twice.
    pub fn is_acknowledged(
        &mut self,
        frame: &RawFrame,
        to: &mut dyn Hear,
    ) -> Result<bool, Failure> {
        let before = self.status()?.counters.transmitted;
        for _ in 0..KNOCKS {
            self.send(frame, to)?;
            self.listen(LISTEN_EVERY, to)?;
            if self.status()?.counters.transmitted != before {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Closes it: an open bus refuses arming.
    pub fn close(self) -> Result<(), Failure> {
        Ok(self.session.client.raw_close(self.bus)?)
    }

    /// Sends a frame, and takes in what has arrived now and then; `false` where nobody acknowledges
    /// what is sent.
    pub fn send(&mut self, frame: &RawFrame, to: &mut dyn Hear) -> Result<bool, Failure> {
        let end = self.session.client.now() + PATIENCE;
        loop {
            match self.session.client.raw_send(self.bus, frame.clone()) {
                Ok(()) => break,
                Err(ClientError::Gateway(Error::QueueFull { .. })) => {
                    if self.session.client.now() >= end {
                        return Ok(false);
                    }
                    self.fetch(to)?;
                    self.session.client.pause(LOOK_EVERY)?;
                }
                Err(error) => return Err(error.into()),
            }
        }
        self.unseen += 1;
        if self.unseen >= SENT_BETWEEN_LOOKS {
            self.fetch(to)?;
        }
        Ok(true)
    }

    /// Takes in what arrives, for so long.
    pub fn listen(&mut self, span: Duration, to: &mut dyn Hear) -> Result<(), Failure> {
        let end = self.session.client.now() + span;
        while self.fetch_until(end, to)? {}
        Ok(())
    }

    /// The same, until `done`.
    pub fn listen_until<H: Hear>(
        &mut self,
        span: Duration,
        to: &mut H,
        done: impl Fn(&H) -> bool,
    ) -> Result<(), Failure> {
        let end = self.session.client.now() + span;
        while self.fetch_until(end, to)? && !done(to) {}
        Ok(())
    }

    /// Takes in what has arrived, and pauses; `false` at the end.
    fn fetch_until(&mut self, end: Duration, to: &mut dyn Hear) -> Result<bool, Failure> {
        self.fetch(to)?;
        let left = end.saturating_sub(self.session.client.now());
        if !left.is_zero() {
            self.session.client.pause(LISTEN_EVERY.min(left))?;
        }
        Ok(!left.is_zero())
    }

    /// Takes in what arrives until `done`, or until no answer comes any more.
    pub fn await_answer<H: Hear>(
        &mut self,
        to: &mut H,
        done: impl Fn(&H) -> bool,
    ) -> Result<(), Failure> {
        let end = self.session.client.now() + self.answer_within;
        loop {
            self.fetch(to)?;
            if done(to) || self.session.client.now() >= end {
                return Ok(());
            }
            self.session.client.pause(LOOK_EVERY)?;
        }
    }

    fn fetch(&mut self, to: &mut dyn Hear) -> Result<(), Failure> {
        self.unseen = 0;
        let hear = |received: &ReceivedFrame| to.hear(&received.frame);
        let lost = fetch(&mut self.session.client, self.bus, hear)?;
        self.lost = self.lost.saturating_add(lost);
        Ok(())
    }
}

/// Fetches the raw frames that have arrived: how many the gateway could not keep until then.
pub fn fetch(
    client: &mut Client<Box<dyn Transport>>,
    bus: u8,
    mut hear: impl FnMut(&ReceivedFrame),
) -> Result<u32, ClientError> {
    let mut lost = 0_u32;
    // If they come without end, what else is to be done has its turn all the same.
    for _ in 0..BATCHES_AT_ONCE {
        let received = client.raw_receive(bus)?;
        lost = lost.saturating_add(received.dropped);
        received.frames.iter().for_each(&mut hear);
        if !received.frames.is_full() {
            break;
        }
    }
    Ok(lost)
}
