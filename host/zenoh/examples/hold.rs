//! A whole program on another computer: takes command of a gateway over the network, arms an axis
//! and keeps a velocity in force.
//!
//! ```text
//! cargo run -p mgw-zenoh --example hold -- tcp/192.168.1.2:7447 left 0 2.0 5
//! ```

use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

use host_protocol::Setpoint;
use mgw_zenoh::{Commander, Endpoints, open};

/// Between two setpoints: several fit into the time that each is valid.
const EVERY: Duration = Duration::from_millis(20);

fn hold(endpoint: &str, name: &str, axis: u8, velocity: f32, time: Duration) -> Result<(), String> {
    let endpoints = Endpoints { connect: vec![endpoint.to_owned()], ..Endpoints::default() };
    let session = open(&endpoints)?;
    let said = |error: mgw_zenoh::Refused| error.to_string();
    let peer = format!("hold-{}", std::process::id());
    let mut gateway = Commander::take(&session, name, &peer).map_err(said)?;
    let armed = gateway.arm(axis).map_err(said)?;
    println!("axis {axis} is armed, a setpoint is valid for {} ms", armed.ttl.as_millis());
    // Less than is allowed: what the gateway's clock shows is a guess.
    let ttl = armed.ttl / 2;
    let setpoint = Setpoint::Velocity { velocity_rad_s: velocity };
    let end = Instant::now() + time;
    let mut next = Instant::now();
    while Instant::now() < end {
        gateway.set(axis, armed.epoch, setpoint, ttl).map_err(said)?;
        next += EVERY;
        thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    gateway.release().map_err(said)
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, name, axis, velocity, seconds] = arguments.as_slice() else {
        eprintln!("usage: hold ENDPOINT NAME AXIS RAD_S SECONDS");
        return ExitCode::from(2);
    };
    let (Ok(axis), Ok(velocity), Ok(seconds)) = (axis.parse(), velocity.parse(), seconds.parse())
    else {
        eprintln!("AXIS, RAD_S and SECONDS are numbers");
        return ExitCode::from(2);
    };
    match hold(endpoint, name, axis, velocity, Duration::from_secs_f32(seconds)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::FAILURE
        }
    }
}
