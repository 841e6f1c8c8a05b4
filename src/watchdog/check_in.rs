//! Which loops are watched, and which of them have checked in since the watchdog was last fed.

use core::fmt;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::signal::Signal;
use gateway::{MAX_BUSES, MAX_LINKS};

use super::verdict;

/// A loop that must check in: a bit of the masks here.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct TaskId(u8);

/// [`MAX_BUSES`] and [`MAX_LINKS`] in a byte.
const BUSES: u8 = byte(MAX_BUSES);
const LINKS: u8 = byte(MAX_LINKS);

/// The loops per bus and per host link, then the others.
const BUS: u8 = 0;
const BUS_RECEIVER: u8 = BUS + BUSES;
const LINK_RECEIVER: u8 = BUS_RECEIVER + BUSES;
const LINK_SENDER: u8 = LINK_RECEIVER + LINKS;
const OTHERS: u8 = LINK_SENDER + LINKS;
/// Number of loops.
const ALL: u8 = OTHERS + 5;
/// The same, for arrays.
pub const TASKS: usize = ALL as usize;
const _: () = assert!(TASKS <= u32::BITS as usize);

#[expect(clippy::cast_possible_truncation, reason = "checked")]
const fn byte(count: usize) -> u8 {
    assert!(count <= u8::MAX as usize);
    count as u8
}

impl TaskId {
    /// Ticks.
    pub const TICKS: Self = Self(OTHERS + 4);
    /// What stores the history.
    pub const HISTORY: Self = Self(OTHERS);
    /// Watches the e-stop input.
    pub const E_STOP: Self = Self(OTHERS + 1);
    /// Serves USB.
    pub const USB: Self = Self(OTHERS + 2);
    /// The light.
    pub const LIGHT: Self = Self(OTHERS + 3);

    /// A CAN bus, or the sending half of an RS485 bus.
    pub const fn bus(bus: u8) -> Self {
        assert!(bus < BUSES);
        Self(BUS + bus)
    }

    /// The receiving half of an RS485 bus.
    pub const fn bus_receiver(bus: u8) -> Self {
        assert!(bus < BUSES);
        Self(BUS_RECEIVER + bus)
    }

    /// The receiving half of a host link.
    pub const fn link_receiver(link: u8) -> Self {
        assert!(link < LINKS);
        Self(LINK_RECEIVER + link)
    }

    /// The sending half of a host link.
    pub const fn link_sender(link: u8) -> Self {
        assert!(link < LINKS);
        Self(LINK_SENDER + link)
    }

    /// All there can be.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..ALL).map(Self)
    }

    /// Its place in lists.
    pub fn index(self) -> usize {
        usize::from(self.0)
    }

    /// Its bit in masks.
    pub fn bit(self) -> u32 {
        1 << self.0
    }
}

/// As a user reads it.
impl fmt::Display for TaskId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            number @ ..BUS_RECEIVER => write!(f, "bus {}", number - BUS),
            number @ ..LINK_RECEIVER => write!(f, "bus {} receiver", number - BUS_RECEIVER),
            number @ ..LINK_SENDER => write!(f, "host link {} receiver", number - LINK_RECEIVER),
            number @ ..OTHERS => write!(f, "host link {} sender", number - LINK_SENDER),
            _ => f.write_str(match *self {
                Self::HISTORY => "history",
                Self::TICKS => "ticks",
                Self::E_STOP => "e-stop input",
                Self::USB => "USB",
                _ => "light",
            }),
        }
    }
}

/// The loops that are watched, as a mask.
static WATCHED: AtomicU32 = AtomicU32::new(0);
/// Those that have checked in since none was missing, as a mask.
static CHECKED_IN: AtomicU32 = AtomicU32::new(0);
/// Has a loop check in.
static PULSES: [Signal<ThreadModeRawMutex, ()>; TASKS] = [const { Signal::new() }; TASKS];

/// A loop is watched as long as this exists.
pub struct Watch(TaskId);

impl Watch {
    /// Watches a loop from now on; once for each.
    pub fn new(task: TaskId) -> Self {
        // Tasks alone come here, so nothing comes between load and store.
        WATCHED.store(WATCHED.load(Ordering::Relaxed) | task.bit(), Ordering::Relaxed);
        Self(task)
    }

    /// Checks in, then waits for `work`, at most until the next pulse, which returns `None`. `work`
    /// may be dropped at any time.
    pub async fn wait<F: Future>(&self, work: F) -> Option<F::Output> {
        self.check_in();
        match select(work, PULSES[self.0.index()].wait()).await {
            Either::First(result) => Some(result),
            Either::Second(()) => None,
        }
    }

    /// Checks in.
    pub fn check_in(&self) {
        let (checked_in, task) = (CHECKED_IN.load(Ordering::Relaxed), self.0);
        if checked_in & task.bit() == 0 {
            CHECKED_IN.store(checked_in | task.bit(), Ordering::Relaxed);
            verdict::note_task(task);
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        WATCHED.store(WATCHED.load(Ordering::Relaxed) & !self.0.bit(), Ordering::Relaxed);
    }
}

/// The watched loops that have not checked in, as a mask. When none is missing, all have to check in
/// again.
pub fn missing() -> u32 {
    let missing = WATCHED.load(Ordering::Relaxed) & !CHECKED_IN.load(Ordering::Relaxed);
    if missing == 0 {
        CHECKED_IN.store(0, Ordering::Relaxed);
    }
    missing
}

/// Has every watched loop check in, one after the other: what an interrupt wakes meanwhile waits for
/// one of them, not for all.
pub async fn pulse() {
    for (task, pulse) in TaskId::all().zip(&PULSES) {
        if WATCHED.load(Ordering::Relaxed) & task.bit() != 0 {
            pulse.signal(());
            yield_now().await;
        }
    }
}
