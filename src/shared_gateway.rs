//! The core, shared by the tasks, and the signals that tell each port to look at it again.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::signal::Signal;
use gateway::{Board, BusSetup, Event, Gateway, Instant, MAX_BUSES, MAX_LINKS, Transmit};
use host_protocol::MAX_FRAME;
use static_cell::StaticCell;

/// Every task runs in thread mode, so the core is guarded without masking interrupts: the controllers' receive
/// queues are filled even while the core works.
type Guard = ThreadModeRawMutex;

/// "The core has changed: poll again."
type Changed = Signal<Guard, ()>;

/// The one gateway of the board. What reaches into the core is never inlined: several tasks call it, and the core's
/// code would be in the image as often.
pub struct SharedGateway {
    core: Mutex<Guard, RefCell<Gateway>>,
    buses: [Changed; MAX_BUSES],
    links: [Changed; MAX_LINKS],
    deadline: Changed,
}

impl SharedGateway {
    /// Puts the gateway of this board in its place; once.
    #[inline(never)]
    pub fn place(board: Board) -> &'static Self {
        static BOARD: StaticCell<Board> = StaticCell::new();
        static SHARED: StaticCell<SharedGateway> = StaticCell::new();
        let board = BOARD.init(board);
        let shared = SHARED.init_with(|| Self {
            core: Mutex::new(RefCell::new(Gateway::unequipped(board))),
            buses: [const { Signal::new() }; MAX_BUSES],
            links: [const { Signal::new() }; MAX_LINKS],
            deadline: Signal::new(),
        });
        shared.with(|core, _| core.equip());
        shared
    }

    /// The time of the gateway.
    pub fn now() -> Instant {
        Instant::from_micros(embassy_time::Instant::now().as_micros())
    }

    fn with<R>(&self, act: impl FnOnce(&mut Gateway, Instant) -> R) -> R {
        // The clock is read under the guard: the core must see times in order.
        self.core.lock(|core| act(&mut core.borrow_mut(), Self::now()))
    }

    /// Tells the core what happened, and every port to poll it again.
    pub fn handle(&self, event: Event<'_>) {
        self.with(|core, now| core.handle(now, event));
        self.buses.iter().chain(&self.links).for_each(|changed| changed.signal(()));
        self.deadline.signal(());
    }

    /// The next frame for a bus.
    #[inline(never)]
    pub fn poll_transmit(&self, bus: u8) -> Option<Transmit> {
        let transmit = self.with(|core, now| core.poll_transmit(now, bus));
        if transmit.is_some() {
            // A frame on its way opens a reply window.
            self.deadline.signal(());
        }
        transmit
    }

    /// The slot of a frame that the controller of a bus should give back.
    #[inline(never)]
    pub fn poll_cancel(&self, bus: u8) -> Option<u8> {
        let slot = self.with(|core, now| core.poll_cancel(now, bus));
        if slot.is_some() {
            // The controller must report in time.
            self.deadline.signal(());
        }
        slot
    }

    /// The next frame for a host link: its length in `out`.
    #[inline(never)]
    pub fn poll_host(&self, link: u8, out: &mut [u8; MAX_FRAME]) -> Option<usize> {
        self.with(|core, _| core.poll_host(link, out))
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

    /// Waits until a bus must run otherwise than `current`.
    pub async fn other_bus_setup(&self, bus: u8, current: Option<BusSetup>) -> Option<BusSetup> {
        loop {
            let setup = self.bus_setup(bus);
            if setup != current {
                return setup;
            }
            self.bus_changed(bus).await;
        }
    }

    /// When the core wants to be told of the time.
    #[inline(never)]
    pub fn next_deadline(&self) -> Option<Instant> {
        self.with(|core, _| core.next_deadline())
    }

    /// Waits until the core may have something new for a bus. For one task per bus.
    pub async fn bus_changed(&self, bus: u8) {
        self.buses[usize::from(bus)].wait().await;
    }

    /// Waits until the core may have something new for a host link. For one task per link.
    pub async fn link_changed(&self, link: u8) {
        self.links[usize::from(link)].wait().await;
    }

    /// Waits until the next deadline may have changed. For one task.
    pub async fn deadline_changed(&self) {
        self.deadline.wait().await;
    }
}
