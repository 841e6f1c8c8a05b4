//! What `mgw plan` says of `RunCycle` is what a simulated gateway keeps, on wires with every stuff
//! bit: random gateways, each in a period that their plan says no period is longer than.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use gateway::{Assumptions, BusPlan, MAX_AXES, Set};
use host_protocol::{
    AxisParameter, CycleEvent, CycleResult, Error, GatewayParameter, MAX_CYCLE_AXES, Protocol,
    ProtocolSet, StateFields, StopAction, Value, cycle_frame_bytes,
};
use mgw_client::{AxisSetpoint, Client, ClientError, make_impedance, make_signal, make_velocity};
use mgw_sim::{BOARD, Injection, MotorWiring, SimTransport, Wiring, World};

/// What the simulated gateway takes between two events is none; a step of its clock may pass.
const SOFTWARE: gateway::Duration = gateway::Duration::from_micros(2);
/// A period that is longer is refused, and one in which setpoints are refreshed is not the plan's.
const LONGEST: gateway::Duration = gateway::Duration::from_micros(15_000);
const PERIODS: u32 = 100;
/// So many of them are not looked at: what was before may take a period more, and each catches up a
/// part of it.
const SETTLED: usize = 30;
/// Of the host's line.
const BAUD: u32 = 3_000_000;

/// An axis and its motor.
#[derive(Debug, Clone, Copy)]
struct Motor {
    bus: u8,
    protocol: Protocol,
    node: u8,
    delay_us: u16,
    /// RMD: is given impedance setpoints.
    impedance: bool,
    /// D5: answers no writes.
    reads_only: bool,
    state_poll_us: u32,
    fault_poll_us: u32,
    refresh_us: u32,
}

#[derive(Debug)]
struct Gateway {
    /// Bitrates of the buses that are used, by their number.
    buses: Vec<(u8, u32, ProtocolSet)>,
    motors: Vec<Motor>,
    fields: StateFields,
}

fn random_gateway(random: &mut fastrand::Rng) -> Gateway {
    let mut gateway =
        Gateway { buses: Vec::new(), motors: Vec::new(), fields: StateFields::of(&[]) };
    gateway.fields = StateFields::from_bits(random.u8(..0x80));
    for bus in 0..4_u8 {
        let is_serial = bus >= 2;
        let mixed = [Protocol::Rmd, Protocol::Thruster];
        let (bitrate, protocols, most) = match (is_serial, random.u8(..5)) {
            (_, 0) => continue,
            (false, 1) => (210_526, &[Protocol::D5][..], 3),
            (false, 2) => (*random.choice(&[500_000, 1_000_000]).unwrap(), &mixed[..], 5),
            (false, 3) => (1_000_000, &mixed[1..], 4),
            (false, _) => (1_000_000, &mixed[..1], 6),
            (true, 1 | 2) => {
                (*random.choice(&[500_000, 2_000_000]).unwrap(), &[Protocol::D5][..], 2)
            }
            (true, _) => (*random.choice(&[500_000, 2_000_000]).unwrap(), &mixed[..1], 3),
        };
        gateway.buses.push((bus, bitrate, ProtocolSet::of(protocols)));
        for node in 1..=random.u8(1..=most) {
            let protocol = *random.choice(protocols).unwrap();
            gateway.motors.push(Motor {
                bus,
                protocol,
                node,
                delay_us: random.u16(0..400),
                impedance: !is_serial && protocol == Protocol::Rmd && random.u8(..4) == 0,
                reads_only: protocol == Protocol::D5 && random.u8(..4) == 0,
                state_poll_us: random.u32(5_000..60_000),
                fault_poll_us: random.u32(20_000..120_000),
                refresh_us: random.u32(3_000..20_000),
            });
        }
    }
    gateway
}

impl Gateway {
    fn world(&self) -> World {
        let bitrate =
            |of: u8| self.buses.iter().find(|(bus, ..)| *bus == of).map_or(0, |(_, rate, _)| *rate);
        let motors = self.motors.iter().map(|motor| MotorWiring {
            bus: motor.bus,
            protocol: motor.protocol,
            node: motor.node,
            bitrate: bitrate(motor.bus),
            can_id: None,
        });
        let motors = motors.collect();
        let mut world = World::new(Wiring { motors, random_number: Some(1), ..Wiring::on(&BOARD) });
        for (index, motor) in self.motors.iter().enumerate() {
            let delay = Duration::from_micros(motor.delay_us.into());
            world.inject(index, Injection::ReplyTime(Some(delay)));
        }
        world
    }

    /// The epoch in which all are armed; nothing where a bus takes no more.
    fn set_up(&self, client: &mut Client<SimTransport>) -> Option<u32> {
        client.set_baud(BAUD).unwrap();
        let silence = Value::Unsigned(10_000_000);
        client.configure_gateway(GatewayParameter::LinkSilenceUs, silence).unwrap();
        for (bus, bitrate, protocols) in &self.buses {
            let window = Duration::from_millis(5);
            client.configure_bus(*bus, *bitrate, *protocols, false, window).unwrap();
        }
        for (axis, motor) in (0..).zip(&self.motors) {
            let number = |value: u32| Value::Unsigned(value);
            let mut values = vec![
                (AxisParameter::Bus, number(motor.bus.into())),
                (AxisParameter::Protocol, number(motor.protocol.number().into())),
                (AxisParameter::Node, number(motor.node.into())),
                (AxisParameter::StopAction, number(StopAction::Coast.number().into())),
                (AxisParameter::AllowUnknownMotorTimeout, Value::Bool(true)),
                (AxisParameter::UnsafeInfiniteTtl, Value::Bool(true)),
                (AxisParameter::StatePollUs, number(motor.state_poll_us)),
                (AxisParameter::FaultPollUs, number(motor.fault_poll_us)),
                (AxisParameter::RefreshUs, number(motor.refresh_us)),
            ];
            if motor.protocol == Protocol::D5 {
                values[3].1 = number(StopAction::Hold.number().into());
            }
            let configure = |client: &mut Client<SimTransport>, parameter, value| {
                let done = client.configure_axis(axis, parameter, value);
                let full = matches!(done, Err(ClientError::Gateway(Error::BusOverloaded { .. })));
                (!full).then(|| done.unwrap())
            };
            for (parameter, value) in values {
                configure(client, parameter, value)?;
            }
            if motor.reads_only {
                // Register 0x10 := 1 (D5 manual, quick start (2)).
                let body = [motor.node, 4, 3, 0x10, 1, 0];
                let sum = body.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
                let data = [&[0xD5], &body[..], &[sum]].concat().into_iter().collect();
                client.native(axis, 0, data, Duration::from_millis(100)).unwrap();
                configure(client, AxisParameter::D5AckLevel, number(1))?;
            }
        }
        Some(client.arm_together(&self.axes()).unwrap())
    }

    fn axes(&self) -> Vec<u8> {
        (0..).take(self.motors.len()).collect()
    }

    fn setpoints(&self) -> Vec<AxisSetpoint> {
        let setpoint = |(axis, motor): (u8, &Motor)| match motor.protocol {
            Protocol::Thruster => make_signal(axis, 0.1),
            _ if motor.impedance => make_impedance(axis, 0.0, 0.0, 1.0, 0.1, 0.0),
            _ => make_velocity(axis, 1.0),
        };
        (0..).zip(&self.motors).map(setpoint).collect()
    }

    fn plans(&self, world: &World) -> Vec<BusPlan> {
        let mut assumed =
            Assumptions { software: SOFTWARE, fields: self.fields, ..Assumptions::DEFAULT };
        assumed.reply_delay = [gateway::Duration::ZERO; MAX_AXES];
        for ((axis, motor), delay) in (0_u8..).zip(&self.motors).zip(&mut assumed.reply_delay) {
            *delay = gateway::Duration::from_micros(motor.delay_us.into());
            if motor.impedance {
                assumed.impedance = assumed.impedance.with(Set::of(axis));
            }
        }
        let buses = self.buses.iter();
        buses.map(|(bus, ..)| world.core().plan_bus(*bus, &assumed).unwrap()).collect()
    }
}

/// A gateway whose axes are armed, its plans, and a host that has commanded motion once.
struct Armed<'a> {
    gateway: &'a Gateway,
    plans: Vec<BusPlan>,
    client: Client<SimTransport>,
    epoch: u32,
}

impl<'a> Armed<'a> {
    fn of(gateway: &'a Gateway) -> Option<Self> {
        let world = Rc::new(RefCell::new(gateway.world()));
        let mut client = Client::connect_as(SimTransport::new(world.clone(), 0), 1, 1).unwrap();
        let epoch = gateway.set_up(&mut client)?;
        let plans = gateway.plans(&world.borrow());
        let mut armed = Self { gateway, plans, client, epoch };
        armed.cycle();
        Some(armed)
    }

    /// What a `Cycle` takes, from the host's first byte to the last one back.
    fn cycle(&mut self) -> Duration {
        let begin = self.client.now();
        let ttl = Duration::from_millis(100);
        let (setpoints, fields) = (self.gateway.setpoints(), self.gateway.fields);
        let states = self.client.cycle(self.epoch, &setpoints, fields, ttl).unwrap();
        assert!(states.iter().all(|state| state.result == CycleResult::Answered), "{states:?}");
        self.client.now() - begin
    }

    /// What the slowest bus says; nothing where one has no time left, or is slower than is of use
    /// here.
    fn slowest(&self, of: impl Fn(&BusPlan) -> Option<gateway::Duration>) -> Option<Duration> {
        let times: Option<Vec<_>> = self.plans.iter().map(of).collect();
        let slowest = times?.into_iter().max().filter(|time| *time <= LONGEST)?;
        Some(Duration::from_micros(slowest.as_micros()))
    }

    /// The axes whose replies may come when they count no longer, as their plans say.
    fn answered_late(&self) -> Set {
        let axes = self.plans.iter().flat_map(|plan| &plan.axes);
        let late = axes.filter(|axis| !axis.reply_counts);
        late.fold(Set::NONE, |set, axis| set.with(Set::of(axis.axis)))
    }

    /// The events of a running cycle; none where its period is refused.
    fn run(&mut self, period: Duration) -> Vec<CycleEvent> {
        let (axes, fields) = (self.gateway.axes(), self.gateway.fields);
        let period = period.max(Duration::from_micros(250));
        match self.client.run_cycle(&axes, fields, period) {
            Err(ClientError::Gateway(Error::BusOverloaded { .. })) => return Vec::new(),
            done => done.unwrap(),
        }
        let mut events = Vec::new();
        let end = self.client.now() + PERIODS * period;
        while self.client.now() < end {
            let told = self.client.poll_cycle(Duration::from_millis(50)).unwrap();
            events.extend(told.map(|told| told.event));
        }
        events.split_off(SETTLED.min(events.len()))
    }
}

/// How many periods were kept up by a bus or by a motor.
fn overruns(events: &[CycleEvent]) -> u32 {
    let count = |event: Option<&CycleEvent>| {
        event.map_or(0, |event| event.overruns.bus + event.overruns.motor)
    };
    count(events.last()) - count(events.first())
}

fn random_gateways(seed: u64) -> impl Iterator<Item = Gateway> {
    let mut random = fastrand::Rng::with_seed(seed);
    let gateways = std::iter::repeat_with(move || random_gateway(&mut random));
    gateways.filter(|gateway| (1..=MAX_CYCLE_AXES).contains(&gateway.motors.len())).take(90)
}

#[test]
fn from_its_steady_period_on_no_period_of_run_cycle_is_longer() {
    let mut kept = 0;
    for gateway in random_gateways(7) {
        let Some(mut armed) = Armed::of(&gateway) else { continue };
        let Some(period) = armed.slowest(|plan| plan.steady) else { continue };
        let events = armed.run(period);
        assert_eq!(overruns(&events), 0, "{period:?} {gateway:#?}");
        let late = armed.answered_late();
        let states = events.iter().flat_map(|event| event.states());
        for state in states.filter(|state| !late.has(state.axis)) {
            assert_eq!(state.result, CycleResult::Answered, "{period:?} {state:?} {gateway:#?}");
            kept += 1;
        }
    }
    assert!(kept > 8_000, "{kept}");
}

/// The plan is not so careful that nothing could break it.
#[test]
fn half_of_the_planned_period_is_refused_or_overrun() {
    let (mut broken, mut all) = (0, 0);
    for gateway in random_gateways(8) {
        let Some(mut armed) = Armed::of(&gateway) else { continue };
        let Some(period) = armed.slowest(|plan| plan.period) else { continue };
        let events = armed.run(period / 2);
        broken += usize::from(events.is_empty() || overruns(&events) > 10);
        all += 1;
    }
    // Where setpoints are sent again within the planned period, half of it may do without.
    assert!(all > 50 && broken * 100 >= all * 95, "{broken} of {all}");
}

#[test]
fn no_cycle_takes_longer_than_the_longest() {
    let mut random = fastrand::Rng::with_seed(9);
    let mut rounds = 0;
    for gateway in random_gateways(9) {
        let Some(mut armed) = Armed::of(&gateway) else { continue };
        let Some(bus) = armed.slowest(|plan| plan.longest) else { continue };
        let axes = (1 << gateway.motors.len()) - 1;
        let velocity = |axis| make_velocity(axis, 0.0).setpoint;
        let (out, back) = cycle_frame_bytes(axes, velocity, gateway.fields);
        let line_us = (out + back) as u64 * 10 * 1_000_000 / u64::from(BAUD);
        let software = Duration::from_micros(2 * SOFTWARE.as_micros());
        let longest = bus + Duration::from_micros(line_us) + software;
        for _ in 0..50 {
            armed.client.pause(Duration::from_micros(random.u64(0..5_000))).unwrap();
            let took = armed.cycle();
            assert!(took <= longest, "{took:?} of {longest:?} {gateway:#?}");
            rounds += 1;
        }
    }
    assert!(rounds > 1_500, "{rounds}");
}
