//! What a controller reports from its interrupt, in the order in which it happened on the bus.
//!
//! The interrupt takes frames out of the controller at once: its receive FIFO holds three frames, a third of a
//! millisecond at 1 Mbit/s. The driver's own interrupt handler counts neither frames lost in that FIFO nor those
//! dropped behind it, and does not say which frame was sent; so all of the controller's interrupts are routed to its
//! second line, which the driver leaves free.

use core::marker::PhantomData;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::can;
use embassy_stm32::interrupt::typelevel::Handler;
use embassy_stm32::pac;
use embassy_stm32::pac::can::Fdcan;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use host_protocol::CanFrame;

use super::element::{self, FRAME_WORDS};

/// Happenings waiting for the task: 1.5 ms of the shortest frames at 1 Mbit/s (47 bits each).
const DEPTH: usize = 32;
/// Places that received frames leave free, so that a report of a sent frame is never lost.
const RESERVED: usize = 4;

/// The FIFO that every frame goes to.
const FIFO: usize = 0;
/// The FIFO that stays empty.
const OTHER_FIFO: usize = 1;
/// Words of a frame's place in the message RAM: the driver lays it out for 64 bytes of data.
pub const PLACE_WORDS: usize = 18;
/// Transmit places that the driver sets up; one bit each in the registers.
pub const TRANSMIT_PLACES: usize = 3;
/// Words of an entry of the transmit event FIFO.
const EVENT_WORDS: usize = 2;
/// More entries than either FIFO holds; a bound for loops.
const MORE_THAN_A_FIFO: usize = 8;

/// Something the controller did.
#[derive(Clone, Copy)]
pub enum Happening {
    /// The frame sent with this marker was acknowledged by another node.
    Transmitted(u8),
    /// The frame of this slot was given back: it has not been sent and will not be.
    Cancelled(u8),
    /// The controller has dealt with a request to give a frame back.
    CancellationFinished,
    /// A frame arrived.
    Received(CanFrame),
    /// The error state may have changed.
    ErrorState,
}

/// The happenings of one controller.
pub struct Happenings {
    queue: Channel<CriticalSectionRawMutex, Happening, DEPTH>,
    /// Received frames lost since the last look, in the controller or here.
    lost: AtomicU32,
}

impl Happenings {
    /// None yet.
    pub const fn new() -> Self {
        Self { queue: Channel::new(), lost: AtomicU32::new(0) }
    }

    /// Forgets everything.
    pub fn clear(&self) {
        self.queue.clear();
        self.lost.store(0, Ordering::Relaxed);
    }

    /// Waits for the next happening.
    pub async fn next(&self) -> Happening {
        self.queue.receive().await
    }

    /// How many frames were lost since the last call, at least: the controller says that it lost frames, not how many.
    pub fn take_lost(&self) -> u32 {
        self.lost.swap(0, Ordering::Relaxed)
    }

    fn count_lost(&self) {
        self.lost.fetch_add(1, Ordering::Relaxed);
    }

    fn received(&self, frame: Option<CanFrame>) {
        match frame {
            Some(frame) if self.queue.free_capacity() > RESERVED => self.report(Happening::Received(frame)),
            _ => self.count_lost(),
        }
    }

    /// Adds a happening of the controller itself.
    pub(super) fn report(&self, happening: Happening) {
        // Received frames leave room, and the error state is also read every few milliseconds.
        let _ = self.queue.try_send(happening);
    }
}

/// A controller of the chip whose happenings are kept.
pub trait Instance: can::Instance {
    /// Its registers.
    fn registers() -> Fdcan;
    /// Its happenings.
    fn happenings() -> &'static Happenings;
}

/// Makes a controller of the chip an [`Instance`].
macro_rules! instance {
    ($name:ident) => {
        impl $crate::fdcan::Instance for embassy_stm32::peripherals::$name {
            fn registers() -> embassy_stm32::pac::can::Fdcan {
                embassy_stm32::pac::$name
            }
            fn happenings() -> &'static $crate::fdcan::Happenings {
                static HAPPENINGS: $crate::fdcan::Happenings = $crate::fdcan::Happenings::new();
                &HAPPENINGS
            }
        }
    };
}
pub(crate) use instance;

/// Chooses the interrupts and routes them to the second line, and with them those that the driver's start adds. Before
/// the controller is started.
pub fn route_interrupts(controller: Fdcan) {
    controller.ils().write(|w| {
        w.set_rfnl(FIFO, true);
        w.set_rfnl(OTHER_FIFO, true);
        w.set_rfll(FIFO, true);
        w.set_tcl(true);
        w.set_tefnl(true);
        w.set_tcfl(true);
        w.set_ewl(true);
        w.set_epl(true);
        w.set_bol(true);
    });
    // Every place tells when it has given its frame back.
    controller.txbcie().write(|w| (0..TRANSMIT_PLACES).for_each(|place| w.set_cf(place, true)));
    controller.ie().write(|w| {
        w.set_rfle(FIFO, true);
        w.set_tefne(true);
        w.set_tcfe(true);
        w.set_ewe(true);
        w.set_epe(true);
    });
}

/// Takes back what the driver's start added and nobody reads: the event FIFO reports sent frames.
pub fn drop_needless_interrupts(controller: Fdcan) {
    controller.ie().modify(|w| {
        w.set_rfne(OTHER_FIFO, false);
        w.set_tce(false);
    });
}

/// Serves the second interrupt line of a controller.
pub struct InterruptHandler<T: Instance> {
    controller: PhantomData<T>,
}

impl<T: Instance> Handler<T::IT1Interrupt> for InterruptHandler<T> {
    unsafe fn on_interrupt() {
        let controller = T::registers();
        let happenings = T::happenings();
        let flags = controller.ir().read();
        // Cleared before the FIFOs are emptied, so that what arrives meanwhile raises the line again.
        controller.ir().write_value(flags);

        if flags.rfl(FIFO) {
            happenings.count_lost();
        }
        // A reply comes after the request that it answers.
        take_transmitted(controller, happenings);
        take_received(controller, happenings);
        if flags.tcf() {
            happenings.report(Happening::CancellationFinished);
        }
        if flags.bo() || flags.ep() || flags.ew() {
            happenings.report(Happening::ErrorState);
        }
    }
}

fn take_transmitted(controller: Fdcan, happenings: &Happenings) {
    let start = usize::from(controller.txefc().read().efsa());
    for _ in 0..MORE_THAN_A_FIFO {
        let status = controller.txefs().read();
        if status.effl() == 0 {
            break;
        }
        let entry = start + usize::from(status.efgi()) * EVENT_WORDS;
        let marker = element::event_marker(pac::FDCANRAM.ram(entry + 1).read());
        controller.txefa().write(|w| w.set_efai(status.efgi()));
        happenings.report(Happening::Transmitted(marker));
    }
}

fn take_received(controller: Fdcan, happenings: &Happenings) {
    let start = usize::from(controller.rxfc(FIFO).read().fsa());
    for _ in 0..MORE_THAN_A_FIFO {
        let status = controller.rxfs(FIFO).read();
        if status.ffl() == 0 {
            break;
        }
        let place = start + usize::from(status.fgi()) * PLACE_WORDS;
        let words: [u32; FRAME_WORDS] = core::array::from_fn(|word| pac::FDCANRAM.ram(place + word).read());
        controller.rxfa(FIFO).write(|w| w.set_fai(status.fgi()));
        happenings.received(element::received(words));
    }
}
