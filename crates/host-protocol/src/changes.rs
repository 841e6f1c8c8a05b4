//! What requests and replies say about changing the configuration as a whole.

use crate::bus::BusConfig;
use crate::names::{MAX_NAME, Subject};
use crate::size::wire;
use crate::text::Text;
use crate::value::Value;

wire! {
    /// One change of the configuration.
    pub enum Change {
        /// A parameter of the gateway.
        Gateway {
            /// Number of a [`GatewayParameter`](crate::GatewayParameter).
            parameter: u16,
            /// Its new value.
            value: Value,
        },
        /// A bus.
        Bus {
            /// Number of the bus, from 0.
            bus: u8,
            /// How it runs from then on; nothing: it does not.
            config: Option<BusConfig>,
        },
        /// A parameter of an axis. An axis that has none left is removed.
        Axis {
            /// Number of the axis, from 0.
            axis: u8,
            /// Number of an [`AxisParameter`](crate::AxisParameter).
            parameter: u16,
            /// Its new value; nothing: it is no longer set, and has its default.
            value: Option<Value>,
        },
        /// A name. It changes whatever the state of what has it, and goes with it.
        Name {
            /// Whose it is: the gateway, or a bus or an axis that is configured.
            of: Subject,
            /// One that [`is_name`](crate::is_name) allows, and that no other bus, or no other
            /// axis, has; nothing: it has none.
            name: Option<Text<MAX_NAME>>,
        },
    }

    /// What is stored of the configuration.
    #[derive(Copy, Eq)]
    pub enum StoredState {
        /// The board has nowhere to store it.
        NoStorage,
        /// Nothing is stored.
        Nothing,
        /// A configuration.
        Kept {
            /// The running one is another.
            differs: bool,
        },
        /// It cannot be read whole, so nothing of it runs.
        Damaged,
        /// Another firmware has stored it in a layout that this one does not know, so nothing of it
        /// runs.
        OtherLayout {
            /// The version of that layout.
            layout: u8,
        },
        /// This firmware, or this board, refuses it as it would refuse it from a host, so nothing
        /// of it runs.
        Refused {
            /// Number of the error.
            error: u16,
        },
        /// It was left alone, as start after start had failed.
        NotRead,
        /// The flash of the board is one bank, from which its program runs: nothing can be stored.
        SingleBank,
    }

    /// A parameter that is set.
    #[derive(Copy)]
    pub struct Setting {
        pub parameter: u16,
        pub value: Value,
    }
}
