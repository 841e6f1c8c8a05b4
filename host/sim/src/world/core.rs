//! The core, and the recorder that is told of every call to it.

use std::ops::Deref;

use flight_recorder::{Call, Recorder};
use gateway::{
    Board, Changes, Event, Found, Gateway, Images, Instant, NextRow, Save, Store, Transmit,
};
use host_protocol::MAX_FRAME;

/// Bytes that the recorder has: several seconds of a busy bus.
const RECORDED: usize = 512 * 1024;

/// The core of a world. What changes it goes through here.
pub(super) struct Core {
    gateway: Box<Gateway>,
    recorder: Recorder<Vec<u8>>,
    /// When it was called last, for calls without a time.
    now: Instant,
}

impl Core {
    pub fn new(board: &'static Board, random_number: Option<u32>) -> Self {
        Self {
            gateway: Box::new(Gateway::new(board, random_number)),
            recorder: Recorder::new(vec![0; RECORDED]),
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
    pub fn recorded(&self) -> &[u8] {
        self.recorder.memory()
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
}

impl Deref for Core {
    type Target = Gateway;

    fn deref(&self) -> &Gateway {
        &self.gateway
    }
}
