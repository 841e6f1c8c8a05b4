//! What requests, replies, events and errors say about buses.

use core::fmt;

use crate::can_frame::CanFrame;
use crate::protocol::ProtocolSet;
use crate::size::wire;
use crate::text::{Bytes, Vec};

/// Bitrates that [`BusCapability`] can list.
pub const MAX_BITRATES: usize = 8;
/// Bytes of one raw frame on a serial bus.
pub const MAX_SERIAL_FRAME: usize = 64;

wire! {
    /// What carries a bus.
    #[derive(Copy, Eq)]
    pub enum BusKind {
        /// A CAN controller.
        Can,
        /// An RS485 port.
        Rs485,
    }

    /// Why a board offers a bus without bitrates.
    #[derive(Copy, Eq)]
    pub enum BusLimit {
        /// The input of bus 0 also decides where the chip starts from.
        BootPin,
        /// This revision of the chip can read wrong frames where two CAN controllers run.
        ChipRevision,
        /// The clock that CAN needs does not run, and the chip's own is not exact enough.
        NoClock,
    }

    /// What a bus of this board can do.
    #[derive(Eq)]
    pub struct BusCapability {
        /// What carries it.
        pub kind: BusKind,
        /// The bitrates it can run at, bit/s.
        pub bitrates: Vec<u32, MAX_BITRATES>,
        /// The protocols that can run on it.
        pub protocols: ProtocolSet,
    }

    /// How a bus is configured.
    #[derive(Copy, Eq)]
    pub struct BusConfig {
        /// bit/s.
        pub bitrate: u32,
        /// The protocols spoken on it.
        pub protocols: ProtocolSet,
        /// Whether every node on it belongs to this gateway: `StartTogether` needs it. Stops are
        /// never broadcast.
        pub exclusive: bool,
        /// How long a motor may take to answer, µs.
        pub reply_window_us: u32,
    }

    /// How a bus takes part in what happens on it.
    #[derive(Copy, Eq, Default)]
    pub enum BusMode {
        /// As a controller does.
        #[default]
        Normal,
        /// It sends nothing. On CAN it acknowledges nothing and drives no error flag either: at a
        /// wrong bitrate it destroys no frame.
        ListenOnly,
        /// On CAN it sends every frame once, whatever comes of it.
        OneShot,
    }

    /// The error state of a bus.
    #[derive(Copy, Eq)]
    pub enum BusState {
        /// Not started.
        Unconfigured,
        /// Running; CAN: error active.
        Active,
        /// CAN: an error counter has reached 96.
        Warning,
        /// CAN: error passive, an error counter has reached 128.
        Passive,
        /// CAN: switched off by the transmit error counter; recovers by itself with growing pauses.
        BusOff,
    }

    /// What happened on a bus since it was configured; each counter stays at its maximum.
    #[derive(Copy, Eq, Default)]
    pub struct BusCounters {
        /// Frames sent and, on CAN, acknowledged.
        pub transmitted: u32,
        /// Frames received.
        pub received: u32,
        /// Frames received that answer no request.
        pub unmatched: u32,
        /// Replies that came after their window.
        pub late: u32,
        /// Received frames or bytes that no protocol of this bus could read.
        pub rejected: u32,
        /// Frames or bytes lost before they were read.
        pub receive_overflows: u32,
        /// Frames that no node acknowledged in time.
        pub missed_acknowledgements: u32,
        /// Frames cancelled before they were transmitted.
        pub cancelled: u32,
        /// How often the controller went bus-off.
        pub bus_offs: u32,
    }

    /// A frame as it is on a bus.
    #[derive(Eq)]
    pub enum RawFrame {
        /// On CAN.
        Can(CanFrame),
        /// On RS485.
        Serial(Bytes<MAX_SERIAL_FRAME>),
    }

    /// A raw frame that was received.
    #[derive(Eq)]
    pub struct ReceivedFrame {
        /// Gateway time of its arrival, µs.
        pub time_us: u64,
        /// The frame.
        pub frame: RawFrame,
    }
}

impl fmt::Display for BusKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Can => "CAN",
            Self::Rs485 => "RS485",
        })
    }
}

impl fmt::Display for BusState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Unconfigured => "unconfigured",
            Self::Active => "active",
            Self::Warning => "warning",
            Self::Passive => "passive",
            Self::BusOff => "bus-off",
        })
    }
}
