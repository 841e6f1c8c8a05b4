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
use std::process::ExitCode;
use std::time::{Duration, Instant};

use mgw_client::host_protocol::{StateField, StateFields, StopTarget};
use mgw_client::{AxisSetpoint, Client, make_velocity, open};

/// How long it lasts.
const LASTS: Duration = Duration::from_secs(2);
/// rad/s.
const AMPLITUDE: f32 = 2.0;
/// One turn of the sine.
const PERIOD_S: f32 = 1.0;
/// The setpoints are valid for so long: what hangs here stops the motors.
const TTL: Duration = Duration::from_millis(100);

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let port = arguments.next().ok_or("usage: sine PORT AXIS…")?;
    let axes = arguments.map(|axis| axis.parse()).collect::<Result<Vec<u8>, _>>()?;
    let fields = StateFields::of(&[StateField::Position, StateField::Velocity]);

    let mut gateway = Client::connect(open(&port)?)?;
    let epoch = gateway.arm_together(&axes)?;
    let (begin, mut rounds) = (Instant::now(), Vec::new());
    while begin.elapsed() < LASTS {
        let round = Instant::now();
        let phase = TAU * begin.elapsed().as_secs_f32() / PERIOD_S;
        let setpoints: Vec<AxisSetpoint> =
            axes.iter().map(|axis| make_velocity(*axis, AMPLITUDE * phase.sin())).collect();
        let states = gateway.cycle(epoch, &setpoints, fields, TTL)?;
        if let Some(lost) = states.iter().find(|state| !state.result.is_answered()) {
            gateway.stop(StopTarget::All)?;
            return Err(format!("axis {}: {}, {}", lost.axis, lost.result, lost.state).into());
        }
        rounds.push(round.elapsed());
    }
    gateway.stop(StopTarget::All)?;

    rounds.sort();
    let at = |permille: usize| rounds[(rounds.len() - 1) * permille / 1_000];
    println!("{} rounds of {} axes in {:?}", rounds.len(), axes.len(), begin.elapsed());
    println!("p50 {:?}, p99 {:?}, p99.9 {:?}, max {:?}", at(500), at(990), at(999), at(1_000));
    Ok(())
}
