//! Which task goes first where several are ready: those between an event and the frames that must
//! follow from it.
//!
//! One executor polls all tasks, and a poll is not interrupted by another task. Urgent tasks, which
//! serve the buses and what can stop them, go before the others. So that a flood on one of them
//! starves no other, a task that never has to wait goes behind all others when its budget is spent;
//! and so that all of them together starve none that is not urgent, those of the buses and the
//! deadlines go behind these where these have not had a turn for long.

use core::cell::Cell;
use core::future::poll_fn;
use core::mem;
use core::pin::Pin;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use core::task::Poll;

use embassy_executor::Metadata;
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_time::{Duration, Instant};
use gateway::MAX_LINKS;

use crate::board::RS485_BUSES;

/// The order of the tasks; among equals the one that has waited longer goes first.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Urgency {
    /// Every other task: frames to the hosts, the log.
    None,
    /// Deadlines: where one falls due together with a demand, the frames of the demand go first.
    Deadline,
    /// RS485 buses.
    Bus,
    /// CAN buses.
    Can,
    /// What can demand a stop: hosts and the e-stop input.
    Demand,
    /// CAN buses while one has a first stop to send: the next waits for the report of the one
    /// before.
    FirstStops,
}

/// Rounds that an urgent task may run without having to wait before it goes behind all others.
const BUDGET: u8 = 4;
/// The same of the CAN buses: only what can demand a stop goes before them, behind each round, and an
/// RS485 bus that has a first stop to send. So the stops of an e-stop leave in time although floods
/// leave no task anything to wait for.
const CAN_BUDGET: u8 = 250;
/// And so many while an RS485 bus has a first stop to send, until that bus may have a turn.
const CAN_TURNS: u8 = 4;

/// So long the urgent tasks may keep the processor to themselves: the watchdog waits for three
/// times as much, and a loop may miss being looked at once.
const LONGEST: Duration = Duration::from_millis(15);
/// That is looked at in one of so many rounds.
const LOOKED_AT_EVERY: u32 = 16;
/// When the others had a turn last, µs modulo 2³².
static OTHERS_RAN: AtomicU32 = AtomicU32::new(0);
/// They have not had one for too long.
static OTHERS_STARVE: AtomicBool = AtomicBool::new(false);
/// A CAN bus has a first stop to send.
static STOPS_ON_CAN: AtomicBool = AtomicBool::new(false);
/// An RS485 bus has.
static STOPS_ON_LINES: AtomicBool = AtomicBool::new(false);
/// How those that have are let pass.
static LINES_PASS: AtomicU8 = AtomicU8::new(Pass::DONE);
/// Rounds of urgent tasks.
static ROUNDS: AtomicU32 = AtomicU32::new(0);
/// Those of RS485 buses and host links, of the CAN buses, the deadlines and the e-stop input.
const URGENT_TASKS: usize = RS485_BUSES + MAX_LINKS + 3;
/// The urgent tasks.
static URGENT: Mutex<ThreadModeRawMutex, [Cell<Option<Urgent>>; URGENT_TASKS]> =
    Mutex::new([const { Cell::new(None) }; URGENT_TASKS]);

impl Urgency {
    /// That of a task with this one, as things are.
    fn now(self) -> Self {
        match self {
            Self::Can if STOPS_ON_CAN.load(Ordering::Relaxed) => Self::FirstStops,
            urgency => urgency,
        }
    }
}

/// Whether an RS485 bus has had a turn since it has a first stop to send.
struct Pass;

impl Pass {
    /// It has.
    const DONE: u8 = 0;
    /// It has not, and is to be let pass.
    const CAME: u8 = 1;
    /// It has been let pass and had no turn: it had spent its budget just before, and waits behind
    /// all other tasks.
    const LET: u8 = 2;
}

type Urgent = (&'static Metadata, Urgency);

#[expect(clippy::cast_possible_truncation, reason = "modulo")]
fn low_bits(us: u64) -> u32 {
    us as u32
}

/// Whether the urgent tasks have kept the processor from the others for too long.
pub fn others_starve() -> bool {
    OTHERS_STARVE.load(Ordering::Relaxed)
}

/// Whether CAN buses and RS485 buses have still to send the first stop of an axis: CAN buses then go
/// before all others, and take turns with RS485 buses that have too.
pub fn set_first_stops(on_can: bool, on_lines: bool) {
    if on_lines && !STOPS_ON_LINES.load(Ordering::Relaxed) {
        LINES_PASS.store(Pass::CAME, Ordering::Relaxed);
    }
    STOPS_ON_LINES.store(on_lines, Ordering::Relaxed);
    if on_can != STOPS_ON_CAN.load(Ordering::Relaxed) {
        STOPS_ON_CAN.store(on_can, Ordering::Relaxed);
        if !others_starve() {
            put_first(|urgency| urgency == Urgency::Can);
        }
    }
}

/// The others have had a turn: one of them says so. Each urgent task goes before them again.
pub fn others_have_run() {
    OTHERS_RAN.store(low_bits(Instant::now().as_micros()), Ordering::Relaxed);
    if others_starve() {
        OTHERS_STARVE.store(false, Ordering::Relaxed);
        put_first(|_| true);
    }
}

/// Gives these urgent tasks their place in the order, one that has been woken already when it is
/// woken the next time.
fn put_first(these: impl Fn(Urgency) -> bool) {
    URGENT.lock(|urgent| {
        for (task, urgency) in urgent.iter().map_while(Cell::get) {
            if these(urgency) {
                task.set_priority(urgency.now() as u8);
            }
        }
    });
}

/// The urgency with which CAN buses let RS485 buses pass that have first stops to send.
fn let_lines_pass() -> Urgency {
    match LINES_PASS.load(Ordering::Relaxed) {
        Pass::CAME => LINES_PASS.store(Pass::LET, Ordering::Relaxed),
        Pass::LET => return Urgency::None,
        _ => {}
    }
    Urgency::Bus
}

/// Counts a round of an urgent task, and looks now and then whether the others starve. Tasks alone
/// come here, so nothing comes between load and store.
fn count_round() {
    let rounds = ROUNDS.load(Ordering::Relaxed).wrapping_add(1);
    ROUNDS.store(rounds, Ordering::Relaxed);
    if rounds.is_multiple_of(LOOKED_AT_EVERY) {
        let now = low_bits(Instant::now().as_micros());
        let since = now.wrapping_sub(OTHERS_RAN.load(Ordering::Relaxed));
        OTHERS_STARVE.store(since > low_bits(LONGEST.as_micros()), Ordering::Relaxed);
    }
}

/// The budget of an urgent task's loop: the rounds it has run without having to wait.
pub struct TaskBudget {
    task: &'static Metadata,
    urgency: Urgency,
    spent: Cell<u8>,
}

impl TaskBudget {
    /// Gives the task that runs this an urgency.
    pub async fn new(urgency: Urgency) -> Self {
        let task = Metadata::for_current_task().await;
        URGENT.lock(|urgent| {
            let is_free = |place: &&Cell<Option<Urgent>>| {
                place.get().is_none_or(|(other, _)| core::ptr::eq(other, task))
            };
            if let Some(place) = urgent.iter().find(is_free) {
                place.set(Some((task, urgency)));
            }
        });
        task.set_priority(urgency.now() as u8);
        Self { task, urgency, spent: Cell::new(0) }
    }

    /// Waits for the event that a round begins with. Where that is there already, tasks of the same
    /// urgency go first, and all tasks when the budget is spent; it is full again after a wait.
    pub fn wait<F: Future + Unpin>(&self, mut event: F) -> impl Future<Output = F::Output> {
        count_round();
        // What was dropped before its end leaves another urgency.
        self.set_urgency(self.urgency.now());
        let (mut is_first, mut held) = (true, None);
        poll_fn(move |context| {
            if self.urgency == Urgency::Bus {
                LINES_PASS.store(Pass::DONE, Ordering::Relaxed);
            }
            if let Some(result) = held.take() {
                self.task.set_priority(self.urgency.now() as u8);
                return Poll::Ready(result);
            }
            let is_first = mem::take(&mut is_first);
            match Pin::new(&mut event).poll(context) {
                Poll::Ready(result) if is_first => {
                    self.spend();
                    held = Some(result);
                    context.waker().wake_by_ref();
                    Poll::Pending
                }
                Poll::Ready(result) => Poll::Ready(result),
                Poll::Pending => {
                    self.spent.set(0);
                    Poll::Pending
                }
            }
        })
    }

    /// Ends a round behind which the next is ready, as a packet holds several requests: buses and
    /// deadlines go first too, and all tasks when the budget is spent.
    pub async fn spend_one_of_many(&self) {
        self.set_urgency(Urgency::Deadline);
        self.spend();
        yield_now().await;
        self.task.set_priority(self.urgency.now() as u8);
    }

    fn spend(&self) {
        let spent = self.spent.get() + 1;
        let budget = if self.urgency == Urgency::Can { CAN_BUDGET } else { BUDGET };
        let is_last = spent == budget;
        self.spent.set(if is_last { 0 } else { spent });
        let stops_on_lines = STOPS_ON_LINES.load(Ordering::Relaxed);
        let urgency = match self.urgency {
            Urgency::Bus if stops_on_lines => Urgency::Bus,
            _ if is_last => Urgency::None,
            Urgency::Can if stops_on_lines && spent.is_multiple_of(CAN_TURNS) => let_lines_pass(),
            Urgency::Can if self.urgency.now() == Urgency::FirstStops => Urgency::Demand,
            _ => return,
        };
        self.set_urgency(urgency);
    }

    /// While the others starve it goes behind them, unless it can demand a stop.
    fn set_urgency(&self, urgency: Urgency) {
        let is_behind = others_starve() && self.urgency != Urgency::Demand;
        let urgency = if is_behind { Urgency::None } else { urgency };
        self.task.set_priority(urgency as u8);
    }
}
