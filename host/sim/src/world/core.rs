//! The core, and the recorder that is told of every call to it.

use std::ops::Deref;
use std::sync::Arc;

use flight_recorder::{Call, Recorder, Recording, recorded_trip};
use gateway::{
    Board, Changes, Event, FlightPage, FlightRead, FlightReadError, Found, Gateway, Images,
    Instant, NextRow, Save, Store, Transmit,
};
use host_protocol::MAX_FRAME;
use host_protocol::replies::MAX_FLIGHT_RECORD_BYTES;

/// Bytes that the recorder has: several seconds of a busy bus.
const RECORDED: usize = 512 * 1024;

/// The core of a world. What changes it goes through here.
pub(super) struct Core {
    gateway: Box<Gateway>,
    recorder: Recorder<Vec<u8>>,
    /// What hosts read of it, since the first one has.
    kept: Option<Kept>,
    /// When it was called last, for calls without a time.
    now: Instant,
}

/// What the recorder has kept, in one part; nothing where it has kept nothing.
#[derive(Clone, Default)]
pub(super) struct Kept {
    id: u32,
    bytes: Arc<[u8]>,
}

impl Kept {
    fn new(bytes: &[u8]) -> Self {
        Self { id: u32::from_le_bytes(Recording::checksum(bytes)), bytes: bytes.into() }
    }

    /// The bytes that a host asks for.
    pub fn page(&self, FlightRead { part, offset }: FlightRead) -> FlightPage<'_> {
        let from = usize::try_from(offset).ok().filter(|_| part == 0);
        let rest = from.and_then(|from| self.bytes.get(from..)).unwrap_or_default();
        FlightPage {
            id: self.id,
            parts: u16::from(!self.bytes.is_empty()),
            length: u32::try_from(self.bytes.len()).unwrap_or(u32::MAX),
            bytes: rest.get(..MAX_FLIGHT_RECORD_BYTES).unwrap_or(rest),
        }
    }
}

impl Core {
    pub fn new(board: &'static Board, random_number: Option<u32>) -> Self {
        Self {
            gateway: Box::new(Gateway::new(board, random_number)),
            recorder: Recorder::new(vec![0; RECORDED]),
            kept: None,
            now: Instant::from_micros(0),
        }
    }

    /// Another start on this board: the memory of the recorder outlives it.
    pub fn restart(&mut self, board: &'static Board, random_number: Option<u32>) {
        *self.gateway = Gateway::new(board, random_number);
        self.recorder = Recorder::new(self.recorder.memory().to_vec());
        self.now = Instant::from_micros(0);
    }

    /// What the recorder holds.
    pub fn recorder_memory(&self) -> &[u8] {
        self.recorder.memory()
    }

    /// The same as a file has it, without the checksum at its end.
    pub fn recorded(&self) -> Vec<u8> {
        let mut memory = self.recorder_memory().to_vec();
        let length = Recording::trim(&mut memory);
        memory.truncate(length);
        memory
    }

    /// What the recorder has kept of a trip, for hosts. Nothing more is added to it.
    pub fn kept(&mut self) -> Result<Kept, FlightReadError> {
        if !self.recorder.end() {
            return Err(FlightReadError::Recording);
        }
        if recorded_trip(self.recorder_memory()).is_none() {
            return Ok(Kept::default());
        }
        let kept = self.kept.take().unwrap_or_else(|| Kept::new(&self.recorded()));
        Ok(self.kept.insert(kept).clone())
    }

    pub fn is_recording(&self) -> bool {
        self.recorder.is_recording()
    }

    fn note(&mut self, now: Instant, call: Call<'_>) {
        self.now = now;
        self.recorder.note(&mut self.gateway, now, &call);
    }

    pub fn set_images(&mut self, now: Instant, images: Images) {
        self.gateway.set_images(now, images);
    }

    pub fn load(&mut self, now: Instant, words: &[u32], found: Found, next: NextRow<'_>) {
        self.gateway.load(now, words, found, next);
    }

    pub fn restore(&mut self, now: Instant, words: &[u32]) {
        self.gateway.restore(now, words);
    }

    pub fn handle(&mut self, now: Instant, event: Event<'_>, store: Store<'_>) -> Changes {
        self.note(now, Call::Handle(event));
        let changes = self.gateway.handle(now, event, store);
        self.recorder.watch(&mut self.gateway, now);
        if self.is_recording() {
            self.kept = None;
        }
        changes
    }

    pub fn take_changes(&mut self) -> Changes {
        self.note(self.now, Call::TakeChanges);
        self.gateway.take_changes()
    }

    pub fn poll_cancel(&mut self, now: Instant, bus: u8) -> Option<u8> {
        self.note(now, Call::PollCancel { bus });
        self.gateway.poll_cancel(now, bus)
    }

    pub fn poll_transmit(&mut self, now: Instant, bus: u8) -> Option<Transmit> {
        self.note(now, Call::PollTransmit { bus });
        self.gateway.poll_transmit(now, bus)
    }

    pub fn next_deadline(&mut self) -> Option<Instant> {
        self.note(self.now, Call::NextDeadline);
        self.gateway.next_deadline()
    }

    pub fn poll_host(
        &mut self,
        link: u8,
        out: &mut [u8; MAX_FRAME],
        store: Store<'_>,
    ) -> Option<usize> {
        self.note(self.now, Call::PollHost { link });
        let length = self.gateway.poll_host(link, out, store);
        if length.is_some() {
            self.recorder.sent();
        }
        length
    }

    pub fn take_save(&mut self) -> Option<Save> {
        self.note(self.now, Call::TakeSave);
        self.gateway.take_save()
    }

    pub fn take_flight_read(&mut self) -> Option<FlightRead> {
        self.note(self.now, Call::TakeFlightRead);
        self.gateway.take_flight_read()
    }
}

impl Deref for Core {
    type Target = Gateway;

    fn deref(&self) -> &Gateway {
        &self.gateway
    }
}
