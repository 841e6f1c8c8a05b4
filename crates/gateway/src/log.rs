//! What happened, for the log of whoever runs the core: kept until it has time to write it.

use core::mem::take;
use core::ops::{Deref, DerefMut};

use heapless::{Deque, Vec};
use host_protocol::{Error, Event, Reply};

use crate::gateway::Gateway;
use crate::link::{Link, Slot};
use crate::{MAX_AXES, MAX_LINKS};

/// Entries that can wait.
const QUEUE: usize = 16;
/// Events that wait to be handed out: those of an e-stop of all axes, and some more.
const NEWS: usize = MAX_AXES + 8;

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

/// The host links, and the log, which hears what they all hear.
#[derive(Clone)]
pub(crate) struct Links {
    links: Vec<Link, MAX_LINKS>,
    /// What happened, µs and what, and is not in the queue of every link yet: the frames that
    /// follow from it go first.
    news: Deque<(u64, Event), NEWS>,
    log: Deque<LogEntry, QUEUE>,
    dropped: u32,
    /// The link that is in command, as the log knows it.
    holder: Option<u8>,
    /// The links that have had something to send since that was last asked, a bit for each.
    changed: u8,
    /// The same of the log.
    log_changed: bool,
}

impl Links {
    pub const fn new() -> Self {
        Self {
            links: Vec::new(),
            news: Deque::new(),
            log: Deque::new(),
            dropped: 0,
            holder: None,
            changed: 0,
            log_changed: false,
        }
    }

    /// Takes an event that every host is told, and the log: soon, by [`hand_out`](Self::hand_out).
    pub fn event(&mut self, now_us: u64, event: &Event) {
        if self.news.is_full() {
            self.hand_out();
        }
        // It fits: there is room now.
        let _ = self.news.push_back((now_us, *event));
        self.changed = u8::MAX;
        self.log_changed = true;
    }

    /// Puts what has happened into the queues of the links and into the log, in its order. Due
    /// before anything else goes there or is taken from there, and before a host begins a
    /// session: what was before it is not for that host.
    pub fn hand_out(&mut self) {
        while let Some((time_us, event)) = self.news.pop_front() {
            self.append(LogEntry::Event(event));
            for link in &mut self.links {
                link.event(time_us, &event);
            }
        }
    }

    /// Adds to the log.
    pub fn log(&mut self, entry: LogEntry) {
        self.hand_out();
        self.append(entry);
    }

    fn append(&mut self, entry: LogEntry) {
        self.log_changed = true;
        // What comes after a loss waits until the loss has been told.
        if self.dropped > 0 || self.log.push_back(entry).is_err() {
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    /// Answers a request of a link.
    pub fn reply(&mut self, link: u8, slot: Slot, result: &Result<Reply, Error>) {
        if let Some(port) = self.links.get_mut(usize::from(link)) {
            port.reply(slot, result);
            self.touch(link);
        }
    }

    /// A link may have something to send.
    pub fn touch(&mut self, link: u8) {
        if self.links.get(usize::from(link)).is_some_and(Link::has_output) {
            self.changed |= 1u8.checked_shl(link.into()).unwrap_or(0);
        }
    }

    /// The links that have got something to send since the last time, a bit for each; and whether
    /// the log has.
    pub fn take_changed(&mut self) -> (u8, bool) {
        (take(&mut self.changed), take(&mut self.log_changed))
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
        self.links.hand_out();
        let Links { log, dropped, .. } = &mut self.links;
        match log.pop_front() {
            None if *dropped > 0 => Some(LogEntry::Dropped { count: take(dropped) }),
            entry => entry,
        }
    }
}
