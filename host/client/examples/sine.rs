//! A sine of velocity on several axes at once, one `Cycle` a round, as fast as the gateway answers;
//! prints how long the rounds took.
//!
//! ```text
//! mgw sim                                                              # in another terminal
//! cargo run -p mgw-client --example sine -- tcp:127.0.0.1:7401 0 2 3   # axes that take velocities
//! ```
#![forbid(unsafe_code)]

use std::error::Error;
use std::f32::consts::TAU;
use std::time::Duration;

use mgw_client::host_protocol::{StateField, StateFields, StopTarget};
use mgw_client::{AxisSetpoint, Client, Transport, make_velocity, open};

/// rad/s.
const AMPLITUDE: f32 = 2.0;
/// One turn of the sine.
const PERIOD_S: f32 = 1.0;
/// The setpoints are valid for so long: what hangs here stops the motors.
const TTL: Duration = Duration::from_millis(100);

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let port = arguments.next().ok_or("usage: sine PORT AXIS…")?;
    let axes = arguments.map(|axis| axis.parse()).collect::<Result<Vec<u8>, _>>()?;
    let mut gateway = Client::connect(open(&port)?)?;
    println!("{}", run(&mut gateway, &axes, Duration::from_secs(2))?);
    Ok(())
}

/// Turns the axes for so long, stops them, and says how long the rounds took.
pub fn run(
    gateway: &mut Client<impl Transport>,
    axes: &[u8],
    lasts: Duration,
) -> Result<String, Box<dyn Error>> {
    let fields = StateFields::of(&[StateField::Position, StateField::Velocity]);
    let epoch = gateway.arm_together(axes)?;
    let (begin, mut rounds) = (gateway.now(), Vec::new());
    while gateway.now() < begin + lasts || rounds.is_empty() {
        let round = gateway.now();
        let phase = TAU * (round - begin).as_secs_f32() / PERIOD_S;
        let setpoints: Vec<AxisSetpoint> =
            axes.iter().map(|axis| make_velocity(*axis, AMPLITUDE * phase.sin())).collect();
        let states = gateway.cycle(epoch, &setpoints, fields, TTL)?;
        if let Some(lost) = states.iter().find(|state| !state.result.is_answered()) {
            gateway.stop(StopTarget::All)?;
            return Err(format!("axis {}: {}, {}", lost.axis, lost.result, lost.state).into());
        }
        rounds.push(gateway.now() - round);
    }
    gateway.stop(StopTarget::All)?;

    rounds.sort();
    let at = |permille: usize| rounds[(rounds.len() - 1) * permille / 1_000];
    Ok(format!(
        "{} rounds of {} axes in {:?}\np50 {:?}, p99 {:?}, p99.9 {:?}, max {:?}",
        rounds.len(),
        axes.len(),
        gateway.now() - begin,
        at(500),
        at(990),
        at(999),
        at(1_000)
    ))
}
