//! What only the STM32G474 has.

use host_protocol::{Error, StoredState};
use virtual_board::machine::Machine;

use crate::bench::Bench;
use crate::lab::refused;
use crate::silicon::START;

/// RM0440, PWR_CR5: at 168 MHz the core needs the boosted range.
#[test]
fn its_regulator_is_boosted_for_168_mhz() {
    let mut machine = Machine::builder().power_on();
    assert!(!machine.part().g474().is_boosted());
    machine.run_for(START);
    assert!(machine.part().g474().is_boosted());
}

/// RM0440, option DBANK: the program then runs from the only bank, and nothing is written there.
#[test]
fn with_one_bank_nothing_is_stored_and_it_says_why() {
    let mut bench = Bench::of(Machine::builder().with_one_bank());
    assert_eq!(bench.client.read_stored().expect("a state").state, StoredState::SingleBank);
    bench.client.take_authority().expect("in command");
    assert_eq!(refused(bench.client.save_configuration()), Error::SingleBank {});
    assert_eq!(bench.machine.borrow_mut().flash_operations(), []);
}
