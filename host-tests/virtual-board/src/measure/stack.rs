//! How deep the stack has reached: the memory below it is painted, and looked at later.

use crate::machine::Machine;

/// What is painted. A stack that ends in such bytes looks that much shorter.
const PAINT: u8 = 0xA5;
/// Symbols of cortex-m-rt's linker script: the end of the static memory, and where the stack
/// begins.
const LIMIT: &str = "_stack_end";
const BEGIN: &str = "_stack_start";
/// More than the stack holds while the firmware waits: the executor and its caller. The tasks are
/// static.
const WAITING: usize = 1024;

/// Paints all memory that the stack may take. For a board that has not run yet.
pub(super) fn paint(machine: &mut Machine) {
    let (limit, length) = room(machine);
    machine.write_memory(limit, &vec![PAINT; length]);
}

/// The same for firmware that has started and waits: what it holds is left alone.
pub(super) fn paint_anew(machine: &mut Machine) {
    let (limit, length) = room(machine);
    machine.write_memory(limit, &vec![PAINT; length - WAITING]);
}

/// Bytes of the stack that have been in use since it was painted.
pub(super) fn used(machine: &mut Machine) -> u64 {
    let (limit, length) = room(machine);
    let memory = machine.read_memory(limit, length);
    let untouched = memory.iter().take_while(|byte| **byte == PAINT).count();
    (length - untouched) as u64
}

/// Where the room for the stack begins, and its length.
fn room(machine: &Machine) -> (u64, usize) {
    let (limit, begin) = (machine.symbol(LIMIT), machine.symbol(BEGIN));
    (limit, usize::try_from(begin - limit).expect("less than the part's memory"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn what_was_written_deepest_counts() {
        let mut machine = Machine::builder().power_on();
        paint(&mut machine);
        assert_eq!(used(&mut machine), 0);
        let begin = machine.symbol(BEGIN);
        machine.write_memory(begin - 100, &[0]);
        assert_eq!(used(&mut machine), 100);
        machine.run_for(Duration::from_millis(20));
        let started = used(&mut machine);
        assert!((1_000..16_384).contains(&started), "{started}");
        paint_anew(&mut machine);
        assert_eq!(used(&mut machine), WAITING as u64);
        machine.run_for(Duration::from_millis(20));
        let waited = used(&mut machine);
        assert!(waited < started, "{waited} of {started}");
    }
}
