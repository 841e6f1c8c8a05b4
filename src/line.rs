//! What a serial line reports beside the driver: a delimiter arrived, the last bit left.
//!
//! The driver's receiver wakes on an idle line or a half-full ring, so a stop in the middle of a stream would wait for
//! the bytes behind it. Its `flush` may never return, because its receiver clears the flag that `flush` waits for. And after a
//! line error it starts its ring anew without forgetting where it was: old bytes would be received again, and new ones not.
//! So errors are taken from it; the reception goes on, and a damaged byte fails its frame's checksum.

use core::marker::PhantomData;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::interrupt::typelevel::Handler;
use embassy_stm32::mode::Async;
use embassy_stm32::pac::usart::Usart;
use embassy_stm32::usart::{self, RingBufferedUartRx, UartTx};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, TimeoutError, with_timeout};

/// Bits of a byte on the line: start, 8 data, stop.
const BITS_PER_BYTE: u64 = 10;
/// Bits that the driver-enable may add: its lead and its tail.
const DRIVER_ENABLE_BITS: u64 = 4;
/// What a transmission may take longer than its bits before it counts as hung.
const MARGIN: Duration = Duration::from_millis(2);

/// What happened on one line.
pub struct LineEvents {
    delimiter: Signal<CriticalSectionRawMutex, ()>,
    sent: Signal<CriticalSectionRawMutex, ()>,
    /// Framing, noise and overrun errors since the last look.
    errors: AtomicU32,
}

impl LineEvents {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self { delimiter: Signal::new(), sent: Signal::new(), errors: AtomicU32::new(0) }
    }

    /// How often the line was wrong since the last call.
    pub fn take_errors(&self) -> u32 {
        self.errors.swap(0, Ordering::Relaxed)
    }

    /// Waits for the byte 0x00, or for an error. For one task per line.
    pub async fn delimiter(&self) {
        self.delimiter.wait().await;
    }
}

/// The errors of a line, as a log should tell of them.
#[derive(Default)]
pub struct LineErrors {
    count: u32,
}

impl LineErrors {
    /// Adds new ones. Returns how many there have been where that is worth a line: at the first, and whenever there are twice
    /// as many. A line that only makes noise must not fill the log.
    pub fn add(&mut self, new: u32) -> Option<u32> {
        let before = self.count;
        self.count = before.saturating_add(new);
        (self.count.checked_ilog2() != before.checked_ilog2()).then_some(self.count)
    }
}

/// A USART of the chip whose line events are kept.
pub trait Instance: usart::Instance {
    /// Its registers.
    fn registers() -> Usart;
    /// Its events.
    fn events() -> &'static LineEvents;
}

/// Makes a USART of the chip an [`Instance`].
macro_rules! instance {
    ($name:ident) => {
        impl $crate::line::Instance for embassy_stm32::peripherals::$name {
            fn registers() -> embassy_stm32::pac::usart::Usart {
                // Safety: the block of this peripheral; a low-power one has the registers that are used here at the same places.
                unsafe { embassy_stm32::pac::usart::Usart::from_ptr(embassy_stm32::pac::$name.as_ptr()) }
            }
            fn events() -> &'static $crate::line::LineEvents {
                static EVENTS: $crate::line::LineEvents = $crate::line::LineEvents::new();
                &EVENTS
            }
        }
    };
}
pub(crate) use instance;

/// Serves the interrupt of a USART. To be bound before the driver's handler, which clears flags of others.
pub struct InterruptHandler<T: Instance> {
    usart: PhantomData<T>,
}

impl<T: Instance> Handler<T::Interrupt> for InterruptHandler<T> {
    unsafe fn on_interrupt() {
        let usart = T::registers();
        let flags = usart.isr().read();
        let enabled = usart.cr1().read();
        if flags.cmf() && enabled.cmie() {
            usart.icr().write(|w| w.set_cmf(true));
            T::events().delimiter.signal(());
        }
        if flags.fe() || flags.ne() || flags.ore() {
            usart.icr().write(|w| {
                w.set_fe(true);
                w.set_ne(true);
                w.set_ore(true);
            });
            T::events().errors.fetch_add(1, Ordering::Relaxed);
            // A damaged byte alone may wake nobody.
            T::events().delimiter.signal(());
        }
        if flags.tc() && enabled.tcie() {
            usart.cr1().modify(|w| w.set_tcie(false));
            T::events().sent.signal(());
        }
    }
}

/// The receiving half of a line.
pub struct Receiver {
    /// The driver.
    pub bytes: RingBufferedUartRx<'static>,
    /// What else happens on the line.
    pub events: &'static LineEvents,
}

impl Receiver {
    /// A receiver that also reports each byte 0x00.
    pub fn with_delimiters<T: Instance>(bytes: RingBufferedUartRx<'static>) -> Self {
        // The character to match is the reset value of CR2.ADD, 0x00: the delimiter of the host protocol.
        T::registers().cr1().modify(|w| w.set_cmie(true));
        Self { bytes, events: T::events() }
    }

    /// A receiver alone.
    pub fn new<T: Instance>(bytes: RingBufferedUartRx<'static>) -> Self {
        Self { bytes, events: T::events() }
    }
}

/// The sending half of a line.
pub struct Sender {
    driver: UartTx<'static, Async>,
    registers: Usart,
    events: &'static LineEvents,
    bits_per_second: u32,
}

impl Sender {
    /// Of a USART that was set up with this bitrate.
    pub fn new<T: Instance>(driver: UartTx<'static, Async>, bits_per_second: u32) -> Self {
        Self { driver, registers: T::registers(), events: T::events(), bits_per_second }
    }

    /// Changes the bitrate of the line, for the receiver too.
    pub fn set_bits_per_second(&mut self, bits_per_second: u32) -> Result<(), usart::ConfigError> {
        self.driver.set_baudrate(bits_per_second)?;
        self.bits_per_second = bits_per_second;
        Ok(())
    }

    /// Of so many bits, rounded up.
    fn duration(&self, bits: u64) -> Duration {
        Duration::from_micros((bits * 1_000_000).div_ceil(u64::from(self.bits_per_second.max(1))))
    }

    /// Sends, and returns when the last stop bit has left.
    pub async fn send(&mut self, bytes: &[u8]) -> Result<(), TimeoutError> {
        let bits = BITS_PER_BYTE * bytes.len() as u64 + DRIVER_ENABLE_BITS;
        with_timeout(self.duration(bits) + MARGIN, async {
            self.registers.icr().write(|w| w.set_tc(true));
            self.events.sent.reset();
            self.registers.cr1().modify(|w| w.set_tcie(true));
            // The result is always Ok: this driver's write reports nothing.
            let _ = self.driver.write(bytes).await;
            // Two bytes are left. Where the driver's receiver has cleared the flag just as it rose, no event comes: then
            // their time tells.
            let rest = self.duration(2 * BITS_PER_BYTE + DRIVER_ENABLE_BITS);
            let _ = with_timeout(rest, self.events.sent.wait()).await;
        })
        .await
    }
}
