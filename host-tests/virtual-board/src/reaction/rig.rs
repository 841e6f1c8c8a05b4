//! A situation, set up once; every reaction is a branch of the run that has led there.
//!
//! One board serves all situations of its bus: between two of them it is switched off and on, and
//! so are the motors. What the emulator has translated stays, which takes most of the time of a new
//! board.

use std::cell::{OnceCell, RefCell};
use std::ops::{ControlFlow, Range};
use std::rc::Rc;
use std::time::Duration;

use host_protocol::replies::Pong;
use host_protocol::requests::{Cycle, Ping};
use host_protocol::{
    AxisParameter, CanFrame, ClearTarget, FixedU32, GatewayParameter, Kind, Protocol, ProtocolSet,
    Reply, Setpoint, StateField, StateFields, StopAction, StopTarget, Value,
};
use mgw_client::{Client, ClientError};
use mgw_sim::MotorWiring;

use super::computers::{
    BITS_PER_BYTE, Cause, SEQUENCE, computer, each_frame, flood, garbage, told,
};
use super::situation::{Bus, Load, Part, Place, Situation};
use super::stops::{self, FirstStops};
use super::{trace, turns};
use crate::board::{Board, serial_port};
use crate::machine::{Builder, CanNode, CanPort, Machine, UartPort};
use crate::measure::Functions;
use crate::nodes::{Probe, since_start};
use crate::outside::Outside;
use crate::rs485_line::Rs485Line;
use crate::transport::BoardTransport;
use crate::usual::{self, REPLY_WINDOW};
use virtual_stm32::Chip;

/// Decides the motors' reply times.
const SEED: u64 = 1;
const MOTOR_TIMEOUT_MS: u32 = 1_000;
/// Nothing expires while nobody speaks.
const TTL: Duration = Duration::from_secs(60);
const LINK_SILENCE_US: u32 = 10_000_000;
/// Polls of axes that are to be quiet.
const RARELY_US: u32 = 1_000_000;
/// For motors to come up to speed, and for a load to be carried evenly.
const SETTLED: Duration = Duration::from_millis(300);
/// For every axis to stop and to confirm it.
const STOPPED: Duration = Duration::from_secs(2);
/// A situation lasts for so long at least behind where it begins.
const LASTS: Duration = Duration::from_millis(400);
/// How long after a bound a branch ends if its stops have come: the last has to be at its end to
/// count.
const SOON: Duration = Duration::from_millis(2);
/// How long after a bound a stop that is late is still waited for.
const PATIENCE: Duration = Duration::from_millis(100);
/// The rate of its line where many buses run a cycle.
const CYCLE_BAUD: u32 = 3_000_000;
/// What the host is told of every axis in each period of a cycle.
const CYCLE_FIELDS: StateFields =
    StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current]);
/// The same of D5 motors, whose replies to setpoints tell no number: each would be read beside them.
const D5_CYCLE_FIELDS: StateFields = StateFields::NONE;

const MOTION: Setpoint = Setpoint::Velocity { velocity_rad_s: 2.0 };
/// Setpoints that are to expire together do so this long behind their request, which is long.
const EXPIRES_AFTER: Duration = Duration::from_millis(20);
/// A ping is answered, whatever else the gateway does.
const ANSWERED: Duration = Duration::from_millis(10);

/// How long a board is off between two situations, and until all is at rest then.
const OFF: Duration = Duration::from_millis(10);
const AT_REST: Duration = Duration::from_secs(1);
/// How long the computers have sent without a pause when the command follows, at least.
const FLOODED: Duration = Duration::from_millis(4);
/// How long they do so once before.
const REHEARSED: Duration = Duration::from_millis(20);
/// Noise on the RS485 line lasts for so long: more than a branch whose stops come in time.
const NOISE: Duration = Duration::from_millis(40);
/// Bits per second of the buses that are there to be flooded.
const FLOODED_CAN: (u8, u32) = (1, 1_000_000);
const FLOODED_BAUD: u32 = 2_000_000;

/// A board with the motors of one bus.
pub(super) struct Stand {
    bus: Bus,
    machine: Rc<RefCell<Machine>>,
    outside: Outside,
    probes: [CanNode<Probe>; 2],
    is_used: bool,
}

/// A situation.
pub(super) struct Rig {
    situation: Situation,
    machine: Rc<RefCell<Machine>>,
    /// From where the board stands to the first phase.
    begin: Duration,
    build_id: String,
    /// That of all axes.
    epoch: u32,
    gateway_ahead_ns: OnceCell<i128>,
}

/// A board with what hangs on it, not yet switched on.
fn wired(board: &dyn Fn() -> Builder, bus: Bus) -> (Builder, Outside, [CanNode<Probe>; 2]) {
    let motors = |part: Part| {
        let (bus, index) = (part.bus, part.index);
        part.nodes().map(move |(_, node)| MotorWiring {
            bus: index,
            protocol: bus.protocol(),
            node,
            bitrate: bus.bitrate(),
            can_id: None,
        })
    };
    let motors: Vec<MotorWiring> = bus.parts().into_iter().flat_map(motors).collect();
    let mut board = board();
    let outside = Outside::connect(&mut board, &motors, SEED).expect("a sound wiring");
    let probes =
        [CanPort::Bus0, CanPort::Bus1].map(|port| board.can_node(port, Probe::new(), None));
    (board, outside, probes)
}

impl Stand {
    /// Switches it on.
    pub(super) fn new(board: &dyn Fn() -> Builder, bus: Bus) -> Self {
        let (powered_off, outside, probes) = wired(board, bus);
        let machine = Rc::new(RefCell::new(powered_off.power_on()));
        Self { bus, machine, outside, probes, is_used: false }
    }

    /// Sets a situation of its bus up. The one before is over.
    /// Panics if the gateway refuses what it should do.
    pub(super) fn set_up(&mut self, situation: Situation) -> Rig {
        assert_eq!(situation.bus, self.bus);
        let is_first = !std::mem::replace(&mut self.is_used, true);
        if !is_first {
            self.start_anew();
        }
        let connect = |link: usize, session| {
            let transport = BoardTransport::new(&self.machine, self.outside.hosts[link]);
            Client::connect_as(transport, session, 1).expect("hello")
        };
        let mut client = connect(0, 1);
        let build_id = client.hello().build_id.to_string();
        let rehearsed =
            |client: &mut _| if is_first { rehearse(client, situation) } else { Ok(()) };
        configure(&mut client, situation)
            .and_then(|()| rehearsed(&mut client))
            .unwrap_or_else(|error| panic!("{situation}: {error}"));
        let mut rig = Rig {
            situation,
            machine: Rc::clone(&self.machine),
            begin: Duration::ZERO,
            build_id,
            epoch: 0,
            gateway_ahead_ns: OnceCell::new(),
        };
        if self.bus.is_of_many() {
            // Before there is a load beside which a ping would wait.
            drop(connect(1, 3));
            rig.gateway_ahead_ns();
        }
        rig.epoch =
            arm(&mut client, situation).unwrap_or_else(|error| panic!("{situation}: {error}"));
        // Known there, but without a say.
        drop((client, connect(1, 2)));
        {
            let mut machine = self.machine.borrow_mut();
            let now = machine.now();
            match situation.load {
                Load::Foreign(Place::BehindAll) => {
                    self.babble(&mut machine, &[self.bus.index()], situation, now)
                }
                Load::All => {
                    self.babble(&mut machine, &[self.bus.index(), FLOODED_CAN.0], situation, now)
                }
                Load::Quiet | Load::Own | Load::Cycle | Load::Foreign(_) | Load::Hosts(_) => {}
            }
            if let Some(of) = situation.load.flood() {
                // So that branches find translated what serves it; it is over long before they
                // begin.
                for host in self.outside.hosts {
                    machine.line(host).send(&flood(of, REHEARSED));
                }
            }
            machine.run_for(SETTLED);
            let ports = machine.board().can_ports;
            for port in ports {
                machine.can_mut(*port).take_log();
            }
            machine.line(self.outside.rs485).clear_sent();
            if situation.load == Load::All {
                let bytes = garbage(NOISE, FLOODED_BAUD);
                machine.drive_line(self.outside.rs485, |line, timeline| {
                    line.disturb(&bytes, false, timeline)
                });
            }
        }
        match situation.load {
            Load::Own | Load::Cycle | Load::Foreign(Place::BehindAll) | Load::All => {}
            Load::Quiet | Load::Hosts(_) => rig.begin = rig.quiet_spell(),
            Load::Foreign(_) => {
                rig.begin = rig.quiet_spell();
                let mut machine = self.machine.borrow_mut();
                let from = machine.now() + rig.begin;
                self.babble(&mut machine, &[self.bus.index()], situation, from);
            }
        }
        rig
    }

    /// Switches board and motors off and on, and has nobody else send any more.
    fn start_anew(&self) {
        let mut machine = self.machine.borrow_mut();
        for probe in self.probes {
            machine.node(probe).forget_unsent();
            machine.node(probe).clear();
        }
        for motor in 0..self.outside.motors() {
            self.outside.power_cycle(&mut machine, motor);
        }
        machine.power_cycle(OFF);
        machine.run_for(AT_REST);
        for host in self.outside.hosts {
            machine.line(host).clear();
        }
    }

    /// A node on each of these buses sends without a pause from an instant on.
    fn babble(&self, machine: &mut Machine, buses: &[u8], situation: Situation, from: Duration) {
        let frames = (SETTLED + LASTS).as_nanos() / (situation.bus.frame() * 3 / 4).as_nanos();
        let frame = CanFrame::standard(situation.load_id(), &[0x55; 8]).expect("a frame");
        for bus in buses {
            let probe = machine.node(self.probes[usize::from(*bus)]);
            for _ in 0..frames {
                probe.send(from, &frame);
            }
        }
    }
}

impl Rig {
    /// The build of the firmware.
    pub(super) fn build_id(&self) -> &str {
        &self.build_id
    }

    /// That the setpoints of all axes expire at one instant, a while and `after` behind the begin
    /// of the situation.
    pub(super) fn expiry(&self, after: Duration) -> Cause {
        let axes = self.situation.bus.axes();
        let ahead = self.gateway_ahead_ns();
        let expires = self.machine.borrow().now() + self.begin + after + EXPIRES_AFTER;
        let expires_at_us = (signed_ns(expires) + ahead) / 1000;
        let since = Duration::from_nanos(
            u64::try_from(expires_at_us * 1000 - ahead).expect("behind the start"),
        );
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "modulo 2³²")]
        let expires_at_us = FixedU32(expires_at_us as u32);
        let cycle = Cycle {
            epoch: FixedU32(self.epoch),
            expires_at_us,
            fields: StateFields::NONE,
            axes: u32::MAX >> (u32::BITS - u32::from(axes)),
            setpoints: (0..axes).map(|_| MOTION).collect(),
        };
        Cause::since(since, &cycle)
    }

    /// By how much the gateway's clock is ahead of the machine's, at least: it is read when a ping
    /// has come in.
    fn gateway_ahead_ns(&self) -> i128 {
        *self.gateway_ahead_ns.get_or_init(|| {
            let ping = Cause::command(&Ping {});
            let report = self.branch(Duration::ZERO, &ping, ANSWERED, |part, since| {
                let mut pong = None;
                each_frame(&told(part), |frame| {
                    if (frame.kind, frame.sequence) == (Kind::Reply, SEQUENCE) {
                        pong = Reply::decode(frame.number, frame.body).ok();
                    }
                });
                let Some(Reply::Ping(Pong { time_us })) = pong else { panic!("no pong: {pong:?}") };
                (i128::from(time_us) * 1000 - signed_ns(since)).to_le_bytes().to_vec()
            });
            i128::from_le_bytes(report.try_into().expect("one number"))
        })
    }

    /// Has `cause` come, so long after the begin of the situation, in a branch of the run. From
    /// then on to the first stop of each of these axes, bus by bus. Most branches end soon after the
    /// bound;
    /// one whose stops have not all come by then is run once more, for longer.
    pub(super) fn react(
        &self,
        after: Duration,
        cause: &Cause,
        bound: Duration,
        axes: &[Range<u8>],
    ) -> Vec<Vec<Option<Duration>>> {
        let among = |stops: FirstStops| {
            let of = |axes: &Range<u8>| stops[axes.start.into()..axes.end.into()].to_vec();
            axes.iter().map(of).collect::<Vec<_>>()
        };
        let soon = among(self.first_stops_within(after, cause, bound + SOON));
        if soon.iter().flatten().all(Option::is_some) {
            return soon;
        }
        among(self.first_stops_within(after, cause, bound + PATIENCE))
    }

    fn first_stops_within(&self, after: Duration, cause: &Cause, within: Duration) -> FirstStops {
        let bus = self.situation.bus;
        let found = self.branch(after, cause, within, move |part, since| {
            let stops = first_stops(part, bus, since);
            let nanos = |stop: &Option<Duration>| {
                stop.map_or(u64::MAX, |stop| u64::try_from(stop.as_nanos()).expect("short"))
            };
            stops.iter().flat_map(|stop| nanos(stop).to_le_bytes()).collect()
        });
        let mut stops = FirstStops::default();
        for (stop, nanos) in stops.iter_mut().zip(words(&found)) {
            *stop = (nanos != u64::MAX).then(|| Duration::from_nanos(nanos));
        }
        stops
    }

    /// The same; what the bus carried meanwhile, as text.
    pub(super) fn trace(&self, after: Duration, cause: &Cause, bound: Duration) -> String {
        let bus = self.situation.bus;
        let found = self.branch(after, cause, bound + PATIENCE, move |part, since| {
            let carried = |Part { index, .. }| match usize::from(index) {
                _ if !bus.is_can() => trace::of_bytes(line(part).sent(), since),
                bus => trace::of_frames(part.fdcan(bus).log(), since),
            };
            bus.counted().into_iter().map(carried).collect::<Vec<_>>().join("\n").into_bytes()
        });
        String::from_utf8(found).expect("it was text")
    }

    /// The longest turns of the tasks, as text. The board goes on meanwhile.
    pub(super) fn turns(&self, functions: &Functions) -> String {
        turns::longest(&mut self.machine.borrow_mut(), functions)
    }

    /// Every turn of them behind what makes them stop, as text. The board has stopped them then.
    pub(super) fn turns_behind(
        &self,
        after: Duration,
        cause: &Cause,
        functions: &Functions,
    ) -> String {
        let mut machine = self.machine.borrow_mut();
        machine.run_for(self.begin + after);
        computer(machine.part_mut(), cause.from).send(&cause.bytes);
        let now = machine.now();
        machine.run_for(cause.since.map_or(Duration::ZERO, |since| since - now));
        turns::in_order(&mut machine, functions)
    }

    /// Has `cause` come in a branch of the run, and a report made of the part and of when it came.
    fn branch(
        &self,
        after: Duration,
        cause: &Cause,
        within: Duration,
        report: impl FnOnce(&mut Chip, Duration) -> Vec<u8> + Send + 'static,
    ) -> Vec<u8> {
        let (command, from) = (cause.bytes.clone(), cause.from);
        let mut machine = self.machine.borrow_mut();
        let begin = self.begin + after;
        // The command is behind what its computer has sent, and the other one sends as well.
        let (before, behind) = match self.situation.load.flood() {
            Some(of) => (flood(of, FLOODED), flood(of, within)),
            None => (Vec::new(), Vec::new()),
        };
        let bits = BITS_PER_BYTE * u64::try_from(before.len() + command.len()).expect("short");
        let takes = Duration::from_nanos(bits * Board::chosen().host_1_bit_ps / 1000);
        let sent = machine.now() + begin;
        let since = cause.since.unwrap_or(sent + takes);
        let send = move |part: &mut Chip, _| {
            assert_eq!(
                computer(part, UartPort::Host1).settings().bit_ps,
                Board::chosen().host_1_bit_ps,
                "as fast as it should be"
            );
            for port in [UartPort::Host0, UartPort::Host1] {
                let command = if port == from { &command[..] } else { &[] };
                computer(part, port).send(&[&before[..], command, &behind[..]].concat());
            }
        };
        machine.branch(begin, send, since - sent + within, move |part| report(part, since))
    }

    /// When the longest pause of the bus begins, with a margin: from where the board stands.
    fn quiet_spell(&self) -> Duration {
        let mut machine = self.machine.borrow_mut();
        let (begin, bus) = (machine.now(), self.situation.bus);
        let ends = move |part: &mut Chip| {
            let ends: Vec<Duration> = match bus.index() {
                _ if !bus.is_can() => line(part).sent().iter().map(|sent| sent.end).collect(),
                bus => part
                    .fdcan(usize::from(bus))
                    .log()
                    .iter()
                    .map(|record| since_start(record.end))
                    .collect(),
            };
            ends.iter()
                .flat_map(|end| u64::try_from(end.as_nanos()).expect("short").to_le_bytes())
                .collect()
        };
        let found = machine.branch(Duration::ZERO, |_, _| {}, LASTS, ends);
        let mut busy: Vec<Duration> = words(&found).map(Duration::from_nanos).collect();
        busy.insert(0, begin);
        busy.push(begin + LASTS);
        let spell = busy
            .windows(2)
            .max_by_key(|pair| pair[1].saturating_sub(pair[0]))
            .expect("a begin and an end");
        let (from, to) = (spell[0] + REPLY_WINDOW, spell[1]);
        assert!(to > from + bus.frame() * 2 + REPLY_WINDOW, "{}: never quiet", self.situation);
        from - begin
    }
}

/// Numbers of a branch's report.
fn words(report: &[u8]) -> impl Iterator<Item = u64> {
    report.chunks_exact(8).map(|word| u64::from_le_bytes(word.try_into().expect("eight bytes")))
}

fn line(part: &mut Chip) -> &mut Rs485Line {
    serial_port(part, UartPort::Rs485).peer_mut().expect("a line")
}

fn first_stops(part: &mut Chip, bus: Bus, since: Duration) -> FirstStops {
    let mut stops = FirstStops::default();
    for Part { index, axes, .. } in bus.counted() {
        let of_bus = match usize::from(index) {
            _ if !bus.is_can() => stops::among_bytes(line(part).sent(), since),
            bus => stops::among_frames(part.fdcan(bus).log(), since),
        };
        let axes = usize::from(axes.start)..usize::from(axes.end);
        stops[axes.clone()].copy_from_slice(&of_bus[..axes.len()]);
    }
    stops
}

fn configure(client: &mut Client<BoardTransport>, situation: Situation) -> Result<(), ClientError> {
    let Situation { bus, load } = situation;
    let us = |span: Duration| u32::try_from(span.as_micros()).expect("a minute");
    client.configure_gateway(GatewayParameter::LinkSilenceUs, Value::Unsigned(LINK_SILENCE_US))?;
    for part in bus.parts() {
        let protocols = ProtocolSet::of(&[part.bus.protocol()]);
        client.configure_bus(part.index, part.bus.bitrate(), protocols, false, REPLY_WINDOW)?;
    }
    if bus.is_of_many() {
        // A slower line carries no event of so many axes in each period.
        client.set_baud(CYCLE_BAUD)?;
    }
    if load == Load::All {
        for (bus, bitrate) in [FLOODED_CAN, (Board::chosen().rs485_bus(), FLOODED_BAUD)] {
            usual::start_rmd_bus(client, bus, bitrate)?;
        }
    }
    let (refresh_us, poll_us) =
        if load == Load::Own { bus.busy_periods_us() } else { (RARELY_US, RARELY_US) };
    let places = |part: Part| {
        let index = part.index;
        part.nodes().map(move |(axis, node)| (axis, index, node))
    };
    for (axis, index, node) in bus.parts().into_iter().flat_map(places) {
        let values = [
            (AxisParameter::TtlUs, us(TTL)),
            (AxisParameter::RefreshUs, RARELY_US),
            (AxisParameter::StatePollUs, RARELY_US),
            (AxisParameter::FaultPollUs, RARELY_US),
            (AxisParameter::StopAction, StopAction::Hold.into()),
            (AxisParameter::Protocol, bus.protocol().into()),
            (AxisParameter::Node, node.into()),
            // From here on it counts on its bus.
            (AxisParameter::Bus, index.into()),
        ];
        usual::set_axis(client, axis, &values)?;
        if bus.protocol() != Protocol::D5 {
            client.provision_motor_timeout(axis, MOTOR_TIMEOUT_MS)?;
        }
    }
    // Not before: an axis whose motor's own timeout is not known yet takes more of its bus.
    for axis in 0..bus.axes() {
        let values =
            [(AxisParameter::RefreshUs, refresh_us), (AxisParameter::StatePollUs, poll_us)];
        usual::set_axis(client, axis, &values)?;
    }
    Ok(())
}

/// Arms all axes, in the epoch that it returns; they move if they are the load.
fn arm(
    client: &mut Client<BoardTransport>,
    Situation { bus, load }: Situation,
) -> Result<u32, ClientError> {
    let axes: Vec<u8> = (0..bus.axes()).collect();
    let epoch = client.arm_together(&axes)?;
    if matches!(load, Load::Own | Load::Cycle) {
        for axis in &axes {
            client.set(*axis, epoch, MOTION, TTL)?;
        }
    }
    if load == Load::Cycle {
        let is_d5 = bus.protocol() == Protocol::D5;
        let fields = if is_d5 { D5_CYCLE_FIELDS } else { CYCLE_FIELDS };
        client.run_cycle(&axes, fields, bus.cycle_period())?;
    }
    Ok(epoch)
}

/// Once before it counts: from then on the emulator has translated what runs, and branches need not
/// do that again.
fn rehearse(client: &mut Client<BoardTransport>, situation: Situation) -> Result<(), ClientError> {
    arm(client, situation)?;
    client.stop(StopTarget::Axis(0))?;
    client.estop()?;
    client.hold(STOPPED, |_| Ok(ControlFlow::Continue(())))?;
    client.clear(ClearTarget::Gateway)?;
    for axis in 0..situation.bus.axes() {
        client.clear(ClearTarget::Axis(axis))?;
    }
    Ok(())
}

fn signed_ns(span: Duration) -> i128 {
    i128::try_from(span.as_nanos()).expect("short")
}

#[cfg(test)]
mod tests {
    use std::slice;

    use host_protocol::requests::EStop;
    use host_protocol::{Event, EventMessage};

    use virtual_stm32::fdcan::Sender;

    use super::*;
    use crate::reaction::situation::Bus;

    fn e_stop() -> Cause {
        Cause::command(&EStop {})
    }

    /// Under the load of the others' frames there is no pause in which a stop could go unnoticed.
    #[test]
    fn a_load_is_one() {
        let mut stand = Stand::new(&Machine::builder, Bus::Can);
        for load in [Load::Own, Load::Cycle, Load::Foreign(Place::BehindAll)] {
            let situation = Situation { bus: Bus::Can, load };
            let rig = stand.set_up(situation);
            let stops =
                rig.react(Duration::ZERO, &e_stop(), situation.bound(16), &situation.counted());
            assert!(stops.iter().flatten().all(Option::is_some), "{stops:?}");
            assert_eq!(
                rig.react(Duration::ZERO, &e_stop(), situation.bound(16), &situation.counted()),
                stops,
                "the board never knew"
            );
            let mut machine = rig.machine.borrow_mut();
            machine.run_for(Duration::from_millis(20));
            let frames = machine.can(CanPort::Bus0).log();
            let ours = frames.iter().filter(|record| record.sender == Sender::Controller).count();
            match load {
                // A motor whose setpoints are answered is not asked for its speed beside them.
                Load::Own | Load::Cycle => {
                    assert!(ours > 30 && frames.len() > 60, "{ours} of {}", frames.len())
                }
                _ => assert!(frames.len() > 140, "{} frames of others", frames.len()),
            }
        }
    }

    /// What the gateway tells the second host of an e-stop, and of its stops as the bus carries
    /// them.
    fn events_told(rig: &Rig, within: Duration) -> Vec<Event> {
        let bytes = rig.branch(Duration::ZERO, &e_stop(), within, |part, _| told(part));
        let mut events = Vec::new();
        each_frame(&bytes, |frame| {
            if frame.kind == Kind::Event {
                let message = EventMessage::decode(frame.number, frame.body);
                events.push(message.expect("an event of the table").event);
            }
        });
        events
    }

    /// A stop with an id behind that of a load that leaves no pause has no bound. It is reported,
    /// and its axis counts as unreachable; the others are stopped in time.
    #[test]
    fn stops_that_lose_to_a_load_are_reported_and_the_others_leave_in_time() {
        let situation = Situation { bus: Bus::Can, load: Load::Foreign(Place::Middle) };
        let rig = Stand::new(&Machine::builder, situation.bus).set_up(situation);
        let (winners, axes) = (situation.winners(), situation.bus.axes());
        let (all, bound) = (0..axes, situation.bound(winners));
        let stops = &rig.react(Duration::ZERO, &e_stop(), bound, slice::from_ref(&all))[0];
        for (k, stop) in (1..=winners).zip(stops) {
            assert!(
                stop.is_some_and(|at| at <= situation.bound(k)),
                "{situation}: stop {k}: {stop:?}"
            );
        }
        assert!(
            stops[usize::from(winners)..].iter().all(Option::is_none),
            "{situation}: {stops:?}"
        );
        let events = events_told(&rig, situation.bound(axes) + PATIENCE * 2);
        let named =
            |name: fn(&Event) -> Option<u8>| events.iter().filter_map(name).collect::<Vec<_>>();
        let unsent = named(|event| match event {
            Event::AxisUnreachable { axis, stop_transmitted: false } => Some(*axis),
            _ => None,
        });
        assert_eq!(unsent, (winners..axes).collect::<Vec<_>>(), "{situation}");
        // Sixteen events wait for a host, and those of the trips come before.
        let delayed = named(|event| match event {
            Event::StopDelayed { axis, .. } => Some(*axis),
            _ => None,
        });
        let loses = |axis: &u8| (winners..axes).contains(axis);
        assert!(!delayed.is_empty() && delayed.iter().all(loses), "{situation}: {delayed:?}");
    }
}
