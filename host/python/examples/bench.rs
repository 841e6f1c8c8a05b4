//! The same cycles as bench.py by the Rust client: `bench PORT AXES CYCLES`. bench.py runs it.

use std::error::Error;
use std::time::{Duration, Instant};

use host_protocol::{AxisState, StateField, StateFields, StopTarget};
use mgw_client::{AxisSetpoint, Client, make_velocity, open};

/// As long as Python has a setpoint valid.
const TTL: Duration = Duration::from_millis(90);
const FIELDS: StateFields =
    StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current]);

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [port, axes, cycles] = arguments.as_slice() else {
        return Err("usage: bench PORT AXES CYCLES".into());
    };
    let (axes, cycles): (u8, usize) = (axes.parse()?, cycles.parse()?);
    let mut gateway = Client::connect(open(port)?)?;
    let epoch = gateway.arm_together(&(0..axes).collect::<Vec<u8>>())?;
    let setpoints: Vec<AxisSetpoint> = (0..axes).map(|axis| make_velocity(axis, 0.5)).collect();
    let mut took = Vec::with_capacity(cycles);
    let begin = Instant::now();
    for _ in 0..cycles {
        let before = Instant::now();
        let states = gateway.cycle(epoch, &setpoints, FIELDS, TTL)?;
        took.push(before.elapsed());
        assert_eq!(states.len(), usize::from(axes));
    }
    let rate = cycles as f64 / begin.elapsed().as_secs_f64();
    gateway.stop(StopTarget::All)?;
    while (0..axes).any(|axis| {
        gateway.read_state(axis).is_ok_and(|report| report.state == AxisState::Stopping)
    }) {}
    gateway.release_authority()?;
    took.sort();
    let (median, p99) = (took[cycles / 2].as_micros(), took[cycles * 99 / 100].as_micros());
    println!("Rust:   {rate:.0} cycles/s of {axes} axes, median {median} µs, p99 {p99} µs");
    Ok(())
}
