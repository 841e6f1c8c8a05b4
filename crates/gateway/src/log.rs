//! What happened, for the caller's log: kept until there is time to write it.

use host_protocol::Event;
use serde::{Deserialize, Serialize};

/// Something worth a line in a log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LogEntry {
    /// What the hosts are told too.
    Event(Event),
    /// A host has said hello.
    Hello {
        /// On this link.
        link: u8,
    },
    /// A host has taken command.
    InCommand {
        /// On this link.
        link: u8,
    },
    /// The chip's random generator gave no number from which epochs could count: nothing is armed.
    NoRandomNumber,
    /// A word of the memory that a reset leaves alone had changed at this start: the e-stop is
    /// latched, and every axis trips.
    MemoryDamaged,
    /// More happened than could wait.
    Dropped {
        /// How many entries are missing here.
        count: u32,
    },
}
