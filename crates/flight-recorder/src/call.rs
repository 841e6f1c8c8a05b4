//! The calls to a core that change it, and what has come of them.

use gateway::{Event, Gateway, Instant, Set, Then, Transmit};
use host_protocol::{CHECKSUM, CanFrame, MAX_FRAME};
use serde::{Deserialize, Serialize};

/// A call to a core that changes it. Left out are [`Gateway::take_changes`] and
/// [`Gateway::next_deadline`]: they work out what the next call would have to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Call<'a> {
    /// [`Gateway::handle`].
    Handle(#[serde(borrow)] Event<'a>),
    /// [`Gateway::poll_cancel`].
    PollCancel {
        /// Index of the bus.
        bus: u8,
    },
    /// [`Gateway::poll_transmit`].
    PollTransmit {
        /// Index of the bus.
        bus: u8,
    },
    /// [`Gateway::poll_host`].
    PollHost {
        /// Index of the link.
        link: u8,
    },
    /// [`Gateway::save_some`].
    SaveSome,
    /// [`Gateway::take_save`].
    TakeSave,
    /// [`Gateway::take_flight_read`].
    TakeFlightRead,
    /// [`Gateway::take_log`].
    TakeLog,
    /// No call: what has come of those before, which is compared when they are made again.
    Came(Outcome),
}

/// What has come of the calls so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Outcome {
    /// The axes that are [armed](Gateway::armed).
    pub(crate) armed: Set,
    /// The axes that [move](Gateway::moving).
    pub(crate) moving: Set,
    /// The axes that [have tripped](Gateway::tripped).
    pub(crate) tripped: Set,
    /// A checksum of why and when those have that had not at the outcome before.
    trips: u32,
}

/// Axis, reason and time of a trip take no more bytes.
const TRIP_BYTES: usize = 64;

impl Outcome {
    /// Whether other axes are armed, move or have tripped than when this had come.
    #[inline(always)]
    pub(crate) fn has_changed(core: &Gateway, before: Option<Self>) -> bool {
        before.is_none_or(|before| {
            (before.armed, before.moving, before.tripped)
                != (core.armed(), core.moving(), core.tripped())
        })
    }

    /// Of the calls to this core, when this had come of those before; `None` where the same has.
    pub(crate) fn behind(core: &Gateway, before: Option<Self>) -> Option<Self> {
        let (armed, moving, tripped) = (core.armed(), core.moving(), core.tripped());
        if !Self::has_changed(core, before) {
            return None;
        }
        let had_tripped = before.map_or(Set::NONE, |before| before.tripped);
        let mut digest = CHECKSUM.digest();
        for (axis, trip) in core.trips(tripped.without(had_tripped)) {
            // What its stop makes of it comes later.
            let why = (axis, trip.reason, trip.time_us);
            let mut bytes = [0; TRIP_BYTES];
            digest.update(postcard::to_slice(&why, &mut bytes).map_or(&[], |bytes| bytes));
        }
        Some(Self { armed, moving, tripped, trips: digest.finalize() })
    }
}

impl Call<'_> {
    /// Makes the call, at a time in the core's own clock, and returns the frame that
    /// `poll_transmit` gives. Nothing is stored.
    pub fn make(&self, core: &mut Gateway, now: Instant) -> Option<Transmit> {
        let store = &mut |_, _| {};
        match *self {
            Self::Handle(event) => _ = core.handle(now, event, store),
            Self::PollCancel { bus } => _ = core.poll_cancel(now, bus),
            Self::PollTransmit { bus } => return core.poll_transmit(now, bus),
            Self::PollHost { link } => _ = core.poll_host(link, &mut [0; MAX_FRAME], store),
            Self::SaveSome => _ = core.save_some(store),
            Self::TakeSave => _ = core.take_save(),
            Self::TakeFlightRead => _ = core.take_flight_read(),
            Self::TakeLog => _ = core.take_log(),
            Self::Came(_) => {}
        }
        None
    }

    /// What has come of the calls up to here, if that is told.
    pub(crate) fn outcome(&self) -> Option<Outcome> {
        match self {
            Self::Came(outcome) => Some(*outcome),
            _ => None,
        }
    }
}

// How a call is kept: its kind in the low four bits of the first byte, whether it was made at the
// time of the call before in the next, and the bus or link above; then, if not, two bytes of µs
// since that (all ones: eight bytes follow); then what belongs to it. What comes often has a kind of
// its own, and costs a stop little; the others are encoded by postcard.

const TICK: u8 = 0;
const CAN_RECEIVED: u8 = 1;
const TRANSMITTED: u8 = 2;
const HOST_BYTES: u8 = 3;
const SERIAL_RECEIVED: u8 = 4;
const POLL_CANCEL: u8 = 5;
const POLL_TRANSMIT: u8 = 6;
const POLL_HOST: u8 = 7;
const SERIAL_ENDED: u8 = 8;
const SERIAL_ANSWERED: u8 = 9;
const OTHER: u8 = 15;

const KIND: u8 = 0x0F;
/// At the time of the call before.
pub(crate) const SAME_TIME: u8 = 0x10;
const INDEX_AT: u32 = 5;
const LONG: u16 = u16::MAX;

/// Writes the first byte of a call, and the time; how many bytes these are, and what is left behind
/// them.
#[inline(always)]
fn encode_head(first: u8, since_us: u64, out: &mut [u8]) -> Option<(usize, &mut [u8])> {
    match u16::try_from(since_us) {
        Ok(0) => Some((1, put(out, [first | SAME_TIME])?)),
        Ok(short) if short != LONG => {
            let [low, high] = short.to_le_bytes();
            Some((3, put(out, [first, low, high])?))
        }
        _ => {
            let [low, high] = LONG.to_le_bytes();
            let rest = put(put(out, [first, low, high])?, since_us.to_le_bytes())?;
            Some((3 + size_of::<u64>(), rest))
        }
    }
}

/// Writes these bytes; what is left behind them.
fn put<const BYTES: usize>(out: &mut [u8], bytes: [u8; BYTES]) -> Option<&mut [u8]> {
    let (to, rest) = out.split_first_chunk_mut()?;
    *to = bytes;
    Some(rest)
}

/// Reads from the front of a memory.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn number<const BYTES: usize>(&mut self) -> Option<[u8; BYTES]> {
        self.take(BYTES)?.try_into().ok()
    }

    fn take_long(&mut self) -> Option<&'a [u8]> {
        let count = u16::from_le_bytes(self.number()?);
        self.take(count.into())
    }
}

impl<'a> Call<'a> {
    /// The first byte of the call, and whether it is all but the time.
    #[inline(always)]
    pub(crate) fn first(&self) -> (u8, bool) {
        let (kind, index, is_all) = match *self {
            Self::Handle(Event::Tick) => (TICK, 0, true),
            Self::Handle(Event::CanReceived { bus, .. }) => (CAN_RECEIVED, bus, false),
            Self::Handle(Event::Transmitted { bus, .. }) => (TRANSMITTED, bus, false),
            Self::Handle(Event::HostBytes { link, .. }) => (HOST_BYTES, link, false),
            Self::Handle(Event::SerialReceived { bus, then, .. }) => {
                let kind = match then {
                    Then::Bytes => SERIAL_RECEIVED,
                    Then::Idle => SERIAL_ENDED,
                    Then::Frame => SERIAL_ANSWERED,
                };
                (kind, bus, false)
            }
            Self::PollCancel { bus } => (POLL_CANCEL, bus, true),
            Self::PollTransmit { bus } => (POLL_TRANSMIT, bus, true),
            Self::PollHost { link } => (POLL_HOST, link, true),
            _ => (OTHER, 0, false),
        };
        (kind | index << INDEX_AT, is_all)
    }

    /// Writes the call, made so many µs after the one before; the bytes that it takes, or `None`
    /// where they are more than there are.
    pub(crate) fn encode(&self, since_us: u64, out: &mut [u8]) -> Option<usize> {
        let (first, _) = self.first();
        let (mut length, mut rest) = encode_head(first, since_us, out)?;
        match self {
            Self::Handle(Event::CanReceived { frame, .. }) => {
                let bytes = frame.bytes();
                rest = put(rest, frame.flagged_id().to_le_bytes())?;
                rest = put(rest, [u8::try_from(bytes.len()).ok()?])?;
                rest.get_mut(..bytes.len())?.copy_from_slice(bytes);
                length += 5 + bytes.len();
            }
            Self::Handle(Event::Transmitted { slot, .. }) => {
                put(rest, [*slot])?;
                length += 1;
            }
            Self::Handle(Event::HostBytes { bytes, .. } | Event::SerialReceived { bytes, .. }) => {
                rest = put(rest, u16::try_from(bytes.len()).ok()?.to_le_bytes())?;
                rest.get_mut(..bytes.len())?.copy_from_slice(bytes);
                length += 2 + bytes.len();
            }
            _ if first & KIND == OTHER => length += postcard::to_slice(self, rest).ok()?.len(),
            _ => {}
        }
        Some(length)
    }

    /// The first call of these bytes, how many µs after the one before it was made, and the bytes
    /// behind it.
    pub(crate) fn decode(bytes: &'a [u8]) -> Option<(u64, Self, &'a [u8])> {
        let mut bytes = Reader(bytes);
        let [first] = bytes.number()?;
        let index = first >> INDEX_AT;
        let since = match first & SAME_TIME {
            0 => match u16::from_le_bytes(bytes.number()?) {
                LONG => u64::from_le_bytes(bytes.number()?),
                short => short.into(),
            },
            _ => 0,
        };
        let call = match first & KIND {
            TICK => Self::Handle(Event::Tick),
            CAN_RECEIVED => {
                let id = u32::from_le_bytes(bytes.number()?);
                let [length] = bytes.number()?;
                let frame = CanFrame::from_flagged_id(id, bytes.take(length.into())?)?;
                Self::Handle(Event::CanReceived { bus: index, frame })
            }
            TRANSMITTED => {
                let [slot] = bytes.number()?;
                Self::Handle(Event::Transmitted { bus: index, slot })
            }
            HOST_BYTES => Self::Handle(Event::HostBytes { link: index, bytes: bytes.take_long()? }),
            kind @ (SERIAL_RECEIVED | SERIAL_ENDED | SERIAL_ANSWERED) => {
                let then = match kind {
                    SERIAL_RECEIVED => Then::Bytes,
                    SERIAL_ENDED => Then::Idle,
                    _ => Then::Frame,
                };
                Self::Handle(Event::SerialReceived { bus: index, bytes: bytes.take_long()?, then })
            }
            POLL_CANCEL => Self::PollCancel { bus: index },
            POLL_TRANSMIT => Self::PollTransmit { bus: index },
            POLL_HOST => Self::PollHost { link: index },
            OTHER => {
                let (call, rest) = postcard::take_from_bytes(bytes.0).ok()?;
                bytes = Reader(rest);
                call
            }
            _ => return None,
        };
        Some((since, call, bytes.0))
    }
}

#[cfg(test)]
#[path = "../tests/unit/call.rs"]
mod tests;
