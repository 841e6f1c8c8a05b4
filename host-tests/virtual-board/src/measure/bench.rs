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
use crate::host_uart::Received;
use crate::machine::{Builder, CanPort, Machine};
use crate::nodes::instant;
use crate::outside::Outside;
use crate::rs485_line::BITS_PER_BYTE;
use crate::transport::Link;
use crate::{usb_session, usual};
use virtual_stm32::fdcan::FrameRecord;
use virtual_stm32::usb::host::Packet;

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

/// From a packet's begin to the end of its acknowledgement on USB, without its bytes (USB 2.0 §8.4,
/// §7.1.18), and the bits of a microsecond.
const PACKET_BITS: u64 = 35 + 7 + 19;
const USB_BITS_PER_US: u64 = 12;
/// How often it is looked whether a packet on USB has been taken.
const LOOK: Duration = Duration::from_micros(1);

/// The board and the computer.
pub(super) struct Bench {
    machine: Machine,
    link: Link,
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
        let (link, inbox) = (Link::Uart(outside.hosts[0]), Inbox::default());
        Self {
            machine,
            link,
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
        self.take_answers();
        self.take_frames();
        let first = self.sequence;
        let mut sent = 0;
        let mut asked = Vec::new();
        for request in requests {
            let mut frame = [0; MAX_FRAME];
            let length =
                request.encode_frame(self.sequence, &mut frame).expect("a request of the table");
            sent += length;
            self.sequence = self.sequence.wrapping_add(1);
            match self.link {
                Link::Uart(host) => {
                    self.machine.line(host).send(&frame[..length]);
                    asked.push(begin + self.lasts(sent));
                }
                Link::Usb => {
                    self.machine.usb().send(&frame[..length]);
                    while self.machine.usb().unsent() > 0 {
                        self.run_to(self.now() + LOOK);
                    }
                    asked.push(self.now());
                }
            }
        }
        self.run_to(end);
        let mut answers = self.take_answers();
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

    /// What so many bytes to or from the board take on the line; those of a packet on USB count as
    /// one instant.
    fn lasts(&mut self, bytes: usize) -> Duration {
        let Link::Uart(host) = self.link else { return Duration::ZERO };
        let bit_ps = self.machine.line(host).settings().bit_ps;
        Duration::from_nanos(bit_ps * BITS_PER_BYTE * bytes as u64 / 1_000)
    }

    fn take_answers(&mut self) -> Vec<Reading> {
        let byte = self.lasts(1);
        let received = match self.link {
            Link::Uart(host) => self.machine.line(host).take_timed(),
            Link::Usb => {
                let packets = self.machine.usb().take_packets();
                let bytes = |Packet { at, data }: Packet| {
                    let bits = PACKET_BITS + 8 * data.len() as u64;
                    let at = at - Duration::from_nanos(bits * 1_000 / USB_BITS_PER_US);
                    data.into_iter().map(move |byte| Received { at, byte })
                };
                packets.into_iter().flat_map(bytes).collect()
            }
        };
        self.inbox.read(&received, byte)
    }

    /// Has the computer's line run at another rate from now on.
    pub(super) fn set_baud(&mut self, baud: u32) {
        let Link::Uart(host) = self.link else { unreachable!("USB has no rate") };
        self.machine.line(host).set_baud(baud);
    }

    /// Has the computer speak over USB from an instant on.
    pub(super) fn plug_usb(&mut self, at: Duration) {
        self.run_to(at);
        usb_session::connect(&mut self.machine);
        self.link = Link::Usb;
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
        let Link::Uart(host) = bench.link else { unreachable!("as it begins") };
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
