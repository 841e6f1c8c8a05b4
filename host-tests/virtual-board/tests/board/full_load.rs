//! The image at full load: nothing is lost, nothing comes twice, no queue grows, and who counts
//! agrees with the wires. What the core alone does for hours is in host-tests/src/long_run.rs.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::{
    AxisParameter, BusCounters, CycleResult, GatewayParameter, Overruns, ProtocolSet, StateField,
    StateFields, Value,
};
use mgw_client::{AxisSetpoint, Client, make_velocity};
use mgw_sim::{Injection, MotorWiring};
use virtual_board::board::Board;
use virtual_board::machine::Machine;
use virtual_board::outside::Outside;
use virtual_board::rs485_line::SentByte;
use virtual_board::transport::BoardTransport;
use virtual_board::usual::{self, Axis, REPLY_WINDOW};
use virtual_stm32::fdcan::{FrameEnd, Sender};

use crate::lab::{MOTOR_TIMEOUT, SEED, bus_rs485};

/// RMD motors on each CAN bus at 1 Mbit/s.
const PER_CAN: u8 = 4;
/// What a motor takes to begin its reply.
const REPLY_TIME: Duration = Duration::from_micros(100);
/// How often the host gives all axes new setpoints, beside it.
const SETPOINTS_EVERY: Duration = Duration::from_millis(10);
const TTL: Duration = Duration::from_millis(150);
const TTL_US: u32 = 200_000;
const LINK_SILENCE_US: u32 = 1_000_000;
const BAUD: u32 = 3_000_000;
const FIELDS: StateFields =
    StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current]);
/// So many setpoints may be answered in a later period only, behind polls.
const UNANSWERED_PERCENT: u64 = 15;
/// What a cycle of the host may take, its time on the line included.
const CYCLE_TAKES: Duration = Duration::from_millis(5);
/// How often everybody's counts are compared.
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// The part of an id that tells the motors of a bus from each other.
const NODE: u32 = 0xF;

/// Bytes of a message on RS485.
const MESSAGE: usize = 13;

/// What came of it.
#[derive(Debug, Default)]
struct Tally {
    lasted: Duration,
    cycles: u64,
    slowest_cycle: Duration,
    periods: u64,
    told: u64,
    answered: u64,
    unanswered: u64,
    overruns: Overruns,
    /// The latest begin of a period.
    late_us: u32,
    /// Requests on all wires, and replies.
    asked: u64,
    replied: u64,
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Overruns { bus, motor, host, gateway } = self.overruns;
        write!(
            f,
            "{:.2} s: {} frames sent, {} heard; {} periods, {} told, {} us late at most; \
             {} setpoints answered in their period, {} later; overruns: bus {bus}, motor {motor}, \
             host {host}, gateway {gateway}; {} cycles beside, the slowest {} us",
            self.lasted.as_secs_f64(),
            self.asked,
            self.replied,
            self.periods,
            self.told,
            self.late_us,
            self.answered,
            self.unanswered,
            self.cycles,
            self.slowest_cycle.as_micros(),
        )
    }
}

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

struct Run {
    machine: Rc<RefCell<Machine>>,
    outside: Outside,
    client: Client<BoardTransport>,
    epoch: u32,
    setpoints: Vec<AxisSetpoint>,
    begun: Duration,
    /// By bus.
    wires: Vec<Wire>,
    /// What the gateway counted when it began.
    before: Vec<BusCounters>,
    period: Option<u32>,
    tally: Tally,
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

/// Buses, their rates, and how many motors each has.
fn buses() -> Vec<(u8, u32, u8)> {
    let can = (0..bus_rs485()).map(|bus| (bus, 1_000_000, PER_CAN));
    can.chain([(bus_rs485(), 2_000_000, full().0)]).collect()
}

impl Run {
    fn begin() -> Self {
        let motors = buses().into_iter().flat_map(|(bus, bitrate, count)| {
            (1..=count).map(move |node| usual::rmd(bus, node, bitrate))
        });
        let motors: Vec<MotorWiring> = motors.collect();
        let mut board = Machine::builder();
        let outside = Outside::connect(&mut board, &motors, SEED).expect("a sound wiring");
        let machine = Rc::new(RefCell::new(board.power_on()));
        for motor in 0..outside.motors() {
            let delay = Injection::ReplyTime(Some(REPLY_TIME));
            outside.inject(&mut machine.borrow_mut(), motor, delay);
        }
        let transport = BoardTransport::new(&machine, outside.hosts[0]);
        let mut client = Client::connect_as(transport, 1, 1).expect("hello");
        let axes: Vec<u8> = (0..u8::try_from(motors.len()).expect("a few")).collect();
        let epoch = set_up(&mut client, &axes);
        let setpoints = axes.iter().map(|axis| make_velocity(*axis, 1.0)).collect();
        let begun = client.now();
        let mut run = Self {
            machine,
            outside,
            client,
            epoch,
            setpoints,
            begun,
            wires: vec![Wire::default(); buses().len()],
            before: Vec::new(),
            period: None,
            tally: Tally::default(),
        };
        run.cycle();
        // Of the start: buses, arming, the first setpoints.
        run.client.pause(SETPOINTS_EVERY).expect("a link");
        while run.client.poll_event(Duration::ZERO).expect("a link").is_some() {}
        run.rest();
        run.read_wires();
        run.wires.iter_mut().for_each(|wire| (wire.asked, wire.replied) = (0, 0));
        run.before = run.counters();
        run.begun = run.client.now();
        run.client.run_cycle(&axes, FIELDS, full().1).expect("the buses have time");
        run
    }

    /// Until no reply is under way.
    fn rest(&mut self) {
        let free = |run: &Self| run.wires.iter().all(|wire| wire.open.is_empty());
        for _ in 0..100 {
            if self.read_wires() && free(self) {
                return;
            }
            self.machine.borrow_mut().run_for(Duration::from_micros(50));
        }
        panic!("never at rest: {:?}", self.wires);
    }

    fn counters(&mut self) -> Vec<BusCounters> {
        let of = |(bus, ..): (u8, _, _)| self.client.bus_status(bus).expect("a status").counters;
        buses().into_iter().map(of).collect()
    }

    /// A cycle that the host asks for beside the gateway's own.
    fn cycle(&mut self) {
        let begin = self.client.now();
        #[expect(clippy::cast_precision_loss, reason = "a hundred")]
        let speed = 1.0 + (self.tally.cycles % 100) as f32 / 100.0;
        for of in &mut self.setpoints {
            *of = make_velocity(of.axis, speed);
        }
        let states = self.client.cycle(self.epoch, &self.setpoints, FIELDS, TTL).expect("a cycle");
        for state in states {
            let is_fine = matches!(state.result, CycleResult::Answered | CycleResult::Superseded);
            assert!(is_fine, "a cycle: axis {}: {}", state.axis, state.result);
        }
        self.tally.cycles += 1;
        let took = self.client.now() - begin;
        self.tally.slowest_cycle = self.tally.slowest_cycle.max(took);
    }

    fn last(&mut self, duration: Duration) {
        let mut next_setpoints = self.client.now();
        let mut next_look = next_setpoints + LOOK_EVERY;
        let end = self.begun + duration;
        while self.client.now() < end {
            next_setpoints += SETPOINTS_EVERY;
            self.cycle();
            self.hear();
            let rest = next_setpoints.saturating_sub(self.client.now());
            self.client.pause(rest).expect("a link");
            self.hear();
            if self.client.now() >= next_look {
                next_look += LOOK_EVERY;
                self.look();
            }
        }
        self.tally.lasted = self.client.now() - self.begun;
    }

    /// Takes what was told of periods.
    fn hear(&mut self) {
        while let Some(message) = self.client.poll_cycle(Duration::ZERO).expect("a link") {
            assert_eq!(message.dropped, 0, "events were lost");
            let event = message.event;
            assert!(self.period.is_none_or(|before| event.period > before), "told twice");
            for state in event.states() {
                match state.result {
                    CycleResult::Answered => self.tally.answered += 1,
                    CycleResult::Superseded => self.tally.unanswered += 1,
                    result => panic!("axis {}: {result}", state.axis),
                }
            }
            self.period = Some(event.period);
            self.tally.periods = u64::from(event.period) + 1;
            self.tally.told += 1;
            self.tally.overruns = event.overruns;
            self.tally.late_us = self.tally.late_us.max(event.late_us);
        }
        let told = self.client.poll_event(Duration::ZERO).expect("a link");
        assert!(told.is_none(), "{told:?}");
    }

    /// Takes what was on the wires: each request has its one reply. Whether RS485 is silent.
    fn read_wires(&mut self) -> bool {
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
        let joined = |one: &SentByte, next: &SentByte| {
            next.first_bit < one.end + (one.end - one.first_bit) / 2
        };
        let requests: Vec<_> = rs485.sent().chunk_by(joined).collect();
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

    /// Whether something waits longer and longer.
    fn look(&mut self) {
        self.read_wires();
        let losses = self.client.losses();
        let lost = losses.damaged + losses.late + losses.events_lost + losses.events_dropped;
        assert_eq!(lost + losses.unreadable, 0, "on the way to the host: {losses:?}");
        let backlog = self.machine.borrow_mut().line(self.outside.hosts[0]).unsent();
        assert_eq!(backlog, 0, "bytes that have not left to the gateway");
        let Tally { periods, told, overruns, answered, unanswered, .. } = self.tally;
        let passed = u64::from(overruns.host) + u64::from(overruns.gateway);
        // The one under way may be counted already, and has not been told.
        assert!(periods <= told + passed + 1, "{}", self.tally);
        assert!(unanswered * 100 <= (answered + unanswered) * UNANSWERED_PERCENT, "{}", self.tally);
        assert!(self.tally.slowest_cycle <= CYCLE_TAKES, "{}", self.tally);
    }

    /// Ends the cycle, and compares what the gateway and the wires have counted.
    fn end(mut self) -> Tally {
        self.client.run_cycle(&[], FIELDS, full().1).expect("over");
        self.rest();
        let after = self.counters();
        for (((bus, ..), wire), (before, after)) in
            buses().iter().zip(&self.wires).zip(self.before.iter().zip(&after))
        {
            let counted = |of: fn(&BusCounters) -> u32| u64::from(of(after) - of(before));
            let (sent, heard) = (counted(|of| of.transmitted), counted(|of| of.received));
            // One exchange may lie between a look at the counters and one at the wire.
            assert!(
                sent.abs_diff(wire.asked) <= 1 && heard.abs_diff(wire.replied) <= 1,
                "bus {bus} counts {sent} and {heard}, its wire {} and {}",
                wire.asked,
                wire.replied
            );
            let BusCounters { transmitted, received, cancelled, .. } = *after;
            let none = BusCounters { transmitted, received, cancelled, ..*before };
            assert_eq!(*after, none, "bus {bus}: something was lost");
            self.tally.asked += wire.asked;
            self.tally.replied += wire.replied;
        }
        self.tally
    }
}

fn set_up(client: &mut Client<BoardTransport>, axes: &[u8]) -> u32 {
    client.set_baud(BAUD).expect("a rate that is offered");
    let silence = Value::Unsigned(LINK_SILENCE_US);
    client.configure_gateway(GatewayParameter::LinkSilenceUs, silence).expect("taken");
    let mut axis = axes.iter().copied();
    for (bus, bitrate, count) in buses() {
        let protocols = ProtocolSet::of(&[host_protocol::Protocol::Rmd]);
        client.configure_bus(bus, bitrate, protocols, false, REPLY_WINDOW).expect("a bus");
        for (node, axis) in (1..=count).zip(&mut axis) {
            let place = Axis { node: node.into(), ..Axis::rmd(bus) };
            place.configure(client, axis).expect("parameters");
            usual::set_axis(client, axis, &[(AxisParameter::TtlUs, TTL_US)]).expect("a TTL");
            let ms = u32::try_from(MOTOR_TIMEOUT.as_millis()).expect("small");
            client.provision_motor_timeout(axis, ms).expect("the motor's own timeout");
        }
    }
    client.arm_together(axes).expect("armed")
}

/// At full load for so long.
fn full_load(duration: Duration) {
    let mut run = Run::begin();
    run.last(duration);
    let tally = run.end();
    println!("full-load: {} | {tally}", Board::chosen().name());
    let periods = duration.as_micros() / full().1.as_micros();
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
