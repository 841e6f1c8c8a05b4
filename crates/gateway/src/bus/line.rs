//! A half-duplex serial line: who may transmit, our own echo, and the frames in the byte stream.

use crate::port::MAX_SERIAL;
use crate::protocol::{Deframer, Info, Serial, SerialFrame};
use crate::time::{Duration, Instant};
use heapless::{Deque, Vec};
use host_protocol::ProtocolSet;
use serde::{Deserialize, Serialize};

/// Idle bits between the last byte heard and the next byte sent on a serial line.
pub const PAUSE_BITS: u64 = 20;
/// The part of a reply window that delays a stop, at most (GUARANTEES G5).
pub(super) const STOP_DELAY: Duration = Duration::from_millis(1);

/// Bits of a byte, with start and stop bit.
pub(super) const BYTE_BITS: u64 = 10;

/// The form of frames on a line with these protocols: one has the line to itself.
pub(super) fn serial_of(protocols: ProtocolSet) -> Option<&'static Serial> {
    protocols.iter().find_map(|protocol| Info::of(protocol).serial.as_ref())
}

/// Bits of such a frame; of the longest that a line can have where it is not known.
pub(super) fn serial_frame_bits(serial: Option<&Serial>) -> u64 {
    BYTE_BITS * serial.map_or(SerialFrame::new().capacity(), |serial| serial.frame_len) as u64
}

/// What a byte from the line is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Heard {
    /// Our own.
    Echo,
    /// Another node's.
    Byte,
    /// Another node's, and the last of a frame.
    Frame(SerialFrame),
}

/// The state of one serial line.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Line {
    /// What we have sent and not yet heard back.
    echo: Deque<u8, MAX_SERIAL>,
    /// The frame that we have sent, as long as its echo may still come behind bytes that are not
    /// ours.
    sent_frame: Option<SerialFrame>,
    /// What finds its frames.
    deframer: Option<Deframer>,
    /// What earlier deframers have rejected.
    rejected_before: u32,
    /// What the port holds until the awaited reply has come, and until when that may.
    behind_reply: Option<(SerialFrame, Instant)>,
    /// When the last byte was sent or heard.
    active_at: Instant,
    /// When the port took what we sent last.
    taken_at: Instant,
    /// When the last bit of that had left.
    sent_at: Instant,
    /// Until when that may still be answered.
    awaited: Option<Instant>,
}

/// The times of one bus that decide who may transmit.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineTimes {
    /// [`PAUSE_BITS`].
    pub gap: Duration,
    /// One frame.
    pub frame: Duration,
    /// How long a motor has for its reply.
    pub window: Duration,
}

impl LineTimes {
    /// The part of the window that delays a stop.
    pub fn stop_delay(&self) -> Duration {
        self.window.min(STOP_DELAY)
    }

    /// Until the last of `stops` stops that are due together has left: 2C + W and the pause before
    /// the first, 2C + W before each other one, and its own C.
    pub fn stop_bound(&self, stops: u64) -> Duration {
        (self.frame.times(2) + self.stop_delay()).times(stops) + self.gap + self.frame
    }
}

impl Line {
    /// From now on the frames of these protocols are found.
    pub fn configure(&mut self, protocols: ProtocolSet) {
        self.rejected_before = self.rejected();
        self.deframer = serial_of(protocols).map(|serial| serial.deframer.clone());
    }

    /// How its frames look.
    pub fn serial(&self) -> Option<&'static Serial> {
        self.deframer.as_ref().and_then(Deframer::serial)
    }

    pub fn restart(&mut self) {
        self.echo.clear();
        self.sent_frame = None;
        self.reset_deframer();
        self.behind_reply = None;
        self.awaited = None;
    }

    fn reset_deframer(&mut self) {
        if let Some(deframer) = &mut self.deframer {
            deframer.reset();
        }
    }

    /// From when on a frame may be sent that is no stop.
    pub fn ready_at(&self, times: LineTimes) -> Instant {
        let idle = self.active_at + times.gap;
        self.awaited.map_or(idle, |until| idle.max(until))
    }

    /// From when on a stop may be sent that is due at `due`. It waits for bytes in flight, never
    /// for a whole reply window, and not for ever: when our own frame, the reply to it and the
    /// pause behind that could have passed, it goes out whatever is on the line. A collision
    /// then costs one repeat (GUARANTEES G5).
    pub fn stop_ready_at(&self, due: Instant, times: LineTimes) -> Instant {
        let idle = self.active_at + times.gap;
        let free = self.awaited.map_or(idle, |_| idle.max(self.sent_at + times.stop_delay()));
        let reply = times.stop_delay() + times.frame;
        let latest = (due + times.frame + reply + times.gap).max(self.sent_at + reply);
        free.min(latest)
    }

    /// A reply may still come.
    pub fn awaits_reply(&self, now: Instant) -> bool {
        self.awaited.is_some_and(|until| now < until)
    }

    /// The port has taken these bytes and sends them behind the awaited reply. Returns until when
    /// that may come.
    pub fn holds(&mut self, bytes: &[u8]) -> Option<Instant> {
        let (bytes, until) = (Vec::from_slice(bytes).ok()?, self.awaited?);
        self.behind_reply = Some((bytes, until));
        Some(until)
    }

    /// Whether the port has such bytes.
    pub fn is_holding(&self) -> bool {
        self.behind_reply.is_some()
    }

    /// It has given them back.
    pub fn gave_back(&mut self) {
        self.behind_reply = None;
    }

    /// It sends them at `at`, if it has any. Returns by how much that is before the reply had to be
    /// there.
    pub fn begins_held(&mut self, at: Instant) -> Option<Duration> {
        let (bytes, until) = self.behind_reply.take()?;
        self.taken(at, &bytes);
        Some(until.since(at))
    }

    /// The port sends these bytes now.
    pub fn taken(&mut self, now: Instant, bytes: &[u8]) {
        self.taken_at = now;
        self.awaited = None;
        self.reset_deframer();
        self.echo.clear();
        self.sent_frame = Vec::from_slice(bytes).ok();
        for byte in bytes {
            // The echo queue holds the longest transmission.
            let _ = self.echo.push_back(*byte);
        }
    }

    /// The last bit has left; a reply may come. A stop waits for the reply from when the bits had
    /// their time on the line: the port may report them much later, as after an e-stop of many
    /// axes.
    pub fn sent(&mut self, now: Instant, times: LineTimes) {
        self.active_at = now;
        self.sent_at = now.min(self.taken_at + times.frame);
        self.awaited = Some(now + times.window);
    }

    /// The awaited reply has come.
    pub fn answered(&mut self) {
        self.awaited = None;
    }

    /// Takes a byte in.
    pub fn receive(&mut self, now: Instant, byte: u8) -> Heard {
        self.active_at = now;
        match self.echo.front() {
            Some(expected) if *expected == byte => {
                self.echo.pop_front();
                if self.echo.is_empty() {
                    self.sent_frame = None;
                }
                return Heard::Echo;
            }
            // Noise, a collision, or a line without echo: from here on only the whole frame is
            // known as ours.
            Some(_) => self.echo.clear(),
            None => {}
        }
        match self.deframer.as_mut().and_then(|deframer| deframer.push(byte)) {
            // A stop may be answered by the same bytes: taken for the answer, our own echo would
            // confirm it.
            Some(frame) if self.sent_frame.as_ref() == Some(&frame) => {
                self.sent_frame = None;
                Heard::Byte
            }
            Some(frame) => Heard::Frame(frame),
            None => Heard::Byte,
        }
    }

    /// The last byte had been heard that long before the port told of it.
    pub fn has_been_idle(&mut self, now: Instant, long: Duration) {
        self.active_at = self.active_at.min(now - long);
    }

    /// Bytes that belonged to no frame, since the start.
    pub fn rejected(&self) -> u32 {
        let rejected = self.deframer.as_ref().map_or(0, Deframer::rejected);
        self.rejected_before.saturating_add(rejected)
    }
}
