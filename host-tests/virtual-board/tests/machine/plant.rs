//! Planted faults do what they say to the running image.

use std::time::Duration;

use rigless::device::ResetCause;
use virtual_board::machine::{Fault, Machine, Place};

use crate::started;

const LIGHT_TASK: Place<'_> = Place::Task("motor_gateway::tasks::light::light", 0);

/// The causes of the resets since the board was switched on.
fn resets(machine: &mut Machine) -> Vec<ResetCause> {
    machine.reports().resets.iter().map(|reset| reset.cause).collect()
}

#[test]
fn a_hang_in_a_task_takes_the_processor_for_good() {
    let mut machine = started();
    assert_eq!(machine.struck(), None);
    machine.plant(LIGHT_TASK, &Fault::Hang);
    assert!(machine.run_until(Duration::from_millis(200), |machine| machine.struck().is_some()));
    let reset = |machine: &mut Machine| !machine.reports().resets.is_empty();
    assert!(machine.run_until(Duration::from_millis(60), reset), "nobody fed the watchdog");
    assert_eq!(resets(&mut machine), [ResetCause::Model("IWDG")]);
}

#[test]
fn a_panic_in_a_task_starts_the_part_again() {
    let mut machine = started();
    machine.plant(LIGHT_TASK, &Fault::Panic);
    machine.run_for(Duration::from_secs(1));
    assert_eq!(resets(&mut machine), [ResetCause::Core]);
}

#[test]
fn a_hard_fault_in_a_function_starts_the_part_again_and_again_until_it_is_healed() {
    let mut machine = started();
    machine.plant(
        Place::Function("motor_gateway::shared_gateway::SharedGateway::poll_host"),
        &Fault::HardFault,
    );
    // Each start calls it: nothing to send yet.
    machine.reset_by_pin();
    machine.run_for(Duration::from_millis(100));
    let before = resets(&mut machine).len();
    assert!(before >= 3, "{:?}", resets(&mut machine));
    machine.heal();
    machine.run_for(Duration::from_millis(100));
    let after = resets(&mut machine).len();
    machine.run_for(Duration::from_secs(1));
    assert_eq!(resets(&mut machine).len(), after);
    assert!(after <= before + 1);
}

#[test]
#[should_panic(expected = "the image has no motor_gateway::nonsense")]
fn what_the_image_does_not_have_cannot_be_planted_in() {
    started().plant(Place::Function("motor_gateway::nonsense"), &Fault::Hang);
}
