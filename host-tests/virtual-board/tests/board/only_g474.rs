//! What only the STM32G474 has.

use std::time::Duration;

use host_protocol::{Error, StoredState};
use virtual_board::machine::Machine;

use crate::lab::{D5, Lab, SEED, refused, wired};
use crate::silicon::START;

/// RM0440, PWR_CR5: at 168 MHz the core needs the boosted range.
#[test]
fn its_regulator_is_boosted_for_168_mhz() {
    let mut machine = Machine::builder().power_on();
    assert!(!machine.part().g474().is_boosted());
    machine.run_for(START);
    assert!(machine.part().g474().is_boosted());
}

/// RM0440, option DBANK = 0: the pages are others, and the program runs from the only bank.
#[test]
fn with_a_flash_of_one_bank_nothing_is_stored_and_the_host_is_told_why() {
    let (board, outside, probes) = wired(SEED);
    let mut lab = Lab::around(board.single_bank().power_on(), outside, probes);
    lab.configure();
    lab.client.take_authority().expect("in command");
    for refusal in [refused(lab.client.save_configuration()), refused(lab.client.forget_stored())] {
        assert_eq!(refusal, Error::SingleBank {});
        assert!(refusal.to_string().contains("DBANK = 1"), "{refusal}");
    }
    assert_eq!(lab.client.read_stored().expect("a state").state, StoredState::SingleBank);
    // It drives its motors as ever.
    let holds = lab.arm(&[D5]);
    lab.keep(&holds, Duration::from_millis(500));
    lab.assert_turning(D5);
    lab.machine.borrow_mut().power_cycle(Duration::from_millis(100));
    lab.run_for(Duration::from_millis(500));
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.list_axes().expect("a list"), []);
    assert_eq!(lab.client.read_stored().expect("a state").state, StoredState::SingleBank);
    assert_eq!(lab.machine.borrow_mut().flash_operations(), []);
}
