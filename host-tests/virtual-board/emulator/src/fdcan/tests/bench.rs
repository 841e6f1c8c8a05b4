//! A controller on a bench: registers by name, message RAM by word, virtual time.

use rigless::chip::can::{Fault, Frame, Id, Offer, Pattern};
use rigless::device::{Device, Level};
use rigless::mcu::{Mcu, Operate, Single};
use rigless::soc::stm32h743::builder;
use rigless::soc::stm32h743::generated::FDCAN1;
use rigless::soc::stm32h743::generated::fdcan1::Register;
use rigless::soc::{Layout, Width};
use rigless::time::VirtualNanos;

use crate::fdcan::{Fdcan, FrameEnd, Wiring};
use crate::message_ram::MessageRam;

/// The kernel clock of the board.
const KERNEL_HZ: u64 = 80_000_000;
/// NBTP for 1 Mbit/s and 500 kbit/s: prescaler 4 and 8, 16 and 3 quanta around the sample point,
/// SJW 3.
pub const MBIT: u32 = 0x0403_0F02;
pub const HALF_MBIT: u32 = 0x0407_0F02;

/// First words of the sections of the message RAM; elements have 18 words.
pub const STANDARD_FILTERS: usize = 0;
pub const RX_FIFO_0: usize = 0x100;
pub const RX_FIFO_1: usize = 0x200;
pub const RX_BUFFERS: usize = 0x280;
pub const TX_EVENTS: usize = 0x300;
pub const TX_BUFFERS: usize = 0x400;
pub const ELEMENT: usize = 18;

/// TXBC: three elements at [`TX_BUFFERS`], as queue or as FIFO.
pub const QUEUE_OF_3: u32 = 0x4300_1000;
pub const FIFO_OF_3: u32 = 0x0300_1000;

/// A microsecond: a bit at 1 Mbit/s.
pub const MICROSECOND: u64 = 1_000;

/// The frame 0x123 with AB CD: 52 bits with stuffing up to the end of its checksum, so the
/// acknowledge slot ends after 54 bits, receivers have it after 61 and the sender after 62.
pub fn short_frame() -> Frame {
    standard(0x123, &[0xAB, 0xCD])
}

pub fn standard(id: u16, data: &[u8]) -> Frame {
    Frame::data_frame(Id::Standard(id), data)
}

pub struct Bench {
    single: Single<Fdcan>,
    pub ram: MessageRam,
    pub now: u64,
    /// The levels of the interrupt lines.
    pub lines: [bool; 2],
}

impl Bench {
    /// Out of reset, its kernel clock running.
    pub fn new() -> Self {
        let ram = MessageRam::new();
        let single = Single::new(builder(), FDCAN1.name, Fdcan::new(ram.clone())).expect("a bench");
        let mut bench = Self { single, ram, now: 0, lines: [false; 2] };
        bench.set_kernel_clock(KERNEL_HZ);
        bench
    }

    /// Set up with this NBTP and TXBC and still off the bus, INIT and CCE set: FIFO 0 of three
    /// elements, FIFO 1 of two, an event FIFO of three, nothing filtered.
    pub fn configured(nbtp: u32, txbc: u32) -> Self {
        let mut bench = Self::new();
        bench.write(Register::FdcanCccr, 0x0000_0001);
        bench.write(Register::FdcanCccr, 0x0000_0003);
        bench.write(Register::FdcanNbtp, nbtp);
        bench.write(Register::FdcanTscc, 0x0000_0001);
        bench.write(Register::FdcanRxf0c, 0x0203_0400); // watermark 2, 3 elements, word 0x100
        bench.write(Register::FdcanRxf1c, 0x0002_0800); // 2 elements, word 0x200
        bench.write(Register::FdcanRxbc, 0x0000_0A00); // word 0x280
        bench.write(Register::FdcanRxesc, 0x0000_0777);
        bench.write(Register::FdcanTxefc, 0x0203_0C00); // watermark 2, 3 entries, word 0x300
        bench.write(Register::FdcanTxbc, txbc);
        bench.write(Register::FdcanTxesc, 0x0000_0007);
        bench.write(Register::FdcanTxbtie, 0xFFFF_FFFF);
        bench.write(Register::FdcanTxbcie, 0xFFFF_FFFF);
        bench
    }

    /// Set up as [`Bench::configured`], and on the bus: 11 bits have passed.
    pub fn on_bus(nbtp: u32, txbc: u32) -> Self {
        let mut bench = Self::configured(nbtp, txbc);
        bench.join();
        bench
    }

    /// Clears INIT and waits until the controller is on the bus.
    pub fn join(&mut self) {
        self.write(Register::FdcanCccr, 0x0000_0000);
        self.run_for(100 * MICROSECOND);
        assert_eq!(self.read(Register::FdcanPsr) & 0x18, 0x08, "idle");
    }

    pub fn set_kernel_clock(&mut self, hz: u64) {
        self.single.drive(VirtualNanos(self.now), |fdcan, registers, context| {
            fdcan.on_clock(hz, registers, context);
        });
        self.follow_lines();
    }

    fn address(register: Register) -> u64 {
        FDCAN1.base + u64::from(register.spec().offset)
    }

    pub fn read(&mut self, register: Register) -> u32 {
        let value = self.single.read(VirtualNanos(self.now), Self::address(register), Width::W32);
        u32::try_from(value.expect("a register")).expect("a word")
    }

    pub fn write(&mut self, register: Register, value: u32) {
        let at = VirtualNanos(self.now);
        self.single
            .write(at, Self::address(register), Width::W32, value.into())
            .expect("a register");
        self.follow_lines();
    }

    /// Lets time pass, event by event, as the emulator does.
    pub fn run_for(&mut self, nanos: u64) {
        let end = self.now + nanos;
        while let Some(VirtualNanos(at)) = self.single.next_event().filter(|at| at.0 <= end) {
            self.now = self.now.max(at);
            self.single.advance_to(VirtualNanos(self.now));
            self.look_outside();
        }
        self.now = end;
        self.look_outside();
    }

    /// What a test has changed at the nodes is noticed.
    fn look_outside(&mut self) {
        self.single.poll(VirtualNanos(self.now));
        self.follow_lines();
    }

    fn follow_lines(&mut self) {
        for change in self.single.drain_interrupts() {
            let line = FDCAN1.interrupts.iter().position(|number| *number == change.interrupt);
            self.lines[line.expect("a line of the controller")] = change.level == Level::High;
        }
    }

    /// A reset of the controller alone, by its bit in the RCC.
    pub fn reset_line(&mut self) {
        self.single.drive(VirtualNanos(self.now), |fdcan, registers, context| {
            fdcan.reset_line(registers, context);
        });
        self.lines = [false; 2];
        self.follow_lines();
    }

    pub fn fdcan(&mut self) -> &mut Fdcan {
        &mut self.single.model
    }

    /// Hangs a node on the bus that hears everything and sends these frames as soon as it can.
    pub fn attach(&mut self, frames: &[Frame]) -> usize {
        self.attach_at(None, frames)
    }

    pub fn attach_at(&mut self, bitrate: Option<u32>, frames: &[Frame]) -> usize {
        let since = VirtualNanos(self.now);
        let offers = frames.iter().map(|frame| Offer { since, frame: *frame, fault: None });
        let node = self.single.model.attach(Pattern::offering(offers), bitrate);
        self.look_outside();
        node
    }

    /// A node that destroys the next `count` frames of the controller.
    pub fn attach_disturbing(&mut self, count: u32) -> usize {
        self.single.model.attach(Pattern::default().disturbing(count), None)
    }

    pub fn node(&mut self, node: usize) -> &mut Pattern {
        self.single.model.nodes_mut()[node].peer_mut()
    }

    /// Gives a node a frame to send, now.
    pub fn offer(&mut self, node: usize, frame: Frame) {
        self.offer_with(node, frame, None);
    }

    pub fn offer_with(&mut self, node: usize, frame: Frame, fault: Option<Fault>) {
        let since = VirtualNanos(self.now);
        self.node(node).queue(Offer { since, frame, fault });
        self.look_outside();
    }

    pub fn silence(&mut self, node: usize, silent: bool) {
        self.single.model.nodes_mut()[node].silence(silent);
        self.look_outside();
    }

    pub fn wire(&mut self, wiring: Wiring) {
        self.single.model.set_wiring(wiring);
        self.look_outside();
    }

    /// Puts a frame into a transmit buffer: an event is stored under the buffer's number.
    pub fn fill(&mut self, buffer: usize, frame: &Frame) {
        let marker = u32::try_from(buffer).expect("small");
        self.fill_with(buffer, frame, 0x0080_0000 | marker << 24);
    }

    pub fn fill_with(&mut self, buffer: usize, frame: &Frame, control: u32) {
        let Id::Standard(id) = frame.id else { panic!("11-bit ids only") };
        let start = TX_BUFFERS + buffer * ELEMENT;
        let [a, b, c, d, e, f, g, h] = frame.data;
        let words = [
            u32::from(id) << 18 | u32::from(frame.remote) << 29,
            control | u32::from(frame.dlc) << 16,
            u32::from_le_bytes([a, b, c, d]),
            u32::from_le_bytes([e, f, g, h]),
        ];
        words
            .into_iter()
            .enumerate()
            .for_each(|(index, word)| assert!(self.ram.set_word(start + index, word)));
    }

    /// Puts a frame into a transmit buffer and requests it.
    pub fn send(&mut self, buffer: usize, frame: &Frame) {
        self.fill(buffer, frame);
        self.write(Register::FdcanTxbar, 1 << buffer);
    }

    pub fn words(&self, start: usize, length: usize) -> Vec<u32> {
        (start..start + length).map(|index| self.ram.word(index).expect("in the RAM")).collect()
    }

    /// Ids of the frames that were on the line and how each ended.
    pub fn log(&mut self) -> Vec<(u32, FrameEnd)> {
        self.fdcan().log().iter().map(|record| (record.frame.id.value(), record.outcome)).collect()
    }

    /// Ids of the frames that arrived somewhere, in order.
    pub fn delivered(&mut self) -> Vec<u32> {
        let log = self.log();
        log.into_iter()
            .filter(|(_, end)| *end == FrameEnd::Acknowledged)
            .map(|(id, _)| id)
            .collect()
    }

    /// What the model has said that it does not do.
    pub fn told(&mut self) -> Vec<(&'static str, &'static str)> {
        self.single.drain_told().into_iter().map(|told| (told.register, told.reason)).collect()
    }
}
