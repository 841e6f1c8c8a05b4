//! What a gateway remembers over a reset: its starts and its trips.

use crate::axis::Trip;
use crate::size::wire;

wire! {
    /// Why the gateway started last.
    #[derive(Copy, Eq)]
    pub enum BootReason {
        /// Power came on.
        PowerOn,
        /// The reset pin.
        Pin,
        /// The firmware asked for it, after a panic for example.
        Software,
        /// The watchdog: the firmware hung.
        Watchdog,
        /// The supply was too low.
        Brownout,
        /// The board cannot tell.
        Unknown,
        /// This gateway is a simulation.
        Simulated,
    }

    /// Something worth remembering.
    #[derive(Copy)]
    pub enum Incident {
        /// The gateway started.
        Started {
            /// Which start since power came on, from 1.
            start: u32,
            /// Why.
            boot: BootReason,
            /// Whether the run before left a crash report; only that of the latest start is
            /// kept.
            has_crash_report: bool,
        },
        /// An axis tripped.
        Tripped {
            /// After which start; the time of the trip counts from there.
            start: u32,
            /// The axis.
            axis: u8,
            /// Why, when, and its last values.
            trip: Trip,
        },
    }
}
