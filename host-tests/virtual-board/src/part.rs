//! The STM32H743 of the emulator, with our models in their slots.

use rigless::device::{Device, DeviceContext, ErasedDevice, RegisterFile, ResetCause};
use rigless::emulator::{Access, Checked, Memory};
use rigless::mcu::Mcu;
use rigless::snapshot::store;
use rigless::soc::stm32h743::Stm32h743;
use rigless::soc::stm32h743::generated::dbgmcu::Register as DebugRegister;
use rigless::soc::stm32h743::generated::rcc::Register as ClockRegister;
use rigless::soc::stm32h743::peripherals::gpio::PORTS;
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;

use crate::crs::{self, Crs};
use crate::fdcan::Fdcan;
use crate::iwdg::Iwdg;
use crate::message_ram::{MessageRam, MessageRamWindow};
use crate::revision::{Interconnect, Revision};
use crate::serial_port::SerialPort;
use crate::usb::{self, Usb};

/// FDCAN controllers of the part.
pub const FDCANS: usize = 2;
/// Their names on the bus.
pub(crate) const FDCAN_NAMES: [&str; FDCANS] = ["FDCAN1", "FDCAN2"];
/// Serial ports of the board: host link 0, host link 1, RS485.
pub const SERIAL_PORTS: usize = 3;
/// Their names on the bus.
const SERIAL_NAMES: [&str; SERIAL_PORTS] = ["USART3", "USART6", "USART2"];
/// The debug unit's name on the bus, and the interconnect's.
const DEBUG_NAME: &str = "DBGMCU";
const INTERCONNECT_NAME: &str = "AXI";
/// The watchdog's name on the bus.
const IWDG_NAME: &str = "IWDG";
/// The flags of RCC_RSR after power-on (RM0433 §8.7.39).
const POWER_ON_FLAGS: u64 = 0x00FE_0000;

/// The part: every field is a model to be reached by name.
#[derive(Debug)]
pub struct Part {
    /// The emulator's part, which answers for everything else.
    pub stm32: Stm32h743,
    /// FDCAN1 and FDCAN2.
    pub fdcan: [Fdcan; FDCANS],
    /// Host link 0, host link 1, RS485.
    pub serial: [SerialPort; SERIAL_PORTS],
    /// The independent watchdog.
    pub iwdg: Iwdg,
    /// The USB controller, with nothing plugged in.
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
}

store!(Part {
    values: [revision, pretended],
    parts: [stm32, fdcan, serial, iwdg, usb, crs, interconnect, message_ram, window],
    built: [slots]
});

/// Where our models answer on the bus.
#[derive(Debug, Clone, Copy)]
struct Slots {
    fdcan: [usize; FDCANS],
    serial: [usize; SERIAL_PORTS],
    iwdg: usize,
    usb: usize,
    crs: usize,
    interconnect: usize,
    debug: usize,
    message_ram: usize,
    gpio: [usize; PORTS.len()],
}

impl Part {
    /// Out of reset.
    ///
    /// # Errors
    ///
    /// If the emulator's description of the part does not hold what our models are for.
    pub fn new() -> Result<Self, Error> {
        let mut stm32 = Stm32h743::new()?;
        let bus = stm32.bus_mut();
        let [first, second] = FDCAN_NAMES;
        let [host_0, host_1, rs485] = SERIAL_NAMES;
        let mut gpio = [0; PORTS.len()];
        for (slot, name) in gpio.iter_mut().zip(PORTS) {
            *slot = bus.slot(name)?;
        }
        let slots = Slots {
            gpio,
            message_ram: bus.add_window(MessageRamWindow::window())?,
            fdcan: [bus.slot(first)?, bus.slot(second)?],
            serial: [bus.slot(host_0)?, bus.slot(host_1)?, bus.slot(rs485)?],
            iwdg: bus.slot(IWDG_NAME)?,
            usb: bus.slot(usb::NAME)?,
            crs: bus.slot(crs::NAME)?,
            interconnect: bus.slot(INTERCONNECT_NAME)?,
            debug: bus.slot(DEBUG_NAME)?,
        };
        let layout = bus.slots()[slots.message_ram].peripheral().registers;
        let message_ram = MessageRam::new();
        Ok(Self {
            stm32,
            fdcan: std::array::from_fn(|_| Fdcan::new(message_ram.clone())),
            serial: std::array::from_fn(|_| SerialPort::new()),
            iwdg: Iwdg::default(),
            usb: Usb::default(),
            crs: Crs::default(),
            interconnect: Interconnect::default(),
            revision: Revision::V,
            pretended: None,
            window: MessageRamWindow::new(message_ram.clone(), layout),
            message_ram,
            slots,
        })
    }

    /// Makes the chip one of that revision; `pretended` is what it says of itself, where that is not true.
    pub fn set_revision(&mut self, revision: Revision, pretended: Option<Revision>) {
        (self.revision, self.pretended) = (revision, pretended);
        self.identify();
    }

    fn identify(&mut self) {
        let identity = self.pretended.unwrap_or(self.revision).identity();
        self.stm32.bus_mut().slot_mut(self.slots.debug).registers_mut().set(DebugRegister::Idc, identity);
    }

    /// The registers of a port of pins.
    pub(crate) fn port_registers(&self, port: usize) -> &RegisterFile {
        self.stm32.bus().slots()[self.slots.gpio[port]].registers()
    }

    /// Cuts the supply at an instant, or gives it back.
    pub(crate) fn supply(&mut self, at: VirtualNanos, on: bool) {
        let (_, mut context) = self.stm32.bus_mut().drive(at, self.slots.iwdg);
        context.request_power(on);
    }

    /// Calls each FDCAN with its registers and an instant to act at.
    fn each_fdcan(
        &mut self,
        at: VirtualNanos,
        mut call: impl FnMut(&mut Fdcan, &mut RegisterFile, &mut DeviceContext<'_>),
    ) {
        for (fdcan, slot) in self.fdcan.iter_mut().zip(self.slots.fdcan) {
            let (registers, mut context) = self.stm32.bus_mut().drive(at, slot);
            call(fdcan, registers, &mut context);
        }
    }

    /// Calls one serial port with its registers and an instant to act at.
    pub fn drive_serial<T>(
        &mut self,
        port: usize,
        at: VirtualNanos,
        call: impl FnOnce(&mut SerialPort, &mut RegisterFile, &mut DeviceContext<'_>) -> T,
    ) -> T {
        let (registers, mut context) = self.stm32.bus_mut().drive(at, self.slots.serial[port]);
        call(&mut self.serial[port], registers, &mut context)
    }
}

impl Mcu for Part {
    fn bus(&self) -> &Bus {
        self.stm32.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.stm32.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
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
        self.identify();
        Device::reset(&mut self.iwdg);
        Device::reset(&mut self.usb);
        Device::reset(&mut self.crs);
        Device::reset(&mut self.interconnect);
        self.fdcan.iter_mut().for_each(Device::reset);
        self.each_fdcan(at, |fdcan, _, context| fdcan.restarted(context));
        for port in 0..SERIAL_PORTS {
            self.drive_serial(port, at, |port, _, context| port.part_reset(context));
        }
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.stm32.poll(now);
        self.each_fdcan(now, Device::poll);
        for port in 0..SERIAL_PORTS {
            self.drive_serial(port, now, Device::poll);
        }
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let disturbs = self.revision.disturbs_message_ram() && self.fdcan.iter().all(Fdcan::is_on_bus);
        let Self {
            stm32, fdcan: [first, second], serial, iwdg, usb, crs, interconnect, window, slots, ..
        } = self;
        let model: &mut dyn ErasedDevice = match slot {
            slot if slot == slots.fdcan[0] => first,
            slot if slot == slots.fdcan[1] => second,
            slot if slot == slots.iwdg => iwdg,
            slot if slot == slots.usb => usb,
            slot if slot == slots.crs => crs,
            slot if slot == slots.interconnect => interconnect,
            slot if slot == slots.message_ram => {
                window.disturb(disturbs);
                window
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
