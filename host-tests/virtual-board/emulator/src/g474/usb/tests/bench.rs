//! The part, with the test as its processor and as its host.

use rigless::device::Level;
use rigless::emulator::{Error, Memory};
use rigless::mcu::Operate;
use rigless::soc::Width;

use super::*;
use crate::g474::Stm32g474;

/// Offset of the first endpoint register.
pub const EPR: u32 = 0;
const RCC_CRRCR: u64 = 0x4002_1098;
const RCC_APB1ENR1: u64 = 0x4002_1058;
const USBEN_AND_CRSEN: u64 = 1 << 23 | 1 << 8;
const CRS_CR: u64 = 0x4000_2000;
const HALF_TRIMMED: u64 = 0x4000;
const PACKETS: u64 = 0x4000_6000;
/// Where each endpoint register's buffers lie: 64 bytes to receive, 64 to send.
const BUFFERS: u16 = 0x40;
const BUFFER: u16 = 64;
/// COUNTn_RX: two blocks of 32 bytes.
pub const ROOM_64: u16 = 0x8400;

/// A bit field of a register by the metadata.
pub fn named_bits(register: &str, field: &str) -> u16 {
    let found = tables::field(tables::named(NAME).registers, register, field).mask();
    u16::try_from(found).expect("in the lower half")
}

/// No memory: no model of this part asks for it here.
struct Nothing;

impl Memory for Nothing {
    fn read(&mut self, address: u64, width: Width) -> Result<u64, Error> {
        Err(Error::Memory { address, width })
    }

    fn write(&mut self, address: u64, width: Width, _: u64) -> Result<(), Error> {
        Err(Error::Memory { address, width })
    }
}

/// The part.
pub struct Bench {
    pub part: Stm32g474,
    now: u64,
    up: bool,
}

impl Bench {
    /// Out of reset, with an exact HSI48, which is on, and the USB's clock enabled.
    pub fn new() -> Self {
        let part = Stm32g474::new().expect("a part");
        let mut bench = Self { part, now: 0, up: false };
        bench.write_at(RCC_CRRCR, Width::W32, 1);
        bench.write_at(RCC_APB1ENR1, Width::W32, USBEN_AND_CRSEN);
        bench.part.crs.set_error(0);
        bench.write_at(CRS_CR, Width::W32, HALF_TRIMMED);
        bench
    }

    /// As the firmware's driver starts it, then reset by the host, and with address 0.
    pub fn enumerated() -> Self {
        let mut bench = Self::new();
        bench.write(CNTR, FRES);
        bench.write(BTABLE, 0);
        bench.write(CNTR, RESET | SUSP | WKUP | CTR);
        bench.write(BCDR, DPPU);
        bench.at_cable(|usb| usb.bus_reset());
        bench.write(ISTR, !RESET);
        bench.write(DADDR, EF);
        bench
    }

    /// Endpoint register 0 as a control endpoint that waits for a SETUP.
    pub fn control_endpoint(&mut self) {
        self.describe(0, ROOM_64);
        self.write(EPR, 1 << 9 | 0x2020);
    }

    /// A bulk endpoint that takes a packet and has none to send.
    pub fn bulk_endpoint(&mut self, number: u16) {
        self.describe(number, ROOM_64);
        self.write(EPR + 4 * u32::from(number), number | 0x3020);
    }

    /// The rows of the table for a register.
    pub fn describe(&mut self, number: u16, room: u16) {
        let start = BUFFERS + 2 * BUFFER * number;
        for (half, value) in (0..).zip([start + BUFFER, 0, start, room]) {
            self.put(8 * number + 2 * half, value);
        }
    }

    /// Lets a packet be sent.
    pub fn put_packet(&mut self, number: u16, data: &[u8]) {
        let start = BUFFERS + 2 * BUFFER * number + BUFFER;
        for (at, pair) in (start..).step_by(2).zip(data.chunks(2)) {
            self.put(at, u16::from_le_bytes([pair[0], pair.get(1).copied().unwrap_or(0xEE)]));
        }
        self.put(8 * number + 2, u16::try_from(data.len()).expect("a packet"));
        // NAK to VALID.
        self.toggle(number, 0x0010);
    }

    /// What lies in a receive buffer, as long as its row says.
    pub fn packet(&mut self, number: u16) -> Vec<u8> {
        let (start, length) = (self.get(8 * number + 4), self.get(8 * number + 6) & 0x3FF);
        let mut bytes = Vec::new();
        for at in (start..start + length).step_by(2) {
            bytes.extend(self.get(at).to_le_bytes());
        }
        bytes.truncate(length.into());
        bytes
    }

    /// Toggles bits of an endpoint register and leaves the rest.
    pub fn toggle(&mut self, number: u16, bits: u16) {
        let old = self.read(EPR + 4 * u32::from(number));
        let kept = old & 0x070F;
        self.write(EPR + 4 * u32::from(number), kept | bits | CTR_RX | CTR_TX);
    }

    /// Clears CTR_RX of an endpoint register.
    pub fn clear_received(&mut self, number: u16) {
        let old = self.read(EPR + 4 * u32::from(number));
        self.write(EPR + 4 * u32::from(number), old & 0x070F | CTR_TX);
    }

    pub fn put(&mut self, at: u16, value: u16) {
        self.write_at(PACKETS + u64::from(at), Width::W16, value.into());
    }

    pub fn get(&mut self, at: u16) -> u16 {
        let found = self.part.read(VirtualNanos(self.now), PACKETS + u64::from(at), Width::W16);
        u16::try_from(found.expect("packet memory")).expect("a half-word")
    }

    pub fn write(&mut self, offset: u32, value: u16) {
        self.write_at(tables::named(NAME).base + u64::from(offset), Width::W32, value.into());
    }

    pub fn read(&mut self, offset: u32) -> u16 {
        let address = tables::named(NAME).base + u64::from(offset);
        let found =
            self.part.read(VirtualNanos(self.now), address, Width::W32).expect("a register");
        u16::try_from(found).expect("the upper half is reserved")
    }

    pub fn write_at(&mut self, address: u64, width: Width, value: u64) {
        self.part.write(VirtualNanos(self.now), address, width, value).expect("a register");
        self.settle();
    }

    /// At the host's end of the cable.
    pub fn at_cable<T>(&mut self, call: impl FnOnce(&mut Function<'_, '_>) -> T) -> T {
        let Stm32g474 { bus, usb, .. } = &mut self.part;
        let slot = bus.slot(NAME).expect("it is there");
        let (_, mut context) = bus.drive(VirtualNanos(self.now), slot);
        let answer = call(&mut Function::new(&mut usb.controller, &mut context));
        self.settle();
        answer
    }

    pub fn wait(&mut self, nanos: u64) {
        self.now += nanos;
        self.part.advance_to(VirtualNanos(self.now));
        self.settle();
    }

    /// So many frames, one a millisecond.
    pub fn frames(&mut self, count: u16) {
        for number in 0..count {
            self.at_cable(|usb| usb.start_of_frame(number));
            self.wait(1_000_000);
        }
    }

    pub fn interrupt_is_up(&mut self) -> bool {
        for change in self.part.drain_interrupts() {
            if change.instance == NAME {
                assert_eq!(change.interrupt, 20, "USB_LP");
                self.up = change.level == Level::High;
            }
        }
        self.up
    }

    /// The registers of which the model has told something.
    pub fn told(&mut self) -> Vec<&'static str> {
        self.part.drain_told().into_iter().map(|told| told.register).collect()
    }

    fn settle(&mut self) {
        let refused = self.part.settle(&mut Nothing).expect("no model asks for memory");
        assert!(refused.is_empty(), "{refused:?}");
    }
}
