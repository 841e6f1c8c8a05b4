//! The STM32H743 of the emulator, with our models in their slots.

use rigless::device::{Device, DeviceContext, ErasedDevice, RegisterFile, ResetCause};
use rigless::emulator::{Access, Checked, Memory};
use rigless::mcu::Mcu;
use rigless::snapshot::store;
use rigless::soc::stm32h743;
use rigless::soc::stm32h743::generated::dbgmcu::Register as DebugRegister;
use rigless::soc::stm32h743::generated::flash::{Register as FlashRegister, sr1};
use rigless::soc::stm32h743::generated::rcc::{Register as ClockRegister, cifr, cr};
use rigless::soc::stm32h743::peripherals::gpio::{Gpio, PORTS};
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;

use crate::crs::{self, Crs};
use crate::fdcan::Fdcan;
use crate::iwdg::Iwdg;
use crate::message_ram::{MessageRam, MessageRamWindow};
use crate::revision::{Interconnect, Revision};
use crate::serial_port::SerialPort;
use crate::usb::otg::{Usb, Windows};

/// FDCAN controllers of the part.
pub const FDCANS: usize = 2;
/// Their names on the bus.
const FDCAN_NAMES: [&str; FDCANS] = ["FDCAN1", "FDCAN2"];
/// The serial ports with a model of ours; LPUART1 has the emulator's.
pub const SERIAL_NAMES: [&str; 8] =
    ["USART1", "USART2", "USART3", "UART4", "UART5", "USART6", "UART7", "UART8"];
/// The first port of pins (RM0433 §2.3).
pub(crate) const FIRST_PORT: u64 = 0x5802_0000;
/// The debug unit's name on the bus, and the interconnect's.
const DEBUG_NAME: &str = "DBGMCU";
const INTERCONNECT_NAME: &str = "AXI";
/// The watchdog's name on the bus.
const IWDG_NAME: &str = "IWDG";
/// The flash interface's name on the bus.
const FLASH_NAME: &str = "Flash";
/// The clock controller's name on the bus.
const CLOCKS_NAME: &str = "RCC";
/// The flags of RCC_RSR after power-on (RM0433 §8.7.39).
const POWER_ON_FLAGS: u64 = 0x00FE_0000;

/// The part: every field is a model to be reached by name.
#[derive(Debug)]
pub struct Stm32h743 {
    /// The emulator's part, which answers for everything else.
    pub stm32: stm32h743::Stm32h743,
    /// FDCAN1 and FDCAN2.
    pub fdcan: [Fdcan; FDCANS],
    /// The serial ports, in the order of [`SERIAL_NAMES`].
    pub serial: [SerialPort; SERIAL_NAMES.len()],
    /// The independent watchdog.
    pub iwdg: Iwdg,
    /// The USB controller, its cable and its host.
    pub usb: Usb,
    /// What trims the clock of the USB.
    pub crs: Crs,
    /// The AXI interconnect.
    pub interconnect: Interconnect,
    /// The message RAM of the FDCANs.
    pub message_ram: MessageRam,
    /// The same as the processor reads it.
    pub window: MessageRamWindow,
    revision: Revision,
    /// What the chip says of itself, where that is not true.
    pretended: Option<Revision>,
    slots: Slots,
    usb_windows: Windows,
}

store!(Stm32h743 {
    values: [revision, pretended],
    parts: [stm32, fdcan, serial, iwdg, usb, crs, interconnect, message_ram, window],
    built: [slots, usb_windows]
});

/// Where our models answer on the bus.
#[derive(Debug, Clone, Copy)]
struct Slots {
    fdcan: [usize; FDCANS],
    serial: [usize; SERIAL_NAMES.len()],
    iwdg: usize,
    clocks: usize,
    flash: usize,
    crs: usize,
    interconnect: usize,
    debug: usize,
    message_ram: usize,
    gpio: [usize; PORTS.len()],
}

impl Stm32h743 {
    /// Out of reset.
    ///
    /// # Errors
    ///
    /// If the emulator's description of the part does not hold what our models are for.
    pub fn new() -> Result<Self, Error> {
        let mut stm32 = stm32h743::Stm32h743::new()?;
        let bus = stm32.bus_mut();
        let [first, second] = FDCAN_NAMES;
        let mut gpio = [0; PORTS.len()];
        let mut serial = [0; SERIAL_NAMES.len()];
        for (slot, name) in gpio.iter_mut().zip(PORTS).chain(serial.iter_mut().zip(SERIAL_NAMES)) {
            *slot = bus.slot(name)?;
        }
        let slots = Slots {
            gpio,
            message_ram: bus.add_window(MessageRamWindow::window())?,
            fdcan: [bus.slot(first)?, bus.slot(second)?],
            serial,
            iwdg: bus.slot(IWDG_NAME)?,
            clocks: bus.slot(CLOCKS_NAME)?,
            flash: bus.slot(FLASH_NAME)?,
            crs: bus.slot(crs::NAME)?,
            interconnect: bus.slot(INTERCONNECT_NAME)?,
            debug: bus.slot(DEBUG_NAME)?,
        };
        let layout = bus.slots()[slots.message_ram].peripheral().registers;
        let mut usb_windows = Windows::new(bus)?;
        usb_windows.exchange(bus);
        let message_ram = MessageRam::new();
        Ok(Self {
            stm32,
            fdcan: std::array::from_fn(|_| Fdcan::new(message_ram.clone())),
            serial: std::array::from_fn(|_| SerialPort::new()),
            iwdg: Iwdg::default(),
            usb: Usb::new(layout),
            crs: Crs::default(),
            interconnect: Interconnect::default(),
            revision: Revision::V,
            pretended: None,
            window: MessageRamWindow::new(message_ram.clone(), layout),
            message_ram,
            slots,
            usb_windows,
        })
    }

    /// Makes the chip one of that revision; `pretended` is what it says of itself, where that is
    /// not true.
    pub fn set_revision(&mut self, revision: Revision, pretended: Option<Revision>) {
        (self.revision, self.pretended) = (revision, pretended);
        self.identify();
    }

    /// Puts a clock of `hz` on the HSE input; none where it is 0. A firmware that waits for it
    /// finds it ready.
    pub fn attach_hse(&mut self, hz: u64) {
        let (clocks, registers) = self.stm32.clocks();
        clocks.attach_crystals(hz, 0);
        let control = registers.get(ClockRegister::Cr);
        let ready = hz > 0 && cr::HSEON.is_set(control);
        registers.set(ClockRegister::Cr, cr::HSERDY.set(control, ready.into()));
    }

    /// The clock on the HSE input stops. Whether the clock security system was on: it then moves
    /// the system to the HSI, and raises the NMI, which is up to the caller.
    pub fn lose_hse(&mut self, at: VirtualNanos) -> bool {
        let slot = self.slots.clocks;
        let mut clocks = std::mem::take(&mut self.stm32.rcc);
        let (registers, mut context) = self.stm32.bus_mut().drive(at, slot);
        clocks.fail_hse(registers, &mut context);
        clocks.attach_crystals(0, 0);
        let noticed = cifr::HSECSSF.is_set(registers.get(ClockRegister::Cifr));
        self.stm32.rcc = clocks;
        noticed
    }

    /// Whether the first bank of the flash erases or programs. The processor then stands still as
    /// soon as it reads from there, an instruction or a constant: here at once and until the end, as
    /// what runs lies there.
    #[must_use]
    pub fn first_bank_is_busy(&self) -> bool {
        let status = self.stm32.bus().slots()[self.slots.flash].registers().get(FlashRegister::Sr1);
        sr1::QW1.is_set(status) || sr1::BSY1.is_set(status)
    }

    fn identify(&mut self) {
        let identity = self.pretended.unwrap_or(self.revision).identity();
        self.stm32
            .bus_mut()
            .slot_mut(self.slots.debug)
            .registers_mut()
            .set(DebugRegister::Idc, identity);
    }

    /// The registers of a port of pins, of which A is 0.
    pub(crate) fn port_registers(&self, port: usize) -> &RegisterFile {
        self.stm32.bus().slots()[self.slots.gpio[port]].registers()
    }

    /// Calls a port of pins with its registers and an instant to act at.
    pub(crate) fn drive_port<T>(
        &mut self,
        port: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut Gpio, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        self.stm32.drive_port(at, port, call)
    }

    /// Cuts the supply at an instant, or gives it back.
    pub(crate) fn supply(&mut self, at: VirtualNanos, on: bool) {
        let (_, mut context) = self.stm32.bus_mut().drive(at, self.slots.iwdg);
        context.request_power(on);
    }

    /// Calls one FDCAN with its registers and an instant to act at.
    pub(crate) fn drive_fdcan<T>(
        &mut self,
        number: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut Fdcan, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        let (registers, mut context) = self.stm32.bus_mut().drive(at, self.slots.fdcan[number]);
        call(&mut self.fdcan[number], registers, &mut context)
    }

    /// Calls the USB controller with an instant to act at.
    fn drive_usb(&mut self, at: VirtualNanos, call: impl FnOnce(&mut Usb, &mut DeviceContext<'_>)) {
        let (_, mut context) = self.stm32.bus_mut().drive(at, self.usb_windows.slot());
        call(&mut self.usb, &mut context);
    }

    /// Calls one serial port with its registers and an instant to act at.
    pub(crate) fn drive_serial<T>(
        &mut self,
        port: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut SerialPort, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        let (registers, mut context) = self.stm32.bus_mut().drive(at, self.slots.serial[port]);
        call(&mut self.serial[port], registers, &mut context)
    }
}

impl Mcu for Stm32h743 {
    fn bus(&self) -> &Bus {
        self.stm32.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.stm32.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        // The emulator's part is put together anew, from its own description.
        self.usb_windows.exchange(self.stm32.bus_mut());
        if cause == ResetCause::PowerOn {
            // The emulator's part has no power-on reset: the one of the pin, and other flags.
            self.stm32.reset(at, ResetCause::Pin);
            let (_, registers) = self.stm32.clocks();
            for register in [ClockRegister::Rsr, ClockRegister::C1Rsr] {
                registers.set(register, POWER_ON_FLAGS);
            }
        } else {
            self.stm32.reset(at, cause);
        }
        self.usb_windows.exchange(self.stm32.bus_mut());
        self.identify();
        Device::reset(&mut self.iwdg);
        ErasedDevice::reset(&mut self.usb);
        Device::reset(&mut self.crs);
        Device::reset(&mut self.interconnect);
        self.fdcan.iter_mut().for_each(Device::reset);
        for number in 0..FDCANS {
            self.drive_fdcan(number, at, |fdcan, _, context| fdcan.restarted(context));
        }
        for port in 0..SERIAL_NAMES.len() {
            self.drive_serial(port, at, |port, _, context| port.part_reset(context));
        }
        self.drive_usb(at, Usb::restarted);
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.stm32.poll(now);
        for number in 0..FDCANS {
            self.drive_fdcan(number, now, Device::poll);
        }
        for port in 0..SERIAL_NAMES.len() {
            self.drive_serial(port, now, Device::poll);
        }
        self.drive_usb(now, Usb::advance);
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let disturbs =
            self.revision.disturbs_message_ram() && self.fdcan.iter().all(Fdcan::is_on_bus);
        let Self {
            stm32,
            fdcan: [first, second],
            serial,
            iwdg,
            usb,
            crs,
            interconnect,
            window,
            slots,
            usb_windows,
            ..
        } = self;
        let model: &mut dyn ErasedDevice = match slot {
            slot if slot == slots.fdcan[0] => first,
            slot if slot == slots.fdcan[1] => second,
            slot if slot == slots.iwdg => iwdg,
            slot if slot == slots.crs => crs,
            slot if slot == slots.interconnect => interconnect,
            slot if slot == slots.message_ram => {
                window.disturb(disturbs);
                window
            }
            slot if slot == slots.clocks && stm32.rcc.crystals().0 == 0 => {
                // The emulator has an oscillator ready without anything on its pins.
                let (_, registers) = stm32.clocks();
                registers
                    .set(ClockRegister::Cr, cr::HSERDY.set(registers.get(ClockRegister::Cr), 0));
                return stm32.split(slot);
            }
            slot if let Some(block) = usb_windows.block(slot) => {
                usb.select(block);
                usb
            }
            slot => match slots.serial.iter().position(|serial| *serial == slot) {
                Some(port) => &mut serial[port],
                None => return stm32.split(slot),
            },
        };
        (stm32.bus_mut(), Some(model))
    }

    // The defaults of the trait would answer for the part that is wrapped here.

    fn read_checked(
        &mut self,
        at: VirtualNanos,
        address: u64,
        report: bool,
        memory: &mut dyn Memory,
    ) -> Option<Checked> {
        self.stm32.read_checked(at, address, report, memory)
    }

    fn checks_every_read(&mut self) -> bool {
        self.stm32.checks_every_read()
    }

    fn mismatched_words(&mut self) -> Option<Vec<u64>> {
        self.stm32.mismatched_words()
    }

    fn write_checked(&mut self, access: Access, memory: &mut dyn Memory) -> Option<bool> {
        self.stm32.write_checked(access, memory)
    }

    fn flip_bits(
        &mut self,
        address: u64,
        data: u64,
        check: u8,
        memory: &mut dyn Memory,
    ) -> Result<(), String> {
        self.stm32.flip_bits(address, data, check, memory)
    }

    fn keeps_check_bits(&self, address: u64) -> bool {
        self.stm32.keeps_check_bits(address)
    }

    fn compares_cores(&self) -> bool {
        self.stm32.compares_cores()
    }

    fn compare_error(&mut self, at: VirtualNanos) {
        self.stm32.compare_error(at);
    }
}
