//! What happened, for the log of whoever runs the core: kept until it has time to write it.

use core::mem::take;
use core::ops::{Deref, DerefMut};

use heapless::{Deque, Vec};
use host_protocol::Event;

use crate::MAX_LINKS;
use crate::gateway::Gateway;
use crate::link::Link;

/// Entries that can wait.
const QUEUE: usize = 16;

/// Something worth a line in a log.
#[derive(Debug, Clone, Copy, PartialEq)]
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
    /// More happened than could wait.
    Dropped {
        /// How many entries are missing here.
        count: u32,
    },
}

/// The host links, and the log, which hears what they all hear.
pub(crate) struct Links {
    links: Vec<Link, MAX_LINKS>,
    log: Deque<LogEntry, QUEUE>,
    dropped: u32,
    /// The link that is in command, as the log knows it.
    holder: Option<u8>,
}

impl Links {
    pub const fn new() -> Self {
        Self { links: Vec::new(), log: Deque::new(), dropped: 0, holder: None }
    }

    /// Adds to the log.
    pub fn log(&mut self, entry: LogEntry) {
        // What comes after a loss waits until the loss has been told.
        if self.dropped > 0 || self.log.push_back(entry).is_err() {
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    /// Adds to the log who is in command, where that has changed.
    pub fn log_holder(&mut self, holder: Option<u8>) {
        if self.holder != holder {
            self.holder = holder;
            if let Some(link) = holder {
                self.log(LogEntry::InCommand { link });
            }
        }
    }
}

impl Deref for Links {
    type Target = Vec<Link, MAX_LINKS>;

    fn deref(&self) -> &Self::Target {
        &self.links
    }
}

impl DerefMut for Links {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.links
    }
}

impl Gateway {
    /// The next entry of the log, in order. Who takes none loses nothing else.
    pub fn take_log(&mut self) -> Option<LogEntry> {
        let Links { log, dropped, .. } = &mut self.links;
        match log.pop_front() {
            None if *dropped > 0 => Some(LogEntry::Dropped { count: take(dropped) }),
            entry => entry,
        }
    }
}
