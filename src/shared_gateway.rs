//! The core, shared by the tasks, and the signals that tell each port to look at it again.

use core::cell::RefCell;

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};
use gateway::{
    Board, BusSetup, Changes, Event, Gateway, Instant, Light, LogEntry, MAX_BUSES, MAX_LINKS,
    Store, Transmit,
};
use host_protocol::MAX_FRAME;
use static_cell::StaticCell;

use crate::board;
use crate::retained::{self, CoreWords};
use crate::watchdog::Watch;

/// Every task runs in thread mode, so the core is guarded without masking interrupts: the
/// controllers' receive queues are filled even while the core works.
type Guard = ThreadModeRawMutex;

/// "The core has changed: poll again."
type Changed = Signal<Guard, ()>;

/// How long the host links wait for the first stops after a start.
const FIRST_STOPS: Duration = Duration::from_millis(100);
/// How often these are looked for.
const FIRST_STOPS_POLL: Duration = Duration::from_millis(1);

/// The one gateway of the board. What reaches into the core is never inlined: several tasks call
/// it, and the core's code would be in the image as often.
pub struct SharedGateway {
    core: Mutex<Guard, RefCell<Gateway>>,
    kept: Mutex<Guard, RefCell<CoreWords>>,
    buses: [Changed; MAX_BUSES],
    links: [Changed; MAX_LINKS],
    /// The next deadline, where it is another one.
    due: Signal<Guard, Option<embassy_time::Instant>>,
    log: Changed,
    history: Changed,
    /// This run knows no motor that a run before may have left turning: the enable output stays
    /// inactive.
    is_bare: bool,
}

impl SharedGateway {
    /// Puts the gateway of this board in its place, with what the run before has left; once.
    #[inline(never)]
    pub fn place(
        board: Board,
        random_number: Option<u32>,
        kept: CoreWords,
        is_bare: bool,
    ) -> &'static Self {
        static BOARD: StaticCell<Board> = StaticCell::new();
        static SHARED: StaticCell<SharedGateway> = StaticCell::new();
        let board = BOARD.init(board);
        let shared = SHARED.init_with(|| Self {
            core: Mutex::new(RefCell::new(Gateway::unequipped(board, random_number))),
            kept: Mutex::new(RefCell::new(kept)),
            buses: [const { Signal::new() }; MAX_BUSES],
            links: [const { Signal::new() }; MAX_LINKS],
            due: Signal::new(),
            log: Signal::new(),
            history: Signal::new(),
            is_bare,
        });
        shared.with(|core, now| {
            core.equip();
            shared.kept.lock(|kept| core.restore(now, kept.borrow().as_slice()));
        });
        shared
    }

    /// Waits until every motor that the run before has left configured has been sent a stop; not
    /// for ever.
    pub async fn first_stops_have_left(&self) {
        let end = embassy_time::Instant::now() + FIRST_STOPS;
        while self.with(|core, _| core.stops_under_way()) && embassy_time::Instant::now() < end {
            Timer::after(FIRST_STOPS_POLL).await;
        }
    }

    /// The time of the gateway.
    pub fn now() -> Instant {
        Instant::from_micros(embassy_time::Instant::now().as_micros())
    }

    fn with<R>(&self, act: impl FnOnce(&mut Gateway, Instant) -> R) -> R {
        // The clock is read under the guard: the core must see times in order.
        self.core.lock(|core| act(&mut core.borrow_mut(), Self::now()))
    }

    /// Tells the core what happened, and those for whom it has something to poll it again.
    ///
    /// The buses are urgent ([`TaskBudget`](crate::task_budget)) and come next. Who may move and whether
    /// the e-stop is latched is stored by then; the history follows when the buses have had
    /// their frames, after many trips in parts, so that the next event does not wait long.
    pub fn handle(&self, event: Event<'_>) {
        let enabled = self.with(|core, now| {
            let changes = self.storing(|store| core.handle(now, event, store));
            self.wake(core, changes);
            core.enable_output()
        });
        board::set_enable_output(enabled && !self.is_bare);
    }

    /// Wakes those who have to poll the core again. Among equals the executor takes first what was
    /// woken last.
    fn wake(&self, core: &Gateway, changes: Changes) {
        if changes.log {
            self.log.signal(());
        }
        if changes.history {
            self.history.signal(());
        }
        if changes.deadline {
            let due = core.next_deadline();
            self.due.signal(due.map(|due| embassy_time::Instant::from_micros(due.as_micros())));
        }
        for (_, link) in (0u8..).zip(&self.links).filter(|(index, _)| changes.has_link(*index)) {
            link.signal(());
        }
        for (_, bus) in (0u8..).zip(&self.buses).filter(|(index, _)| changes.has_bus(*index)) {
            bus.signal(());
        }
    }

    /// Gives the core the memory that outlives a reset, and closes what it writes.
    fn storing<R>(&self, act: impl FnOnce(Store<'_>) -> R) -> R {
        let mut wrote = false;
        let result = self.kept.lock(|kept| {
            let mut kept = kept.borrow_mut();
            act(&mut |index, word| {
                wrote = true;
                kept.write(index, word);
            })
        });
        if wrote {
            retained::close();
        }
        result
    }

    /// Stores a part of what the latest events have left to store. Returns whether that was all.
    #[inline(never)]
    fn save_some(&self, core: &mut Gateway) -> bool {
        self.storing(|store| core.save_some(store))
    }

    /// Stores all of it, and lets others go first between its parts. Before
    /// [`poll_host`](Self::poll_host), which would not.
    pub async fn save(&self) {
        while !self.with(|core, _| self.save_some(core)) {
            yield_now().await;
        }
    }

    /// The next frame for a bus.
    #[inline(never)]
    pub fn poll_transmit(&self, bus: u8) -> Option<Transmit> {
        self.with(|core, now| {
            let transmit = core.poll_transmit(now, bus);
            if transmit.is_some() {
                let changes = core.take_changes();
                self.wake(core, changes);
            }
            transmit
        })
    }

    /// The slot of a frame that the controller of a bus should cancel.
    #[inline(never)]
    pub fn poll_cancel(&self, bus: u8) -> Option<u8> {
        self.with(|core, now| {
            let slot = core.poll_cancel(now, bus);
            if slot.is_some() {
                let changes = core.take_changes();
                self.wake(core, changes);
            }
            slot
        })
    }

    /// The next frame for a host link: its length in `out`.
    #[inline(never)]
    pub fn poll_host(&self, link: u8, out: &mut [u8; MAX_FRAME]) -> Option<usize> {
        self.with(|core, _| self.storing(|store| core.poll_host(link, out, store)))
    }

    /// Whether no motor moves and none may.
    #[inline(never)]
    pub fn all_at_rest(&self) -> bool {
        self.with(|core, _| core.all_at_rest())
    }

    /// How a bus must be running.
    #[inline(never)]
    pub fn bus_setup(&self, bus: u8) -> Option<BusSetup> {
        self.with(|core, _| core.bus_setup(bus))
    }

    /// The same, for the task of that bus, which now polls it for everything that has changed.
    pub fn bus_setup_to_poll(&self, bus: u8) -> Option<BusSetup> {
        if let Some(changed) = self.buses.get(usize::from(bus)) {
            changed.reset();
        }
        self.bus_setup(bus)
    }

    /// Waits until a bus must run otherwise than `current`, for the watched task of that bus.
    pub async fn other_bus_setup(
        &self,
        bus: u8,
        current: Option<BusSetup>,
        watch: &Watch,
    ) -> Option<BusSetup> {
        loop {
            let setup = self.bus_setup(bus);
            if setup != current {
                return setup;
            }
            watch.wait(self.bus_changed(bus)).await;
        }
    }

    /// The next entry of the core's log.
    #[inline(never)]
    pub fn take_log(&self) -> Option<LogEntry> {
        self.with(|core, _| core.take_log())
    }

    /// What the light of the board shows.
    #[inline(never)]
    pub fn light(&self) -> Light {
        self.with(|core, _| core.light())
    }

    /// Waits until the core may have something new for a bus. For one task per bus.
    pub async fn bus_changed(&self, bus: u8) {
        self.buses[usize::from(bus)].wait().await;
    }

    /// Waits until the core may have something new for a host link. For one task per link.
    pub async fn link_changed(&self, link: u8) {
        self.links[usize::from(link)].wait().await;
    }

    /// Waits until the log may have a new entry. For one task.
    pub async fn log_changed(&self) {
        self.log.wait().await;
    }

    /// Waits until a part of the history may be left to store. For one task.
    pub async fn history_changed(&self) {
        self.history.wait().await;
    }

    /// Waits until the core wants to be told of another time: when. For one task.
    pub async fn due_changed(&self) -> Option<embassy_time::Instant> {
        self.due.wait().await
    }
}
