//! The simulated gateway with four motors that the demonstration and `mgw sim` share.

use std::cell::RefCell;
use std::rc::Rc;

use host_protocol::{CanId, Protocol};
use mgw_client::{Client, Transport};
use mgw_sim::{Injection, SimTransport, Wiring, World};

use crate::Told;
use crate::args::FactoryMotor;
use crate::config::{self, Configuration, Source};
use crate::failure::Failure;
use crate::parameters::dialect_number;

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

/// A world with an unconfigured gateway and these motors.
pub fn of(motors: &[FactoryMotor]) -> Result<Rc<RefCell<World>>, Failure> {
    let (wiring, injections) = self::wiring(motors);
    let mut world = World::try_new(wiring).map_err(|error| Failure::Usage(error.to_string()))?;
    injections.into_iter().for_each(|(motor, injection)| world.inject(motor, injection));
    Ok(Rc::new(RefCell::new(world)))
}

/// How these motors are connected, and what they are told before anything else.
pub fn wiring(motors: &[FactoryMotor]) -> (Wiring, Told) {
    let (mut wiring, mut injections) = (Wiring::on(&mgw_sim::BOARD), Vec::new());
    for (index, motor) in motors.iter().enumerate() {
        wiring = wiring.with(motor.bus, motor.protocol, motor.node);
        if let (Some(wired), Some(bitrate)) = (wiring.motors.last_mut(), motor.bitrate) {
            wired.bitrate = bitrate;
        }
        if let Some(Ok(number)) = motor.dialect.map(|of| u8::try_from(dialect_number(of))) {
            injections.push((index, Injection::RmdDialect(number)));
        }
    }
    (wiring, injections)
}

/// The same with a fifth motor, a D5 on RS485, and the configuration of all five.
pub fn demonstration() -> Result<(Rc<RefCell<World>>, Configuration), Failure> {
    let configuration = read(&[CONFIGURATION, FIFTH].join("\n"))?;
    Ok((Rc::new(RefCell::new(World::new(Wiring::five_motors()))), configuration))
}

/// The configuration for it.
pub fn configuration() -> Result<Configuration, Failure> {
    read(CONFIGURATION)
}

fn read(text: &str) -> Result<Configuration, Failure> {
    Source { path: "host/cli/examples".to_owned(), text: text.to_owned() }.for_any_board()
}

/// Gives a gateway that has none a configuration.
pub fn configure<T: Transport>(
    client: &mut Client<T>,
    configuration: &Configuration,
) -> Result<(), Failure> {
    config::make(client, &Configuration::default().changes_to(configuration))?;
    config::write_timeouts(client, configuration).map(drop)
}

/// A session with its gateway, in the time of the simulation.
pub fn connect(world: &Rc<RefCell<World>>) -> Result<Client<SimTransport>, Failure> {
    Ok(Client::connect_as(SimTransport::new(Rc::clone(world), LINK), SESSION, FIRST_SEQUENCE)?)
}
