//! Every scenario of the host's side is a test of its own, played with several seeds, and none is forgotten.
//!
//! `MGW_SEEDS=100` plays more of them, `MGW_SEED=7` one.

use host_tests::client_scenario::run;
use host_tests::scenario::seeds;

fn play(name: &str, text: &str) {
    for seed in seeds().unwrap() {
        if let Err(error) = run(text, seed) {
            panic!(
                "{name}, seed {seed}\n{error}\nagain: MGW_SEED={seed} cargo test -p host-tests --test client_scenarios -- {name}"
            );
        }
    }
}

macro_rules! scenarios {
    ($($name:ident)+) => {
        $(
            #[test]
            fn $name() {
                play(stringify!($name), include_str!(concat!("../client-scenarios/", stringify!($name), ".txt")));
            }
        )+

        #[test]
        fn every_file_is_listed() {
            let listed = [$(stringify!($name)),+];
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/client-scenarios");
            for entry in std::fs::read_dir(folder).unwrap() {
                let name = entry.unwrap().file_name().into_string().unwrap();
                let Some(name) = name.strip_suffix(".txt") else { continue };
                assert!(listed.contains(&name), "{name} is not listed in tests/client_scenarios.rs");
            }
        }
    };
}

scenarios! {
    a_connection_that_fails_is_opened_again_for_the_stop
    a_cut_line_is_told_and_the_motor_stops
    a_delay_and_a_jitter_of_30_ms_together_trip_nothing
    a_delay_in_one_direction_only_trips_nothing
    a_delay_of_40_ms_trips_nothing
    a_jitter_of_40_ms_trips_nothing
    a_lost_answer_to_a_move_moves_once
    a_move_behind_a_delay_of_40_ms_arrives
    a_native_motion_on_a_lossy_line_goes_on
    a_program_that_stands_still_moves_nothing_afterwards
    a_stall_of_300_ms_trips_and_is_told
    a_stall_of_50_ms_trips_nothing
    a_stop_by_another_host_is_told
    a_stop_is_written_before_hello
    a_stop_on_a_dead_line_says_that_it_is_not_confirmed
    a_stop_over_a_connection_that_fails_is_written_again
    a_stop_passes_a_line_with_errors_in_two_of_a_hundred_bytes
    a_stop_reaches_the_gateway_although_nothing_answers
    a_stop_that_the_motor_ignores_is_not_confirmed
    a_stop_whose_answers_are_forged_is_sent_all_the_same
    a_time_beyond_all_bounds_moves_nothing
    a_trip_at_the_moment_of_ctrl_c_is_a_failure
    a_trip_while_armed_is_a_failure
    a_trip_while_it_is_stopped_is_a_failure
    an_armed_axis_stays_so_on_a_lossy_line
    an_emergency_stop_of_another_host_is_a_failure
    an_emergency_stop_reaches_the_gateway_although_nothing_answers
    ctrl_c_beside_a_host_that_polls_stops
    ctrl_c_ends_a_move
    ctrl_c_ends_a_native_motion
    ctrl_c_is_followed_by_a_stop_and_nothing_that_moves
    ctrl_c_just_before_the_answer_to_arming_starts_no_motion
    ctrl_c_on_a_lossy_line_repeats_the_stop
    ctrl_c_while_a_request_is_unanswered_is_not_delayed_by_it
    ctrl_c_while_armed_stops_every_axis_that_was_armed
    ctrl_c_while_arming_starts_no_motion
    ctrl_c_while_arming_starts_no_move
    ctrl_c_while_arming_starts_no_native_motion
    ctrl_c_while_arming_with_dead_answers_starts_no_motion
    ctrl_c_with_dead_answers_stops_at_once
    endless_events_delay_no_stop
    endless_noise_delays_no_stop
    errors_in_one_of_two_hundred_bytes_trip_nothing
    eight_lost_setpoints_in_a_row_trip_nothing
    forged_answers_leave_nothing_in_motion
    frames_that_come_twice_trip_nothing
    losses_of_1_in_a_hundred_trip_nothing
    losses_of_20_in_a_hundred_trip_nothing
    losses_of_5_in_a_hundred_trip_nothing
    lost_answers_stop_nothing
    four_lost_setpoints_in_a_row_behind_a_delay_of_40_ms_trip_nothing
    watch_ends_although_events_keep_coming
    watch_ends_although_noise_keeps_coming
    watch_on_a_bad_line_goes_on
    ctrl_c_before_hello_is_answered_arms_nothing
    ctrl_c_just_before_arming_arms_nothing
    ctrl_c_at_a_setpoint_is_followed_by_a_stop
    a_stop_whose_connection_ends_is_not_confirmed
}
