//! A channel between a serial port and memory, as the drivers set it up.

use std::collections::VecDeque;

use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::emulator::{Error, Memory};
use rigless::mcu::{Mcu, Operate};
use rigless::time::VirtualNanos;

use super::*;
use crate::g474::Stm32g474;
use crate::serial_port::FarEnd;

/// Registers (stm32-metapac 21).
const AHB1ENR: u64 = 0x4002_1048;
const APB1ENR1: u64 = 0x4002_1058;
const STATUS: u64 = 0x4002_0000;
const CLEAR: u64 = 0x4002_0004;
const CCR1: u64 = 0x4002_0008;
const CNDTR1: u64 = 0x4002_000C;
const CPAR1: u64 = 0x4002_0010;
const CMAR1: u64 = 0x4002_0014;
const DMAMUX_C0CR: u64 = 0x4002_0800;
const USART3: u64 = 0x4000_4800;
const CR1: u64 = USART3;
const CR3: u64 = USART3 + 0x08;
const BRR: u64 = USART3 + 0x0C;
const RDR: u64 = USART3 + 0x24;
const TDR: u64 = USART3 + 0x28;
const RAM: u64 = 0x2000_0000;
/// Requests of the multiplexer (stm32-metapac 21, USART3).
const USART3_RX: u64 = 28;
const USART3_TX: u64 = 29;
/// USART CR1: on, both directions, FIFOs. CR3: DMAR and DMAT.
const USART_ON: u64 = 1 << 29 | 0b1101;
const DMA_BOTH_WAYS: u64 = 1 << 7 | 1 << 6;
const TCIE: u64 = 1 << 1;
const HTIE: u64 = 1 << 2;
/// Sixteen clocks of 16 MHz: a word of ten bits takes 10 µs.
const DIVIDER: u64 = 16;
const WORD_NS: u64 = 10_000;

/// Says its words and keeps what it hears.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Talker {
    says: VecDeque<u16>,
    heard: Vec<u16>,
}

store!(Talker);

impl Peer for Talker {
    fn receive(&mut self, word: u16, _: &mut Timeline<'_, '_>) {
        self.heard.push(word);
    }

    fn transmit(&mut self, _: VirtualNanos) -> Option<u16> {
        self.says.pop_front()
    }
}

impl FarEnd for Talker {}

/// Sixteen bytes of SRAM1.
#[derive(Debug, Default)]
struct Ram([u8; 16]);

impl Ram {
    fn place(address: u64, width: Width) -> Result<usize, Error> {
        let place = address.checked_sub(RAM).and_then(|offset| usize::try_from(offset).ok());
        place.filter(|place| *place < 16).ok_or(Error::Memory { address, width })
    }
}

impl Memory for Ram {
    fn read(&mut self, address: u64, width: Width) -> Result<u64, Error> {
        assert_eq!(width, Width::W8);
        Ok(self.0[Self::place(address, width)?].into())
    }

    fn write(&mut self, address: u64, width: Width, value: u64) -> Result<(), Error> {
        assert_eq!(width, Width::W8);
        self.0[Self::place(address, width)?] = value.to_le_bytes()[0];
        Ok(())
    }
}

/// The chip, its memory, and the test as its processor.
struct Bench {
    part: Stm32g474,
    ram: Ram,
    now: u64,
}

impl Bench {
    /// A talker on USART3, and the first channel with that request.
    fn new(request: u64) -> Self {
        let mut part = Stm32g474::new().expect("a part");
        part.serial[3].attach(Talker::default());
        let mut bench = Self { part, ram: Ram::default(), now: 0 };
        for (address, value) in [
            (AHB1ENR, 0b101), // DMA1, DMAMUX1
            (APB1ENR1, 1 << 18),
            (BRR, DIVIDER),
            (CR3, DMA_BOTH_WAYS),
            (DMAMUX_C0CR, request),
        ] {
            bench.write(address, value);
        }
        bench
    }

    fn write(&mut self, address: u64, value: u64) {
        self.part.write(VirtualNanos(self.now), address, Width::W32, value).expect("a register");
        self.settle();
    }

    fn read(&mut self, address: u64) -> u64 {
        self.part.read(VirtualNanos(self.now), address, Width::W32).expect("a register")
    }

    fn settle(&mut self) {
        self.part.settle(&mut self.ram).expect("it comes to rest");
    }

    fn run(&mut self, nanos: u64) {
        let end = self.now + nanos;
        self.poll();
        while let Some(at) = self.part.next_event().filter(|at| at.0 <= end) {
            self.now = at.0;
            self.part.advance_to(at);
            self.settle();
            self.poll();
        }
        self.now = end;
        self.poll();
    }

    fn poll(&mut self) {
        self.part.poll(VirtualNanos(self.now));
        self.settle();
    }

    /// Sets the channel up between a register and the first bytes of memory, and switches it on.
    fn start(&mut self, register: u64, count: u64, control: u64) {
        for (address, value) in
            [(CPAR1, register), (CMAR1, RAM), (CNDTR1, count), (CCR1, control | EN)]
        {
            self.write(address, value);
        }
        self.write(CR1, USART_ON);
        self.run(WORD_NS);
    }

    /// Has the talker say words from now on.
    fn say(&mut self, words: &[u16]) {
        self.talker().says.extend(words);
    }

    fn talker(&mut self) -> &mut Talker {
        self.part.serial[3].peer_mut().expect("a talker")
    }

    /// The level of the channel's interrupt since the last look, where it changed.
    fn interrupt(&mut self) -> Option<Level> {
        let changes = self.part.drain_interrupts();
        changes
            .iter()
            .rfind(|change| change.instance == "DMA1" && change.interrupt == 11)
            .map(|change| change.level)
    }
}

#[test]
fn a_message_leaves_in_order_and_its_end_is_told_once() {
    let mut bench = Bench::new(USART3_TX);
    bench.ram.0[..4].copy_from_slice(&[1, 2, 3, 4]);
    bench.start(TDR, 4, DIR | MINC | TCIE);
    bench.run(10 * WORD_NS);
    assert_eq!(bench.talker().heard, [1, 2, 3, 4]);
    assert_eq!(bench.read(CNDTR1), 0);
    assert_eq!(bench.read(STATUS) & 0xF, GLOBAL | COMPLETE | HALF);
    assert_eq!(bench.interrupt(), Some(Level::High));
    bench.write(CLEAR, COMPLETE | HALF);
    assert_eq!(bench.read(STATUS), 0, "the global flag goes with the last of the others");
    assert_eq!(bench.interrupt(), Some(Level::Low));
    bench.run(10 * WORD_NS);
    assert_eq!(bench.talker().heard.len(), 4, "no more than it was told");
}

#[test]
fn a_ring_goes_round_and_tells_its_half_and_its_end() {
    let mut bench = Bench::new(USART3_RX);
    bench.start(RDR, 4, MINC | CIRC | TCIE | HTIE);
    bench.say(&[10, 11, 12, 13, 14]);
    let mut seen = Vec::new();
    for _ in 0..100 {
        bench.run(WORD_NS / 10);
        let now = (bench.read(CNDTR1), bench.read(STATUS) & (HALF | COMPLETE));
        if seen.last() != Some(&now) {
            seen.push(now);
        }
    }
    let (half, both) = (HALF, HALF | COMPLETE);
    assert_eq!(seen, [(4, 0), (3, 0), (2, half), (1, half), (4, both), (3, both)]);
    assert_eq!(bench.ram.0[..5], [14, 11, 12, 13, 0]);
}

#[test]
fn memory_that_is_not_there_ends_it_with_an_error() {
    let mut bench = Bench::new(USART3_RX);
    for (address, value) in
        [(CPAR1, RDR), (CMAR1, 0x3000_0000), (CNDTR1, 4), (CCR1, MINC | ERROR | EN)]
    {
        bench.write(address, value);
    }
    bench.write(CR1, USART_ON);
    bench.run(WORD_NS);
    bench.say(&[10]);
    bench.run(10 * WORD_NS);
    assert_eq!(bench.read(STATUS) & 0xF, GLOBAL | ERROR);
    assert_eq!(bench.read(CCR1) & EN, 0, "switched off");
    assert_eq!(bench.interrupt(), Some(Level::High));
}

#[test]
fn a_channel_that_is_on_keeps_its_count_and_addresses() {
    let mut bench = Bench::new(USART3_RX);
    bench.start(RDR, 4, MINC);
    bench.say(&[10, 11]);
    bench.run(10 * WORD_NS);
    bench.write(CNDTR1, 9);
    bench.write(CMAR1, RAM + 8);
    assert_eq!((bench.read(CNDTR1), bench.read(CMAR1)), (2, RAM));
    bench.write(CCR1, MINC);
    bench.write(CNDTR1, 9);
    assert_eq!(bench.read(CNDTR1), 9, "off, it takes them");
}

#[test]
fn a_request_that_the_multiplexer_does_not_lead_there_moves_nothing() {
    let mut bench = Bench::new(USART3_TX + 2);
    bench.start(RDR, 4, MINC);
    bench.say(&[10]);
    bench.run(10 * WORD_NS);
    assert_eq!((bench.read(CNDTR1), bench.ram.0), (4, [0; 16]));
}
