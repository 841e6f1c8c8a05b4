//! What a serial line reports beside the driver: bytes arrived, the last bit left.
//!
//! The driver's receiver stays out of it. It wakes on an idle line or a half-full ring, so a stop
//! in the middle of a stream would wait for the bytes behind it. After a ring that overflowed or a
//! line error it stops the reception, answers with the next error for as long as bytes keep coming,
//! and starts its ring anew without forgetting where it was: old bytes would be received again, and
//! new ones not. Here DMA fills a ring round and round and is never stopped; who was too slow goes
//! on with the next byte that comes. And the driver's `flush` may never return.

mod ring;

pub use ring::Overflow;

use core::future::poll_fn;
use core::marker::PhantomData;
use core::mem;
use core::pin::pin;
use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering};
use core::task::Poll;

use embassy_futures::yield_now;
use embassy_stm32::dma::{ChannelInstance, Transfer, TransferOptions};
use embassy_stm32::interrupt::typelevel::Handler;
use embassy_stm32::mode::Async;
use embassy_stm32::pac::usart::Usart;
use embassy_stm32::usart::{self, UartRx, UartTx};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, TimeoutError, Timer, block_for, with_timeout};
use host_protocol::DELIMITER;

use crate::dma_memory::Buffer;
use ring::Ring;

/// Bits of a byte on the line: start, 8 data, stop.
const BITS_PER_BYTE: u64 = 10;
/// Bits that the driver-enable may add: its lead and its tail.
const DRIVER_ENABLE_BITS: u64 = 4;
/// A byte that is arriving is waited for, and the one behind it.
const ARRIVING_BYTES: usize = 2;
/// Of delimiters without anything between them one in so many is looked at.
const DELIMITERS_AT_ONCE: u16 = 16;
/// A pause that is over before a timer would have been set.
const SHORT: Duration = Duration::from_micros(10);
/// What a transmission may take longer than its bits before it counts as hung.
const MARGIN: Duration = Duration::from_millis(2);

/// What happened on one line.
pub struct LineEvents {
    arrived: Signal<CriticalSectionRawMutex, ()>,
    sent: Signal<CriticalSectionRawMutex, ()>,
    /// Framing, noise and overrun errors since the last look.
    errors: AtomicU32,
    /// Bytes taken from the ring since the start, modulo 2³².
    heard: AtomicU32,
    /// Rounds of the ring that DMA has completed, modulo 2³².
    rounds: AtomicU32,
    /// How much of the round was left at the last delimiter.
    delimiter_at: AtomicU16,
    /// The ring is to be set up anew.
    restart: AtomicBool,
    /// How much of the round was left when the line became idle; [`NEVER_IDLE`] where it has not
    /// since bytes were taken.
    idle_at: AtomicU32,
    /// When it did, µs modulo 2³².
    idle_us: AtomicU32,
}

/// More than a round has.
const NEVER_IDLE: u32 = u32::MAX;

impl LineEvents {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self {
            arrived: Signal::new(),
            sent: Signal::new(),
            errors: AtomicU32::new(0),
            heard: AtomicU32::new(0),
            rounds: AtomicU32::new(0),
            delimiter_at: AtomicU16::new(0),
            restart: AtomicBool::new(false),
            idle_at: AtomicU32::new(NEVER_IDLE),
            idle_us: AtomicU32::new(0),
        }
    }

    /// How often the line was wrong since the last call.
    pub fn take_errors(&self) -> u32 {
        self.errors.swap(0, Ordering::Relaxed)
    }

    /// How many bytes have been taken from the ring, modulo 2³².
    pub fn heard(&self) -> u32 {
        self.heard.load(Ordering::Relaxed)
    }

    /// What was sent last has left, and nobody has waited for that yet.
    pub fn has_sent(&self) -> bool {
        self.sent.signaled()
    }

    /// Whether a delimiter is to be looked at: not where it comes right behind the one before, as
    /// it begins a frame and says nothing. Where DMA is late it counts as the end of one; and of a
    /// stream of them some are looked at, so that a stop behind it finds few. `remaining`: of the
    /// round.
    fn says_something(&self, remaining: u16) -> bool {
        let before = self.delimiter_at.load(Ordering::Relaxed);
        self.delimiter_at.store(remaining, Ordering::Relaxed);
        before != remaining.wrapping_add(1) || remaining.is_multiple_of(DELIMITERS_AT_ONCE)
    }

    /// Asks for a ring that is set up anew.
    pub fn ask_for_restart(&self) {
        self.restart.store(true, Ordering::Relaxed);
        self.arrived.signal(());
    }
}

/// The time, µs modulo 2³².
fn now_us() -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "modulo 2³²")]
    let low = Instant::now().as_micros() as u32;
    low
}

/// The errors of a line, as a log should tell of them.
#[derive(Default)]
pub struct LineErrors {
    count: u32,
}

impl LineErrors {
    /// Adds new ones. Returns how many there have been where that is worth a line: at the first,
    /// and whenever there are twice as many. A line that only makes noise must not fill the
    /// log.
    pub fn add(&mut self, new: u32) -> Option<u32> {
        let before = self.count;
        self.count = before.saturating_add(new);
        (self.count.checked_ilog2() != before.checked_ilog2()).then_some(self.count)
    }
}

/// A USART of the chip that is served here.
pub trait Instance: usart::Instance {
    /// Its registers.
    fn registers() -> Usart;
    /// Its events.
    fn events() -> &'static LineEvents;
    /// The DMA stream of its receiver.
    type Stream: ChannelInstance;
    /// Whether the stream has completed a round of its ring, and its interrupt has not been served.
    fn has_completed_round() -> bool;
    /// How many bytes of its round the stream has still to fill.
    fn remaining() -> u16;
    /// Has the stream fill this memory. What it did before is over.
    ///
    /// # Safety
    ///
    /// One transfer at a time.
    unsafe fn fill(memory: *mut [u8], options: TransferOptions) -> Transfer<'static>;
}

/// Makes a USART of the chip an [`Instance`]: its name, that of its receiver's DMA stream, what binds
/// their interrupts, and the stream's registers, flags and number among these.
macro_rules! instance {
    ($name:ident, $stream:ident, $irqs:expr, $registers:expr, $flags:expr, $number:expr) => {
        impl $crate::line::Instance for embassy_stm32::peripherals::$name {
            type Stream = embassy_stm32::peripherals::$stream;

            fn has_completed_round() -> bool {
                let flags = $flags.read();
                // The driver serves the first half first, and is called again.
                flags.tcif($number) && !flags.htif($number)
            }

            fn remaining() -> u16 {
                $registers.ndtr().read().ndt()
            }

            fn registers() -> embassy_stm32::pac::usart::Usart {
                // Safety: the block of this peripheral; a low-power one has the registers that are
                // used here at the same places.
                unsafe {
                    embassy_stm32::pac::usart::Usart::from_ptr(embassy_stm32::pac::$name.as_ptr())
                }
            }
            fn events() -> &'static $crate::line::LineEvents {
                static EVENTS: $crate::line::LineEvents = $crate::line::LineEvents::new();
                &EVENTS
            }

            unsafe fn fill(
                memory: *mut [u8],
                options: embassy_stm32::dma::TransferOptions,
            ) -> embassy_stm32::dma::Transfer<'static> {
                use embassy_stm32::peripherals;
                use embassy_stm32::usart::RxDma;
                // Safety: the driver's receiver, which was given the stream, is never used.
                let stream = unsafe { peripherals::$stream::steal() };
                let request = RxDma::<peripherals::$name>::request(&*stream);
                let mut channel = embassy_stm32::dma::Channel::new(stream, $irqs);
                let data = <Self as $crate::line::Instance>::registers().rdr().as_ptr().cast();
                // Safety: the caller's; the register is read a byte at a time, and the channel is
                // only a number, which the transfer takes with it.
                unsafe {
                    core::mem::transmute::<
                        embassy_stm32::dma::Transfer<'_>,
                        embassy_stm32::dma::Transfer<'static>,
                    >(channel.read_raw::<u8, u8>(request, data, memory, options))
                }
            }
        }
    };
}
pub(crate) use instance;

/// Serves the interrupt of a USART, in place of the driver's handler, which stops the reception at
/// an error.
pub struct InterruptHandler<T: Instance> {
    usart: PhantomData<T>,
}

impl<T: Instance> Handler<T::Interrupt> for InterruptHandler<T> {
    unsafe fn on_interrupt() {
        let usart = T::registers();
        let flags = usart.isr().read();
        let enabled = usart.cr1().read();
        let has_matched = flags.cmf() && enabled.cmie();
        let is_idle = flags.idle() && enabled.idleie();
        if has_matched || is_idle {
            usart.icr().write(|w| {
                w.set_cmf(flags.cmf());
                w.set_idle(flags.idle());
            });
            if is_idle {
                T::events().idle_us.store(now_us(), Ordering::Relaxed);
                T::events().idle_at.store(T::remaining().into(), Ordering::Relaxed);
            }
            if is_idle || T::events().says_something(T::remaining()) {
                T::events().arrived.signal(());
            }
        }
        if flags.fe() || flags.ne() || flags.ore() {
            usart.icr().write(|w| {
                w.set_fe(true);
                w.set_ne(true);
                w.set_ore(true);
            });
            T::events().errors.fetch_add(1, Ordering::Relaxed);
            T::events().arrived.signal(());
        }
        if flags.tc() && enabled.tcie() {
            usart.cr1().modify(|w| w.set_tcie(false));
            T::events().sent.signal(());
        }
    }
}

/// Counts the rounds of the ring in the interrupt of a line's DMA stream, and has what has come
/// looked at. It comes before the driver's handler, which clears the flags.
pub struct RingInterruptHandler<T: Instance> {
    usart: PhantomData<T>,
}

impl<T: Instance> Handler<<T::Stream as ChannelInstance>::Interrupt> for RingInterruptHandler<T> {
    unsafe fn on_interrupt() {
        if T::has_completed_round() {
            T::events().rounds.fetch_add(1, Ordering::Release);
        }
        T::events().arrived.signal(());
    }
}

/// The receiving half of a line.
pub struct Receiver {
    ring: Ring,
    registers: Usart,
    /// What ends what is to be read.
    ends: Ends,
    /// The ring may hold more of what wants to be read.
    has_more: bool,
    /// What was read last ends inside a frame.
    is_inside: bool,
    /// The line has been idle for a byte's time behind what was read last.
    pub was_idle: bool,
    /// What else happens on the line.
    pub events: &'static LineEvents,
}

/// What ends the bytes that want to be read together.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ends {
    /// The line is idle.
    Idle,
    /// [`DELIMITER`]: what comes before it says nothing yet.
    Delimiter,
}

impl Receiver {
    /// Starts a receiver of frames that end with the byte 0x00.
    pub fn with_delimiters<T: Instance>(driver: UartRx<'static, Async>, memory: Buffer) -> Self {
        // The character to match is the reset value of CR2.ADD, 0x00: the delimiter of the host
        // protocol.
        T::registers().cr1().modify(|w| w.set_cmie(true));
        Self::start::<T>(driver, memory, Ends::Delimiter)
    }

    /// Starts a receiver of what comes between two idle times of the line.
    pub fn new<T: Instance>(driver: UartRx<'static, Async>, memory: Buffer) -> Self {
        T::registers().cr1().modify(|w| w.set_idleie(true));
        Self::start::<T>(driver, memory, Ends::Idle)
    }

    fn start<T: Instance>(driver: UartRx<'static, Async>, memory: Buffer, ends: Ends) -> Self {
        // It holds the pin and the clock; both are in use from now on.
        mem::forget(driver);
        let registers = T::registers();
        // Safety: the only ring of this line.
        let ring = unsafe { Ring::start(memory, T::fill, T::remaining, &T::events().rounds) };
        registers.cr3().modify(|w| {
            w.set_eie(true);
            w.set_dmar(true);
        });
        // A byte that came before asks for no transfer, and each behind it would be one late.
        registers.rqr().write(|w| w.set_rxfrq(true));
        Self {
            ring,
            registers,
            ends,
            has_more: false,
            is_inside: false,
            was_idle: false,
            events: T::events(),
        }
    }

    /// Takes what has come, as much as fits; nothing if nothing has.
    fn take(&mut self, bytes: &mut [u8]) -> Result<usize, Overflow> {
        if self.events.restart.swap(false, Ordering::Relaxed) {
            self.registers.rqr().write(|w| w.set_rxfrq(true));
            self.ring.restart();
            self.events.delimiter_at.store(0, Ordering::Relaxed);
        }
        let idle_at = self.events.idle_at.swap(NEVER_IDLE, Ordering::Relaxed);
        let length = self.ring.take(bytes)?;
        self.was_idle = self.ring.is_empty() && u32::from(self.ring.remaining()) == idle_at;
        self.events.heard.fetch_add(u32::try_from(length).unwrap_or(u32::MAX), Ordering::Relaxed);
        Ok(length)
    }

    /// Waits for bytes, until those that have come want to be read, and takes as much as fits;
    /// nothing where there was only an error. Bears being dropped. What wakes is an event of the
    /// line, or that DMA has filled half of the ring. When its task is woken by another one's
    /// event, it looks too, unless more is just coming: what has come decides what may go.
    pub fn read(
        &mut self,
        bytes: &mut [u8],
    ) -> impl Future<Output = Result<usize, Overflow>> + Unpin {
        let mut looks = mem::take(&mut self.has_more) || self.ends == Ends::Idle;
        poll_fn(move |context| {
            let arrived = self.events.arrived.wait();
            // Taken back first: what comes behind what is read is told anew.
            let has_arrived = pin!(arrived).poll(context).is_ready();
            if !has_arrived
                && (!mem::replace(&mut looks, true) || self.goes_on() || self.ring.is_empty())
            {
                return Poll::Pending;
            }
            let result = self.take(bytes);
            if let Ok(length @ 1..) = result {
                self.has_more = length == bytes.len();
                self.wake_when_idle(bytes.get(length - 1) != Some(&DELIMITER));
            }
            Poll::Ready(result)
        })
    }

    /// A byte is just arriving of what ends with an idle line: that wakes when it is over.
    fn goes_on(&self) -> bool {
        self.ends == Ends::Idle && self.registers.isr().read().busy()
    }

    /// Where frames end with a delimiter, that wakes; behind the begin of one so does an idle line,
    /// as DMA may be later than the interrupt.
    fn wake_when_idle(&mut self, is_inside: bool) {
        if self.ends == Ends::Delimiter && mem::replace(&mut self.is_inside, is_inside) != is_inside
        {
            self.registers.cr1().modify(|w| w.set_idleie(is_inside));
        }
    }
}

/// The sending half of a line.
pub struct Sender {
    driver: UartTx<'static, Async>,
    /// Holds the message on its way.
    memory: Buffer,
    registers: Usart,
    /// What else happens on the line.
    pub events: &'static LineEvents,
    bits_per_second: u32,
}

impl Sender {
    /// Of a USART that was set up with this bitrate; `memory` has room for the longest message.
    pub fn new<T: Instance>(
        driver: UartTx<'static, Async>,
        memory: Buffer,
        bits_per_second: u32,
    ) -> Self {
        Self { driver, memory, registers: T::registers(), events: T::events(), bits_per_second }
    }

    /// Changes the bitrate of the line, for the receiver too.
    pub fn set_bits_per_second(&mut self, bits_per_second: u32) -> Result<(), usart::ConfigError> {
        self.driver.set_baudrate(bits_per_second)?;
        self.bits_per_second = bits_per_second;
        Ok(())
    }

    /// Of so many bits, rounded up.
    fn duration(&self, bits: u64) -> Duration {
        Duration::from_micros(gateway::bits_at(bits, self.bits_per_second).as_micros())
    }

    /// Waits until no byte is just arriving: what has come whole decides what may go. Not for ever,
    /// as noise may not end: then what has come so far is looked at.
    pub async fn between_bytes(&self) {
        for _ in 0..ARRIVING_BYTES {
            if !self.registers.isr().read().busy() {
                return;
            }
            Timer::after(self.duration(BITS_PER_BYTE)).await;
        }
        self.events.arrived.signal(());
        yield_now().await;
    }

    /// Waits until the line, which has just become idle, has been so for so many bits.
    pub async fn has_been_idle(&self, bits: u64) {
        // It is told when it has been idle for a byte's time.
        let pause = self.duration(bits.saturating_sub(BITS_PER_BYTE));
        let since = now_us().wrapping_sub(self.events.idle_us.load(Ordering::Relaxed));
        let rest = pause.checked_sub(Duration::from_micros(since.into())).unwrap_or(Duration::MIN);
        if rest < SHORT {
            block_for(rest);
        } else {
            Timer::after(rest).await;
        }
    }

    /// Room for a message, to be sent by [`send_held`](Self::send_held).
    pub fn message(&mut self) -> &mut [u8] {
        self.memory.bytes()
    }

    /// Sends, and returns when the last stop bit has left. A message without room counts as one
    /// that did not leave in time.
    pub async fn send(&mut self, message: &[u8]) -> Result<(), TimeoutError> {
        let room = self.message().get_mut(..message.len()).ok_or(TimeoutError)?;
        room.copy_from_slice(message);
        self.send_held(message.len()).await
    }

    /// The same for so many bytes of [`message`](Self::message). One timer watches all of it: the
    /// executor keeps it when the message has left, and the next one need not set it.
    pub async fn send_held(&mut self, length: usize) -> Result<(), TimeoutError> {
        let limit = self.duration(BITS_PER_BYTE * length as u64 + DRIVER_ENABLE_BITS) + MARGIN;
        let bytes = self.memory.bytes().get(..length).ok_or(TimeoutError)?;
        self.registers.icr().write(|w| w.set_tc(true));
        self.events.sent.reset();
        self.registers.cr1().modify(|w| w.set_tcie(true));
        let leaves = async {
            // What the driver's write returns is always Ok: it reports nothing. The transmitter
            // still holds the last bytes then.
            let _ = self.driver.write(bytes).await;
            self.events.sent.wait().await;
        };
        match with_timeout(limit, leaves).await {
            // Its event has not come, but it has left.
            Err(TimeoutError) if self.registers.isr().read().tc() => Ok(()),
            left => left,
        }
    }
}
