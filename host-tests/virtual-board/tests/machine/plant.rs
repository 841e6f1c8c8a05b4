//! Planted faults do what they say to the running image.

use std::time::Duration;

use rigless::device::ResetCause;
use virtual_board::machine::{Fault, Machine, Place};
use virtual_board::pins::LIGHT;

use crate::started;

const LIFE: Place<'_> = Place::Task("motor_gateway::tasks::life::life", 0);

/// The causes of the resets since the board was switched on.
fn resets(machine: &mut Machine) -> Vec<ResetCause> {
    machine.reports().resets.iter().map(|reset| reset.cause).collect()
}

#[test]
fn a_hang_in_a_task_takes_the_processor_for_good() {
    let mut machine = started();
    machine.run_for(Duration::from_secs(1));
    let blinked = machine.probe(LIGHT).changed();
    machine.plant(LIFE, &Fault::Hang);
    machine.run_for(Duration::from_secs(3));
    assert_eq!(machine.probe(LIGHT).changed(), blinked);
    assert_eq!(resets(&mut machine), []);
}

#[test]
fn a_panic_in_a_task_starts_the_part_again() {
    let mut machine = started();
    machine.plant(LIFE, &Fault::Panic);
    machine.run_for(Duration::from_secs(1));
    assert_eq!(resets(&mut machine), [ResetCause::Core]);
}

#[test]
fn a_hard_fault_in_a_function_starts_the_part_again_and_again_until_it_is_healed() {
    let mut machine = started();
    machine
        .plant(Place::Function("motor_gateway::shared_gateway::SharedGateway::poll_host"), &Fault::HardFault);
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
