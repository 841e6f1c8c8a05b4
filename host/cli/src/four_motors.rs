//! The simulated gateway with four motors that the demonstration and `mgw sim` share.

use std::cell::RefCell;
use std::rc::Rc;

use mgw_client::Client;
use mgw_sim::{SimTransport, Wiring, World};

use crate::failure::Failure;
use crate::plan::Plan;

/// Its configuration, which is also the example of a configuration file.
const CONFIGURATION: &str = include_str!("../examples/four-motors.toml");
/// The host link that it is set up through.
const LINK: u8 = 0;
/// A session number and a first sequence number like any other: simulated runs are the same each time.
const SESSION: u32 = 0x0D0E_0001;
const FIRST_SEQUENCE: u16 = 1;

/// A world with an unconfigured gateway and four motors.
pub fn world() -> Rc<RefCell<World>> {
    Rc::new(RefCell::new(World::new(Wiring::four_motors())))
}

/// The configuration for it.
pub fn plan() -> Result<Plan, Failure> {
    Plan::parse(CONFIGURATION)
}

/// A session with its gateway, in the time of the simulation.
pub fn connect(world: &Rc<RefCell<World>>) -> Result<Client<SimTransport>, Failure> {
    Ok(Client::connect_as(SimTransport::new(Rc::clone(world), LINK), SESSION, FIRST_SEQUENCE)?)
}
