//! A trace of the program counter: how often the flash is read for the instructions that are
//! executed, and which stage they belong to.

use std::ops::{Range, Sub};

use virtual_stm32::fetch::{Cache, Geometry, read_cycles};

use super::profile::Executed;
use super::stages::{Counts, Functions, Stages};
use crate::machine::Machine;
use crate::nodes::instant;

/// What a trace says.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Traced {
    /// Reads of the flash.
    pub(crate) reads: u64,
    /// Instructions by stage.
    pub(crate) stages: Counts,
    /// Instructions by address, since the look before.
    pub(crate) executed: Executed,
}

impl Sub for Traced {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        let stages = std::array::from_fn(|stage| self.stages[stage] - before.stages[stage]);
        Self { reads: self.reads - before.reads, stages, executed: self.executed }
    }
}

/// A board's trace, and the cache that it is fed to.
pub(crate) struct Fetches {
    code: Range<u64>,
    bytes: Vec<u8>,
    cache: Cache,
    stages: Stages,
}

impl Fetches {
    /// Traces from now on.
    pub(crate) fn begin(machine: &mut Machine, functions: Functions) -> Self {
        let code = machine.code();
        let length = usize::try_from(code.end - code.start).expect("less than the flash");
        let bytes = machine.read_memory(code.start, length);
        let cache = Cache::new(Geometry::of(machine.part()));
        machine.take_hits();
        machine.trace(code.clone(), true);
        Self { code, bytes, cache, stages: Stages::new(functions) }
    }

    /// Traces no longer.
    pub(crate) fn end(self, machine: &mut Machine) {
        machine.trace(self.code, false);
        machine.take_hits();
    }

    /// What it says so far.
    pub(crate) fn look(&mut self, machine: &mut Machine) -> Traced {
        let mut executed = Executed::new();
        for hit in machine.take_hits() {
            let Some(at) = hit.address.checked_sub(self.code.start) else { continue };
            let Some(upper) = usize::try_from(at).ok().and_then(|at| self.bytes.get(at + 1)) else {
                continue;
            };
            // Armv7-M: these five bits begin an instruction of 32 bits.
            let is_long = *upper >= 0b1110_1000;
            self.cache.fetch(hit.address, if is_long { 4 } else { 2 });
            self.stages.executed(hit.address);
            *executed.entry(hit.address).or_insert(0) += 1;
        }
        Traced { reads: self.cache.reads(), stages: self.stages.counts(), executed }
    }
}

/// Cycles that a read of the flash costs as the firmware has set it.
pub(super) fn cycles(machine: &mut Machine) -> u64 {
    let now = instant(machine.now());
    read_cycles(machine.part_mut(), now)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::measure::bench::STARTED;

    #[test]
    fn every_instruction_is_traced_and_code_that_stays_is_read_once() {
        let mut machine = Machine::builder().power_on();
        machine.run_for(STARTED);
        let image = std::fs::read(crate::machine::image_path().unwrap()).unwrap();
        let mut fetches = Fetches::begin(&mut machine, Functions::read(&image).unwrap());
        let before = machine.instructions();
        machine.run_for(Duration::from_millis(30));
        let Traced { reads, stages, executed: by_address } = fetches.look(&mut machine);
        let executed = machine.instructions() - before;
        assert!(executed > 1_000, "{executed}");
        assert_eq!(stages.iter().sum::<u64>(), executed);
        assert_eq!(by_address.values().sum::<u64>(), executed);
        assert!(reads > 100 && reads < executed / 10, "{reads} of {executed}");
        // Two wait states at 200 MHz, half of the processor's clock: (2 + 4) * 2.
        assert_eq!(cycles(&mut machine), 12);
        fetches.end(&mut machine);
        machine.run_for(Duration::from_millis(5));
        assert!(machine.take_hits().is_empty());
    }
}
