//! The axes, and what is kept of them so that nothing is searched: who is on which bus, who stops,
//! who has something to send, who is due when.
//!
//! Each kept word is a function of one axis. An axis that may have changed is touched, and
//! [`Axes::settle`] works its words out anew: what an event costs depends on the axes that it
//! touches.

use crate::axis::{Axis, Is, Look};
use crate::set::Set;
use crate::time::Instant;
use crate::{MAX_AXES, MAX_BUSES};
use core::fmt;
use heapless::Vec;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

/// What is kept of all axes.
#[derive(Debug, Clone, PartialEq)]
struct Kept {
    /// By bus.
    on: [Set; MAX_BUSES],
    /// By [`Is`].
    which: [Set; Is::COUNT],
    /// Those that are due no earlier than is kept of them, but perhaps later: they have had a frame
    /// handed over since they were looked at.
    early: Set,
    each: [Look; MAX_AXES],
}

impl Default for Kept {
    fn default() -> Self {
        Self::NONE
    }
}

impl Kept {
    const NONE: Self = Self {
        on: [Set::NONE; MAX_BUSES],
        which: [Set::NONE; Is::COUNT],
        early: Set::NONE,
        each: [Look::NONE; MAX_AXES],
    };

    /// Keeps this of one axis. Returns what was kept of it before.
    #[inline(always)]
    fn put(&mut self, index: usize, look: Look) -> Option<Look> {
        let one = Set::of(index);
        self.early.put(one, false);
        let was = core::mem::replace(self.each.get_mut(index)?, look);
        let mut changed = was.flags ^ look.flags;
        while changed != 0 {
            if let Some(set) = self.which.get_mut(changed.trailing_zeros() as usize) {
                set.toggle(one);
            }
            changed &= changed - 1;
        }
        if was.traffic() != look.traffic() {
            for (here, set) in self.on.iter_mut().enumerate() {
                set.put(one, look.bus.has(here));
            }
        }
        Some(was)
    }

    /// Keeps otherwise what is so of an axis, and notes that it is due no earlier than is kept.
    fn note(&mut self, index: usize, is: Is, so: bool) -> Option<&mut Look> {
        let one = Set::of(index);
        self.early.add(one);
        self.which.get_mut(is as usize)?.put(one, so);
        let look = self.each.get_mut(index)?;
        look.put(is, so);
        Some(look)
    }

    fn due(&self, index: usize) -> Instant {
        self.each.get(index).map_or(Instant::NEVER, |kept| kept.due)
    }
}

/// The axes of a gateway.
///
/// `axes` comes last: with zeros right behind it the compiler makes it on the stack, which has no
/// room for it, and then moves it.
#[derive(Clone, Deserialize)]
#[repr(C)]
pub(crate) struct Axes {
    /// Those that may have changed since they were settled.
    touched: Set,
    /// Those that may have changed since all were made, when all are settled.
    used: Set,
    /// Those that may have changed since they were copied, when all are settled.
    #[serde(skip)]
    pub stale: Set,
    #[serde(skip)]
    kept: Kept,
    /// None of them is due before this.
    #[serde(skip)]
    none_due_before: Instant,
    /// One of them is due then, or none ever.
    #[serde(skip)]
    is_first_known: bool,
    /// Buses whose traffic is another one than they know.
    new_traffic: Set,
    #[serde(deserialize_with = "all")]
    axes: Vec<Axis, MAX_AXES>,
}

/// The axes of a snapshot, which has nothing of those that are still as they were made.
fn all<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Axis, MAX_AXES>, D::Error> {
    struct All;

    impl<'de> Visitor<'de> for All {
        type Value = Vec<Axis, MAX_AXES>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "{MAX_AXES} axes")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut given: A) -> Result<Self::Value, A::Error> {
            let mut axes = Vec::new();
            while let Some(axis) = given.next_element::<Option<Axis>>()? {
                let index = u8::try_from(axes.len()).unwrap_or(u8::MAX);
                let _ = axes.push(axis.unwrap_or(Axis::new(index)));
            }
            Ok(axes)
        }
    }

    deserializer.deserialize_tuple(MAX_AXES, All)
}

impl Axes {
    pub const fn new() -> Self {
        Self {
            axes: Vec::new(),
            touched: Set::NONE,
            used: Set::NONE,
            stale: Set::NONE,
            kept: Kept::NONE,
            none_due_before: Instant::from_micros(0),
            is_first_known: false,
            new_traffic: Set::NONE,
        }
    }

    /// Makes all axes, each where it stays.
    pub fn init(&mut self) {
        while !self.axes.is_full() {
            let index = u8::try_from(self.axes.len()).unwrap_or(u8::MAX);
            let _ = self.axes.push(Axis::new(index));
        }
    }

    /// The same axes, taken from a snapshot: what is kept of them, and the tables that they go
    /// through, are found again. `now`: when it was taken.
    pub fn attach(&mut self, now: Instant) {
        let used = self.used;
        for axis in &mut self.axes {
            axis.attach();
            self.touched.add(Set::of(axis.index));
        }
        self.settle(now, now, Set::NONE);
        self.used = used;
        self.take_new_traffic();
    }

    pub fn get(&self, index: usize) -> Option<&Axis> {
        self.axes.get(index)
    }

    pub fn get_mut(&mut self, index: usize) -> Option<&mut Axis> {
        self.touched.add(Set::of(index));
        self.axes.get_mut(index)
    }

    /// Has a frame of an axis handed over. What that alone changes of what is kept needs no look at
    /// the axis: until the frame has left it wants nothing, and it is due no earlier. Where a time
    /// of it has passed, the frame may be what it had waited for.
    pub fn hand_over<T>(
        &mut self,
        index: usize,
        act: impl FnOnce(&mut Axis) -> Option<T>,
    ) -> Option<T> {
        let given = act(self.axes.get_mut(index)?);
        let is_overdue = self.which(Is::Overdue).has(index);
        if self.spares_look(index, given.is_some() && !is_overdue)
            && let Some(look) = self.kept.note(index, Is::Ready, false)
        {
            look.stop_due = Instant::NEVER;
        }
        given
    }

    /// A frame of an axis has left. Where nothing follows but that its reply is due until the time
    /// that `act` returns, that needs no look at the axis either.
    pub fn transmitted(&mut self, index: usize, act: impl FnOnce(&mut Axis) -> Option<Instant>) {
        let Some(axis) = self.axes.get_mut(index) else { return };
        let reply_by = act(axis);
        let is_late = self.which(Is::Late).has(index);
        if self.spares_look(index, reply_by.is_some() && !is_late)
            && let Some(reply_by) = reply_by
            && let Some(look) = self.kept.note(index, Is::Awaiting, true)
        {
            look.due = look.due.min(reply_by);
            self.is_first_known &= reply_by > self.none_due_before;
            self.none_due_before = self.none_due_before.min(reply_by);
        }
    }

    /// An axis has changed. Whether what is kept of it follows from that alone, as far as it is
    /// `known`; else it is to be looked at.
    fn spares_look(&mut self, index: usize, known: bool) -> bool {
        let one = Set::of(index);
        let spares = known && !self.touched.has(index);
        if spares {
            self.used.add(one);
            self.stale.add(one);
        } else {
            self.touched.add(one);
        }
        spares
    }

    /// Every axis, configured or not.
    pub fn iter(&self) -> core::slice::Iter<'_, Axis> {
        self.axes.iter()
    }

    /// The axes of a set.
    pub fn of(&self, set: Set) -> impl Iterator<Item = &Axis> + Clone {
        set.into_iter().filter_map(|index| self.axes.get(index))
    }

    /// Those of a set of which something is so that is not kept.
    pub fn those(&self, set: Set, is: impl Fn(&Axis) -> bool) -> Set {
        self.of(set).filter(|axis| is(axis)).map(|axis| axis.index).collect()
    }

    /// Calls `act` with each axis of a set.
    pub fn each(&mut self, set: Set, mut act: impl FnMut(&mut Axis)) {
        for index in set {
            if let Some(axis) = self.get_mut(index) {
                act(axis);
            }
        }
    }

    /// The axes for a bus.
    pub fn on(&self, bus: u8) -> Set {
        self.kept.on.get(usize::from(bus)).copied().unwrap_or_default()
    }

    pub fn which(&self, is: Is) -> Set {
        self.kept.which.get(is as usize).copied().unwrap_or_default()
    }

    /// What is kept as a time of each axis of a set that has one.
    pub fn times(
        &self,
        set: Set,
        time: impl Fn(&Look) -> Instant,
    ) -> impl Iterator<Item = (usize, Instant)> {
        set.into_iter()
            .filter_map(move |index| Some((index, time(self.kept.each.get(index)?))))
            .filter(|(_, at)| *at < Instant::NEVER)
    }

    /// When the axes must be looked at again: not later than the first of them, as long as that is
    /// after `now`; [`Instant::NEVER`] where time alone changes none. That another one has become
    /// the first is found out when its time has come.
    pub fn due_again(&mut self, now: Instant) -> Instant {
        if self.none_due_before <= now && !self.is_first_known {
            (self.none_due_before, self.is_first_known) = (self.work_out_first_due(), true);
        }
        self.none_due_before
    }

    fn work_out_first_due(&self) -> Instant {
        let due = self.which(Is::Configured).into_iter().map(|index| self.kept.due(index));
        due.min().unwrap_or(Instant::NEVER)
    }

    /// The axes to which time alone has brought something.
    pub fn due(&mut self, now: Instant) -> Set {
        let overdue = self.which(Is::Overdue);
        if self.due_again(now) > now { overdue } else { overdue.with(self.due_by(now)) }
    }

    fn due_by(&self, now: Instant) -> Set {
        let configured = self.which(Is::Configured).into_iter();
        configured.filter(|index| self.kept.due(*index) <= now).collect()
    }

    /// Works out anew what is kept of the axes that may have changed. Returns the buses that they
    /// are or were on. `after`: what was due until then has been done; `unstopped`: time alone
    /// brings nothing to these, which are looked at when they are reached.
    pub fn settle(&mut self, now: Instant, after: Instant, unstopped: Set) -> Set {
        // What becomes ready meanwhile is asked for before its tick comes.
        let is_later = now > after && self.none_due_before <= now;
        let ripe = if is_later { self.due_by(now).without(unstopped) } else { Set::NONE };
        let touched = self.touched.take();
        self.used.add(touched);
        self.stale.add(touched);
        let touched = touched.with(ripe);
        if touched.is_empty() {
            return Set::NONE;
        }
        let mut buses = Set::NONE;
        for index in touched {
            let Some(axis) = self.axes.get(index) else { continue };
            let look = Look::at(axis, now, after);
            let Some(was) = self.kept.put(index, look) else { continue };
            let here = was.bus.with(look.bus);
            buses.add(here);
            if was.traffic() != look.traffic() {
                self.new_traffic.add(here);
            }
            if look.due <= self.none_due_before {
                (self.none_due_before, self.is_first_known) = (look.due, true);
            } else if was.due <= self.none_due_before {
                // Another one may be first where this one was.
                self.is_first_known = false;
            }
        }
        buses
    }

    /// What a snapshot has before the axes; see [`Parts`](crate::gateway::Part).
    pub fn head(&self) -> impl Serialize {
        (self.touched, self.used, self.new_traffic)
    }

    /// What a snapshot has of an axis: nothing of one that is still as it was made.
    pub fn used(&self, index: usize) -> Option<&Axis> {
        if Set::of(index).without(self.used).is_empty() { self.axes.get(index) } else { None }
    }

    /// A copy begins: all that a snapshot has something of.
    pub fn all_stale(&mut self) {
        self.stale = self.used;
    }

    /// Whether no axis may have changed since.
    pub fn is_settled(&self) -> bool {
        self.touched.is_empty()
    }

    /// The buses whose axes have another traffic than was told the last time.
    pub fn take_new_traffic(&mut self) -> Set {
        self.new_traffic.take()
    }

    /// Panics where what is kept is not what a look at every axis gives; `unstopped`: but these,
    /// which are looked at when they are reached. For tests.
    pub fn assert_kept(&self, now: Instant, after: Instant, unstopped: Set) {
        let mut fresh = Kept::NONE;
        for (axis, kept) in self.axes.iter().zip(&self.kept.each) {
            let mut look =
                if unstopped.has(axis.index) { *kept } else { Look::at(axis, now, after) };
            if self.kept.early.has(axis.index) {
                look.due = look.due.min(kept.due);
            }
            fresh.put(axis.index.into(), look);
        }
        fresh.early = self.kept.early;
        assert_eq!(self.touched, Set::NONE, "axes that are not settled");
        assert_eq!(fresh, self.kept);
        let first = self.work_out_first_due();
        assert!(self.none_due_before <= first, "none due before");
        assert!(!self.is_first_known || self.none_due_before == first, "first due");
    }
}
