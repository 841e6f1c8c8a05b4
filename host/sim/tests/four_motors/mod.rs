//! The four motors of the simulator, configured and armed through the client.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::{AxisParameter, Protocol, ProtocolSet, Setpoint, StopAction, Value};
use mgw_client::{Client, Hold, Transport};
use mgw_sim::{SimTransport, Wiring, World};

/// Bus, protocol, node and stop action of axes 0 to 3, in the order of the motors.
const AXES: [(u32, Protocol, u32, StopAction); 4] = [
    (0, Protocol::Rmd, 0x01, StopAction::Hold),
    (0, Protocol::Thruster, 0x0B, StopAction::Coast),
    (1, Protocol::D5, 0x0B, StopAction::Hold),
    (2, Protocol::Rmd, 0x01, StopAction::Hold),
];

/// A time after which nothing is refreshed any more by accident.
pub const TTL: Duration = Duration::from_millis(100);

/// A world, and a client that has configured its buses and axes.
pub struct Rig {
    pub world: Rc<RefCell<World>>,
    pub client: Client<SimTransport>,
}

impl Rig {
    pub fn new(wiring: Wiring) -> Self {
        let world = Rc::new(RefCell::new(World::new(wiring)));
        let mut client = Client::connect_as(SimTransport::new(Rc::clone(&world), 0), 7, 1).unwrap();
        configure(&mut client);
        Self { world, client }
    }

    /// Arms all axes.
    pub fn arm(&mut self) -> Vec<Hold> {
        (0..4).map(|axis| hold(axis, self.client.arm(axis).unwrap().epoch)).collect()
    }

    /// Arms all axes and moves them for a while.
    pub fn move_for(&mut self, duration: Duration) {
        let holds = self.arm();
        self.client.hold_setpoints(&holds, duration, |_| Ok(ControlFlow::Continue(()))).unwrap();
    }

    /// Lets time pass without a word from the host.
    pub fn silence(&self, ms: u64) {
        self.world.borrow_mut().run_for(Duration::from_millis(ms));
    }

    pub fn speeds(&self) -> Vec<f64> {
        self.world.borrow().motors().iter().map(mgw_sim::Motor::speed_rad_s).collect()
    }
}

fn hold(axis: u8, epoch: u32) -> Hold {
    let setpoint = match AXES[usize::from(axis)].1 {
        Protocol::Thruster => Setpoint::Signal { fraction: 0.1 },
        Protocol::Rmd | Protocol::D5 => Setpoint::Velocity { velocity_rad_s: 2.0 },
    };
    Hold { axis, epoch, setpoint, ttl: TTL }
}

/// Configures buses and axes, and the timeouts of those motors that can be told.
pub fn configure(client: &mut Client<impl Transport>) {
    let window = Duration::from_millis(5);
    let both = ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster]);
    client.configure_bus(0, 1_000_000, both, false, window).unwrap();
    client.configure_bus(1, 210_526, ProtocolSet::of(&[Protocol::D5]), false, window).unwrap();
    client.configure_bus(2, 115_200, ProtocolSet::of(&[Protocol::Rmd]), false, window).unwrap();
    for (axis, (bus, protocol, node, stop_action)) in (0..).zip(AXES) {
        let values = [
            (AxisParameter::Bus, bus),
            (AxisParameter::Protocol, protocol.into()),
            (AxisParameter::Node, node),
            (AxisParameter::StopAction, stop_action.into()),
        ];
        for (parameter, value) in values {
            client.configure_axis(axis, parameter, Value::Unsigned(value)).unwrap();
        }
        if protocol != Protocol::D5 {
            client.provision_motor_timeout(axis, 1_000).unwrap();
        }
    }
}
