//! A core whose calls are recorded.

use crate::call::Call;
use crate::recorder::Recorder;
use crate::shelf::Shelf;
use core::ops::Deref;
use gateway::{
    Board, Changes, Event, FlightPage, FlightRead, FlightReadError, Gateway, Instant, LogEntry,
    Save, Store, Transmit,
};
use host_protocol::MAX_FRAME;

/// A core, and the recorder that is told of every call that changes it.
pub struct Recorded<S> {
    recorder: Recorder<S>,
    /// When it was called last, for calls without a time.
    now: Instant,
    core: Gateway,
}

impl<S: Shelf> Recorded<S> {
    /// A core and its board. Always inlined, and nothing is asked of the core: it is too large for
    /// the stack of a board, and is made where it stays.
    #[inline(always)]
    pub const fn new(core: Gateway, board: &'static Board, shelf: S) -> Self {
        Self { recorder: Recorder::new(shelf, board), now: Instant::from_micros(0), core }
    }

    /// What the recorder has kept.
    pub fn recorder(&self) -> &Recorder<S> {
        &self.recorder
    }

    /// After a start: takes what the recorder had kept before a reset, if its memory has outlived it.
    pub fn recall(&mut self) {
        self.recorder.recall();
    }

    /// Another core begins on this board. What the recorder has kept stays, where `keeps` says so.
    pub fn restart(&mut self, core: Gateway, keeps: bool) {
        self.recorder.restart(keeps);
        (self.core, self.now) = (core, Instant::from_micros(0));
    }

    /// The core, for what is done with it before any axis is armed: nothing of it is recorded.
    pub fn before_motion(&mut self) -> &mut Gateway {
        &mut self.core
    }

    #[inline(always)]
    fn note(&mut self, now: Instant, call: Call<'_>) {
        self.now = now;
        self.recorder.note(&self.core, now, &call);
    }

    /// [`Gateway::handle`].
    pub fn handle(&mut self, now: Instant, event: Event<'_>, store: Store<'_>) -> Changes {
        self.note(now, Call::Handle(event));
        self.core.handle(now, event, store)
    }

    /// Whether [`go_on`](Self::go_on) is to be called, to be asked when the frames that follow from
    /// an event have been handed over.
    #[inline(always)]
    pub fn is_due(&self) -> bool {
        self.recorder.is_due(&self.core)
    }

    /// Has the recorder look at what has come of the calls, and copy a part of the core where it
    /// wants a copy. Returns whether more is to be copied. When nothing more urgent is to do.
    pub fn go_on(&mut self, now: Instant) -> bool {
        self.recorder.watch(&mut self.core, now);
        self.recorder.wants_copy() && self.recorder.copy_some(&mut self.core, now)
    }

    /// [`Gateway::take_changes`].
    pub fn take_changes(&mut self) -> Changes {
        self.core.take_changes()
    }

    /// [`Gateway::poll_cancel`].
    pub fn poll_cancel(&mut self, now: Instant, bus: u8) -> Option<u8> {
        self.note(now, Call::PollCancel { bus });
        self.core.poll_cancel(now, bus)
    }

    /// [`Gateway::poll_transmit`].
    pub fn poll_transmit(&mut self, now: Instant, bus: u8) -> Option<Transmit> {
        self.note(now, Call::PollTransmit { bus });
        self.core.poll_transmit(now, bus)
    }

    /// [`Gateway::next_deadline`].
    pub fn next_deadline(&mut self) -> Option<Instant> {
        self.core.next_deadline()
    }

    /// [`Gateway::poll_host`].
    pub fn poll_host(
        &mut self,
        link: u8,
        out: &mut [u8; MAX_FRAME],
        store: Store<'_>,
    ) -> Option<usize> {
        self.note(self.now, Call::PollHost { link });
        let length = self.core.poll_host(link, out, store);
        if length.is_some() {
            self.recorder.sent();
        }
        length
    }

    /// [`Gateway::save_some`].
    pub fn save_some(&mut self, store: Store<'_>) -> bool {
        // Mostly nothing is left to store, and that is no change.
        if !self.core.has_more_to_save() {
            return true;
        }
        self.note(self.now, Call::SaveSome);
        self.core.save_some(store)
    }

    /// [`Gateway::take_save`].
    pub fn take_save(&mut self) -> Option<Save> {
        self.note(self.now, Call::TakeSave);
        self.core.take_save()
    }

    /// [`Gateway::take_flight_read`].
    pub fn take_flight_read(&mut self) -> Option<FlightRead> {
        if !self.core.has_flight_read() {
            return None;
        }
        self.note(self.now, Call::TakeFlightRead);
        self.core.take_flight_read()
    }

    /// The answer to that, for [`Event::FlightRecord`], with its bytes in `out`. When nothing more
    /// urgent is to do.
    ///
    /// # Errors
    /// See [`FlightReadError`].
    pub fn read<'a>(
        &mut self,
        now: Instant,
        FlightRead { part, offset }: FlightRead,
        out: &'a mut [u8],
    ) -> Result<FlightPage<'a>, FlightReadError> {
        self.recorder.watch(&mut self.core, now);
        if !self.recorder.end() {
            return Err(FlightReadError::Recording);
        }
        Ok(self.recorder.page_of_trip(part, offset, out))
    }

    /// [`Gateway::take_log`].
    pub fn take_log(&mut self) -> Option<LogEntry> {
        self.note(self.now, Call::TakeLog);
        self.core.take_log()
    }
}

impl<S> Deref for Recorded<S> {
    type Target = Gateway;

    fn deref(&self) -> &Gateway {
        &self.core
    }
}
