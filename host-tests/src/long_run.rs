//! A gateway at full load for as long as wanted, in virtual time: nothing is lost, nothing comes
//! twice, no queue grows, and all who count agree.

use std::cell::RefCell;
use std::fmt;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::{
    AxisParameter, BusCounters, CycleResult, GatewayParameter, Overruns, Protocol, ProtocolSet,
    StateField, StateFields, StopAction, StopTarget, Value,
};
use mgw_client::{AxisSetpoint, Client, ClientError, make_velocity};
use mgw_sim::{BOARD, Injection, MotorWiring, SimTransport, Station, Wiring, World};

/// Axes: so many RMDs on each of two CAN buses at 1 Mbit/s, and one on RS485.
const PER_BUS: u8 = 4;
const BUSES: [(u8, u32, u8); 3] =
    [(0, 1_000_000, PER_BUS), (1, 1_000_000, PER_BUS), (2, 1_000_000, 1)];
/// What a motor takes to begin its reply.
const REPLY_TIME: Duration = Duration::from_micros(100);
/// The period of the cycle: at 944 µs the frames of four axes fill a bus.
const PERIOD: Duration = Duration::from_micros(1_050);
/// How often the host gives all axes new setpoints, beside it.
const SETPOINTS_EVERY: Duration = Duration::from_millis(10);
const TTL_US: u32 = 200_000;
const TTL: Duration = Duration::from_millis(150);
const BAUD: u32 = 2_000_000;
const FIELDS: StateFields =
    StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current]);
/// The clocks of the host are compared so often, which takes part in the load, too.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// So many setpoints may be answered in the next period only: a poll of 236 µs between those of a
/// bus, of which there are some 40 a second, puts off what is behind it for a few periods.
const UNANSWERED_PERCENT: u64 = 15;

/// What came of it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    /// Virtual time.
    pub lasted: Duration,
    /// Cycles that the host asked for and that were answered.
    pub cycles: u64,
    /// What the slowest of them took.
    pub slowest_cycle: Duration,
    /// Periods of the gateway's own cycle.
    pub periods: u64,
    /// Those that the host was told of.
    pub told: u64,
    /// Setpoints of axes that were answered in their period.
    pub answered: u64,
    /// Those that were not.
    pub unanswered: u64,
    /// As the gateway counts them.
    pub overruns: Overruns,
    /// Frames that the gateway sent, as it counts them.
    pub transmitted: u64,
    /// Frames that it heard.
    pub received: u64,
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Overruns { bus, motor, host, gateway } = self.overruns;
        write!(
            f,
            "{} s: {} frames sent, {} heard; {} periods, {} told; {} setpoints answered in their \
             period, {} later; overruns: bus {bus}, motor {motor}, host {host}, gateway {gateway}; \
             {} cycles beside, the slowest {} us",
            self.lasted.as_secs(),
            self.transmitted,
            self.received,
            self.periods,
            self.told,
            self.answered,
            self.unanswered,
            self.cycles,
            self.slowest_cycle.as_micros(),
        )
    }
}

/// Runs for so long. `tell` hears every minute of virtual time how far it is, and says whether to
/// go on.
///
/// # Errors
/// What was lost, came twice, grew or disagreed.
pub fn run(duration: Duration, mut tell: impl FnMut(&Tally) -> bool) -> Result<Tally, String> {
    let mut run = Run::begin()?;
    let mut next_tell = Duration::ZERO;
    while run.tally.lasted < duration {
        run.second()?;
        if run.tally.lasted >= next_tell {
            next_tell += Duration::from_secs(60);
            if !tell(&run.tally) {
                break;
            }
        }
    }
    run.end()
}

struct Run {
    world: Rc<RefCell<World>>,
    client: Client<SimTransport>,
    epoch: u32,
    setpoints: Vec<AxisSetpoint>,
    begun: Duration,
    next_look: Duration,
    next_setpoints: Duration,
    /// The period that was told of last.
    period: Option<u32>,
    /// What came too late to be awaited on each bus before the cycle began: arming looks at motors
    /// that others interrupt.
    late: [u32; BUSES.len()],
    /// Frames on each bus, by who sent them: gateway, motors.
    seen: [(u64, u64); BUSES.len()],
    tally: Tally,
}

impl Run {
    fn begin() -> Result<Self, String> {
        let motors = BUSES.iter().flat_map(|(bus, bitrate, count)| {
            (1..=*count).map(|node| MotorWiring {
                bus: *bus,
                protocol: Protocol::Rmd,
                node,
                bitrate: *bitrate,
                can_id: None,
            })
        });
        let motors: Vec<MotorWiring> = motors.collect();
        let count = u8::try_from(motors.len()).map_err(|error| error.to_string())?;
        let wiring = Wiring { motors, random_number: Some(1), ..Wiring::on(&BOARD) };
        let world = Rc::new(RefCell::new(World::try_new(wiring).map_err(|e| e.to_string())?));
        for motor in 0..usize::from(count) {
            world.borrow_mut().inject(motor, Injection::ReplyTime(Some(REPLY_TIME)));
        }
        let transport = SimTransport::new(world.clone(), 0);
        let mut client = Client::connect_as(transport, 1, 1).map_err(|e| e.to_string())?;
        let axes: Vec<u8> = (0..count).collect();
        let epoch = set_up(&mut client, &axes).map_err(|e| e.to_string())?;
        let setpoints = axes.iter().map(|axis| make_velocity(*axis, 1.0)).collect();
        let begun = client.now();
        let mut run = Self {
            world,
            client,
            epoch,
            setpoints,
            begun,
            next_look: begun,
            next_setpoints: begun,
            period: None,
            late: [0; BUSES.len()],
            seen: [(0, 0); BUSES.len()],
            tally: Tally::default(),
        };
        run.cycle()?;
        // Of the start: buses, arming, the first setpoints.
        while run.client.poll_event(Duration::ZERO).map_err(|e| e.to_string())?.is_some() {}
        for (bus, ..) in BUSES {
            let late = run.counters(bus)?.late;
            run.late.get_mut(usize::from(bus)).into_iter().for_each(|place| *place = late);
        }
        run.client.run_cycle(&axes, FIELDS, PERIOD).map_err(|e| e.to_string())?;
        Ok(run)
    }

    /// A cycle that the host asks for beside the gateway's own.
    fn cycle(&mut self) -> Result<(), String> {
        let begin = self.client.now();
        let turn = self.tally.cycles % 100;
        for of in &mut self.setpoints {
            *of = make_velocity(of.axis, 1.0 + turn as f32 / 100.0);
        }
        let states = self.client.cycle(self.epoch, &self.setpoints, FIELDS, TTL);
        let states = states.map_err(|error| format!("a cycle: {error}"))?;
        for state in states {
            match state.result {
                CycleResult::Answered | CycleResult::Superseded => {}
                result => return Err(format!("a cycle: axis {}: {result}", state.axis)),
            }
        }
        self.tally.cycles += 1;
        let took = self.client.now().saturating_sub(begin);
        self.tally.slowest_cycle = self.tally.slowest_cycle.max(took);
        Ok(())
    }

    /// A second of virtual time, and then a look at all counters.
    fn second(&mut self) -> Result<(), String> {
        self.next_look += LOOK_EVERY;
        while self.client.now() < self.next_look {
            self.next_setpoints += SETPOINTS_EVERY;
            self.cycle()?;
            self.hear()?;
            let rest = self.next_setpoints.saturating_sub(self.client.now());
            self.client.pause(rest).map_err(|error| error.to_string())?;
            self.hear()?;
        }
        self.tally.lasted = self.client.now().saturating_sub(self.begun);
        self.look()
    }

    /// Takes what was told of periods.
    fn hear(&mut self) -> Result<(), String> {
        while let Some(message) =
            self.client.poll_cycle(Duration::ZERO).map_err(|error| error.to_string())?
        {
            let event = message.event;
            if message.dropped != 0 {
                return Err(format!("{} events were lost", message.dropped));
            }
            if self.period.is_some_and(|before| event.period <= before) {
                return Err(format!("period {} behind {:?}", event.period, self.period));
            }
            for state in event.states() {
                match state.result {
                    CycleResult::Answered => self.tally.answered += 1,
                    CycleResult::Superseded | CycleResult::NoReply => self.tally.unanswered += 1,
                    result => return Err(format!("axis {}: {result}", state.axis)),
                }
            }
            self.period = Some(event.period);
            self.tally.periods = u64::from(event.period) + 1;
            self.tally.told += 1;
            self.tally.overruns = event.overruns;
        }
        match self.client.poll_event(Duration::ZERO) {
            Ok(None) => Ok(()),
            told => Err(format!("{told:?}")),
        }
    }

    /// What everybody counts.
    fn look(&mut self) -> Result<(), String> {
        self.count_frames();
        let losses = self.client.losses();
        let count = losses.damaged + losses.late + losses.events_lost + losses.events_dropped;
        if count + losses.unreadable != 0 {
            return Err(format!("on the way to the host: {losses:?}"));
        }
        let backlog = self.world.borrow().host_backlog(0);
        if backlog > 0 {
            return Err(format!("{backlog} bytes have not left to the gateway"));
        }
        let Tally { periods, told, overruns, answered, unanswered, .. } = self.tally;
        let passed = u64::from(overruns.host) + u64::from(overruns.gateway);
        // The one under way may be counted already, and has not been told.
        if periods > told + passed + 1 {
            return Err(format!("{periods} periods, {told} told, {passed} counted as not"));
        }
        if unanswered * 100 > (answered + unanswered) * UNANSWERED_PERCENT {
            return Err(format!("{unanswered} of {} unanswered", answered + unanswered));
        }
        if self.tally.slowest_cycle > Duration::from_millis(20) {
            return Err(format!("a cycle took {:?}", self.tally.slowest_cycle));
        }
        Ok(())
    }

    /// What the gateway counts on a bus.
    fn counters(&mut self, bus: u8) -> Result<BusCounters, String> {
        Ok(self.client.bus_status(bus).map_err(|error| error.to_string())?.counters)
    }

    /// Ends the cycle, and compares what the gateway and the wires have counted.
    fn end(mut self) -> Result<Tally, String> {
        for (bus, ..) in BUSES {
            // Before the stops: those leave replies behind that nobody awaits any more.
            let counters = self.counters(bus)?;
            let BusCounters { transmitted, received, cancelled, .. } = counters;
            let late = self.late.get(usize::from(bus)).copied().unwrap_or_default();
            let none = BusCounters { late, ..BusCounters::default() };
            if counters != (BusCounters { transmitted, received, cancelled, ..none }) {
                return Err(format!("bus {bus}: {counters:?}"));
            }
        }
        let text = |error: ClientError| error.to_string();
        self.client.run_cycle(&[], FIELDS, PERIOD).map_err(text)?;
        self.client.stop(StopTarget::All).map_err(text)?;
        self.client.pause(Duration::from_millis(20)).map_err(text)?;
        self.count_frames();
        for (bus, ..) in BUSES {
            let BusCounters { transmitted, received, .. } = self.counters(bus)?;
            let counted = (u64::from(transmitted), u64::from(received));
            self.count_frames();
            let (sent, heard) = self.seen.get(usize::from(bus)).copied().unwrap_or_default();
            // One each may be on its way.
            if counted.0.abs_diff(sent) > 1 || counted.1.abs_diff(heard) > 1 {
                return Err(format!("bus {bus} counts {counted:?}, its wire {sent} and {heard}"));
            }
            self.tally.transmitted += counted.0;
            self.tally.received += counted.1;
        }
        Ok(self.tally)
    }

    /// Counts what was on the wires since the last time.
    fn count_frames(&mut self) {
        for entry in self.world.borrow_mut().trace() {
            let Some((sent, heard)) = self.seen.get_mut(usize::from(entry.bus)) else { continue };
            *if entry.from == Station::Gateway { sent } else { heard } += 1;
        }
    }
}

fn set_up(client: &mut Client<SimTransport>, axes: &[u8]) -> Result<u32, ClientError> {
    client.set_baud(BAUD)?;
    client.configure_gateway(GatewayParameter::LinkSilenceUs, Value::Unsigned(1_000_000))?;
    let mut axis = axes.iter().copied();
    for (bus, bitrate, count) in BUSES {
        let protocols = ProtocolSet::of(&[Protocol::Rmd]);
        client.configure_bus(bus, bitrate, protocols, false, Duration::from_millis(5))?;
        for (node, axis) in (1..=count).zip(&mut axis) {
            for (parameter, value) in [
                (AxisParameter::Bus, bus.into()),
                (AxisParameter::Protocol, u32::from(Protocol::Rmd.number())),
                (AxisParameter::Node, node.into()),
                (AxisParameter::StopAction, u32::from(StopAction::Coast.number())),
                (AxisParameter::TtlUs, TTL_US),
            ] {
                client.configure_axis(axis, parameter, Value::Unsigned(value))?;
            }
            client.provision_motor_timeout(axis, 1_000)?;
        }
    }
    client.arm_together(axes)
}
