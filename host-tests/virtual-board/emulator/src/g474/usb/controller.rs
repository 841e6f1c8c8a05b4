//! The registers of the controller, and what the host's end of the cable finds there.

mod cable;

use rigless::device::{DeviceContext, Level};
use rigless::snapshot::store;
use rigless::time::{EventId, VirtualNanos};

use super::endpoint::{CTR_RX, CTR_TX, EP_KIND, Endpoint, Kind, Status};
use super::packet_memory::{Failed, PacketMemory};
use super::registers::*;
pub use cable::Function;

const ENDPOINTS: usize = 8;
/// What the interrupts of the part stand for, as its table lists them: urgent transfers,
/// everything, the wake-up.
const LOW_PRIORITY: usize = 1;
/// How long the bus is idle before that counts as suspended.
const IDLE_NANOS: u64 = 3_000_000;
/// The clock, and how far off it may be: 0.25 %.
const HZ: u64 = 48_000_000;
const HZ_TOLERANCE: u64 = 120_000;

/// What the processor and the host share.
#[derive(Debug)]
pub struct Controller {
    memory: PacketMemory,
    endpoints: [Endpoint; ENDPOINTS],
    control: u16,
    flags: u16,
    frame: u16,
    address: u16,
    buffers: u16,
    charger: u16,
    hz: u64,
    /// When the bus has been idle for long enough, unless something happens on it.
    idle: Option<EventId>,
    raised: bool,
}

store!(Controller {
    values: [endpoints, control, flags, frame, address, buffers, charger, hz, idle, raised],
    parts: [memory],
    built: [],
});

impl Controller {
    /// Out of reset, with its packets in `memory` and no cable.
    #[must_use]
    pub fn new(memory: PacketMemory) -> Self {
        Self {
            memory,
            endpoints: [Endpoint::default(); ENDPOINTS],
            control: FRES | PDWN,
            flags: 0,
            frame: 0,
            address: 0,
            buffers: 0,
            charger: 0,
            hz: 0,
            idle: None,
            raised: false,
        }
    }

    fn is_on(&self) -> bool {
        self.control & (FRES | PDWN) == 0
    }

    /// The endpoint whose packets have been received or sent, and which of both; the lowest
    /// register first.
    fn transferred(&self) -> u16 {
        let done = (0..).zip(self.endpoints).find(|(_, endpoint)| endpoint.has(CTR_RX | CTR_TX));
        done.map_or(0, |(number, endpoint)| {
            CTR | number | if endpoint.has(CTR_RX) { DIR } else { 0 }
        })
    }

    /// What a read of the register at an offset finds. Reading changes nothing.
    #[must_use]
    pub fn read(&self, offset: u32) -> u16 {
        match offset {
            CNTR => self.control,
            ISTR => self.flags | self.transferred(),
            FNR => self.frame,
            DADDR => self.address,
            BTABLE => self.buffers,
            BCDR => self.charger,
            _ => self.endpoints.get(endpoint_at(offset)).map_or(0, |endpoint| endpoint.read()),
        }
    }

    /// Endpoints and address are forgotten; no packet is taken until the firmware has seen it.
    fn forget(&mut self) {
        self.flags |= RESET;
        self.address = 0;
        self.endpoints.iter_mut().for_each(Endpoint::reset);
    }

    fn set_control(&mut self, value: u16, context: &mut DeviceContext<'_>) {
        if value & RESUME != 0 {
            context.tell("CNTR", "the device wakes no host");
        }
        self.control = value;
        if value & FRES != 0 {
            self.forget();
        }
        self.watch_idle(context);
    }

    /// From here on the bus is idle, as far as the controller sees it; without a cable, too, as its
    /// pull-up holds D+ high.
    fn watch_idle(&mut self, context: &mut DeviceContext<'_>) {
        let watches = self.is_on() && self.charger & DPPU != 0 && self.control & FSUSP == 0;
        self.idle = watches.then(|| context.schedule(VirtualNanos(context.now().0 + IDLE_NANOS)));
    }

    fn suspend(&mut self) {
        if self.is_on() && self.control & FSUSP == 0 {
            self.flags |= SUSP | ESOF;
            self.frame = self.frame & !LCK | LSOF | RXDP;
        }
    }

    fn wake(&mut self) {
        if self.control & FSUSP != 0 {
            self.flags |= WKUP;
            self.control &= !LPMODE;
        }
    }

    fn refresh(&mut self, context: &mut DeviceContext<'_>) {
        // What CNTR enables lies where ISTR has it.
        let raise = (self.flags | self.transferred()) & self.control & (FLAGS | CTR) != 0;
        if self.raised != raise {
            self.raised = raise;
            context.interrupt(LOW_PRIORITY, Level::from(raise));
        }
    }

    /// The register of an endpoint of the device with that address, if it takes part in
    /// transactions.
    fn addressed(
        &self,
        address: u8,
        endpoint: u8,
        context: &mut DeviceContext<'_>,
    ) -> Option<usize> {
        let listens = self.is_on() && self.flags & RESET == 0 && self.control & FSUSP == 0;
        if !listens || self.address & EF == 0 || self.address & ADD != u16::from(address) {
            return None;
        }
        if self.hz.abs_diff(HZ) > HZ_TOLERANCE {
            context.tell(
                "CNTR",
                "the clock is off 48 MHz by more than 0.25 %: no packet is understood",
            );
            return None;
        }
        let is_used = |candidate: &Endpoint| {
            (candidate.receives(), candidate.transmits()) != (Status::Disabled, Status::Disabled)
        };
        let found = self
            .endpoints
            .iter()
            .position(|found| found.address() == endpoint && is_used(found))?;
        let unknown = match self.endpoints[found].kind() {
            Kind::Isochronous => true,
            Kind::Bulk => self.endpoints[found].has(EP_KIND),
            Kind::Control | Kind::Interrupt => false,
        };
        if unknown {
            context.tell("EPR", "isochronous and double-buffered endpoints are not modelled");
        }
        (!unknown).then_some(found)
    }

    fn store(
        &self,
        number: usize,
        data: &[u8],
        context: &mut DeviceContext<'_>,
    ) -> Result<(), Failed> {
        let stored = self.memory.receive(self.buffers, row(number), data);
        if stored == Err(Failed::Outside) {
            context.tell("BTABLE", "a receive buffer lies outside the packet memory");
        }
        stored
    }

    /// Takes what the processor writes to the register at an offset.
    pub fn write(&mut self, offset: u32, value: u16, context: &mut DeviceContext<'_>) {
        match offset {
            CNTR => self.set_control(value, context),
            ISTR => {
                self.flags &= value;
                if self.control & FRES != 0 {
                    self.flags |= RESET;
                }
            }
            DADDR => self.address = value & (EF | ADD),
            BTABLE => self.buffers = value & BTABLE_BITS,
            LPMCSR if value != 0 => context.tell("LPMCSR", "link power management is not modelled"),
            BCDR => {
                if value & CHARGER != 0 {
                    context.tell("BCDR", "charger detection is not modelled");
                }
                self.charger = value & DPPU;
                self.watch_idle(context);
            }
            // FNR is read-only.
            _ => {
                let held = self.control & FRES != 0;
                if let Some(endpoint) =
                    self.endpoints.get_mut(endpoint_at(offset)).filter(|_| !held)
                {
                    endpoint.write(value);
                }
            }
        }
        self.refresh(context);
    }

    /// A time that it waited for is over.
    pub fn on_event(&mut self, event: EventId, context: &mut DeviceContext<'_>) {
        if self.idle == Some(event) {
            self.suspend();
            self.watch_idle(context);
            self.refresh(context);
        }
    }

    /// Its clock runs at that rate.
    pub fn set_clock(&mut self, hz: u64) {
        self.hz = hz;
    }

    /// Out of reset again; the packet memory stays.
    pub fn reset(&mut self) {
        *self = Self { hz: self.hz, ..Self::new(self.memory.clone()) };
    }
}

/// The endpoint whose register is at an offset.
fn endpoint_at(offset: u32) -> usize {
    usize::try_from(offset / 4).unwrap_or(usize::MAX)
}

fn row(number: usize) -> u16 {
    u16::try_from(number).expect("one of eight")
}
