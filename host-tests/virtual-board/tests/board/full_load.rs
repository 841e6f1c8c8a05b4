//! The image [at full load](host_tests::full_load): each request on its wires has its one reply.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::rc::Rc;
use std::time::Duration;

use host_tests::full_load::{FullBus, FullLoad, REPLY_TIME};
use mgw_client::Client;
use mgw_sim::{Injection, MotorWiring};
use virtual_board::board::Board;
use virtual_board::machine::Machine;
use virtual_board::outside::Outside;
use virtual_board::rs485_line::messages;
use virtual_board::transport::BoardTransport;
use virtual_stm32::fdcan::{FrameEnd, Sender};

use crate::lab::{SEED, bus_rs485};

/// RMD motors on each CAN bus at 1 Mbit/s.
const PER_CAN: u8 = 4;
const BAUD: u32 = 3_000_000;
/// How often everybody's counts are compared.
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// The part of an id that tells the motors of a bus from each other.
const NODE: u32 = 0xF;
/// Bytes of a message on RS485.
const MESSAGE: usize = 13;

/// What a bus has carried.
#[derive(Debug, Default, Clone)]
struct Wire {
    asked: u64,
    replied: u64,
    /// Whom a reply is still to come from.
    open: BTreeSet<u32>,
}

impl Wire {
    fn ask(&mut self, node: u32) {
        self.asked += 1;
        assert!(self.open.insert(node), "no reply came from {node}");
    }

    fn reply(&mut self, node: u32) {
        self.replied += 1;
        assert!(self.open.remove(&node), "{node} has replied twice");
    }
}

/// What is outside of the board.
struct Wires {
    machine: Rc<RefCell<Machine>>,
    outside: Outside,
    /// By bus.
    wires: Vec<Wire>,
}

/// RMD motors on RS485 at 2 Mbaud, and the period of all: what the core keeps up with. At 944 µs
/// the frames of four axes fill a CAN bus.
fn full() -> (u8, Duration) {
    let (on_rs485, period_us) = match Board::chosen() {
        Board::NucleoH743zi => (3, 1_050),
        Board::NucleoG474re => (1, 1_250),
    };
    (on_rs485, Duration::from_micros(period_us))
}

fn buses() -> Vec<FullBus> {
    let can = (0..bus_rs485()).map(|bus| FullBus { bus, bitrate: 1_000_000, motors: PER_CAN });
    let rs485 = FullBus { bus: bus_rs485(), bitrate: 2_000_000, motors: full().0 };
    can.chain([rs485]).collect()
}

impl Wires {
    fn connect() -> Self {
        let motors: Vec<MotorWiring> = buses().into_iter().flat_map(FullBus::motors).collect();
        let mut board = Machine::builder();
        let outside = Outside::connect(&mut board, &motors, SEED).expect("a sound wiring");
        let machine = Rc::new(RefCell::new(board.power_on()));
        for motor in 0..outside.motors() {
            let delay = Injection::ReplyTime(Some(REPLY_TIME));
            outside.inject(&mut machine.borrow_mut(), motor, delay);
        }
        Self { machine, outside, wires: vec![Wire::default(); buses().len()] }
    }

    /// Until no reply is under way. Returns how many requests and replies there were on each since
    /// the last time.
    fn rest(&mut self) -> Vec<(u64, u64)> {
        for _ in 0..100 {
            if self.read() && self.wires.iter().all(|wire| wire.open.is_empty()) {
                let wires =
                    std::mem::replace(&mut self.wires, vec![Wire::default(); buses().len()]);
                return wires.iter().map(|wire| (wire.asked, wire.replied)).collect();
            }
            self.machine.borrow_mut().run_for(Duration::from_micros(50));
        }
        panic!("never at rest: {:?}", self.wires);
    }

    /// Takes what was on the wires: each request has its one reply. Whether RS485 is silent.
    fn read(&mut self) -> bool {
        let mut machine = self.machine.borrow_mut();
        let ports = machine.board().can_ports;
        let (line, cans) = self.wires.split_last_mut().expect("a line");
        for (port, wire) in ports.iter().zip(cans) {
            for record in machine.can_mut(*port).take_log() {
                let node = record.frame.id.value() & NODE;
                assert_eq!(record.outcome, FrameEnd::Acknowledged, "{record:?}");
                match record.sender {
                    Sender::Controller => wire.ask(node),
                    Sender::Node(_) => wire.reply(node),
                }
            }
        }
        let rs485 = machine.line(self.outside.rs485);
        let requests: Vec<_> = messages(rs485.sent()).collect();
        // A motor's reply has no name here: there is one behind each request, before the next.
        let begins = requests.iter().map(|message| (message[0].first_bit, true));
        let replies = rs485.replies().iter().map(|reply| (reply.first_bit, false));
        let mut passages: Vec<_> = begins.chain(replies).collect();
        passages.sort_unstable();
        let is_cut = requests.last().is_some_and(|message| message.len() != MESSAGE);
        // The rest of a message that is under way would be another one.
        if !is_cut {
            for (_, is_ours) in passages {
                if is_ours { line.ask(0) } else { line.reply(0) }
            }
            rs485.clear_sent();
        }
        !is_cut
    }

    /// Bytes of the host that have not left to the gateway.
    fn backlog(&self) -> usize {
        self.machine.borrow_mut().line(self.outside.hosts[0]).unsent()
    }
}

/// At full load for so long.
fn full_load(duration: Duration) {
    let (mut wires, period) = (Wires::connect(), full().1);
    let transport = BoardTransport::new(&wires.machine, wires.outside.hosts[0]);
    let client = Client::connect_as(transport, 1, 1).expect("hello");
    let mut load = FullLoad::set_up(client, BAUD, buses(), period).expect("a start");
    wires.rest();
    load.begin().expect("the buses have time");
    while load.tally.lasted < duration {
        load.last_until(load.tally.lasted + LOOK_EVERY).expect("full load");
        wires.read();
        load.look(wires.backlog()).expect("full load");
    }
    load.end().expect("full load");
    let tally = load.compare(&wires.rest()).expect("full load");
    println!("full-load: {} | {tally}", Board::chosen().name());
    let periods = duration.as_micros() / period.as_micros();
    assert!(u128::from(tally.periods) >= periods * 99 / 100, "{tally}");
}

#[test]
fn a_second_of_full_load_loses_nothing() {
    full_load(Duration::from_secs(1));
}

/// By hand, for a minute unless told otherwise.
#[test]
#[ignore = "takes long: .ci/virtual-board load"]
fn a_minute_of_full_load_loses_nothing() {
    let seconds = std::env::var("LOAD_SECONDS")
        .map_or(60, |seconds| seconds.parse().expect("a number of seconds"));
    full_load(Duration::from_secs(seconds));
}
