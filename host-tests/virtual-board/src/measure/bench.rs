//! A board with eight motors, and a computer at host link 0 that speaks the bytes of the protocol.
//!
//! Everything happens on an absolute grid of virtual time: how long an answer takes, or how long
//! the build id in it is, moves nothing that comes later. So a run can be repeated with a look at
//! the instruction count at instants that the first run has found.

use std::collections::VecDeque;
use std::time::Duration;

use host_protocol::{Deframer, Error, Kind, MAX_FRAME, Reply, Request};
use mgw_sim::MotorWiring;

use super::fetches::{self, Fetches, Traced};
use super::stages::Functions;
use super::{SEED, stack};
use crate::host_uart::{HostUart, Received};
use crate::machine::{Builder, CanPort, Line, Machine};
use crate::nodes::instant;
use crate::outside::Outside;
use crate::rs485_line::BITS_PER_BYTE;
use crate::usual;
use virtual_stm32::fdcan::FrameRecord;

/// Axes, each with an RMD motor: the first half on bus 0, the other on bus 1.
pub(super) const AXES: u8 = 8;
/// Bits per second of both buses.
pub(super) const BITRATE: u32 = 1_000_000;

/// By then a board has started: it takes 3 ms.
pub(super) const STARTED: Duration = Duration::from_millis(20);

/// Two instants between which instructions are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) from: Duration,
    pub(super) to: Duration,
}

impl Span {
    pub(super) fn nanos(&self) -> u64 {
        u64::try_from((self.to - self.from).as_nanos()).expect("not for centuries")
    }
}

/// What has been counted by an instant.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Count {
    pub(super) instructions: u64,
    /// What a trace says, where there is one.
    pub(super) trace: Option<Traced>,
}

/// A request and what came of it.
#[derive(Debug, Clone)]
pub(super) struct Answer {
    /// When the last bit of the request had arrived at the board.
    pub(super) asked: Duration,
    /// When the start bit of the reply's first byte began.
    pub(super) first_bit: Duration,
    /// When the stop bit of its last byte ended.
    pub(super) end: Duration,
    /// The reply.
    pub(super) reply: Reply,
}

/// What happened while a bench waited for answers.
#[derive(Debug)]
pub(super) struct Exchange {
    /// When the first bit of the first request was sent.
    pub(super) begin: Duration,
    /// In the order of the requests.
    pub(super) answers: Vec<Answer>,
    /// The frames of both buses since the exchange before, in their order.
    pub(super) frames: [Vec<FrameRecord>; 2],
}

/// The board and the computer.
pub(super) struct Bench {
    machine: Machine,
    host: Line<HostUart>,
    inbox: Inbox,
    sequence: u16,
    /// Where to look at the instruction count, in order.
    marks: VecDeque<Duration>,
    counts: Vec<Count>,
    /// Of these times there is a trace as well, in order.
    traced: VecDeque<Span>,
    functions: Option<Functions>,
    fetches: Option<Fetches>,
}

/// Bus and node of an axis.
pub(super) const fn place(axis: u8) -> (u8, u8) {
    (axis / (AXES / 2), axis % (AXES / 2) + 1)
}

impl Bench {
    /// Switches a board on and lets it start; paints its stack. Looks at the instruction count at
    /// `marks`, which are in order.
    pub(super) fn power_on(
        board: Builder,
        instructions_per_second: u64,
        marks: Vec<Duration>,
    ) -> Self {
        let mut board = board.instructions_per_second(instructions_per_second);
        let motors: Vec<MotorWiring> = (0..AXES)
            .map(|axis| {
                let (bus, node) = place(axis);
                usual::rmd(bus, node, BITRATE)
            })
            .collect();
        let outside = Outside::connect(&mut board, &motors, SEED).expect("a sound wiring");
        let mut machine = board.power_on();
        machine.run_for(STARTED);
        stack::paint_anew(&mut machine);
        let (host, inbox) = (outside.hosts[0], Inbox::default());
        Self {
            machine,
            host,
            inbox,
            sequence: 1,
            marks: marks.into(),
            counts: Vec::new(),
            traced: VecDeque::new(),
            functions: None,
            fetches: None,
        }
    }

    /// Traces the instructions of these times, which are in order and begin and end with a mark,
    /// where the functions of the image are known.
    pub(super) fn traced(mut self, spans: Vec<Span>, functions: Option<Functions>) -> Self {
        self.traced = spans.into();
        self.functions = functions;
        self
    }

    /// Cycles that a read of the flash costs.
    pub(super) fn read_cycles(&mut self) -> u64 {
        fetches::cycles(&mut self.machine)
    }

    /// What was counted at each mark passed.
    pub(super) fn counts(&self) -> &[Count] {
        &self.counts
    }

    /// Bytes of the stack that have been in use since then.
    pub(super) fn stack_used(&mut self) -> u64 {
        stack::used(&mut self.machine)
    }

    pub(super) fn now(&self) -> Duration {
        self.machine.now()
    }

    /// Runs to an instant.
    pub(super) fn run_to(&mut self, at: Duration) {
        while let Some(mark) = self.marks.pop_front_if(|mark| *mark <= at) {
            self.machine.run_to(instant(mark));
            self.count(mark);
        }
        self.machine.run_to(instant(at));
    }

    fn count(&mut self, mark: Duration) {
        if self.fetches.is_none()
            && self.traced.front().is_some_and(|span| span.from == mark)
            && let Some(functions) = &self.functions
        {
            self.fetches = Some(Fetches::begin(&mut self.machine, functions.clone()));
        }
        let trace = self.fetches.as_mut().map(|fetches| fetches.look(&mut self.machine));
        self.counts.push(Count { instructions: self.machine.instructions(), trace });
        if self.traced.pop_front_if(|span| span.to == mark).is_some()
            && let Some(fetches) = self.fetches.take()
        {
            fetches.end(&mut self.machine);
        }
    }

    /// Sends requests at an instant, one right behind the other, and gives the board until `end` to
    /// answer them.
    /// Panics if one of them is refused or not answered.
    pub(super) fn exchange(
        &mut self,
        at: Duration,
        end: Duration,
        requests: &[Request],
    ) -> Exchange {
        self.run_to(at);
        let begin = self.now();
        let host = self.machine.line(self.host);
        let bit_ps = host.settings().bit_ps;
        let lasts =
            |bytes: usize| Duration::from_nanos(bit_ps * BITS_PER_BYTE * bytes as u64 / 1_000);
        self.inbox.read(&host.take_timed(), lasts(1));
        let first = self.sequence;
        let mut sent = 0;
        let mut asked = Vec::new();
        for request in requests {
            let mut frame = [0; MAX_FRAME];
            let length =
                request.encode_frame(self.sequence, &mut frame).expect("a request of the table");
            host.send(&frame[..length]);
            sent += length;
            asked.push(begin + lasts(sent));
            self.sequence = self.sequence.wrapping_add(1);
        }
        self.take_frames();
        self.run_to(end);
        let received = self.machine.line(self.host).take_timed();
        let mut answers = self.inbox.read(&received, lasts(1));
        let answers =
            asked.into_iter().zip(first..).zip(requests).map(|((asked, sequence), request)| {
                let at = answers.iter().position(|answer| answer.sequence == sequence);
                let reply = answers
                    .swap_remove(at.unwrap_or_else(|| panic!("{request:?} is not answered")));
                let Reading { first_bit, end, reply, .. } = reply;
                let reply = reply.unwrap_or_else(|error| panic!("{request:?} is refused: {error}"));
                Answer { asked, first_bit, end, reply }
            });
        Exchange { begin, answers: answers.collect(), frames: self.take_frames() }
    }

    fn take_frames(&mut self) -> [Vec<FrameRecord>; 2] {
        [CanPort::Bus0, CanPort::Bus1].map(|port| self.machine.can_mut(port).take_log())
    }
}

/// A result as it was read.
struct Reading {
    sequence: u16,
    first_bit: Duration,
    end: Duration,
    reply: Result<Reply, Error>,
}

/// What comes from the board: a frame may reach from one exchange into the next.
#[derive(Default)]
struct Inbox {
    deframer: Deframer,
    /// When the first byte of the frame that is coming had arrived.
    opened: Option<Duration>,
}

impl Inbox {
    /// The replies and errors that end in these bytes, each of which lasts for `byte`.
    fn read(&mut self, received: &[Received], byte: Duration) -> Vec<Reading> {
        let mut readings = Vec::new();
        for Received { at, byte: value } in received {
            let opened = *self.opened.get_or_insert(*at);
            let Some(frame) = self.deframer.push(*value) else { continue };
            self.opened = None;
            let frame = frame.expect("a sound frame");
            let reply = match frame.kind {
                Kind::Reply => {
                    Ok(Reply::decode(frame.number, frame.body).expect("a reply of the table"))
                }
                Kind::Error => {
                    Err(Error::decode(frame.number, frame.body).expect("an error of the table"))
                }
                Kind::Request | Kind::WatcherRequest | Kind::Event => continue,
            };
            readings.push(Reading {
                sequence: frame.sequence,
                first_bit: opened - byte,
                end: *at,
                reply,
            });
        }
        readings
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::requests::Ping;

    const RATE: u64 = 250_000_000;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    /// The 12 bytes of a ping, 10 bits each; the port's divider makes 1.09 µs of a bit, 109 cycles
    /// of 100 MHz.
    #[test]
    fn a_request_has_arrived_when_its_last_stop_bit_ends() {
        let mut bench = Bench::power_on(Machine::builder(), RATE, Vec::new());
        let exchange = bench.exchange(ms(20), ms(30), &[Ping {}.into()]);
        let [Answer { asked, first_bit, end, reply: Reply::Ping(_) }] = &exchange.answers[..]
        else {
            panic!("{exchange:?}")
        };
        let took = *asked - ms(20);
        assert_eq!(took, Duration::from_nanos(120 * 1_090));
        assert!(
            first_bit > asked && *end > *first_bit + Duration::from_micros(100),
            "{exchange:?}"
        );
        // The last byte has been on its way for all its ten bits then, not for one more or less.
        let host = bench.host;
        bench.exchange(ms(40), ms(40), &[]);
        bench.machine.line(host).send(&[0; 12]);
        bench.run_to(ms(40) + took.mul_f64(10.9 / 12.0));
        assert_eq!(bench.machine.line(host).unsent(), 1);
        bench.run_to(ms(40) + took.mul_f64(11.1 / 12.0));
        assert_eq!(bench.machine.line(host).unsent(), 0);
    }

    #[test]
    fn marks_are_counted_and_change_nothing() {
        let marks = [ms(25), ms(28), ms(29)];
        let mut bench = Bench::power_on(Machine::builder(), RATE, marks.to_vec());
        let first = bench.exchange(ms(20), ms(30), &[Ping {}.into()]);
        assert_eq!(bench.counts().len(), 3);
        assert!(bench.counts().is_sorted(), "{:?}", bench.counts());
        let mut unmarked = Bench::power_on(Machine::builder(), RATE, Vec::new());
        let second = unmarked.exchange(ms(20), ms(30), &[Ping {}.into()]);
        assert_eq!(first.answers[0].end, second.answers[0].end);
        assert_eq!(bench.machine.access_digest(), unmarked.machine.access_digest());
    }
}
