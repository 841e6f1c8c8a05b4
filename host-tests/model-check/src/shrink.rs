//! Making a list of steps that breaks a promise shorter.

use crate::action::Step;
use crate::world::World;
use promise_model::{Check, Violation};

/// Runs the steps from a time on; the first promise that they break, and after how many of them.
#[must_use]
pub fn broken_by(start_us: u64, steps: &[Step], settle_us: u64) -> Option<(Violation, usize)> {
    broken_with(start_us, steps, settle_us, None)
}

/// The same for one promise, if one is named.
#[must_use]
pub fn broken_with(
    start_us: u64,
    steps: &[Step],
    settle_us: u64,
    check: Option<Check>,
) -> Option<(Violation, usize)> {
    let is_meant = |violation: &&Violation| check.is_none_or(|check| check == violation.check);
    let mut world = World::new(start_us);
    for (done, step) in (1..).zip(steps) {
        world.step(step);
        if let Some(violation) = world.oracle().violations().iter().find(is_meant) {
            return Some((violation.clone(), done));
        }
    }
    world.run_to(world.since_start_us() + settle_us);
    let broken = world.oracle().violations().iter().find(is_meant);
    broken.map(|violation| (violation.clone(), steps.len()))
}

/// Leaves out what is not needed to break the same promise (delta debugging), in at most so many
/// runs.
#[must_use]
pub fn shrink(
    start_us: u64,
    steps: Vec<Step>,
    check: Check,
    settle_us: u64,
    mut runs: u32,
) -> Vec<Step> {
    let mut steps = steps;
    let mut breaks = |steps: &[Step]| {
        runs = runs.saturating_sub(1);
        (broken_with(start_us, steps, settle_us, Some(check)).map(|(_, done)| done), runs > 0)
    };
    let mut chunk = steps.len() / 2;
    while chunk > 0 {
        let mut from = 0;
        while from < steps.len() {
            let to = (from + chunk).min(steps.len());
            let fewer: Vec<Step> = [&steps[..from], &steps[to..]].concat();
            let (done, goes_on) = breaks(&fewer);
            match done {
                Some(done) => {
                    steps = fewer;
                    steps.truncate(done);
                }
                None => from = to,
            }
            if !goes_on {
                return steps;
            }
        }
        chunk /= 2;
    }
    steps
}
