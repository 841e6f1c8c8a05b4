//! The STM32G474, which rigless does not know: its memory, its registers, and a model for each
//! peripheral that counts.
//!
//! The registers come from the metadata of stm32-metapac ([`tables`]). Where a peripheral is the
//! same as in the STM32H743 the emulator's model of that answers for it, with the table it was
//! written for: GPIO, TIM2, RNG, the serial ports, IWDG. A test compares these tables with the
//! metadata. A register that no model has keeps what is written, and the session reports it.

pub mod clocks;
pub mod crs;
pub mod dma;
pub mod external_interrupts;
pub mod flash;
pub mod multiplexer;
pub mod tables;
pub mod usb;

use std::num::NonZeroU64;

use rigless::cpu::armv7m::{self, Dwt};
use rigless::device::{DeviceContext, ErasedDevice, RegisterFile, ResetCause};
use rigless::mcu::{Mcu, Operate};
use rigless::snapshot::store;
use rigless::soc::stm32h743::generated;
use rigless::soc::stm32h743::peripherals::gpio::Gpio;
use rigless::soc::stm32h743::peripherals::rng::{self, Rng};
use rigless::soc::stm32h743::peripherals::tim::{General, TIMERS, Tim};
use rigless::soc::{
    Access, Bus, Cpu, Endian, Error, FieldSpec, Gate, Peripheral, Region, RegisterSpec, Window,
    WriteModify,
};
use rigless::time::VirtualNanos;

use clocks::Clocks;
use crs::Crs;
use dma::{CHANNELS, Dma};
use external_interrupts::ExternalInterrupts;
use flash::Flash;
use multiplexer::Multiplexer;
use usb::Usb;
use usb::packet_memory::{PacketMemory, PacketMemoryWindow};

use crate::fdcan::Fdcan;
use crate::fdcan::fixed_layout::{self, FixedLayout};
use crate::iwdg::Iwdg;
use crate::message_ram::{MessageRam, MessageRamWindow};
use crate::serial_port::SerialPort;

/// The ports of pins, as SYSCFG_EXTICR counts them.
pub const PORTS: [&str; 7] = ["GPIOA", "GPIOB", "GPIOC", "GPIOD", "GPIOE", "GPIOF", "GPIOG"];
/// The first port's registers.
pub(crate) const FIRST_PORT: u64 = 0x4800_0000;
/// The serial ports; the first is the one with low power.
pub const SERIAL_NAMES: [&str; 6] = ["LPUART1", "USART1", "USART2", "USART3", "UART4", "UART5"];
/// The controllers for CAN.
const FDCAN_NAMES: [&str; 3] = ["FDCAN1", "FDCAN2", "FDCAN3"];
/// The first word of the FDCANs' message RAM, as the processor finds it (stm32-metapac 21,
/// FDCANRAM1), and its size in bytes.
const MESSAGE_RAM: u64 = 0x4000_A400;
const MESSAGE_RAM_BYTES: NonZeroU64 =
    NonZeroU64::new(3 * 4 * fixed_layout::WORDS as u64).expect("not empty");
/// Bits 16 to 19 of BRR, which only the LPUART has.
static LPUART_DIVIDER: FieldSpec = FieldSpec::new("BRR_16_19", 16, 4, Access::ReadWrite);
/// The timer that the firmware counts time with.
const TIMER: &str = "TIM2";
/// The core clock until the firmware sets another.
const RESET_CORE_HZ: u64 = 16_000_000;
/// External interrupts of the core: 0 to 101.
const INTERRUPT_LINES: u16 = 102;

/// The memory (stm32-metapac 21; the system memory at the top of the code area after AN2606). The
/// second address of the CCM SRAM, 0x2001_8000, is not there: the firmware uses the first. Where no
/// chip has any there is memory for `board-resume`, which the flash has no room for beside an image.
static MEMORY: [Region; 7] = [
    Region::flash("flash", 0x0800_0000, 512 << 10).erased_to(0xFF).programmed_by(flash::NAME),
    Region::ram("ccm", 0x1000_0000, 32 << 10),
    Region::system("system", 0x1FFF_0000, 32 << 10),
    Region::ram("sram1", 0x2000_0000, 80 << 10),
    Region::ram("sram2", 0x2001_4000, 16 << 10),
    Region::flash("resume", 0x0A00_0000, 256 << 10),
    Region::ram("desk", 0x0A10_0000, 512 << 10),
];

/// Reset values that are not 0, of what the firmware reads or an emulator's model starts from
/// (stm32g4 0.16): MODER, OSPEEDR and PUPDR of the ports.
const PORT_RESETS: [(&str, [u64; 3]); 7] = [
    ("GPIOA", [0xABFF_FFFF, 0x0C00_0000, 0x6400_0000]),
    ("GPIOB", [0xFFFF_FEBF, 0x0000_00C0, 0x0000_0100]),
    ("GPIOC", [0xFFFF_FFFF, 0, 0]),
    ("GPIOD", [0xFFFF_FFFF, 0, 0]),
    ("GPIOE", [0xFFFF_FFFF, 0, 0]),
    ("GPIOF", [0xFFFF_FFFF, 0, 0]),
    ("GPIOG", [0xFFFF_FFFF, 0, 0]),
];
/// FLASH_OPTR as delivered (RM0440, option bytes), but nSWBOOT0 = 0: PB8 then decides nothing,
/// which a board can use for a bus.
const OPTIONS: u64 = 0xFFEF_F8AA & !(1 << 26);
/// PWR_CR1: range 1; PWR_CR5: not boosted (stm32g4 0.16).
const PWR_CR1: u64 = 0x0000_0200;
const PWR_CR5: u64 = 0x0000_0100;

/// The part: every field is a model to be reached by name.
#[derive(Debug)]
pub struct Stm32g474 {
    /// The clocks.
    pub clocks: Clocks,
    /// The ports of pins.
    pub gpio: [Gpio; PORTS.len()],
    /// FDCAN1 to FDCAN3.
    pub fdcan: [Fdcan; 3],
    /// The serial ports, in the order of [`SERIAL_NAMES`].
    pub serial: [SerialPort; SERIAL_NAMES.len()],
    /// The independent watchdog.
    pub iwdg: Iwdg,
    /// The USB's clock.
    pub crs: Crs,
    /// The USB controller, its cable and its host.
    pub usb: Usb,
    packets: PacketMemoryWindow,
    message_ram: MessageRam,
    window: MessageRamWindow,
    external_interrupts: ExternalInterrupts,
    /// The flash interface.
    pub flash: Flash,
    dma: [Dma; 2],
    multiplexer: Multiplexer,
    timer: Tim<General>,
    rng: Rng,
    cycles: Dwt,
    bus: Bus,
    wiring: Box<[Field]>,
}

store!(Stm32g474 {
    values: [gpio, timer, rng, cycles],
    parts: [
        clocks,
        fdcan,
        serial,
        iwdg,
        crs,
        usb,
        packets,
        message_ram,
        external_interrupts,
        dma,
        multiplexer,
        flash,
        bus
    ],
    built: [window, wiring],
});

/// Which model answers for a slot of the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Field {
    None,
    Clocks,
    Gpio(usize),
    Fdcan(usize),
    Serial(usize),
    Watchdog,
    MessageRam,
    Crs,
    Usb,
    Packets,
    ExternalInterrupts,
    Flash,
    Dma(usize),
    Multiplexer,
    Timer,
    Rng,
    Cycles,
}

impl Field {
    fn of(instance: &str) -> Self {
        match instance {
            clocks::NAME => Self::Clocks,
            crs::NAME => Self::Crs,
            usb::NAME => Self::Usb,
            usb::packet_memory::NAME => Self::Packets,
            external_interrupts::NAME => Self::ExternalInterrupts,
            flash::NAME => Self::Flash,
            "DMA1" => Self::Dma(0),
            "DMA2" => Self::Dma(1),
            multiplexer::NAME => Self::Multiplexer,
            TIMER => Self::Timer,
            "RNG" => Self::Rng,
            armv7m::DWT => Self::Cycles,
            "IWDG" => Self::Watchdog,
            crate::message_ram::NAME => Self::MessageRam,
            name => {
                let place = |names: &[&str]| names.iter().position(|known| *known == name);
                let gpio = place(&PORTS).map(Self::Gpio);
                let fdcan = place(&FDCAN_NAMES).map(Self::Fdcan);
                gpio.or(fdcan).or(place(&SERIAL_NAMES).map(Self::Serial)).unwrap_or(Self::None)
            }
        }
    }
}

/// The table of the emulator's model that answers for a peripheral, of the STM32H743's.
pub fn borrowed_table(instance: &str) -> Option<&'static [RegisterSpec]> {
    match instance {
        TIMER => Some(&generated::tim2::REGISTERS),
        "RNG" => Some(&generated::rng::REGISTERS),
        "IWDG" => Some(&generated::iwdg::REGISTERS),
        port if PORTS.contains(&port) => Some(&generated::gpioa::REGISTERS),
        port if SERIAL_NAMES.contains(&port) => Some(&generated::usart1::REGISTERS),
        _ => None,
    }
}

/// The peripherals as the bus has them.
fn instances() -> impl Iterator<Item = Peripheral> {
    let described = tables::peripherals().iter().map(|described| {
        let mut peripheral = *described;
        if let Some(registers) = borrowed_table(described.name) {
            peripheral.registers = registers;
        }
        if described.name == external_interrupts::NAME {
            peripheral.interrupts = &external_interrupts::INTERRUPT_NUMBERS;
        }
        peripheral
    });
    described.chain([armv7m::PERIPHERAL])
}

fn bus() -> Result<Bus, Error> {
    let cpu = Cpu::new("CM4", true, INTERRUPT_LINES, Endian::Little);
    let mut builder = Bus::builder(cpu, &MEMORY, instances())
        .undefined_reads_zero()
        .write_modify(external_interrupts::NAME, "PR0", WriteModify::OneToClear)
        .write_modify(TIMER, "SR", WriteModify::ZeroToClear)
        .reset(TIMER, "ARR", u64::from(u32::MAX))
        .field("RNG", "SR", "SEIS", rng::SEIS)
        .field("RNG", "SR", "CEIS", rng::CEIS)
        .declare(SERIAL_NAMES[0], "BRR", &LPUART_DIVIDER)
        .reset(flash::NAME, "OPTR", OPTIONS)
        .reset(flash::NAME, "CR", flash::CR_RESET)
        .reset("PWR", "CR1", PWR_CR1)
        .reset("PWR", "CR5", PWR_CR5)
        .declare(crs::NAME, "CR", &crs::TRIM_6)
        .clocked_by(clocks::NAME, crs::CLOCK);
    for (register, value) in clocks::RESETS {
        builder = builder.reset(clocks::NAME, register, value);
    }
    for (register, value) in crs::RESETS {
        builder = builder.reset(crs::NAME, register, value);
    }
    for (port, values) in PORT_RESETS {
        for (register, value) in ["MODER", "OSPEEDR", "PUPDR"].into_iter().zip(values) {
            builder = builder.reset(port, register, value);
        }
    }
    for (instance, gate) in tables::enables() {
        builder = builder.gate(instance, gate);
    }
    for (instance, line) in tables::resets() {
        builder = builder.reset_by(instance, line);
    }
    for (instance, clock) in clocks::clocked() {
        builder = builder.clocked_by(instance, clock);
    }
    for reader in
        [clocks::NAME, crs::NAME, external_interrupts::NAME, multiplexer::NAME, "DMA1", "DMA2"]
    {
        builder = builder.reads_requests(reader);
    }
    builder.build()
}

impl Stm32g474 {
    /// Out of reset.
    ///
    /// # Errors
    ///
    /// If its description contradicts itself.
    pub fn new() -> Result<Self, Error> {
        let mut bus = bus()?;
        let enabled = Gate::by(clocks::NAME, "APB1ENR1", "FDCANEN");
        let window =
            Window::new(crate::message_ram::NAME, MESSAGE_RAM, MESSAGE_RAM_BYTES).gated(enabled);
        let window = bus.add_window(window)?;
        let layout = bus.slots()[window].peripheral().registers;
        let message_ram = MessageRam::new();
        let packets = bus.add_window(PacketMemoryWindow::window())?;
        let packet_layout = bus.slots()[packets].peripheral().registers;
        let packet_memory = PacketMemory::new();
        let wiring = bus.peripherals().map(|peripheral| Field::of(peripheral.name)).collect();
        let [tim2, ..] = TIMERS;
        let mut part = Self {
            clocks: Clocks::default(),
            gpio: std::array::from_fn(|_| Gpio::default()),
            fdcan: std::array::from_fn(|number| {
                let table = tables::named(FDCAN_NAMES[number]).registers;
                let first_word = fixed_layout::WORDS * u32::try_from(number).expect("one of three");
                Fdcan::with_fixed_layout(message_ram.clone(), FixedLayout { table, first_word })
            }),
            serial: std::array::from_fn(|port| match port {
                0 => SerialPort::low_power(),
                _ => SerialPort::new(),
            }),
            iwdg: Iwdg::default(),
            crs: Crs::new(),
            usb: Usb::new(packet_memory.clone()),
            packets: PacketMemoryWindow::new(packet_memory, packet_layout),
            window: MessageRamWindow::new(message_ram.clone(), layout),
            message_ram,
            external_interrupts: ExternalInterrupts::default(),
            flash: Flash::default(),
            dma: [Dma::new("DMA1", 0), Dma::new("DMA2", CHANNELS)],
            multiplexer: Multiplexer::new(&SERIAL_NAMES),
            timer: Tim::new(tim2),
            rng: Rng::new(RESET_CORE_HZ, rng::KERNEL_HZ),
            cycles: Dwt::with_clock(RESET_CORE_HZ),
            bus,
            wiring,
        };
        part.check()?;
        part.restarted(VirtualNanos(0), ResetCause::PowerOn);
        Ok(part)
    }

    /// Calls one FDCAN with its registers and an instant to act at.
    pub(crate) fn drive_fdcan<T>(
        &mut self,
        number: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut Fdcan, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        let slot = self.bus.slot(FDCAN_NAMES[number]).expect("it is there");
        let (registers, mut context) = self.bus.drive(at, slot);
        call(&mut self.fdcan[number], registers, &mut context)
    }

    /// Calls one serial port with its registers and an instant to act at.
    pub(crate) fn drive_serial<T>(
        &mut self,
        port: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut SerialPort, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        let slot = self.bus.slot(SERIAL_NAMES[port]).expect("it is there");
        let (registers, mut context) = self.bus.drive(at, slot);
        call(&mut self.serial[port], registers, &mut context)
    }

    /// Whether the main regulator gives what more than 150 MHz need (RM0440, PWR_CR5: R1MODE, bit
    /// 8, is cleared).
    #[must_use]
    pub fn is_boosted(&self) -> bool {
        const R1MODE: u64 = 1 << 8;
        let row = tables::row(tables::named("PWR").registers, "CR5");
        self.bus.registers("PWR").expect("it is there").get(row) & R1MODE == 0
    }

    /// The registers of a port of pins, of which A is 0.
    pub(crate) fn port_registers(&self, port: usize) -> &RegisterFile {
        self.bus.registers(PORTS[port]).expect("it is there")
    }

    /// Puts a crystal of `hz` on the HSE pins; none where it is 0.
    pub fn attach_hse(&mut self, at: VirtualNanos, hz: u64) {
        let slot = self.bus.slot(clocks::NAME).expect("it is there");
        let (registers, mut context) = self.bus.drive(at, slot);
        self.clocks.attach_crystal(hz, registers, &mut context);
    }

    /// The crystal stops. Whether the clock security system was on: it then moves the system to the
    /// HSI, and raises the NMI, which is up to the caller.
    pub fn lose_hse(&mut self, at: VirtualNanos) -> bool {
        let slot = self.bus.slot(clocks::NAME).expect("it is there");
        let (registers, mut context) = self.bus.drive(at, slot);
        self.clocks.lose_crystal(registers, &mut context)
    }

    /// The flash is one bank: option DBANK = 0.
    pub fn set_single_bank(&mut self) {
        self.flash.set_single_bank();
        self.load_options(VirtualNanos(0));
    }

    fn load_options(&mut self, at: VirtualNanos) {
        let slot = self.bus.slot(flash::NAME).expect("it is there");
        self.flash.load_options(self.bus.drive(at, slot).0);
    }

    /// Cuts the supply at an instant, or gives it back.
    pub(crate) fn supply(&mut self, at: VirtualNanos, on: bool) {
        let slot = self.bus.slot(clocks::NAME).expect("it is there");
        self.bus.drive(at, slot).1.request_power(on);
    }

    fn restarted(&mut self, at: VirtualNanos, cause: ResetCause) {
        let slot = self.bus.slot(clocks::NAME).expect("it is there");
        let (registers, mut context) = self.bus.drive(at, slot);
        self.clocks.restarted(cause, registers, &mut context);
        let slot = self.bus.slot(crs::NAME).expect("it is there");
        let (registers, mut context) = self.bus.drive(at, slot);
        self.crs.restarted(registers, &mut context);
        self.load_options(at);
    }

    /// Calls a port of pins with its registers and an instant to act at.
    pub(crate) fn drive_port<T>(
        &mut self,
        port: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut Gpio, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        let slot = self.bus.slot(PORTS[port]).expect("it is there");
        let (registers, mut context) = self.bus.drive(at, slot);
        call(&mut self.gpio[port], registers, &mut context)
    }
}

impl Mcu for Stm32g474 {
    fn bus(&self) -> &Bus {
        &self.bus
    }

    fn bus_mut(&mut self) -> &mut Bus {
        &mut self.bus
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.reset_every_model();
        for number in 0..FDCAN_NAMES.len() {
            self.drive_fdcan(number, at, |fdcan, _, context| fdcan.restarted(context));
        }
        for port in 0..self.serial.len() {
            self.drive_serial(port, at, |port, _, context| port.part_reset(context));
        }
        self.restarted(at, cause);
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.poll_every_model(now);
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        // What a board has added lies behind the part's own slots.
        let model: Option<&mut dyn ErasedDevice> =
            match self.wiring.get(slot).copied().unwrap_or(Field::None) {
                Field::None => None,
                Field::Clocks => Some(&mut self.clocks),
                Field::Gpio(port) => Some(&mut self.gpio[port]),
                Field::Fdcan(number) => Some(&mut self.fdcan[number]),
                Field::Serial(port) => Some(&mut self.serial[port]),
                Field::Watchdog => Some(&mut self.iwdg),
                Field::MessageRam => Some(&mut self.window),
                Field::Crs => Some(&mut self.crs),
                Field::Usb => Some(&mut self.usb),
                Field::Packets => Some(&mut self.packets),
                Field::ExternalInterrupts => Some(&mut self.external_interrupts),
                Field::Flash => Some(&mut self.flash),
                Field::Dma(number) => Some(&mut self.dma[number]),
                Field::Multiplexer => Some(&mut self.multiplexer),
                Field::Timer => Some(&mut self.timer),
                Field::Rng => Some(&mut self.rng),
                Field::Cycles => Some(&mut self.cycles),
            };
        (&mut self.bus, model)
    }
}

#[cfg(test)]
mod tests;
