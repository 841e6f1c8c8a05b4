//! The gateway's core: events in any order, at any time.

use std::collections::VecDeque;

use embedded_can::{ExtendedId, Frame as _, StandardId};
use gateway::{Board, BusPort, BusPortKind, Event, Gateway, Instant, Outgoing, Transmit};
use host_protocol::{BootReason, BusState, CanFrame, Deframer, MAX_FRAME};

use crate::host_messages::frame;
use crate::motors::{Reply, reply_to};
use crate::take::Take;

const BUSES: u8 = 3;
const LINKS: u8 = 2;
/// The contract of a port: it never holds more frames.
const TRANSMIT_SLOTS: usize = 2;
/// More frames than this after one event would be a loop.
const MAX_OUTPUT: usize = 1_000;
/// Deadlines that may be due one after another at one moment.
const MAX_TICKS: usize = 100;

static BOARD: Board = Board {
    name: "fuzz",
    firmware: "0.0.0",
    build_id: "fuzz",
    boot: BootReason::Simulated,
    crash_report: "",
    e_stop_input: false,
    enable_output: false,
    buses: &[
        BusPort { kind: BusPortKind::Can, bitrates: &[1_000_000, 500_000] },
        BusPort { kind: BusPortKind::Can, bitrates: &[1_000_000, 210_526] },
        BusPort { kind: BusPortKind::Rs485 { local_echo: true }, bitrates: &[115_200] },
    ],
    bus_limit: None,
    links: LINKS,
};

/// What the next bytes of the input are: the number before each event.
pub mod step {
    pub const WAIT: u8 = 0;
    pub const REQUEST: u8 = 1;
    pub const HOST_BYTES: u8 = 2;
    pub const CAN_FRAME: u8 = 3;
    pub const SERIAL_BYTES: u8 = 4;
    pub const TRANSMITTED: u8 = 5;
    pub const ANSWERED: u8 = 6;
    pub const BUS_STATE: u8 = 7;
    pub const OVERFLOW: u8 = 8;
    pub const NEXT_DEADLINE: u8 = 9;
    pub const KINDS: u8 = 10;
}

/// Microseconds of a unit of [`step::WAIT`].
const WAIT_UNIT_US: u64 = 10;

pub fn check(bytes: &[u8]) {
    let mut bench = Bench::new();
    let mut take = Take(bytes);
    while !take.is_empty() {
        bench.step(&mut take);
        bench.drain();
    }
    bench.settle();
}

struct Bench {
    gateway: Gateway,
    now_us: u64,
    sequence: u16,
    /// Frames that the buses hold.
    held: [VecDeque<Transmit>; BUSES as usize],
    links: [Deframer; LINKS as usize],
}

impl Bench {
    fn new() -> Bench {
        Bench {
            gateway: Gateway::new(&BOARD, Some(0)),
            now_us: 1_000,
            sequence: 0,
            held: [const { VecDeque::new() }; BUSES as usize],
            links: [const { Deframer::new() }; LINKS as usize],
        }
    }

    fn handle(&mut self, event: Event<'_>) {
        self.gateway.handle(Instant::from_micros(self.now_us), event, &mut |_, _| {});
    }

    fn step(&mut self, take: &mut Take<'_>) {
        match take.byte() % step::KINDS {
            step::WAIT => {
                self.now_us += u64::from(take.word()) * WAIT_UNIT_US;
                self.handle(Event::Tick);
            }
            step::REQUEST => {
                let (link, number, length) = (take.byte() % LINKS, take.word(), take.byte());
                self.sequence = self.sequence.wrapping_add(1);
                let frame = frame(1, self.sequence, number, take.bytes(usize::from(length)));
                self.handle(Event::HostBytes { link, bytes: &frame });
            }
            step::HOST_BYTES => {
                let (link, length) = (take.byte() % LINKS, take.byte());
                let bytes = take.bytes(usize::from(length));
                self.handle(Event::HostBytes { link, bytes });
            }
            step::CAN_FRAME => self.can_frame(take),
            step::SERIAL_BYTES => {
                let (bus, length) = (take.byte() % BUSES, take.byte());
                let bytes = take.bytes(usize::from(length));
                self.handle(Event::SerialReceived { bus, bytes });
            }
            step::TRANSMITTED => _ = self.transmit(take.byte() % BUSES),
            step::ANSWERED => {
                let bus = take.byte() % BUSES;
                let reply = self.transmit(bus).and_then(|frame| reply_to(&frame));
                self.now_us += u64::from(take.byte()) * WAIT_UNIT_US;
                match reply {
                    Some(Reply::Can(frame)) => self.handle(Event::CanReceived { bus, frame }),
                    Some(Reply::Serial(bytes)) => {
                        self.handle(Event::SerialReceived { bus, bytes: &bytes })
                    }
                    None => {}
                }
            }
            step::BUS_STATE => {
                let (bus, state) = (take.byte() % BUSES, take.byte());
                let state =
                    [BusState::Active, BusState::Warning, BusState::Passive, BusState::BusOff]
                        [usize::from(state % 4)];
                // A port drops what it holds when its bus goes off.
                if state == BusState::BusOff {
                    self.held[usize::from(bus)].clear();
                }
                let (transmit_errors, receive_errors) = (take.word(), take.word());
                self.handle(Event::BusState { bus, state, transmit_errors, receive_errors });
            }
            step::OVERFLOW => {
                let (bus, lost) = (take.byte() % BUSES, u32::from(take.byte()) + 1);
                self.handle(Event::ReceiveOverflow { bus, lost });
            }
            _ => {
                if let Some(deadline) = self.gateway.next_deadline() {
                    self.now_us = self.now_us.max(deadline.as_micros());
                    self.handle(Event::Tick);
                }
            }
        }
    }

    fn can_frame(&mut self, take: &mut Take<'_>) {
        let (bus, id, length) = (take.byte() % BUSES, take.word(), take.byte() % 9);
        let data = take.bytes(usize::from(length));
        let frame = match StandardId::new(id) {
            Some(id) => CanFrame::new(id, data),
            None => CanFrame::new(ExtendedId::new(id.into()).expect("16 bits"), data),
        };
        let frame = frame.expect("at most 8 bytes");
        self.handle(Event::CanReceived { bus, frame });
    }

    /// The oldest frame of a bus leaves; an RS485 port hears itself.
    fn transmit(&mut self, bus: u8) -> Option<Outgoing> {
        let Transmit { slot, frame } = self.held[usize::from(bus)].pop_front()?;
        if let Outgoing::Serial(bytes) = &frame {
            self.handle(Event::SerialReceived { bus, bytes });
        }
        self.handle(Event::Transmitted { bus, slot });
        Some(frame)
    }

    /// Takes everything the gateway has to say.
    fn drain(&mut self) {
        let now = Instant::from_micros(self.now_us);
        for (bus, held) in (0..).zip(&mut self.held) {
            let mut count = 0;
            while let Some(transmit) = self.gateway.poll_transmit(now, bus) {
                assert!(usize::from(transmit.slot) < TRANSMIT_SLOTS);
                // A slot used again means that the frame in it was withdrawn.
                held.retain(|other| other.slot != transmit.slot);
                held.push_back(transmit);
                count += 1;
                assert!(count < MAX_OUTPUT, "bus {bus} is sent frames without end");
            }
        }
        let mut out = [0; MAX_FRAME];
        for (link, deframer) in (0..).zip(&mut self.links) {
            let mut count = 0;
            while let Some(length) = self.gateway.poll_host(link, &mut out, &mut |_, _| {}) {
                let frames = out[..length].iter().filter(|byte| match deframer.push(**byte) {
                    Some(result) => result.is_ok(),
                    None => false,
                });
                assert_eq!(frames.count(), 1, "one whole frame at a time");
                count += 1;
                assert!(count < MAX_OUTPUT, "link {link} is sent frames without end");
            }
        }
    }

    /// Ticks end the work that is due: no deadline stays in the past.
    fn settle(&mut self) {
        for _ in 0..MAX_TICKS {
            let Some(deadline) = self.gateway.next_deadline() else { return };
            if deadline.as_micros() > self.now_us {
                return;
            }
            self.handle(Event::Tick);
            self.drain();
        }
        panic!("a deadline stays due");
    }
}
