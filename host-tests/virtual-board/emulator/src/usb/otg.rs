//! A model of the STM32H743's USB core (Synopsys DWC2) as a full-speed device with the internal
//! transceiver, without DMA: OTG2_HS, on PA11 and PA12, with a scripted host at the other end of
//! its cable.
//!
//! Sources: RM0433 chapter 57 as the emulator's table of the SVD file and stm32-metapac's `otg_v1`
//! have it; what embassy-usb-synopsys-otg 0.3.3 relies on, which runs on these chips; ST's HAL
//! (`stm32h7xx_ll_usb.c`) for the order of a transfer.
//!
//! | Feature | Behaviour |
//! |---|---|
//! | role | a device 25 ms after GUSBCFG has had FDMOD and PHYSEL (chibios-upstream #13); resets and flushes are over at once |
//! | pull-up | in that role with GCCFG.PWRDWN, GOTGCTL.BVALOEN and BVALOVAL, and without DCTL.SDIS, with a cable or without |
//! | receive FIFO | GRXFSIZ words; SETUP, OUT data, end of transfer, end of setup stage in order; full: NAK |
//! | transmit FIFOs | DIEPTXF words each; a packet is sent when it is there as a whole |
//! | SETUP | taken whatever the endpoint's state; sets NAK in both directions, ends a STALL, DATA1 follows |
//! | OUT | taken unless NAKSTS: EPENA and PKTCNT are not looked at, as embassy's driver sets neither on endpoint 0; a short packet or PKTCNT 0 sets NAKSTS |
//! | IN | sent if EPENA and not NAKSTS; the acknowledgement of the last packet clears EPENA and raises XFRC |
//! | address | DCFG.DAD is in force after the next acknowledged IN of endpoint 0, as the status stage goes out under the old one |
//! | reset | USBRST when it begins, ENUMDNE when it ends, USBAEP cleared; suspend and resume raise USBSUSP, ESUSP and WKUPINT |
//! | not modelled, and told | isochronous endpoints, DMA, the host's side, remote wake-up, global NAK, detection of VBUS, link power management |

mod bus;
mod core;
mod endpoint;
mod fifo;
mod registers;
#[cfg(test)]
mod tests;

use std::num::NonZeroU64;

use rigless::device::{DeviceContext, ErasedDevice, Level, RegisterFile, RequestChange};
use rigless::snapshot::store;
use rigless::soc::stm32h743::generated::PERIPHERALS;
use rigless::soc::stm32h743::{CPU, MEMORY};
use rigless::soc::{Bus, Error, Gate, Peripheral, RegisterSpec, Width, Window};
use rigless::time::{EventId, VirtualNanos};

use self::core::Core;
use super::host::Host;

/// The blocks of the core in ST's description, by name and first address.
const BLOCKS: [(&str, u64); 4] = [
    ("OTG2_HS_GLOBAL", 0x000),
    ("OTG2_HS_HOST", 0x400),
    ("OTG2_HS_DEVICE", 0x800),
    ("OTG2_HS_PWRCLK", 0xE00),
];
/// Where they lie.
const BASE: u64 = 0x4008_0000;
/// Its interrupt (RM0433, table 147: usb2_gbl_it).
const INTERRUPTS: &[u16] = &[101];

/// The core with its cable and its host.
#[derive(Debug)]
pub struct Usb {
    core: Core,
    /// The other end of the cable.
    pub host: Host,
    /// The interrupt line as it was driven last.
    driven: bool,
    /// The first address of the block that is accessed.
    block: u64,
    layout: &'static [RegisterSpec],
}

store!(Usb { values: [core, host, driven], parts: [], built: [block, layout] });

/// The windows that stand in the bus's slots of the core, whose registers ST's file describes
/// wrongly and whose FIFOs it does not.
#[derive(Debug)]
pub struct Windows {
    others: Bus,
    /// Places in the part's bus and in the other one.
    places: [(usize, usize); BLOCKS.len()],
}

impl Windows {
    /// For a bus of the emulator's STM32H743.
    ///
    /// # Errors
    ///
    /// If its description does not hold the core.
    pub fn new(bus: &Bus) -> Result<Self, Error> {
        // The same description with the core's blocks moved away: a gate is resolved to a place
        // that is the same in both.
        let moved = PERIPHERALS.iter().map(|peripheral| {
            let is_ours = BLOCKS.iter().any(|(name, _)| *name == peripheral.name);
            let moved =
                Peripheral { name: "moved away", base: peripheral.base + MOVED, ..*peripheral };
            if is_ours { moved } else { *peripheral }
        });
        let mut others = Bus::builder(CPU, &MEMORY, moved).build()?;
        let mut places = [(0, 0); BLOCKS.len()];
        for (place, (name, offset)) in places.iter_mut().zip(BLOCKS) {
            let described = bus.slot(name)?;
            let size = NonZeroU64::new(bus.slots()[described].peripheral().size).expect("a block");
            let window = Window::new(name, BASE + offset, size).gated(Gate::by(
                "RCC",
                "AHB1ENR",
                "USB2OTGHSEN",
            ));
            *place = (described, others.add_window(window.raising(INTERRUPTS))?);
        }
        Ok(Self { others, places })
    }

    /// Puts them into the bus, or takes them out again.
    pub fn exchange(&mut self, bus: &mut Bus) {
        for (place, other) in self.places {
            std::mem::swap(bus.slot_mut(place), self.others.slot_mut(other));
        }
    }

    /// The block of a slot: its first address, from the core's.
    #[must_use]
    pub fn block(&self, slot: usize) -> Option<u64> {
        let number = self.places.iter().position(|(place, _)| *place == slot)?;
        Some(BLOCKS[number].1)
    }

    /// The slot by which the core is driven.
    #[must_use]
    pub fn slot(&self) -> usize {
        self.places[0].0
    }
}

/// How far: behind the core and before what comes next.
const MOVED: u64 = 0x4_0000;

impl Usb {
    /// Out of reset, without a cable. `layout` is the table of the windows.
    #[must_use]
    pub fn new(layout: &'static [RegisterSpec]) -> Self {
        Self { core: Core::default(), host: Host::new(), driven: false, block: 0, layout }
    }

    /// The next access is to that block.
    pub fn select(&mut self, block: u64) {
        self.block = block;
    }

    /// The part restarted: the host did not.
    pub fn restarted(&mut self, context: &mut DeviceContext<'_>) {
        self.driven = false;
        self.advance(context);
    }

    /// Carries out what the host does, schedules what comes, and drives the interrupt line.
    pub fn advance(&mut self, context: &mut DeviceContext<'_>) {
        if let Some(next) = self.host.advance(context.now(), &mut self.core) {
            context.schedule(next);
        }
        for (register, reason) in self.core.take_complaints() {
            context.tell(register, reason);
        }
        let level = self.core.interrupts(context.now());
        if level != self.driven {
            self.driven = level;
            context.interrupt(0, Level::from(level));
        }
    }
}

impl ErasedDevice for Usb {
    fn layout(&self) -> &'static [RegisterSpec] {
        self.layout
    }

    fn read(&mut self, _: usize, _: &mut RegisterFile, _: &mut DeviceContext<'_>) -> Option<u64> {
        None
    }

    fn write(&mut self, _: usize, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn on_event(&mut self, _: EventId, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.advance(context);
    }

    fn on_request(&mut self, _: RequestChange, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn on_clock(&mut self, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn poll(&mut self, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.advance(context);
    }

    fn reset(&mut self) {
        self.core = Core::default();
    }

    fn on_access(&mut self, _: u64, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn on_refused(&mut self, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn read_window(&mut self, offset: u64, width: Width, context: &mut DeviceContext<'_>) -> u64 {
        if width != Width::W32 {
            context.tell("OTG", "a register read otherwise than as a word");
        }
        let value = self.core.read(self.block + offset, context.now());
        self.advance(context);
        value.into()
    }

    fn write_window(
        &mut self,
        offset: u64,
        width: Width,
        value: u64,
        context: &mut DeviceContext<'_>,
    ) {
        match u32::try_from(value) {
            Ok(value) if width == Width::W32 => {
                self.core.write(self.block + offset, value, context.now())
            }
            _ => context.tell("OTG", "a register written otherwise than as a word"),
        }
        self.advance(context);
    }

    fn peek_window(&self, offset: u64, _: Width, now: VirtualNanos) -> Option<u64> {
        self.core.peek(self.block + offset, now).map(u64::from)
    }
}
