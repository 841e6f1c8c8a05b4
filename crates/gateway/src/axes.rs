//! The axes, and what is kept of them so that nothing is searched: who is on which bus, who stops,
//! who has something to send, who is due when.
//!
//! Each kept word is a function of one axis. An axis that may have changed is touched, and
//! [`Axes::settle`] works its words out anew: what an event costs depends on the axes that it
//! touches.

use crate::axis::{Axis, Traffic};
use crate::set::Set;
use crate::time::{Earliest, Instant};
use crate::{MAX_AXES, MAX_BUSES};
use heapless::Vec;
use host_protocol::AxisState;

/// What is asked of axes as a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Is {
    /// Not `Unconfigured`.
    Configured,
    /// It has a stop, under way or confirmed.
    Stopping,
    /// No command of its stop has left.
    FirstStop,
    /// It has something to send now.
    Ready,
    /// A time of it has passed and has not been looked at.
    Overdue,
    /// Its motor owes a reply.
    Awaiting,
    /// Its motor owes a reply with the id of the next frame to it.
    OwedOurId,
    /// Its motor answers requests to others.
    Objecting,
    /// It moves by a setpoint.
    Active,
    /// Arming, armed, active, stopping or tripped.
    Moving,
    Tripped,
    Unreachable,
    /// Its trip has still to reach its group.
    Spreading,
    /// Its trip is not in the history.
    Unrecorded,
    /// What outlives a reset has changed.
    Unsaved,
}

impl Is {
    const ALL: [Self; 15] = [
        Self::Configured,
        Self::Stopping,
        Self::FirstStop,
        Self::Ready,
        Self::Overdue,
        Self::Awaiting,
        Self::OwedOurId,
        Self::Objecting,
        Self::Active,
        Self::Moving,
        Self::Tripped,
        Self::Unreachable,
        Self::Spreading,
        Self::Unrecorded,
        Self::Unsaved,
    ];

    const fn bit(self) -> u16 {
        1 << self as u16
    }
}

/// What is kept of one axis: what is so of it, a bit for each [`Is`], and when it is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Look {
    flags: u16,
    /// When the axis must be looked at again; [`Instant::NEVER`] where time alone changes nothing.
    due: Instant,
    /// When its setpoint is late, but for the time that its bus may take; [`Instant::NEVER`] where
    /// none is owed.
    delivery_due: Instant,
}

impl Look {
    /// Of an axis without configuration.
    const NONE: Self = Self { flags: 0, due: Instant::NEVER, delivery_due: Instant::NEVER };

    /// At an axis at `now`. `after`: what was due until then has been done.
    fn at(axis: &Axis, now: Instant, after: Instant) -> Self {
        if !axis.is_configured() {
            let flags = if axis.is_unsaved() { Is::Unsaved.bit() } else { 0 };
            return Self { flags, ..Self::NONE };
        }
        let mut flags = Is::Configured.bit();
        let mut note = |is: Is, so: bool| flags |= if so { is.bit() } else { 0 };
        if let Some(stop) = axis.stop() {
            note(Is::Stopping, true);
            note(Is::FirstStop, !stop.has_left());
            note(Is::Tripped, axis.trip_reason().is_some());
            note(Is::Unreachable, axis.is_unreachable());
            note(Is::Spreading, axis.trip_spreads());
            note(Is::Unrecorded, axis.trip_is_unrecorded());
        }
        note(Is::Active, axis.state() == AxisState::Active);
        note(Is::Moving, axis.may_move());
        note(Is::Unsaved, axis.is_unsaved());
        note(Is::Awaiting, axis.transactions.awaits_reply());
        note(Is::OwedOurId, axis.reply_with_our_id_since().is_some());
        note(Is::Objecting, axis.transactions.objects());
        let mut due = Earliest::after(after);
        for at in axis.timers().into_iter().flatten() {
            note(Is::Overdue, at <= now);
            due.consider(Some(at));
        }
        if axis.transactions.is_idle() {
            let at = axis.next_request_at(now);
            note(Is::Ready, at.is_some_and(|at| at <= now));
            due.consider(if after == now { at } else { axis.next_request_at(after) });
        }
        let due = due.at().unwrap_or(Instant::NEVER);
        let delivery_due = axis.delivery_due_at().unwrap_or(Instant::NEVER);
        Self { flags, due, delivery_due }
    }
}

/// What is kept of all axes.
#[derive(Debug, Clone, PartialEq)]
struct Kept {
    /// By bus.
    on: [Set; MAX_BUSES],
    /// By [`Is`].
    which: [Set; Is::ALL.len()],
    looks: [Look; MAX_AXES],
    traffic: [Traffic; MAX_AXES],
}

impl Kept {
    const NONE: Self = Self {
        on: [Set::NONE; MAX_BUSES],
        which: [Set::NONE; Is::ALL.len()],
        looks: [const { Look::NONE }; MAX_AXES],
        traffic: [const { Traffic::NONE }; MAX_AXES],
    };

    /// Works out what is kept of one axis. Returns whether its traffic is another one.
    fn keep(&mut self, axis: &Axis, now: Instant, after: Instant) -> bool {
        let index = usize::from(axis.index);
        let one = Set::of(index);
        let (Some(look), Some(traffic)) = (self.looks.get_mut(index), self.traffic.get_mut(index))
        else {
            return false;
        };
        let before = core::mem::replace(look, Look::at(axis, now, after));
        let mut changed = before.flags ^ look.flags;
        while changed != 0 {
            if let Some(set) = self.which.get_mut(changed.trailing_zeros() as usize) {
                set.put(one, !set.has(index));
            }
            changed &= changed - 1;
        }
        if core::mem::replace(traffic, axis.traffic()) == *traffic {
            return false;
        }
        for (here, set) in self.on.iter_mut().enumerate() {
            set.put(one, traffic.bus.map(usize::from) == Some(here));
        }
        true
    }

    fn due(&self, index: usize) -> Instant {
        self.looks.get(index).map_or(Instant::NEVER, |look| look.due)
    }
}

/// The axes of a gateway.
#[derive(Clone)]
pub(crate) struct Axes {
    axes: Vec<Axis, MAX_AXES>,
    /// Those that may have changed since they were settled.
    touched: Set,
    kept: Kept,
    /// The earliest time of `Kept::due`.
    first_due: Instant,
    /// Buses whose traffic is another one than they know.
    new_traffic: Set,
}

impl Axes {
    pub const fn new() -> Self {
        Self {
            axes: Vec::new(),
            touched: Set::NONE,
            kept: Kept::NONE,
            first_due: Instant::NEVER,
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

    pub fn get(&self, index: usize) -> Option<&Axis> {
        self.axes.get(index)
    }

    pub fn get_mut(&mut self, index: usize) -> Option<&mut Axis> {
        self.touched.add(Set::of(index));
        self.axes.get_mut(index)
    }

    /// Every axis, configured or not.
    pub fn iter(&self) -> core::slice::Iter<'_, Axis> {
        self.axes.iter()
    }

    /// The axes of a set.
    pub fn of(&self, set: Set) -> impl Iterator<Item = &Axis> + Clone {
        set.into_iter().filter_map(|index| self.axes.get(index))
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

    /// The axes for a bus of which something is so.
    pub fn which_on(&self, is: Is, bus: u8) -> Set {
        self.which(is).and(self.on(bus))
    }

    /// When the first of these setpoints is late, but for the time that their bus may take.
    pub fn first_delivery_due(&self, set: Set) -> Option<Instant> {
        let due = set
            .into_iter()
            .filter_map(|index| self.kept.looks.get(index))
            .map(|look| look.delivery_due);
        due.min().filter(|at| *at < Instant::NEVER)
    }

    /// When the first axis must be looked at again.
    pub fn first_due(&self) -> Option<Instant> {
        Some(self.first_due).filter(|at| *at < Instant::NEVER)
    }

    /// The axes to which time alone has brought something.
    pub fn due(&self, now: Instant) -> Set {
        let overdue = self.which(Is::Overdue);
        if self.first_due <= now { overdue.with(self.due_by(now)) } else { overdue }
    }

    fn due_by(&self, now: Instant) -> Set {
        let mut set = Set::NONE;
        for index in self.which(Is::Configured) {
            if self.kept.due(index) <= now {
                set.add(Set::of(index));
            }
        }
        set
    }

    /// Works out anew what is kept of the axes that may have changed. Returns the buses that they
    /// are or were on. `after`: what was due until then has been done.
    pub fn settle(&mut self, now: Instant, after: Instant) -> Set {
        // What becomes ready meanwhile is asked for before its tick comes.
        let ripe = if self.first_due <= now && now > after { self.due_by(now) } else { Set::NONE };
        let touched = self.touched.take().with(ripe);
        if touched.is_empty() {
            return Set::NONE;
        }
        let before = self.buses_of(touched);
        let (mut is_new_traffic, mut is_first_later) = (false, false);
        for index in touched {
            let before = self.kept.due(index);
            if let Some(axis) = self.axes.get(index) {
                is_new_traffic |= self.kept.keep(axis, now, after);
            }
            let due = self.kept.due(index);
            is_first_later |= before <= self.first_due && due > before;
            self.first_due = self.first_due.min(due);
        }
        if is_first_later {
            let configured = self.which(Is::Configured).into_iter();
            let first = configured.map(|index| self.kept.due(index)).min();
            self.first_due = first.unwrap_or(Instant::NEVER);
        }
        let buses = before.with(self.buses_of(touched));
        self.new_traffic.add(if is_new_traffic { buses } else { Set::NONE });
        buses
    }

    /// The buses whose axes have another traffic than was told the last time.
    pub fn take_new_traffic(&mut self) -> Set {
        self.new_traffic.take()
    }

    /// Panics where what is kept is not what a look at every axis gives. For tests.
    pub fn assert_kept(&self, now: Instant, after: Instant) {
        let mut fresh = Kept::NONE;
        for axis in self.axes.iter() {
            fresh.keep(axis, now, after);
        }
        assert_eq!(self.touched, Set::NONE, "axes that are not settled");
        for (is, (fresh, kept)) in
            Is::ALL.into_iter().zip(fresh.which.into_iter().zip(self.kept.which))
        {
            assert_eq!(fresh, kept, "{is:?}");
        }
        assert_eq!(fresh, self.kept);
        assert_eq!(fresh.looks.iter().map(|look| look.due).min(), Some(self.first_due));
    }

    fn buses_of(&self, set: Set) -> Set {
        let mut buses = Set::NONE;
        for (bus, on) in self.kept.on.iter().enumerate() {
            buses.put(Set::of(bus), !on.and(set).is_empty());
        }
        buses
    }
}
