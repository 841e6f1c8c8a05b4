//! What is remembered: the last trips and starts (G8).

use crate::wire::Incident;
use std::collections::VecDeque;

/// So many are remembered, and so many are on a page.
const REMEMBERED: usize = 16;
const PAGE: usize = 8;

/// What must be remembered, the latest first.
#[derive(Debug, Clone)]
pub(crate) struct History {
    incidents: VecDeque<Incident>,
    start: u32,
    /// Pages that were read at this instant.
    read: Vec<Page>,
    /// Trips of this instant.
    news: Vec<(u8, Vec<u8>)>,
    /// Since a start the whole list has not been read: what has tripped meanwhile nobody was told.
    unread: Option<Unread>,
}

/// A page that was read.
#[derive(Debug, Clone)]
struct Page {
    first: usize,
    incidents: Vec<Incident>,
    next: Option<u8>,
}

#[derive(Debug, Clone)]
struct Unread {
    /// What has been read of it so far.
    read: Vec<Incident>,
    /// The reset has interrupted something: it may have been a trip that nobody was told.
    interrupted: bool,
    /// Axes that tripped by the reset.
    tripping: Vec<u8>,
}

impl History {
    pub fn new() -> Self {
        let incidents = [Incident::Started { start: 1 }].into();
        Self { incidents, start: 1, read: Vec::new(), news: Vec::new(), unread: None }
    }

    /// The gateway has started without a memory.
    pub fn blank() -> Self {
        let mut history = Self { incidents: VecDeque::new(), ..Self::new() };
        history.started(1, false, Vec::new());
        history
    }

    /// The gateway has started again; with it these axes have tripped.
    pub fn started(&mut self, start: u32, interrupted: bool, tripping: Vec<u8>) {
        self.start = start;
        self.news.clear();
        self.read.clear();
        // A start after which the list was not read has told nobody of its trips either.
        let before = self.unread.take();
        let interrupted = interrupted || before.is_some();
        self.unread = Some(Unread { read: Vec::new(), interrupted, tripping });
    }

    pub fn tripped(&mut self, axis: u8, trip: Vec<u8>) {
        self.news.push((axis, trip));
    }

    /// An axis counts as unreachable: where it tripped for that, the trip says so in its last
    /// field.
    pub fn unreachable(&mut self, axis: u8) {
        if let Some((_, trip)) = self.news.iter_mut().find(|(tripped, _)| *tripped == axis)
            && let Some(last) = trip.last_mut()
        {
            *last = 1;
        }
    }

    /// The instant is over: what was read of it that is wrong. Allowance: a page that is read at
    /// the instant of a trip may have it or not.
    pub fn settle(&mut self) -> Vec<String> {
        let read = std::mem::take(&mut self.read);
        if self.unread.is_some() {
            // The list will tell them.
            self.news.clear();
        }
        let wrong = if self.news.is_empty() {
            read.iter().filter_map(|page| self.wrong(page)).collect()
        } else {
            Vec::new()
        };
        for (axis, trip) in self.news.drain(..) {
            self.incidents.push_front(Incident::Tripped { start: self.start, axis, trip });
        }
        self.incidents.truncate(REMEMBERED);
        wrong
    }

    /// What is wrong with a page.
    fn wrong(&self, Page { first, incidents, next }: &Page) -> Option<String> {
        let wanted: Vec<&Incident> = self.incidents.iter().skip(*first).take(PAGE).collect();
        let goes_on = self.incidents.len() > first + PAGE;
        let is_next = next.map(usize::from) == goes_on.then_some(first + PAGE);
        let fits = incidents.iter().eq(wanted.iter().copied());
        (!is_next || !fits).then(|| format!("{incidents:?}, {next:?}, not {wanted:?}"))
    }

    /// A page from `first` on.
    pub fn read(&mut self, first: u8, page: Vec<Incident>, next: Option<u8>) -> Result<(), String> {
        let first = usize::from(first);
        let Some(unread) = &mut self.unread else {
            self.read.push(Page { first, incidents: page, next });
            return Ok(());
        };
        if unread.read.len() != first {
            return Ok(());
        }
        unread.read.extend(page);
        if next.is_some() {
            return Ok(());
        }
        let Some(Unread { read, interrupted, tripping }) = self.unread.take() else {
            return Ok(());
        };
        let result = self.fits(&read, interrupted, &tripping);
        self.incidents = read.into();
        result.map_err(|wrong| format!("{wrong}: {:?}", self.incidents))
    }

    /// Whether the whole list fits what was known before the start.
    fn fits(&self, read: &[Incident], interrupted: bool, tripping: &[u8]) -> Result<(), String> {
        let this_start = |incident: &Incident| *incident == Incident::Started { start: self.start };
        let Some(place) = read.iter().position(this_start) else { return Err("no start".into()) };
        let (since, before) = (&read[..place], &read[place + 1..]);
        let has_tripped = |wanted: &u8| {
            let of_it = |incident: &Incident| match incident {
                Incident::Tripped { start, axis, .. } => *start == self.start && axis == wanted,
                _ => false,
            };
            since.iter().any(of_it)
        };
        if let Some(axis) = tripping.iter().find(|axis| !has_tripped(axis)).filter(|_| !interrupted)
        {
            return Err(format!("axis {axis} has not tripped"));
        }
        let untold = if interrupted { before.len() } else { 0 };
        let is_the_end_of = |skipped: usize| {
            let known = before.get(skipped..).unwrap_or_default();
            let wanted = self
                .incidents
                .len()
                .min(REMEMBERED - place - 1 - skipped.min(REMEMBERED - place - 1));
            known.len() == wanted && known.iter().zip(&self.incidents).all(|(a, b)| a == b)
        };
        if (0..=untold).any(is_the_end_of) {
            Ok(())
        } else {
            Err(format!("not behind it {:?}", self.incidents))
        }
    }
}
