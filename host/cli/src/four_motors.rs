//! The simulated gateway with four motors that the demonstration and `mgw sim` share.

use std::cell::RefCell;
use std::rc::Rc;

use host_protocol::{CanId, Protocol};
use mgw_client::Client;
use mgw_sim::{SimTransport, Wiring, World};

use crate::failure::Failure;
use crate::plan::Plan;

/// Its configuration, which is also the example of a configuration file.
const CONFIGURATION: &str = include_str!("../examples/four-motors.toml");
/// What the demonstration has beside it, which is also an example.
const FIFTH: &str = include_str!("../examples/d5-on-rs485.toml");
/// The axis of the D5 in it.
pub const D5_AXIS: u8 = 2;
/// The host link that it is set up through.
const LINK: u8 = 0;
/// A session number and a first sequence number like any other: simulated runs are the same each
/// time.
const SESSION: u32 = 0x0D0E_0001;
const FIRST_SEQUENCE: u16 = 1;

/// A world with an unconfigured gateway and four motors. `d5_id`: of the D5, where that is not its
/// node.
pub fn world(d5_id: Option<CanId>) -> Rc<RefCell<World>> {
    let mut wiring = Wiring::four_motors();
    wiring
        .motors
        .iter_mut()
        .filter(|motor| motor.protocol == Protocol::D5)
        .for_each(|d5| d5.can_id = d5_id);
    Rc::new(RefCell::new(World::new(wiring)))
}

/// The same with a fifth motor, a D5 on RS485, and the configuration of all five.
pub fn demonstration() -> Result<(Rc<RefCell<World>>, Plan), Failure> {
    let plan = Plan::parse(&[CONFIGURATION, FIFTH].join("\n"))?;
    Ok((Rc::new(RefCell::new(World::new(Wiring::five_motors()))), plan))
}

/// The configuration for it.
pub fn plan() -> Result<Plan, Failure> {
    Plan::parse(CONFIGURATION)
}

/// A session with its gateway, in the time of the simulation.
pub fn connect(world: &Rc<RefCell<World>>) -> Result<Client<SimTransport>, Failure> {
    Ok(Client::connect_as(SimTransport::new(Rc::clone(world), LINK), SESSION, FIRST_SEQUENCE)?)
}
