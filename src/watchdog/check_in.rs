//! Who is watched, and who has checked in since the watchdog was last fed.
//!
//! A loop that waits for its next event, and for nothing else, need not check in. Once it is woken
//! it has to, or to wait again, before the next feed; and each is woken now and then to prove that
//! it can be.

use core::fmt;
use core::future::poll_fn;
use core::pin::Pin;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::signal::Signal;
use gateway::{MAX_BUSES, MAX_LINKS};

use super::verdict;

/// A loop that is watched: a bit of the masks here.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct TaskId(u8);

/// [`MAX_BUSES`] and [`MAX_LINKS`] in a byte.
const BUSES: u8 = byte(MAX_BUSES);
const LINKS: u8 = byte(MAX_LINKS);

/// The loops per RS485 bus and per host link, then the others.
const BUS: u8 = 0;
const BUS_RECEIVER: u8 = BUS + BUSES;
const LINK_RECEIVER: u8 = BUS_RECEIVER + BUSES;
const LINK_SENDER: u8 = LINK_RECEIVER + LINKS;
const OTHERS: u8 = LINK_SENDER + LINKS;
/// How many there are.
const ALL: u8 = OTHERS + 6;
/// The same.
pub const TASKS: usize = ALL as usize;
const _: () = assert!(TASKS <= u32::BITS as usize);

#[expect(clippy::cast_possible_truncation, reason = "checked")]
const fn byte(count: usize) -> u8 {
    assert!(count <= u8::MAX as usize);
    count as u8
}

impl TaskId {
    /// What ticks.
    pub const TICKS: Self = Self(OTHERS + 4);
    /// What serves the CAN buses.
    pub const CAN: Self = Self(OTHERS + 5);
    /// What stores the history.
    pub const HISTORY: Self = Self(OTHERS);
    /// What watches the e-stop input.
    pub const E_STOP: Self = Self(OTHERS + 1);
    /// What serves USB.
    pub const USB: Self = Self(OTHERS + 2);
    /// The light.
    pub const LIGHT: Self = Self(OTHERS + 3);

    /// The sending half of an RS485 bus.
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
    pub fn all() -> impl Iterator<Item = Self> + Clone {
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
                Self::CAN => "CAN buses",
                Self::E_STOP => "e-stop input",
                Self::USB => "USB",
                _ => "light",
            }),
        }
    }
}

/// Who is watched.
static WATCHED: AtomicU32 = AtomicU32::new(0);
/// Who must check in before the watchdog is fed: all that are watched and do not wait.
static BUSY: AtomicU32 = AtomicU32::new(0);
/// Who has checked in since the watchdog was last fed.
static CHECKED_IN: AtomicU32 = AtomicU32::new(0);
/// "Prove that you can be woken."
static ASKED: [Signal<ThreadModeRawMutex, ()>; TASKS] = [const { Signal::new() }; TASKS];

/// Changes a mask. Tasks alone come here, so nothing comes between load and store.
fn change(mask: &AtomicU32, by: impl FnOnce(u32) -> u32) {
    mask.store(by(mask.load(Ordering::Relaxed)), Ordering::Relaxed);
}

/// A loop that is watched as long as this lives.
pub struct Watch(TaskId);

impl Watch {
    /// From now on. For one loop each.
    pub fn new(task: TaskId) -> Self {
        change(&WATCHED, |watched| watched | task.bit());
        change(&BUSY, |busy| busy | task.bit());
        verdict::note_task(task);
        Self(task)
    }

    /// Waits for the event that a round begins with; it may be dropped at any time. Returns `None`
    /// where the loop has been [asked](ask) to prove that it can be woken.
    pub fn wait<F: Future + Unpin>(
        &self,
        mut event: F,
    ) -> impl Future<Output = Option<F::Output>> + Unpin {
        let mut asked = ASKED[self.0.index()].wait();
        poll_fn(move |context| {
            let result = match Pin::new(&mut event).poll(context) {
                Poll::Ready(result) => Some(result),
                Poll::Pending if Pin::new(&mut asked).poll(context).is_ready() => None,
                Poll::Pending => {
                    change(&BUSY, |busy| busy & !self.0.bit());
                    return Poll::Pending;
                }
            };
            change(&BUSY, |busy| busy | self.0.bit());
            self.check_in();
            Poll::Ready(result)
        })
    }

    /// Says that the loop comes round.
    pub fn check_in(&self) {
        change(&CHECKED_IN, |checked_in| checked_in | self.0.bit());
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        change(&WATCHED, |watched| watched & !self.0.bit());
        change(&BUSY, |busy| busy & !self.0.bit());
    }
}

/// Who had to check in and has not, as a mask. When nobody is missing, everybody who does not
/// wait has to check in anew.
pub fn missing() -> u32 {
    let missing = BUSY.load(Ordering::Relaxed) & !CHECKED_IN.load(Ordering::Relaxed);
    if missing == 0 {
        CHECKED_IN.store(0, Ordering::Relaxed);
    }
    missing
}

/// Asks a loop to prove that it can be woken: it counts as waiting when it has. False where it is
/// not watched.
pub fn ask(task: TaskId) -> bool {
    let is_watched = WATCHED.load(Ordering::Relaxed) & task.bit() != 0;
    if is_watched {
        change(&BUSY, |busy| busy | task.bit());
        ASKED[task.index()].signal(());
    }
    is_watched
}
