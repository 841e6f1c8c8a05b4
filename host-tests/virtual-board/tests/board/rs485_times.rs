//! When a frame has left the RS485 line, at every baud rate: the reply window begins with its last
//! stop bit, and nothing of ours lies over a motor's reply.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::{Protocol, ProtocolSet, StopTarget};
use mgw_client::Client;
use mgw_sim::Injection;
use virtual_board::machine::Machine;
use virtual_board::outside::Outside;
use virtual_board::rs485_line::Reply;
use virtual_board::transport::BoardTransport;
use virtual_board::usual::{self, Axis};

use crate::lab::{SEED, bus_rs485};

const BAUDS: [u32; 5] = [115_200, 500_000, 1_000_000, 1_500_000, 2_000_000];
/// The reply window.
const WINDOW: Duration = Duration::from_millis(2);
const MOTOR: usize = 0;
const AXIS: u8 = 0;

/// A board with one motor on its RS485 line.
struct Bench {
    machine: Rc<RefCell<Machine>>,
    outside: Outside,
    client: Client<BoardTransport>,
}

impl Bench {
    fn at(baud: u32) -> Self {
        let mut board = Machine::builder();
        let motor = usual::rmd(bus_rs485(), 1, baud);
        let outside = Outside::connect(&mut board, &[motor], SEED).expect("a sound wiring");
        let machine = Rc::new(RefCell::new(board.power_on()));
        let client = Client::connect_as(BoardTransport::new(&machine, outside.hosts[0]), 1, 1)
            .expect("hello");
        let mut bench = Self { machine, outside, client };
        let rmd = ProtocolSet::of(&[Protocol::Rmd]);
        bench.client.configure_bus(bus_rs485(), baud, rmd, false, WINDOW).expect("a bus");
        Axis::rmd(bus_rs485()).configure(&mut bench.client, AXIS).expect("parameters");
        bench
    }

    fn run_for(&self, duration: Duration) {
        self.machine.borrow_mut().run_for(duration);
    }

    fn clear(&self) {
        self.machine.borrow_mut().line(self.outside.rs485).clear_sent();
    }

    fn replies(&self) -> Vec<Reply> {
        self.machine.borrow_mut().line(self.outside.rs485).replies().to_vec()
    }

    /// The replies that a byte of ours lies over.
    fn overlaps(&self) -> usize {
        let mut machine = self.machine.borrow_mut();
        let line = machine.line(self.outside.rs485);
        let over = |reply: &&Reply| {
            let mut ours = line.sent().iter();
            ours.any(|sent| sent.first_bit < reply.end && reply.first_bit < sent.end)
        };
        line.replies().iter().filter(over).count()
    }

    /// From the last stop bit of the request before the last reply to that reply.
    fn reply_time(&self) -> Duration {
        let reply = *self.replies().last().expect("a reply");
        let mut machine = self.machine.borrow_mut();
        let sent = machine.line(self.outside.rs485).sent().to_vec();
        let request = sent.iter().rfind(|sent| sent.end <= reply.first_bit).expect("a request");
        reply.first_bit - request.end
    }

    /// Makes the motor answer so long after the request.
    fn answer_after(&self, time: Duration) {
        self.outside.inject(&mut self.machine.borrow_mut(), MOTOR, Injection::LateReply(time));
    }
}

#[test]
fn the_reply_window_begins_with_the_last_stop_bit() {
    for baud in BAUDS {
        let mut bench = Bench::at(baud);
        bench.client.read_state(AXIS).expect("a report");
        let usual = bench.reply_time();
        // The reply, 13 bytes, ends just inside the window; it is known a byte later, when the line
        // is idle. The motor's time varies.
        let reply = Duration::from_secs_f64(130.0 / f64::from(baud));
        let end = WINDOW - reply.mul_f64(2.0 / 13.0) - Duration::from_micros(70);
        bench.answer_after(end - reply - usual);
        bench.run_for(Duration::from_millis(20));
        let before = bench.client.bus_status(bus_rs485()).expect("a status").counters;
        for _ in 0..5 {
            bench.client.read_state(AXIS).expect("a report");
        }
        let after = bench.client.bus_status(bus_rs485()).expect("a status").counters;
        let time = bench.reply_time() + reply;
        assert!(time > WINDOW.mul_f64(0.85) && time < WINDOW, "{baud} baud: {time:?}");
        assert_eq!(after.late, before.late, "{baud} baud: late, replies after {time:?}");
        assert!(after.received >= before.received + 5, "{baud} baud: {after:?}");
    }
}

#[test]
fn no_byte_of_ours_lies_over_a_reply() {
    for baud in BAUDS {
        let mut bench = Bench::at(baud);
        bench.client.read_state(AXIS).unwrap_or_else(|error| panic!("{baud} baud: {error}"));
        // A stop waits for a reply for 1 ms.
        bench.answer_after(Duration::from_micros(900).saturating_sub(bench.reply_time()));
        bench.clear();
        for phase in 0..24 {
            bench.client.stop(StopTarget::Axis(AXIS)).expect("taken");
            bench.run_for(Duration::from_micros(40 * phase));
            bench.client.stop(StopTarget::All).expect("taken");
            bench.run_for(Duration::from_millis(10));
        }
        assert!(bench.replies().len() >= 10, "{baud} baud: {} replies", bench.replies().len());
        assert_eq!(bench.overlaps(), 0, "{baud} baud");
    }
}
