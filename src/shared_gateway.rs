//! The core and the CAN buses, shared by the tasks, and the signals that tell each other port to
//! look at the core again.
//!
//! The task that gives the core an event hands over the CAN frames that follow from it before
//! anything else happens: no task stands between a demand and its stop.

use core::cell::{Cell, RefCell};
use core::convert::Infallible;

use cortex_m::peripheral::SCB;
use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Ticker, Timer, with_timeout};
use gateway::{
    Board, BusSetup, Changes, Event, FlightRead, Found, Gateway, Images, Instant, Light, LogEntry,
    MAX_LINKS, MAX_STORED_ROW, NextRow, Save, Store, Transmit,
};
use host_protocol::MAX_FRAME;
use host_protocol::replies::MAX_FLIGHT_RECORD_BYTES;
use static_cell::StaticCell;

use crate::board::{self, CAN_BUSES, RS485_BUSES};
use crate::can_bus::CanBus;
use crate::fdcan::{self, CanPort};
use crate::flight::{self, Core};
use crate::retained::{self, CoreWords};
use crate::task_budget;
use crate::watchdog::{self, Watch};

/// Every task runs in thread mode, so the core is guarded without masking interrupts: the
/// controllers' receive queues are filled even while the core works.
type Guard = ThreadModeRawMutex;

/// "The core has changed: poll again."
type Changed = Signal<Guard, ()>;

/// The number of the first RS485 bus: they come after the CAN buses.
#[expect(clippy::cast_possible_truncation, reason = "a handful")]
const FIRST_RS485: u8 = CAN_BUSES as u8;
/// How long the host links wait for the first stops after a start.
const FIRST_STOPS: Duration = Duration::from_millis(100);
/// How often these are looked for.
const FIRST_STOPS_POLL: Duration = Duration::from_millis(1);
/// How long the host links then wait for what is stored, where a reset has left what runs.
const LOADED: Duration = Duration::from_millis(100);
/// How often the watchdog is fed while a start reads what is stored, before there is a task.
const FEED: Duration = Duration::from_millis(10);

/// The one gateway of the board. What reaches into the core is never inlined: several tasks call
/// it, and the core's code would be in the image as often.
pub struct SharedGateway {
    parts: Mutex<Guard, RefCell<Parts>>,
    /// The RS485 buses, which have tasks of their own.
    buses: [Changed; RS485_BUSES],
    links: [Changed; MAX_LINKS],
    /// When the task of the deadlines comes next by itself, and that it must come earlier.
    tick: Mutex<Guard, Cell<Option<Instant>>>,
    earlier: Changed,
    log: Changed,
    history: Changed,
    save: Changed,
    started: Changed,
    loaded: Changed,
    /// The flight recorder has something to do.
    flight: Changed,
    /// This run knows no motor that a run before may have left turning: the enable output stays
    /// inactive.
    is_bare: bool,
}

/// What one caller at a time reaches.
struct Parts {
    core: Core,
    kept: CoreWords,
    can: [Option<CanBus>; CAN_BUSES],
    /// The CAN bus that is asked first for its next event.
    first: usize,
}

impl Parts {
    /// Gives the core the memory that outlives a reset, and closes what it writes.
    fn storing<R>(&mut self, act: impl FnOnce(&mut Core, Store<'_>) -> R) -> R {
        let mut wrote = false;
        let Self { core, kept, .. } = self;
        let result = act(core, &mut |index, word| {
            wrote = true;
            kept.write(index, word);
        });
        if wrote {
            retained::close();
        }
        result
    }

    /// The next event of a CAN bus, each in turn.
    fn next_can_event(&mut self) -> Option<Event<'static>> {
        let Self { core, can, first, .. } = self;
        (0..CAN_BUSES).find_map(|_| {
            let bus = can.get_mut(*first).and_then(Option::as_mut);
            *first = if *first + 1 < CAN_BUSES { *first + 1 } else { 0 };
            bus?.next(core)
        })
    }

    /// Hands the CAN controllers the frames of the buses that have changed. Returns whether there
    /// was one.
    fn serve_can(&mut self, now: Instant, changes: Changes) -> bool {
        let Self { core, can, .. } = self;
        let mut has_served = false;
        for bus in changes.buses {
            let can_bus = can.get_mut(bus).and_then(Option::as_mut);
            has_served |= can_bus.is_some_and(|can_bus| can_bus.serve(core, now));
        }
        has_served
    }
}

impl SharedGateway {
    /// Puts the gateway of this board in its place; once. It is not [started](Self::start) yet.
    #[inline(never)]
    pub fn place(
        board: Board,
        random_number: Option<u32>,
        kept: CoreWords,
        is_bare: bool,
        has_kept_flight: bool,
    ) -> &'static Self {
        static BOARD: StaticCell<Board> = StaticCell::new();
        static SHARED: StaticCell<SharedGateway> = StaticCell::new();
        let memory = flight::take(has_kept_flight);
        let board = BOARD.init(board);
        let shared = SHARED.init_with(|| Self {
            parts: Mutex::new(RefCell::new(Parts {
                core: Core::new(Gateway::uninit(board, random_number), board, memory),
                kept,
                can: [const { None }; CAN_BUSES],
                first: 0,
            })),
            buses: [const { Signal::new() }; RS485_BUSES],
            links: [const { Signal::new() }; MAX_LINKS],
            tick: Mutex::new(Cell::new(None)),
            earlier: Signal::new(),
            log: Signal::new(),
            history: Signal::new(),
            save: Signal::new(),
            started: Signal::new(),
            loaded: Signal::new(),
            flight: Signal::new(),
            is_bare,
        });
        shared.with(|parts, _| {
            parts.core.before_motion().init();
            parts.core.recall();
        });
        shared
    }

    /// Whether a reset has left the running configuration, which then counts, whatever is stored.
    fn is_remembered(&self) -> bool {
        self.with(|parts, _| Gateway::is_remembered(parts.kept.as_slice()))
    }

    /// Whether start after start has failed: this run is without configuration.
    pub fn is_bare(&self) -> bool {
        self.is_bare
    }

    /// Tells what is known of images; once, before any host is heard.
    pub fn set_images(&self, images: Images) {
        self.with(|parts, now| parts.core.before_motion().set_images(now, images));
    }

    /// Goes on from what the run before has left. Where it has left nothing, the others begin when
    /// what is stored is loaded.
    #[inline(never)]
    pub fn restore(&self) {
        self.with(|parts, now| parts.core.before_motion().restore(now, parts.kept.as_slice()));
        if self.is_remembered() {
            self.started.signal(());
        }
    }

    /// Takes over what is stored.
    #[inline(never)]
    pub fn load(&self, found: Found, next: NextRow<'_>) {
        self.with(|parts, now| parts.core.before_motion().load(now, found, next));
        if self.is_remembered() {
            // What was lost and found is to be stopped.
            self.handle(Event::Tick);
        } else {
            self.started.signal(());
        }
        self.loaded.signal(());
    }

    /// Waits until it has started. Nobody else feeds the watchdog meanwhile: there is so much to
    /// read and no more.
    pub async fn has_started(&self) {
        let feed = async || -> Infallible {
            let mut ticker = Ticker::every(FEED);
            loop {
                watchdog::feed();
                ticker.next().await;
            }
        };
        let _: Either<(), Infallible> = select(self.started.wait(), feed()).await;
    }

    /// Waits until it is known what is stored; not for ever.
    pub async fn has_loaded(&self) {
        // What is not known is told as no storage.
        let _ = with_timeout(LOADED, self.loaded.wait()).await;
    }

    /// Waits until the flight recorder has something to do. For one task.
    pub fn flight_due(&self) -> impl Future<Output = ()> + Unpin {
        self.flight.wait()
    }

    /// Has it do a part of that. Returns whether there is more.
    #[inline(never)]
    pub fn go_on_with_flight(&self) -> bool {
        self.with(|parts, now| {
            if let Some(read) = parts.core.take_flight_read() {
                self.answer(parts, now, read);
            }
            parts.core.go_on(now)
        })
    }

    /// Waits until something is to be stored. For one task.
    pub async fn save_due(&self) -> Save {
        loop {
            if let Some(save) = self.with(|parts, _| parts.core.take_save()) {
                return save;
            }
            self.save.wait().await;
        }
    }

    /// Writes a row of the running configuration, and returns its bytes.
    #[inline(never)]
    pub fn stored_row(&self, row: usize, out: &mut [u8; MAX_STORED_ROW]) -> usize {
        self.with(|parts, _| parts.core.stored_row(row, out))
    }

    /// Adds a CAN bus. Its task starts it.
    pub fn add_can(&self, bus: u8, port: &'static mut (dyn CanPort + Send)) {
        self.with(|parts, _| {
            if let Some(place) = parts.can.get_mut(usize::from(bus)) {
                *place = Some(CanBus::new(bus, port));
                // What a reset has left it is to run, whether or not anything is to be sent.
                fdcan::look();
            }
        });
    }

    /// Waits until every motor that the run before has left configured has been sent a stop; not
    /// for ever.
    pub async fn first_stops_have_left(&self) {
        let end = embassy_time::Instant::now() + FIRST_STOPS;
        while self.with(|parts, _| parts.core.stops_under_way())
            && embassy_time::Instant::now() < end
        {
            Timer::after(FIRST_STOPS_POLL).await;
        }
    }

    /// The time of the gateway.
    pub fn now() -> Instant {
        Instant::from_micros(embassy_time::Instant::now().as_micros())
    }

    fn with<R>(&self, act: impl FnOnce(&mut Parts, Instant) -> R) -> R {
        // The clock is read under the guard: the core must see times in order.
        self.parts.lock(|parts| act(&mut parts.borrow_mut(), Self::now()))
    }

    /// Tells the core what happened, hands over the CAN frames that follow from it, and tells the
    /// other ports for which it has something to poll it again.
    ///
    /// Who may move and whether the e-stop is latched is stored before a frame follows from it; the
    /// history follows when nobody is in a hurry, after many trips in parts.
    #[inline(never)]
    pub fn handle(&self, event: Event<'_>) {
        self.with(|parts, now| {
            self.follow(parts, now, &event);
            self.mind_deadline(parts);
        });
    }

    #[inline(never)]
    fn follow(&self, parts: &mut Parts, now: Instant, event: &Event<'_>) {
        let changes = parts.storing(|core, store| core.handle(now, *event, store));
        self.hand_out(parts, now, changes);
        board::set_enable_output(parts.core.enable_output() && !self.is_bare);
        let mut lines = (FIRST_RS485..).take(RS485_BUSES);
        task_budget::set_first_stops(
            (0..FIRST_RS485).any(|bus| parts.core.owes_first_stop(bus)),
            lines.any(|bus| parts.core.owes_first_stop(bus)),
        );
        if changes.flight_read || parts.core.is_due() {
            self.flight.signal(());
        }
    }

    /// Tells the core one thing that the CAN controllers have done: a demand that comes meanwhile
    /// goes before the next. Where there may be more, who waits for events is told.
    #[inline(never)]
    pub fn follow_can(&self) {
        self.with(|parts, now| {
            fdcan::may_sleep();
            if let Some(event) = &parts.next_can_event() {
                fdcan::stay_awake();
                self.follow(parts, now, event);
                self.mind_deadline(parts);
            }
        });
    }

    /// Looks for error states of the CAN buses that no interrupt has told of.
    pub fn look_at_can(&self) {
        self.with(|parts, _| parts.can.iter().flatten().for_each(CanBus::look));
    }

    /// Serves the CAN buses that have changed, and tells the others. A frame that is handed over
    /// changes more; a controller has room for a few.
    fn hand_out(&self, parts: &mut Parts, now: Instant, mut changes: Changes) {
        while parts.serve_can(now, changes) {
            self.tell(changes);
            changes = parts.core.take_changes();
        }
        self.tell(changes);
    }

    /// Has the task of the deadlines come in time. A tick that comes too early finds nothing to do
    /// and costs less than to put it off.
    fn mind_deadline(&self, parts: &mut Parts) {
        if let Some(due) = parts.core.next_deadline()
            && self.tick.lock(Cell::get).is_none_or(|tick| due < tick)
        {
            self.earlier.signal(());
        }
    }

    /// Tells those who have to poll the core again. Among equals the executor takes first what was
    /// woken last.
    fn tell(&self, changes: Changes) {
        if changes.log {
            self.log.signal(());
        }
        if changes.history {
            self.history.signal(());
        }
        if changes.save {
            self.save.signal(());
        }
        if changes.restart {
            SCB::sys_reset();
        }
        for link in changes.links.into_iter().filter_map(|link| self.links.get(link)) {
            link.signal(());
        }
        let serial = changes.buses.into_iter().filter_map(|bus| bus.checked_sub(CAN_BUSES));
        for bus in serial.filter_map(|bus| self.buses.get(bus)) {
            bus.signal(());
        }
    }

    /// Stores a part of what the latest events have left to store. Returns whether that was all.
    #[inline(never)]
    fn save_some(&self) -> bool {
        self.with(|parts, _| parts.storing(|core, store| core.save_some(store)))
    }

    /// Stores all of it, says so and lets others go first between its parts. Before
    /// [`poll_host`](Self::poll_host), which would not.
    pub async fn save(&self, comes_round: impl Fn()) {
        while !self.save_some() {
            comes_round();
            yield_now().await;
        }
    }

    /// Tells a host what the flight recorder has kept.
    #[inline(never)]
    fn answer(&self, parts: &mut Parts, now: Instant, read: FlightRead) {
        let mut page = [0; MAX_FLIGHT_RECORD_BYTES];
        let result = parts.core.read(now, read, &mut page);
        self.follow(parts, now, &Event::FlightRecord { result });
        self.mind_deadline(parts);
    }

    /// Whether an RS485 bus may have a frame to send just now, or to give back.
    #[inline(never)]
    pub fn may_want(&self, bus: u8) -> bool {
        self.with(|parts, now| parts.core.may_want(now, bus))
    }

    /// Whether that would go behind a reply.
    #[inline(never)]
    pub fn awaits_reply(&self, bus: u8) -> bool {
        self.with(|parts, now| parts.core.awaits_reply(now, bus))
    }

    /// The slot of a frame that an RS485 bus is to give back.
    #[inline(never)]
    pub fn poll_cancel(&self, bus: u8) -> Option<u8> {
        self.poll(|core, now| core.poll_cancel(now, bus))
    }

    /// The next frame for an RS485 bus.
    #[inline(never)]
    pub fn poll_transmit(&self, bus: u8) -> Option<Transmit> {
        self.poll(|core, now| core.poll_transmit(now, bus))
    }

    /// Asks the core for an RS485 bus, and does what follows for the others.
    fn poll<R>(&self, ask: impl FnOnce(&mut Core, Instant) -> R) -> R {
        self.with(|parts, now| {
            let given = ask(&mut parts.core, now);
            let changes = parts.core.take_changes();
            self.hand_out(parts, now, changes);
            self.mind_deadline(parts);
            given
        })
    }

    /// The next frame for a host link: its length in `out`.
    #[inline(never)]
    pub fn poll_host(&self, link: u8, out: &mut [u8; MAX_FRAME]) -> Option<usize> {
        self.with(|parts, _| parts.storing(|core, store| core.poll_host(link, out, store)))
    }

    /// The rate of a host link on a UART.
    #[inline(never)]
    pub fn baud(&self, link: u8) -> u32 {
        self.with(|parts, _| parts.core.baud(link))
    }

    /// Whether the ROM bootloader may take the board.
    #[inline(never)]
    pub fn may_detach(&self) -> bool {
        self.with(|parts, _| parts.core.may_detach())
    }

    /// How a bus must be running.
    #[inline(never)]
    pub fn bus_setup(&self, bus: u8) -> Option<BusSetup> {
        self.with(|parts, _| parts.core.bus_setup(bus))
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
        self.with(|parts, _| parts.core.take_log())
    }

    /// What the light of the board shows.
    #[inline(never)]
    pub fn light(&self) -> Light {
        self.with(|parts, _| parts.core.light())
    }

    /// Waits until the core may have something new for an RS485 bus. For one task per bus.
    pub fn bus_changed(&self, bus: u8) -> impl Future<Output = ()> + Unpin {
        self.buses[usize::from(bus - FIRST_RS485)].wait()
    }

    /// Waits until the core may have something new for a host link. For one task per link.
    pub fn link_changed(&self, link: u8) -> impl Future<Output = ()> + Unpin {
        self.links[usize::from(link)].wait()
    }

    /// Waits until the log may have a new entry. For one task.
    pub fn log_changed(&self) -> impl Future<Output = ()> + Unpin {
        self.log.wait()
    }

    /// Waits until a part of the history may be left to store. For one task.
    pub fn history_changed(&self) -> impl Future<Output = ()> + Unpin {
        self.history.wait()
    }

    /// When the next tick is due, and that the task of the deadlines comes then. Not before
    /// `earliest`.
    pub fn next_tick(&self, earliest: Instant) -> Option<Instant> {
        let due = self.with(|parts, _| parts.core.next_deadline()).map(|due| due.max(earliest));
        self.tick.lock(|tick| tick.set(due));
        due
    }

    /// Waits until it must come earlier. For one task.
    pub fn earlier_tick(&self) -> impl Future<Output = ()> + Unpin {
        self.earlier.wait()
    }

    /// Tells the core that time has passed, where something is due.
    #[inline(never)]
    pub fn tick(&self) {
        self.with(|parts, now| {
            if parts.core.next_deadline().is_some_and(|due| due <= now) {
                self.follow(parts, now, &Event::Tick);
            }
        });
    }
}
