//! What only the STM32G474 has.

use virtual_board::machine::Machine;

use crate::silicon::START;

/// RM0440, PWR_CR5: at 168 MHz the core needs the boosted range.
#[test]
fn its_regulator_is_boosted_for_168_mhz() {
    let mut machine = Machine::builder().power_on();
    assert!(!machine.part().g474().is_boosted());
    machine.run_for(START);
    assert!(machine.part().g474().is_boosted());
}
