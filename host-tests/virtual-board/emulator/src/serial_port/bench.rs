//! A port without a firmware: for tests of what hangs on its pins.

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::mcu::{Mcu, Operate, Single};
use rigless::soc::stm32h743::builder;
use rigless::soc::stm32h743::generated::USART2;
use rigless::soc::stm32h743::generated::usart1::{Register, cr1, cr3, isr};
use rigless::soc::{Layout, Width};
use rigless::time::VirtualNanos;

use super::SerialPort;

/// The port's kernel clock, in hertz.
pub const KERNEL_HZ: u64 = 100_000_000;
/// BRR for 100 MHz / 868 = 115207 baud.
pub const BRR_115200: u64 = 868;
pub(super) const ON: u64 = cr1::UE.mask() | cr1::TE.mask() | cr1::RE.mask() | cr1::FIFOEN.mask();

/// A port alone on a chip, and the test as its processor.
#[derive(Debug)]
pub struct Bench {
    /// The chip with this one model.
    pub part: Single<SerialPort>,
    /// Nanoseconds since the start.
    pub now: u64,
}

impl Bench {
    /// A port with its kernel clock running.
    ///
    /// # Panics
    ///
    /// Here and below: only by a defect of this crate.
    #[must_use]
    pub fn new(port: SerialPort) -> Self {
        let part = Single::new(builder(), "USART2", port).expect("the part has the port");
        let mut bench = Self { part, now: 0 };
        bench.drive(|port, registers, context| port.on_clock(KERNEL_HZ, registers, context));
        bench
    }

    /// Switched on at a rate, with FIFOs and driver-enable, and with further bits of CR1.
    #[must_use]
    pub fn switched_on(port: SerialPort, brr: u64, control: u64) -> Self {
        let mut bench = Self::new(port);
        bench.write(Register::Brr, brr);
        bench.write(Register::Cr3, cr3::DEM.mask());
        bench.write(Register::Cr1, ON | control);
        // The idle frame that a transmitter starts with.
        bench.run(12 * brr * 10);
        bench
    }

    /// Calls the port at this instant.
    pub fn drive<T>(
        &mut self,
        input: impl FnOnce(&mut SerialPort, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        self.part.drive(VirtualNanos(self.now), input)
    }

    /// Writes a register.
    pub fn write(&mut self, register: Register, value: u64) {
        let address = USART2.base + u64::from(register.spec().offset);
        self.part.write(VirtualNanos(self.now), address, Width::W32, value).expect("a register");
    }

    /// Reads a register.
    pub fn read(&mut self, register: Register) -> u64 {
        let address = USART2.base + u64::from(register.spec().offset);
        self.part.read(VirtualNanos(self.now), address, Width::W32).expect("a register")
    }

    /// Lets nanoseconds pass, with a look at every event as the session has it.
    pub fn run(&mut self, nanos: u64) {
        let end = self.now + nanos;
        self.poll();
        while let Some(at) = self.part.next_event().filter(|at| at.0 <= end) {
            self.now = at.0;
            self.part.advance_to(at);
            self.poll();
        }
        self.now = end;
        self.part.advance_to(VirtualNanos(end));
        self.poll();
    }

    fn poll(&mut self) {
        self.part.poll(VirtualNanos(self.now));
    }

    /// What the receiver has, as its DMA would take it.
    pub fn take_words(&mut self) -> Vec<u64> {
        let mut words = Vec::new();
        while isr::RXNE.is_set(self.read(Register::Isr)) {
            words.push(self.read(Register::Rdr));
        }
        words
    }
}
