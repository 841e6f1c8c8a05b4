//! What a reset leaves in the retained RAM, and what a power cycle does not; and why the part
//! started.

use std::time::Duration;

use rigless::device::ResetCause;
use virtual_board::board::Board;
use virtual_board::machine::{Fault, Machine, Place};

use crate::{STARTED, started};

/// A word that the firmware does not use.
const UNUSED: u64 = Board::NucleoH743zi.facts().retained_ram.base + 0xC000;

/// `LDR r0, =UNUSED; LDR r1, =word; STR r1, [r0]`, then what `rest` says, then a loop for ever.
fn storing(word: u32, rest: &[u16]) -> Fault {
    // The words stand behind the code: it is padded to eight instructions.
    let mut code = vec![0x4803, 0x4904, 0x6001];
    code.extend(rest);
    code.resize(7, 0xBF00);
    code.push(0xE7FE);
    for word in [u32::try_from(UNUSED).unwrap(), word] {
        let [a, b, c, d] = word.to_le_bytes();
        code.extend([u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])]);
    }
    Fault::Code(code)
}

/// Stores a word there in place of the light's task, and hangs.
fn stored(word: u32, rest: &[u16]) -> Machine {
    let mut machine = started();
    machine.plant(Place::Task("motor_gateway::tasks::light::light", 0), &storing(word, rest));
    assert!(machine.run_until(Duration::from_secs(1), |machine| machine.read_word(UNUSED) == word));
    machine.run_for(Duration::from_micros(10));
    machine
}

/// `STR r1, [r0, #4]`.
const STORE_ANOTHER: u16 = 0x6041;

#[test]
fn the_last_write_before_a_reset_is_lost() {
    let mut machine = started();
    let before = machine.read_word(UNUSED);
    assert_ne!(before, 0, "anything is in the RAM at first");
    let mut machine = stored(0x1234_5678, &[]);
    machine.reset_by_pin();
    assert_eq!(machine.read_word(UNUSED), before);
}

#[test]
fn a_write_that_another_one_followed_outlives_a_reset() {
    let mut machine = stored(0x1234_5678, &[STORE_ANOTHER]);
    let second = UNUSED + 4;
    assert_eq!(machine.read_word(second), 0x1234_5678);
    machine.reset_by_pin();
    assert_eq!(machine.read_word(UNUSED), 0x1234_5678);
    assert_ne!(machine.read_word(second), 0x1234_5678, "the dummy itself is lost");
    machine.run_for(STARTED);
    machine.reset_by_pin();
    assert_eq!(machine.read_word(UNUSED), 0x1234_5678, "lost is the last write, not the last word");
}

#[test]
fn a_power_cycle_leaves_nothing_and_starts_as_power_on() {
    let mut machine = stored(0x1234_5678, &[STORE_ANOTHER]);
    let log = machine.take_rtt();
    assert!(!log.is_empty());
    let instructions = machine.instructions();
    machine.power_cycle(Duration::from_millis(5));
    assert_eq!(machine.instructions(), instructions, "without power nothing runs");
    assert_ne!(machine.read_word(UNUSED), 0x1234_5678);
    machine.run_for(STARTED);
    let resets = machine.reports().resets;
    assert_eq!(resets.iter().map(|reset| reset.cause).collect::<Vec<_>>(), [ResetCause::PowerOn]);
    assert_eq!(machine.take_rtt(), started().take_rtt(), "as the first start");
}
