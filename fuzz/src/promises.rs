//! The whole core among hosts, buses and motors, with the model of the promises watching: the bytes
//! choose what happens.

use model_check::generate::Generator;
use model_check::{Step, World, text};

/// When the clock starts: its low 32 bits wrap around while the axes are being armed.
const START_US: u64 = (1 << 32) - 20_000;
/// After the last byte, µs: what was begun goes on.
const SETTLE_US: u64 = 300_000;

/// Requests and bytes of the hosts.
pub fn from_hosts(bytes: &[u8]) {
    check(bytes, Generator::of_hosts);
}

/// Frames, noise, faults of buses and motors, while a host drives the axes.
pub fn from_buses(bytes: &[u8]) {
    check(bytes, Generator::of_buses);
}

/// Any frames of hosts, while buses and motors fail.
pub fn from_bad_hosts(bytes: &[u8]) {
    check(bytes, Generator::of_bad_hosts);
}

fn check(bytes: &[u8], mut next: impl FnMut(&mut Generator, &World) -> Step) {
    let mut world = World::new(START_US);
    let mut generator = Generator::fuzzed(bytes);
    let mut steps = Vec::new();
    while !generator.is_spent() {
        let step = next(&mut generator, &world);
        world.step(&step);
        steps.push(step);
        judge(&world, &steps);
    }
    world.run_to(world.since_start_us() + SETTLE_US);
    judge(&world, &steps);
}

/// A counterexample is told as a file for `.ci/model-check replay`.
fn judge(world: &World, steps: &[Step]) {
    if let Some(violation) = world.broken() {
        panic!("{violation}\n{}", text::write(START_US, steps));
    }
}
