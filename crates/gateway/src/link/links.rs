//! The host links together, with the one ring of what happened that they and the log read.

use super::{Cursor, Identity, Link, Ring, Slot};
use crate::log::LogEntry;
use crate::port::Board;
use crate::set::Set;
use crate::time::Instant;
use crate::{MAX_AXES, MAX_LINKS};
use core::mem::take;
use core::ops::Deref;
use heapless::Vec;
use host_protocol::{Error, Event, MAX_FRAME, Reply, Request};
use serde::{Deserialize, Serialize};

/// The host links, and the log, which hears what they all hear.
///
/// `links` comes last: with zeros right behind it the compiler makes it on the stack, which has no
/// room for it, and then moves it.
#[derive(Clone, Deserialize)]
#[repr(C)]
pub(crate) struct Links {
    /// Those that may have changed since they were copied.
    #[serde(skip)]
    pub stale: Set,
    /// What happened.
    pub ring: Ring,
    /// That may have changed since it was copied. (In a [`Tracked`](crate::tracked::Tracked) it would
    /// pass over the stack when it is made.)
    #[serde(skip)]
    pub is_ring_stale: bool,
    /// How far the log has been told.
    told: Cursor,
    /// The link that is in command, as the log knows it.
    holder: Option<u8>,
    /// The links that have had something to send since that was last asked.
    changed: Set,
    /// The same of the log.
    log_changed: bool,
    /// Axes whose trips have been told since that was last asked.
    tripped: Vec<u8, MAX_AXES>,
    /// When the first of them is due; `None` where that has to be worked out.
    #[serde(skip)]
    due: Option<Instant>,
    links: Vec<Link, MAX_LINKS>,
}

impl Links {
    /// The next entry of the log, in order. Who takes none loses nothing else.
    pub fn take_entry(&mut self) -> Option<LogEntry> {
        let Self { ring, told, .. } = self;
        let (entry, lost, behind_it) = ring.next(*told)?;
        if lost > 0 {
            // The loss is told first.
            told.entry = told.entry.wrapping_add(lost);
            return Some(LogEntry::Dropped { count: lost });
        }
        *told = behind_it;
        Some(entry.what)
    }

    pub const fn new() -> Self {
        Self {
            links: Vec::new(),
            stale: Set::NONE,
            ring: Ring::new(),
            is_ring_stale: false,
            told: Cursor { entry: 0, event: 0 },
            holder: None,
            changed: Set::NONE,
            log_changed: false,
            tripped: Vec::new(),
            due: None,
        }
    }

    /// Makes all links, each where it stays.
    #[inline(never)]
    pub fn init(&mut self) {
        while !self.links.is_full() {
            let _ = self.links.push(Link::blank());
        }
    }

    pub fn get_mut(&mut self, link: u8) -> Option<&mut Link> {
        self.due = None;
        self.stale.add(Set::of(link));
        self.links.get_mut(usize::from(link))
    }

    /// Each link is told the rates that the board has for it.
    pub fn attach(&mut self, board: &'static Board) {
        for (link, port) in self.links.iter_mut().zip(board.links) {
            link.baud.attach(port.bauds);
        }
    }

    /// What a snapshot has before the links; see [`Parts`](crate::gateway::Part).
    pub fn head(&self) -> impl Serialize {
        let Self { told, holder, changed, log_changed, tripped, links, .. } = self;
        (told, holder, changed, log_changed, tripped, links.len())
    }

    /// Into how many pieces it divides what it has before that.
    pub const RING_PIECES: usize = Ring::PIECES;

    /// When [`Link::tick`] is due for the first of them; [`Instant::NEVER`] where it is for none.
    pub fn due(&mut self) -> Instant {
        let due = self.due.unwrap_or_else(|| self.work_out_due());
        self.due = Some(due);
        due
    }

    fn work_out_due(&self) -> Instant {
        let due = self.links.iter().filter_map(Link::deadline).min();
        due.map_or(Instant::NEVER, Instant::from_micros)
    }

    /// Panics where the links are due at another time. For tests.
    pub fn assert_due(&self) {
        assert!(self.due.is_none_or(|due| due == self.work_out_due()), "links due");
    }

    /// Takes an event that every host is told, and the log.
    #[inline(never)]
    pub fn event(&mut self, now_us: u64, event: &Event) {
        self.push(now_us, LogEntry::Event(*event));
        if let Event::Tripped { axis, .. } = event {
            // It fits: an axis trips once until that is asked.
            let _ = self.tripped.push(*axis);
        }
        for (link, _) in self.links.iter().enumerate().filter(|(_, port)| port.is_told()) {
            self.changed.add(Set::of(link));
        }
    }

    /// The axes whose trips have been told since the last time, in that order.
    pub fn take_tripped(&mut self) -> Vec<u8, MAX_AXES> {
        take(&mut self.tripped)
    }

    /// Adds to the log alone.
    #[inline(never)]
    pub fn log(&mut self, entry: LogEntry) {
        self.push(0, entry);
    }

    fn push(&mut self, time_us: u64, entry: LogEntry) {
        self.ring.push(time_us, entry);
        (self.is_ring_stale, self.log_changed) = (true, true);
    }

    /// Whether a request is to be executed, see [`Link::admit`].
    pub fn admit(
        &mut self,
        link: u8,
        now_us: u64,
        identity: Identity,
        watches: bool,
        request: &Result<Request, Error>,
    ) -> Option<Option<Slot>> {
        let end = self.ring.end();
        self.get_mut(link)?.admit(now_us, identity, watches, request, end)
    }

    /// The next frame for a host, see [`Link::poll_transmit`].
    pub fn poll_transmit(&mut self, link: u8, out: &mut [u8; MAX_FRAME]) -> Option<usize> {
        self.due = None;
        self.stale.add(Set::of(link));
        self.links.get_mut(usize::from(link))?.poll_transmit(&self.ring, out)
    }

    /// Answers a request of a link.
    pub fn reply(&mut self, link: u8, slot: Slot, result: Result<&Reply, Error>) {
        if let Some(port) = self.links.get_mut(usize::from(link)) {
            port.reply(slot, result);
            self.touch(link);
        }
    }

    /// The host on a link is to be told of a period of the cycle, if it has said hello.
    pub fn changed_by_cycle(&mut self, link: u8) {
        if self.links.get(usize::from(link)).is_some_and(Link::is_told) {
            self.changed.add(Set::of(link));
        }
    }

    /// A link may have something to send, or another rate.
    pub fn touch(&mut self, link: u8) {
        self.stale.add(Set::of(link));
        let Some(port) = self.links.get_mut(usize::from(link)) else { return };
        if port.baud.take_changed() || port.has_output(&self.ring) {
            self.changed.add(Set::of(link));
        }
    }

    /// The links that have got something to send since the last time, and whether the log has.
    pub fn take_changed(&mut self) -> (Set, bool) {
        (self.changed.take(), take(&mut self.log_changed))
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
