//! Faults, each in mid-motion, and what GUARANTEES promises: the end state, and the time until the
//! stop.

mod can_bus;
mod host_link;
mod line_noise;
mod mute_motor;
mod overflow;
mod pins;
mod reset;
mod two_hosts;

use std::fs;
use std::sync::LazyLock;
use std::time::Duration;

use virtual_board::board::Board;

use crate::reaction::{self, Reaction};

/// A test for each fault, which runs once in a process, and a table of all their reaction times.
macro_rules! faults {
    ($($file:ident::$fault:ident)+) => {
        $(
            #[test]
            fn $fault() {
                print(reactions::$fault());
            }
        )+

        mod reactions {
            use super::*;
            $(pub fn $fault() -> &'static [Reaction] {
                static REACTIONS: LazyLock<Vec<Reaction>> = LazyLock::new($file::$fault);
                &REACTIONS
            })+
        }

        fn every_reaction() -> Vec<Reaction> {
            [$(reactions::$fault()),+].concat()
        }
    };
}

faults! {
    host_link::a_cut_host_link_expires_the_setpoints
    host_link::a_cut_host_link_is_silent_before_a_long_setpoint_expires
    host_link::nothing_but_noise_from_the_host_expires_the_setpoints
    host_link::a_host_that_never_pauses_keeps_nothing_waiting
    mute_motor::a_mute_motor_is_stopped_although_it_answers_nothing
    can_bus::a_cut_bus_trips_for_want_of_acknowledgement_and_the_stop_leaves_first_when_it_is_mended
    can_bus::a_bus_without_another_node_is_passive_and_never_off
    can_bus::a_short_trips_as_bus_off_and_the_stop_follows_when_the_bus_is_back
    can_bus::a_long_short_is_followed_by_the_stop_as_soon_as_the_bus_is_back
    line_noise::a_host_that_is_disturbed_now_and_then_stays_in_command
    line_noise::a_disturbed_rs485_line_loses_its_motor_and_the_stop_gets_through
    line_noise::a_quiet_spell_of_noise_on_rs485_is_only_counted
    line_noise::an_error_on_a_line_brings_nothing_old_back
    overflow::frames_lost_in_the_controller_are_counted_and_nothing_sticks
    pins::an_opened_e_stop_input_stops_every_axis
    pins::an_opened_e_stop_input_stays_latched_over_a_reset
    pins::the_enable_output_is_inactive_from_a_panic_until_the_firmware_runs_again
    pins::the_enable_output_is_inactive_while_an_axis_is_unreachable
    pins::the_enable_output_stays_inactive_over_a_reset_while_an_axis_is_unreachable
    pins::the_light_shows_the_state
    reset::the_reset_pin_in_mid_motion_is_followed_by_stops
    reset::a_reset_by_software_in_mid_motion_is_followed_by_stops
    reset::a_hang_of_any_task_is_followed_by_stops
    reset::a_hang_of_the_core_is_followed_by_stops
    reset::a_panic_in_a_task_is_followed_by_stops
    reset::a_hard_fault_is_followed_by_stops
    reset::a_stack_that_is_full_faults_and_is_followed_by_stops
    reset::a_power_cycle_leaves_nothing_configured_and_says_so
    reset::after_a_reset_an_axis_is_cleared_and_moves_again
    two_hosts::the_second_host_may_read_and_stop_and_not_command
    two_hosts::an_emergency_stop_from_the_second_host_reaches_every_bus_at_once
}

/// Prints them, as lines of the committed table: they name the same stops and limits.
#[track_caller]
fn print(reactions: &[Reaction]) {
    reactions.iter().for_each(|reaction| println!("{reaction}"));
    if Board::chosen() == Board::NucleoH743zi {
        reactions.iter().for_each(|reaction| reaction.check_written(TABLE));
    }
}

/// The committed table of their times.
const TABLE: &str = include_str!("../../fault-times.txt");

/// Keeps the text above the table.
#[test]
#[ignore = "writes fault-times.txt anew: .ci/virtual-board faults"]
fn the_table_of_reaction_times() {
    let comments = TABLE.lines().take_while(|line| line.starts_with('#'));
    let mut table: String = comments.map(|line| format!("{line}\n")).collect();
    table += &format!("{}\n", reaction::head());
    every_reaction().iter().for_each(|reaction| table += &format!("{reaction}\n"));
    fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/fault-times.txt"), table).expect("written");
}

#[test]
#[should_panic(expected = "fault-times.txt has no line")]
fn a_limit_that_is_not_in_the_table_is_found() {
    let line = TABLE.lines().find(|line| line.starts_with("motor mute")).expect("a line");
    let moved = TABLE.replace(line, &line.replace(" 80505", " 80506"));
    let reaction = Reaction {
        cause: "motor mute".to_owned(),
        motor: "RMD on CAN",
        stop: "141#8100000000000000".to_owned(),
        took: Duration::ZERO,
        limit: Duration::from_micros(80_505),
    };
    assert_ne!(moved, TABLE);
    reaction.check_written(&moved);
}
