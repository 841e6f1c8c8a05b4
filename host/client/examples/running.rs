//! A free-running cycle: the gateway drives several axes in a period of its own while this program
//! gives a sine of velocity whenever it comes to it; prints what the gateway tells of the periods.
//!
//! ```text
//! mgw sim                                                                      # in another terminal
//! cargo run -p mgw-client --example running -- tcp:127.0.0.1:7401 1000 0 2 3   # µs, axes
//! ```
#![forbid(unsafe_code)]

use std::error::Error;
use std::f32::consts::TAU;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use mgw_client::host_protocol::{CycleMessage, StateField, StateFields, StopTarget};
use mgw_client::{AxisSetpoint, Client, make_velocity, open};

/// How long it lasts.
const LASTS: Duration = Duration::from_secs(2);
/// rad/s.
const AMPLITUDE: f32 = 2.0;
/// One turn of the sine.
const TURN_S: f32 = 1.0;
/// The setpoints are valid for so long: what hangs here stops the motors.
const TTL: Duration = Duration::from_millis(100);
/// Between two setpoints.
const SETPOINTS_EVERY: Duration = Duration::from_millis(10);

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
    let usage = "usage: running PORT PERIOD_US AXIS…";
    let port = arguments.next().ok_or(usage)?;
    let period = Duration::from_micros(arguments.next().ok_or(usage)?.parse()?);
    let axes = arguments.map(|axis| axis.parse()).collect::<Result<Vec<u8>, _>>()?;
    let fields =
        StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Voltage]);

    let mut gateway = Client::connect(open(&port)?)?;
    let epoch = gateway.arm_together(&axes)?;
    gateway.run_cycle(&axes, fields, period)?;
    let begin = Instant::now();
    let mut last: Option<CycleMessage> = None;
    let (mut told, mut longest_us) = (0_u32, 0);
    while begin.elapsed() < LASTS {
        let phase = TAU * begin.elapsed().as_secs_f32() / TURN_S;
        let setpoints: Vec<AxisSetpoint> =
            axes.iter().map(|axis| make_velocity(*axis, AMPLITUDE * phase.sin())).collect();
        gateway.cycle(epoch, &setpoints, fields, TTL)?;
        let next = Instant::now() + SETPOINTS_EVERY;
        while let Some(left) = next.checked_duration_since(Instant::now()) {
            if let Some(message) = gateway.poll_cycle(left)? {
                told += 1;
                longest_us = longest_us.max(message.event.took_us);
                last = Some(message);
            }
        }
    }
    gateway.stop(StopTarget::All)?;
    gateway.run_cycle(&[], fields, period)?;

    let event = last.ok_or("no period was told of")?.event;
    let period_us = period.as_micros();
    println!(
        "{told} of {} periods of {period_us} µs told, the longest took {longest_us} µs",
        event.period + 1
    );
    println!("jitter {} µs, overruns: {:?}", event.jitter_us, event.overruns);
    for state in event.states() {
        println!(
            "axis {}: {}, {}, {:?} rad",
            state.axis, state.state, state.result, state.position_rad
        );
    }
    Ok(())
}
