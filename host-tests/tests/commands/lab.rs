//! One axis of a gateway with one simulated motor, and what goes over its bus.

use host_protocol::{AxisParameter, AxisState, Protocol, ProtocolSet, StopAction, Value};
use mgw_client::Client;
use mgw_sim::{BOARD, Injection, SimTransport, Station, Wire, Wiring, World};
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

/// The axis.
pub const AXIS: u8 = 0;
/// The other one, of a second motor, where one is not enough.
pub const SECOND: u8 = 1;
/// Shorter than the time after which a silent host is given up.
const PING_EVERY: Duration = Duration::from_millis(50);

pub struct Lab {
    world: Rc<RefCell<World>>,
    pub client: Client<SimTransport>,
    bus: u8,
    protocol: Protocol,
    stop: StopAction,
}

/// How long a reply is awaited.
const REPLY_WINDOW: Duration = Duration::from_millis(5);

/// The longest period of a poll.
const RARELY_US: u32 = 1_000_000;
/// So soon after arming the first polls are over.
const SETTLED: Duration = Duration::from_millis(200);

/// The node that the frames of the page name.
pub fn node(protocol: Protocol) -> u8 {
    match protocol {
        Protocol::Rmd => 1,
        Protocol::Thruster | Protocol::D5 => 0x0B,
    }
}

impl Lab {
    /// `serial`: on RS485, which only an RMD speaks.
    pub fn new(protocol: Protocol, serial: bool, stop: StopAction) -> Self {
        let (bus, bitrate) = match (serial, protocol) {
            (true, _) => (2, 115_200),
            (false, Protocol::D5) => (1, 210_526),
            (false, _) => (0, 1_000_000),
        };
        let wiring = Wiring::on(&BOARD).with(bus, protocol, node(protocol)).with(
            bus,
            protocol,
            node(protocol) + 1,
        );
        let world = Rc::new(RefCell::new(World::new(wiring)));
        let client = Client::connect_as(SimTransport::new(world.clone(), 0), 1, 1).unwrap();
        let mut lab = Self { world, client, bus, protocol, stop };
        lab.client
            .configure_bus(bus, bitrate, ProtocolSet::of(&[protocol]), true, REPLY_WINDOW)
            .unwrap();
        lab.configure_motor(AXIS, node(protocol));
        if stop == StopAction::Brake {
            lab.world.borrow_mut().inject(0, Injection::Brake(true));
        }
        if protocol == Protocol::Thruster {
            lab.world.borrow_mut().inject(0, Injection::Encoder(true));
            lab.configure(AxisParameter::PositionDevice, Value::Bool(true));
        }
        lab
    }

    /// As [`new`](Self::new), but the motor is polled so rarely that no poll falls into what is
    /// watched.
    pub fn quiet(protocol: Protocol, serial: bool, stop: StopAction) -> Self {
        let mut lab = Self::new(protocol, serial, stop);
        for parameter in [AxisParameter::StatePollUs, AxisParameter::FaultPollUs] {
            lab.configure(parameter, Value::Unsigned(RARELY_US));
        }
        lab
    }

    /// Configures the axis of the second motor.
    pub fn configure_second(&mut self) {
        self.configure_motor(SECOND, node(self.protocol) + 1);
    }

    fn configure_motor(&mut self, axis: u8, node: u8) {
        let [bus, protocol, stop] = [self.bus, self.protocol.number(), self.stop.number()]
            .map(|number| Value::Unsigned(number.into()));
        for (parameter, value) in [
            (AxisParameter::Bus, bus),
            (AxisParameter::Protocol, protocol),
            (AxisParameter::Node, Value::Unsigned(node.into())),
            (AxisParameter::StopAction, stop),
            (AxisParameter::AllowUnknownMotorTimeout, Value::Bool(true)),
        ] {
            self.client
                .configure_axis(axis, parameter, value)
                .unwrap_or_else(|e| panic!("{parameter:?}: {e}"));
        }
    }

    pub fn configure(&mut self, parameter: AxisParameter, value: Value) {
        self.client
            .configure_axis(AXIS, parameter, value)
            .unwrap_or_else(|e| panic!("{parameter:?}: {e}"));
    }

    /// Puts something into the motor, or takes it out.
    pub fn inject(&mut self, injection: Injection) {
        self.world.borrow_mut().inject(0, injection);
    }

    /// Arms the axis and returns its epoch.
    pub fn arm(&mut self) -> u32 {
        self.arm_axis(AXIS)
    }

    pub fn arm_axis(&mut self, axis: u8) -> u32 {
        let epoch = self.client.arm(axis).unwrap_or_else(|e| panic!("arming: {e}")).epoch;
        self.pass(SETTLED);
        epoch
    }

    /// Time passes while the host is alive.
    pub fn pass(&mut self, time: Duration) {
        let end = self.client.now() + time;
        while self.client.now() < end {
            self.client.ping().unwrap();
            let rest = end.saturating_sub(self.client.now());
            self.client.pause(rest.min(PING_EVERY)).unwrap();
        }
    }

    /// The state of the axis, for which its motor is not asked.
    pub fn state(&mut self) -> AxisState {
        self.client.list_axes().unwrap()[0].state
    }

    /// What the gateway has sent since the last call.
    pub fn frames(&mut self) -> Vec<Wire> {
        let trace = self.world.borrow_mut().trace();
        trace
            .into_iter()
            .filter(|entry| entry.from == Station::Gateway)
            .map(|entry| entry.wire)
            .collect()
    }
}
