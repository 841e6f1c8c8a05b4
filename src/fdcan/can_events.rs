//! What a controller reports from its interrupt, in the order in which it happened on the bus.
//!
//! The interrupt takes frames out of the controller at once: its receive FIFO holds three frames, a
//! third of a millisecond at 1 Mbit/s. The driver's own interrupt handler counts neither frames
//! lost in that FIFO nor those dropped behind it, and does not say which frame was sent; so all of
//! the controller's interrupts are routed to its second line, which the driver leaves free.

use core::cell::RefCell;
use core::future::poll_fn;
use core::marker::PhantomData;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, compiler_fence};
use core::task::Poll;

use embassy_stm32::can;
use embassy_stm32::interrupt::typelevel::Handler;
use embassy_stm32::pac::can::Fdcan;
use embassy_stm32::pac::can::regs::{Ir, Txbcie};
use embassy_sync::blocking_mutex::CriticalSectionMutex;
use embassy_sync::waitqueue::AtomicWaker;
use gateway::port::TRANSMIT_SLOTS;
use heapless::Deque;

use super::element::{self, FRAME_WORDS};
use super::message_ram::{MessageRam, TRANSMIT_PLACES};

/// Events waiting for the task: 1.5 ms of the shortest frames at 1 Mbit/s (47 bits each).
const DEPTH: usize = 32;
/// Places that received frames leave free, so that a report of a sent frame is never lost.
const RESERVED: usize = 4;
const _: () = assert!(TRANSMIT_SLOTS < RESERVED);

/// The FIFO that every frame goes to.
pub const FIFO: usize = 0;
/// The FIFO that stays empty.
pub const OTHER_FIFO: usize = 1;
/// More entries than either FIFO holds; a bound for loops.
const MORE_THAN_A_FIFO: usize = 8;

/// Something that a controller did with a frame. Whole words: copied with no byte by itself.
#[derive(Clone, Copy)]
#[repr(u32)]
pub enum CanEvent {
    /// The frame sent with this marker was acknowledged by another node.
    Transmitted(u8),
    /// The frame of this slot was cancelled: it has not been sent and will not be.
    Cancelled(u8),
    /// A frame arrived, as it [lay](element::received) in the message RAM.
    Received([u32; FRAME_WORDS]),
}

/// The task that looks for events looks, or has been woken to: it need not be woken for another.
static AWAKE: AtomicBool = AtomicBool::new(false);
static TASK: AtomicWaker = AtomicWaker::new();

/// Waits until one of the controllers may have an event. For one task, which says before each look
/// that it [may sleep](may_sleep) if it finds nothing.
pub fn waiting() -> impl Future<Output = ()> + Unpin {
    poll_fn(|context| {
        if !AWAKE.load(Ordering::Relaxed) {
            TASK.register(context.waker());
            // An event may have come meanwhile.
            if !AWAKE.load(Ordering::Relaxed) {
                return Poll::Pending;
            }
        }
        Poll::Ready(())
    })
}

/// Has the task of [`waiting`] look.
pub fn look() {
    if !AWAKE.load(Ordering::Relaxed) {
        stay_awake();
        TASK.wake();
    }
}

/// The look that follows may be the last one: what comes from now on wakes the task.
pub fn may_sleep() {
    AWAKE.store(false, Ordering::Relaxed);
    before_the_look();
}

/// No part of a look comes before what precedes it: an interrupt between the two would go unseen.
fn before_the_look() {
    compiler_fence(Ordering::SeqCst);
}

/// The task looks once more, without being woken.
pub fn stay_awake() {
    AWAKE.store(true, Ordering::Relaxed);
}

/// The events of one controller.
pub struct CanEvents {
    queue: CriticalSectionMutex<RefCell<Deque<CanEvent, DEPTH>>>,
    /// There may be something: what is set below, or in the queue.
    any: AtomicBool,
    /// Set however often they come: they take no place from a frame.
    cancellation_finished: AtomicBool,
    error_state: AtomicBool,
    /// Received frames lost since the last look, in the controller or here.
    lost: AtomicU32,
}

impl CanEvents {
    /// None yet.
    pub const fn new() -> Self {
        Self {
            queue: CriticalSectionMutex::new(RefCell::new(Deque::new())),
            any: AtomicBool::new(false),
            cancellation_finished: AtomicBool::new(false),
            error_state: AtomicBool::new(false),
            lost: AtomicU32::new(0),
        }
    }

    /// Forgets everything.
    pub fn clear(&self) {
        self.queue.lock(|queue| queue.borrow_mut().clear());
        self.cancellation_finished.store(false, Ordering::Relaxed);
        self.error_state.store(false, Ordering::Relaxed);
        self.lost.store(0, Ordering::Relaxed);
    }

    /// Whether there may be something. Who asks looks at everything then, and
    /// [says so](Self::may_have_more) where it finds something: there may be more.
    pub fn take_any(&self) -> bool {
        let any = take(&self.any);
        before_the_look();
        any
    }

    /// There may be more than what was found.
    pub fn may_have_more(&self) {
        self.any.store(true, Ordering::Relaxed);
    }

    fn tell(&self) {
        self.may_have_more();
        look();
    }

    /// The next event.
    pub fn take(&self) -> Option<CanEvent> {
        self.queue.lock(|queue| queue.borrow_mut().pop_front())
    }

    /// Whether the controller has dealt with a request to cancel a frame since the last call.
    pub fn take_cancellation_finished(&self) -> bool {
        take(&self.cancellation_finished)
    }

    /// Whether the error state may have changed since the last call.
    pub fn take_error_state(&self) -> bool {
        take(&self.error_state)
    }

    /// How many frames were lost since the last call, at least: the controller says that it lost
    /// frames, not how many.
    pub fn take_lost(&self) -> u32 {
        match self.lost.load(Ordering::Relaxed) {
            0 => 0,
            _ => self.lost.swap(0, Ordering::Relaxed),
        }
    }

    fn count_lost(&self) {
        self.lost.fetch_add(1, Ordering::Relaxed);
        self.may_have_more();
    }

    fn received(&self, frame: [u32; FRAME_WORDS]) {
        if !self.add(CanEvent::Received(frame), RESERVED) {
            self.count_lost();
        }
    }

    /// Adds an event. Received frames leave room for what becomes of ours: as many as there are
    /// slots, and one that waits.
    pub(super) fn report(&self, event: CanEvent) {
        self.add(event, 0);
    }

    /// Adds an event if so many places stay free. Returns whether it has.
    fn add(&self, event: CanEvent, reserved: usize) -> bool {
        let has_room = self.queue.lock(|queue| {
            let mut queue = queue.borrow_mut();
            queue.len() + reserved < DEPTH && queue.push_back(event).is_ok()
        });
        if has_room {
            self.tell();
        }
        has_room
    }

    /// A request to cancel a frame has been dealt with.
    pub(super) fn report_cancellation(&self) {
        self.cancellation_finished.store(true, Ordering::Relaxed);
        self.tell();
    }

    /// The error state may have changed.
    pub fn report_error_state(&self) {
        self.error_state.store(true, Ordering::Relaxed);
        self.tell();
    }
}

/// Takes a flag that an interrupt sets.
fn take(flag: &AtomicBool) -> bool {
    flag.load(Ordering::Relaxed) && flag.swap(false, Ordering::Relaxed)
}

/// A controller of the chip whose events are kept.
pub trait Instance: can::Instance {
    /// Its registers.
    fn registers() -> Fdcan;
    /// Its part of the message RAM.
    fn message_ram() -> MessageRam;
    /// Routes every interrupt that [`route_interrupts`] chooses to the second line: how they are
    /// grouped is the chip's.
    fn route_to_second_line();
    /// Its events.
    fn events() -> &'static CanEvents;
}

/// Makes a controller of the chip an [`Instance`]: its name, where its part of the message RAM
/// begins (a block of the chip, and bytes into it), and the function that sets the line of each
/// interrupt.
macro_rules! instance {
    ($name:ident, $ram:ident + $offset:literal, $second_line:path) => {
        impl $crate::fdcan::Instance for embassy_stm32::peripherals::$name {
            fn registers() -> embassy_stm32::pac::can::Fdcan {
                embassy_stm32::pac::$name
            }
            fn message_ram() -> $crate::fdcan::MessageRam {
                // Safety: the block of this controller, as the manual of the chip and the driver
                // have it.
                unsafe {
                    $crate::fdcan::MessageRam::new(
                        embassy_stm32::pac::$ram.as_ptr().byte_add($offset).cast(),
                    )
                }
            }
            fn route_to_second_line() {
                embassy_stm32::pac::$name.ils().write($second_line);
            }
            fn events() -> &'static $crate::fdcan::CanEvents {
                static EVENTS: $crate::fdcan::CanEvents = $crate::fdcan::CanEvents::new();
                &EVENTS
            }
        }
    };
}
pub(crate) use instance;

/// Chooses the interrupts and routes them to the second line, and with them those that the driver's
/// start adds. Before the controller is started.
pub fn route_interrupts<T: Instance>() {
    T::route_to_second_line();
    let controller = T::registers();
    // What the controller told before a restart is over.
    controller.ir().write_value(Ir(u32::MAX));
    // Every place tells when it has given its frame back.
    controller.txbcie().write_value(Txbcie((1 << TRANSMIT_PLACES) - 1));
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
        let events = T::events();
        let flags = controller.ir().read();
        // Cleared before the FIFOs are emptied, so that what arrives meanwhile raises the line
        // again.
        controller.ir().write_value(flags);

        if flags.rfl(FIFO) {
            events.count_lost();
        }
        // A reply comes after the request that it answers.
        take_transmitted::<T>();
        take_received::<T>();
        if flags.tcf() {
            events.report_cancellation();
        }
        if flags.bo() || flags.ep() || flags.ew() {
            events.report_error_state();
        }
    }
}

fn take_transmitted<T: Instance>() {
    let controller = T::registers();
    for _ in 0..MORE_THAN_A_FIFO {
        let status = controller.txefs().read();
        if status.effl() == 0 {
            break;
        }
        let marker = element::event_marker(T::message_ram().event(usize::from(status.efgi())));
        controller.txefa().write(|w| w.set_efai(status.efgi()));
        T::events().report(CanEvent::Transmitted(marker));
    }
}

fn take_received<T: Instance>() {
    let controller = T::registers();
    for _ in 0..MORE_THAN_A_FIFO {
        let status = controller.rxfs(FIFO).read();
        if status.ffl() == 0 {
            break;
        }
        let words = T::message_ram().received(usize::from(status.fgi()));
        controller.rxfa(FIFO).write(|w| w.set_fai(status.fgi()));
        T::events().received(words);
    }
}
