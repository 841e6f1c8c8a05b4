//! What passes between the core and whatever carries its bytes: firmware tasks, the simulator, a
//! test.
//!
//! The contract of a port, for each bus:
//! - It takes frames with [`Gateway::poll_transmit`](crate::Gateway::poll_transmit) and reports
//!   each one it took, once, by its slot: [`Event::Transmitted`] when the bus has acknowledged it
//!   (CAN) or its last bit has left (RS485). It never holds more than one frame per slot.
//! - It asks with [`Gateway::poll_cancel`](crate::Gateway::poll_cancel) which frames it should give
//!   back, of a CAN controller or [behind a reply](Transmit::behind_reply), and reports each, once:
//!   [`Event::Cancelled`] if it has not been sent and will not be, else [`Event::Transmitted`]. A
//!   port that does neither in time is started again.
//! - A serial port keeps a frame that goes [behind a reply](Transmit::behind_reply) until that has
//!   come, or the core wants it back: it does not begin it without a look whether the core does, and
//!   says that it begins before it says that it has left.
//! - When a CAN controller goes bus-off the port drops every frame it holds, then reports
//!   [`Event::BusState`]. It does not recover by itself: the core has it start the bus again.
//! - When [`Gateway::bus_setup`](crate::Gateway::bus_setup) shows a new generation, the port drops
//!   what it holds and starts the bus again with that setup, then reports [`Event::BusState`].
//! - It sets a host link to [`Gateway::baud`](crate::Gateway::baud) where that has changed: asked
//!   when a frame to that host has left, and when [`Changes`] names the link.
//! - After every call of `handle` it polls what [`Changes`] names, each until nothing is left, and
//!   after polling a bus what [`Gateway::take_changes`](crate::Gateway::take_changes) names. After
//!   a start it polls everything once. It may leave out a poll that gives nothing: behind a frame
//!   that [goes alone](Transmit::is_alone), and for frames to cancel where it holds none.
//! - It gives `handle` a tick when [`Gateway::next_deadline`](crate::Gateway::next_deadline) has
//!   come. Where many axes stop, that is at once: it polls the buses first, so that of each the
//!   first stop leaves before the others are looked at.
//!
//! And for the board:
//! - It calls [`Gateway::restore`](crate::Gateway::restore) once, first, with the words that were
//!   stored before the reset, and opens the host links when
//!   [`Gateway::stops_under_way`](crate::Gateway::stops_under_way) is over, or after 100 ms.
//! - It gives [`Gateway::handle`](crate::Gateway::handle) and
//!   [`Gateway::poll_host`](crate::Gateway::poll_host) a [`Store`], and has a word in memory when
//!   they return. So what must outlive a reset is stored after an event and before any frame that
//!   follows from it, the rest before a host is told. A program that has nothing to outlive stores
//!   nothing.
//! - Where it can store the configuration, it calls [`Gateway::load`](crate::Gateway::load) once,
//!   behind `restore` and, where nothing
//!   [was remembered](crate::Gateway::is_remembered), before the first event; and it carries out what [`Gateway::take_save`](crate::Gateway::take_save) gives
//!   when [`Changes`] says so; then it reports [`Event::Saved`].
//! - Where it can take images of the firmware, it calls
//!   [`Gateway::set_images`](crate::Gateway::set_images) once, before it opens the host links, and
//!   carries those jobs out too. When [`Changes`] says so it starts anew, at once.
//! - When [`Changes`] says so it takes what a host asks the flight recorder for with
//!   [`Gateway::take_flight_read`](crate::Gateway::take_flight_read), and reports
//!   [`Event::FlightRecord`] within 1 s, before it takes another.
//! - After every call of `handle` it sets its enable output to
//!   [`Gateway::enable_output`](crate::Gateway::enable_output).

use crate::set::Set;
use heapless::Vec;
use host_protocol::{
    BusKind, BusMode, BusState, Bytes, CanFrame, FirmwareVersion, MAX_IMAGE_BYTES, SIGNATURE_SIZE,
    StoredState, requests::BeginImage,
};
use serde::{Deserialize, Serialize};

/// Frames the core hands to one CAN controller at the same time: one, and a second only for a stop.
pub const TRANSMIT_SLOTS: usize = 2;

/// Longest byte sequence sent at once on a serial bus.
pub const MAX_SERIAL: usize = 64;

/// Puts a word into the memory that outlives a reset: its index below
/// [`RETAINED_WORDS`](crate::RETAINED_WORDS), and the word. A reset between two words loses nothing
/// but the change.
pub type Store<'a> = &'a mut dyn FnMut(usize, u32);

/// Something that happened outside the core.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Event<'a> {
    /// Bytes arrived on a host link.
    HostBytes {
        /// Index of the host link.
        link: u8,
        /// The bytes, in order of arrival.
        bytes: &'a [u8],
    },
    /// What came on a host link was no bytes: framing errors, noise. To be told where the link does
    /// not run at [`DEFAULT_BAUD`](host_protocol::DEFAULT_BAUD).
    HostLineError {
        /// Index of the host link.
        link: u8,
    },
    /// A frame arrived on a CAN bus.
    CanReceived {
        /// Index of the bus.
        bus: u8,
        /// The frame.
        frame: CanFrame,
    },
    /// Bytes arrived on a serial bus. The receiver stays on while we transmit, so that every byte
    /// sent is heard back first: the answer to a stop may have the same bytes, and on a line that
    /// gives no echo no stop is ever confirmed.
    SerialReceived {
        /// Index of the bus.
        bus: u8,
        /// The bytes, in order of arrival.
        bytes: &'a [u8],
        /// What comes behind them.
        then: Then,
    },
    /// A frame taken with `poll_transmit` has left: acknowledged on CAN, last stop bit sent on
    /// RS485.
    Transmitted {
        /// Index of the bus.
        bus: u8,
        /// The slot it was taken with.
        slot: u8,
    },
    /// A frame that `poll_cancel` asked back has not left and will not.
    Cancelled {
        /// Index of the bus.
        bus: u8,
        /// The slot it was taken with.
        slot: u8,
    },
    /// The controller's error state or counters changed, or the bus was started.
    BusState {
        /// Index of the bus.
        bus: u8,
        /// Error state.
        state: BusState,
        /// Transmit error counter (TEC).
        transmit_errors: u16,
        /// Receive error counter (REC).
        receive_errors: u16,
    },
    /// Frames or bytes were lost before the core could see them.
    ReceiveOverflow {
        /// Index of the bus.
        bus: u8,
        /// How many were lost, as far as the port knows; at least 1.
        lost: u32,
    },
    /// The e-stop input was read: once at the start, then at each change. The core takes it as open
    /// until then.
    EStopInput {
        /// Open: the button is pressed or its cable cut. Closed is the normal state.
        open: bool,
    },
    /// What [`take_save`](crate::Gateway::take_save) asked for is done, or cannot be.
    Saved {
        /// What became of it. After an error the storage holds what it held before.
        result: Result<(), SaveError>,
    },
    /// What [`take_flight_read`](crate::Gateway::take_flight_read) asked for.
    FlightRecord {
        /// The bytes, or why there are none.
        #[serde(borrow)]
        result: Result<FlightPage<'a>, FlightReadError>,
    },
    /// Nothing but time has passed: the deadline of `next_deadline` is due.
    Tick,
}

/// Who has to ask the core again after an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Changes {
    /// The buses to poll.
    pub buses: Set,
    /// The host links to poll.
    pub links: Set,
    /// The log has an entry.
    pub log: bool,
    /// A part of the history has still to be stored.
    pub history: bool,
    /// [`Gateway::take_save`](crate::Gateway::take_save) has something.
    pub save: bool,
    /// [`Gateway::take_flight_read`](crate::Gateway::take_flight_read) has something.
    pub flight_read: bool,
    /// The gateway is to start anew now.
    pub restart: bool,
}

/// What is to be stored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Save {
    /// The stored configuration, whole or not at all: it becomes the rows that
    /// [`Gateway::stored_row`](crate::Gateway::stored_row) gives, and this number with them, by
    /// which the core knows them again.
    Rows {
        /// That number.
        digest: u32,
    },
    /// There is no stored configuration any more.
    Nothing,
    /// An image of the firmware.
    Image(ImageJob),
}

/// What becomes of an image of the firmware that a host sends.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum ImageJob {
    /// Bytes of it are written, in their order. What is erased at once is erased before its first
    /// byte is written.
    Write {
        /// Where they lie in the image, a multiple of [`IMAGE_UNIT`](host_protocol::IMAGE_UNIT).
        offset: u32,
        /// The bytes, whole units.
        bytes: Bytes<MAX_IMAGE_BYTES>,
    },
    /// All of it is read back and checked, and runs on trial from the next start on.
    Finish {
        /// What was announced of it.
        image: BeginImage,
        /// Its signature, or nothing.
        signature: Bytes<SIGNATURE_SIZE>,
    },
    /// The image that runs on trial is kept.
    Confirm,
}

/// The image that runs, and the room for another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Images {
    /// The version of the one that runs.
    pub version: FirmwareVersion,
    /// Bytes of the longest image that may take its place; 0: none may.
    pub room: u32,
    /// Whether only images signed with the key of the one that runs may.
    pub needs_signature: bool,
    /// What the start has found.
    pub found: FoundImage,
}

impl Images {
    /// Of a board that takes no images.
    pub const NONE: Self = Self {
        version: FirmwareVersion { major: 0, minor: 0, patch: 0 },
        room: 0,
        needs_signature: false,
        found: FoundImage::Kept,
    };
}

/// What a start finds out about the image that runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FoundImage {
    /// It is kept.
    Kept,
    /// It is new, and on trial: the one before runs again from the next start on, unless it is
    /// confirmed.
    OnTrial,
    /// It runs again, as another was not confirmed.
    RolledBack,
}

/// What a start finds where the configuration is stored: the number that was stored with its rows,
/// or why there are none, which is never [`StoredState::Kept`].
pub type Found = Result<u32, StoredState>;

/// Why the configuration could not be stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum SaveError {
    /// It is too long for the storage.
    Full,
    /// The memory did not take it.
    Failed,
    /// An image is not what was announced.
    Damaged,
    /// An image lacks the signature of the key of the one that runs.
    NotSigned,
}

/// Bytes of what the flight recorder has kept that a host asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FlightRead {
    /// Which part of it: 0 is the first.
    pub part: u16,
    /// From which byte of that part on.
    pub offset: u32,
}

impl FlightRead {
    /// Whether there is no such part of so many, or no such byte in one of this length. A part
    /// without bytes has a beginning.
    pub(crate) const fn is_beyond(self, parts: u16, length: u32) -> bool {
        parts > 0 && (self.part >= parts || self.offset > 0 && self.offset >= length)
    }
}

/// What the flight recorder has kept, and some bytes of it: see
/// [`FlightRecordPage`](host_protocol::replies::FlightRecordPage).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FlightPage<'a> {
    /// Another one where something else is kept.
    pub id: u32,
    /// How many parts there are; 0: nothing is kept.
    pub parts: u16,
    /// Bytes of the one that was asked for.
    pub length: u32,
    /// Those of it that were asked for, none where there are none. What is more than a message holds is
    /// left out.
    pub bytes: &'a [u8],
}

/// Why nothing can be read of what the flight recorder has kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FlightReadError {
    /// There is no flight recorder.
    NoRecorder,
    /// It records: an axis is armed.
    Recording,
}

/// What the light of a board shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Light {
    /// Nothing moves and nothing may, and no motor holds.
    Idle,
    /// Nothing moves and nothing may; a motor holds, its output on.
    Holding,
    /// An axis may move.
    Armed,
    /// The host in command fell silent, and none has been heard since.
    LinkLost,
    /// An axis is tripped.
    Tripped,
    /// The e-stop is latched.
    EStopped,
}

/// What comes on a serial line behind bytes that have arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Then {
    /// Perhaps more, at once.
    Bytes,
    /// The line has been idle for a byte's time, which counts for the pause before the next frame.
    Idle,
    /// They end the reply that a frame [waits for](Transmit::behind_reply): that frame begins when
    /// the line has been idle for [`PAUSE_BITS`](crate::PAUSE_BITS).
    Frame,
}

/// What to send, and the slot to report it by.
#[derive(Debug, Clone, PartialEq)]
pub struct Transmit {
    /// Slot of [`Event::Transmitted`], below [`TRANSMIT_SLOTS`].
    pub slot: u8,
    /// The frame.
    pub frame: Outgoing,
    /// Nothing goes beside it: the next poll gives nothing before something happens.
    pub is_alone: bool,
    /// A serial port keeps it until the reply to the frame before has come, and sends it then by
    /// itself ([`Then::Frame`]): the core takes the reply in while the line already carries the
    /// frame. A reply has come when as many bytes have as the frame before and this one have, the
    /// echo and a reply of that length, and the line is idle.
    pub behind_reply: bool,
}

/// A frame on its way to a bus.
#[derive(Debug, Clone, PartialEq)]
pub enum Outgoing {
    /// For a CAN controller.
    Can(CanFrame),
    /// For a serial port.
    Serial(Vec<u8, MAX_SERIAL>),
}

/// How a bus must be running.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusSetup {
    /// Grows by one each time the setup changes; a port restarts its bus when it sees a new one.
    pub generation: u32,
    /// Bits per second.
    pub bitrate: u32,
    /// How it takes part in what happens there. A CAN controller that only listens acknowledges
    /// nothing, and one that sends once reports what has not left as
    /// [cancelled](Event::Cancelled).
    pub mode: BusMode,
}

/// One bus of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusPort {
    /// What it is.
    pub kind: BusKind,
    /// Bitrates it can run at, bits per second.
    pub bitrates: &'static [u32],
}

/// A place that is filled when it is known.
impl Default for BusPort {
    fn default() -> Self {
        Self { kind: BusKind::Can, bitrates: &[] }
    }
}

/// One host link of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkPort {
    /// Rates that it can run at, [`DEFAULT_BAUD`](host_protocol::DEFAULT_BAUD) among them; none
    /// where it is no UART. At most [`MAX_BITRATES`](host_protocol::MAX_BITRATES).
    pub bauds: &'static [u32],
}

/// What the core must know of the board that it runs on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// Name of the board, e.g. `nucleo-h743zi`; at most 24 bytes.
    pub name: &'static str,
    /// Version of the firmware, at most 24 bytes.
    pub firmware: &'static str,
    /// What identifies the build, at most 40 bytes.
    pub build_id: &'static str,
    /// Why the board started.
    pub boot: host_protocol::BootReason,
    /// What the firmware left behind before this start: the message of a panic, of a fault or of
    /// the watchdog. Empty if there was none; at most 240 bytes.
    pub crash_report: &'static str,
    /// Whether it has an e-stop input.
    pub e_stop_input: bool,
    /// Whether it has an enable output.
    pub enable_output: bool,
    /// Its buses, at most [`MAX_BUSES`](crate::MAX_BUSES).
    pub buses: &'static [BusPort],
    /// Why one of them has no bitrates, if one has none.
    pub bus_limit: Option<host_protocol::BusLimit>,
    /// Its host links, at most [`MAX_LINKS`](crate::MAX_LINKS).
    pub links: &'static [LinkPort],
}

/// None: a place that is filled when it is known.
impl Default for &Board {
    fn default() -> Self {
        &Board {
            name: "",
            firmware: "",
            build_id: "",
            boot: host_protocol::BootReason::PowerOn,
            crash_report: "",
            e_stop_input: false,
            enable_output: false,
            buses: &[],
            bus_limit: None,
            links: &[],
        }
    }
}
