//! One axis of a gateway with one simulated motor, and what goes over its bus.

use host_protocol::{AxisParameter, AxisState, Protocol, ProtocolSet, StopAction, Value};
use mgw_client::Client;
use mgw_sim::{BOARD, Injection, SimTransport, Station, Wire, Wiring, World};
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

/// The axis.
pub const AXIS: u8 = 0;
/// Shorter than the time after which a silent host is given up.
const PING_EVERY: Duration = Duration::from_millis(50);

pub struct Lab {
    world: Rc<RefCell<World>>,
    pub client: Client<SimTransport>,
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
        let wiring = Wiring::on(&BOARD).with(bus, protocol, node(protocol));
        let world = Rc::new(RefCell::new(World::new(wiring)));
        let client = Client::connect_as(SimTransport::new(world.clone(), 0), 1, 1).unwrap();
        let mut lab = Self { world, client };
        lab.client.configure_bus(bus, bitrate, ProtocolSet::of(&[protocol]), false, REPLY_WINDOW).unwrap();
        for (parameter, number) in [
            (AxisParameter::Bus, bus),
            (AxisParameter::Protocol, protocol.number()),
            (AxisParameter::Node, node(protocol)),
            (AxisParameter::StopAction, stop.number()),
        ] {
            lab.configure(parameter, Value::Unsigned(number.into()));
        }
        lab.configure(AxisParameter::AllowUnknownMotorTimeout, Value::Bool(true));
        if stop == StopAction::Brake {
            lab.world.borrow_mut().inject(0, Injection::Brake(true));
        }
        if protocol == Protocol::Thruster {
            lab.world.borrow_mut().inject(0, Injection::Encoder(true));
            lab.configure(AxisParameter::PositionDevice, Value::Bool(true));
        }
        lab
    }

    /// As [`new`](Self::new), but the motor is polled so rarely that no poll falls into what is watched.
    pub fn quiet(protocol: Protocol, serial: bool, stop: StopAction) -> Self {
        let mut lab = Self::new(protocol, serial, stop);
        for parameter in [AxisParameter::StatePollUs, AxisParameter::FaultPollUs] {
            lab.configure(parameter, Value::Unsigned(RARELY_US));
        }
        lab
    }

    pub fn configure(&mut self, parameter: AxisParameter, value: Value) {
        self.client.configure_axis(AXIS, parameter, value).unwrap_or_else(|e| panic!("{parameter:?}: {e}"));
    }

    /// Arms the axis and returns its epoch.
    pub fn arm(&mut self) -> u32 {
        let epoch = self.client.arm(AXIS).unwrap_or_else(|e| panic!("arming: {e}")).epoch;
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
        trace.into_iter().filter(|entry| entry.from == Station::Gateway).map(|entry| entry.wire).collect()
    }
}
