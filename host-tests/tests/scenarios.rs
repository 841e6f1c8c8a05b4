//! Every scenario is a test of its own, played with several seeds, and none is forgotten.
//!
//! `MGW_SEEDS=100` plays more of them, `MGW_SEED=7` one.

use host_tests::scenario::{run, seeds};

fn play(name: &str, text: &str) {
    for seed in seeds().unwrap() {
        if let Err(error) = run(text, seed) {
            panic!(
                "{name}, seed {seed}\n{error}\nagain: MGW_SEED={seed} cargo test -p host-tests --test scenarios -- {name}"
            );
        }
    }
}

macro_rules! scenarios {
    ($($name:ident)+) => {
        $(
            #[test]
            fn $name() {
                play(stringify!($name), include_str!(concat!("../scenarios/", stringify!($name), ".txt")));
            }
        )+

        #[test]
        fn every_file_is_listed() {
            let listed = [$(stringify!($name)),+];
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios");
            for entry in std::fs::read_dir(folder).unwrap() {
                let name = entry.unwrap().file_name().into_string().unwrap();
                let Some(name) = name.strip_suffix(".txt") else { continue };
                assert!(listed.contains(&name), "{name} is not listed in tests/scenarios.rs");
            }
        }
    };
}

scenarios! {
    a_babbling_node_with_the_highest_id_delays_a_stop_by_one_frame_at_most
    a_babbling_node_with_the_lowest_id_trips_and_the_stop_goes_out_when_it_falls_silent
    a_backlog_of_five_seconds_released_at_once_moves_nothing
    a_brake_stop_holds_locks_verifies_and_switches_off
    a_bus_that_cannot_carry_its_axes_is_refused_with_numbers
    a_bus_that_is_cut_at_a_reset_keeps_no_host_out
    a_bus_that_stays_off_is_started_again_and_its_stops_follow
    a_confirmed_stop_is_repeated_every_500_ms_while_tripped
    a_cut_bus_trips_for_want_of_acknowledgement
    a_d5_that_answers_nothing_is_not_armed
    a_d5_that_answers_reads_only_is_confirmed_by_reading_back
    a_d5_that_keeps_its_speed_is_not_acknowledged_by_reading_back
    a_fault_bit_trips_and_clears_only_when_it_is_gone
    a_fault_that_heals_by_itself_does_not_let_the_motor_run_on
    a_fresh_setpoint_is_refreshed_within_a_third_of_the_motors_timeout
    a_held_motor_that_turns_is_stopped_again
    a_holding_axis_lets_go_on_request
    a_holding_rmd_is_not_taken_from_its_polls_by_configuration
    a_holding_rmd_is_polled_so_that_its_own_timeout_does_not_drop_the_load
    a_host_that_floods_delays_no_stop_of_another
    a_host_that_floods_its_own_link_feeds_nothing_with_old_setpoints
    a_host_that_never_reads_blocks_nothing_and_may_stop
    a_late_reply_after_retry_is_ignored
    a_late_reply_to_a_setpoint_of_0_does_not_acknowledge_the_stop
    a_limit_that_nothing_measures_is_refused
    a_load_between_our_ids_keeps_no_stop_out_that_wins_against_it
    a_lost_reply_is_made_up_for_and_three_in_a_row_trip
    a_measured_value_beyond_the_limit_trips
    a_motor_holds_while_another_stop_cannot_leave
    a_motor_that_answers_all_but_its_fault_word_trips
    a_motor_that_answers_polls_and_no_motion_trips
    a_motor_that_echoes_the_stop_and_turns_on_is_never_confirmed
    a_motor_that_ignores_its_first_command_after_a_timeout_is_armed_all_the_same
    a_motor_that_loses_its_power_trips_and_does_not_go_on_by_itself
    a_motor_that_should_hold_and_is_silent_is_stopped_again
    a_motor_that_throws_motion_back_trips_as_refused
    a_motor_that_turns_again_is_not_cleared
    a_motor_that_turns_backwards_is_not_standing
    a_mute_motor_trips_and_is_stopped_although_it_answers_nothing
    a_native_change_of_the_id_to_that_of_another_axis_is_refused
    a_native_motion_obeys_the_rules_of_setpoints
    a_native_relative_move_goes_out_once_and_trips_when_unanswered
    a_native_stop_is_a_stop
    a_new_session_on_the_link_ends_the_authority_of_the_old_one
    a_part_of_a_d5_speed_is_motion
    a_position_move_ends_with_its_permission
    a_relative_move_with_lost_reads_displaces_once
    a_relative_move_with_three_lost_replies_displaces_once
    a_reply_of_another_node_confirms_nothing
    a_request_that_is_repeated_is_executed_once
    a_reset_while_arming_runs_the_stop_action
    a_setpoint_is_taken_just_inside_the_ttl_and_refused_just_outside
    a_setpoint_of_another_epoch_feeds_nothing
    a_setpoint_that_noise_keeps_from_the_line_trips_as_not_delivered
    a_shorted_bus_trips_as_bus_off_and_is_stopped_when_it_is_back
    a_silent_host_trips_every_moving_axis_and_each_stop_is_confirmed
    a_speed_of_0_that_comes_back_unchanged_while_the_shaft_turns_trips
    a_stop_is_confirmed_under_a_load_that_first_stops_lose_to
    a_stop_on_rs485_waits_for_bytes_in_flight_only
    a_stop_takes_back_motion_that_waits_in_the_controller
    a_stop_that_is_asked_for_in_a_trip_goes_out_at_once
    a_stop_while_arming_arms_nothing
    a_stop_while_clearing_ends_the_clearing
    a_stuck_d5_that_ignores_the_stop_is_never_confirmed
    a_subscription_streams_and_ends_with_its_host
    a_thruster_is_told_its_timeout_again_whenever_it_is_armed
    a_thruster_that_has_timed_out_is_armed
    a_thruster_that_refuses_a_signal_trips_and_its_refused_stop_is_repeated
    a_thruster_that_refuses_is_not_stopped_by_its_refusal
    a_thruster_that_restarts_in_motion_refuses_and_trips
    a_thruster_that_would_resume_at_the_first_word_hears_zero_first
    a_thruster_with_an_encoder_is_stopped_in_its_position_controller_too
    a_trip_keeps_its_reason_time_and_last_values
    a_trip_outlives_a_reset_and_nothing_a_loss_of_power
    a_tripped_axis_bars_no_other_without_a_group
    a_write_that_waits_in_a_d5_is_overwritten_by_its_stop
    after_a_hang_and_a_reset_the_stops_go_first
    after_an_e_stop_each_axis_is_cleared_when_its_own_stop_is_confirmed
    an_armed_axis_is_disarmed_by_silence_and_does_not_trip
    an_armed_motor_that_turns_without_a_setpoint_trips
    an_axis_on_an_id_of_another_axis_is_refused
    an_axis_that_gets_another_motor_leaves_no_request_behind
    an_echo_with_another_value_acknowledges_nothing
    an_idle_axis_on_a_bus_that_is_off_gets_the_stop_of_an_e_stop_when_it_is_back
    an_impedance_setpoint_holds_like_a_spring
    an_old_reading_shows_no_standstill
    an_open_e_stop_input_bars_clearing_over_a_reset
    an_unreachable_motor_is_left_alone_between_two_stops
    an_unreachable_motor_stays_so_over_a_reset
    arming_asks_each_motor_in_its_order_and_writes_nothing_that_stays
    arming_needs_a_known_motor_timeout
    arming_needs_a_motor_that_stands_answers_and_has_no_fault
    authority_given_back_stops_and_disarms_without_a_trip
    axes_of_one_trip_group_trip_together
    bad_configurations_are_refused_by_name
    bad_moves_are_refused_by_name_and_nothing_moves
    bad_setpoints_are_refused_by_name_and_nothing_moves
    clear_waits_for_the_confirmation
    clearing_ends_although_a_stop_cannot_leave
    e_stop_stops_a_motor_that_something_else_set_in_motion
    e_stop_stops_all_and_bars_arming
    e_stop_while_arming_trips_and_arms_nothing
    e_stop_while_stopping_trips_and_goes_on_stopping
    each_measured_limit_trips_to_both_sides
    each_setpoint_beyond_its_limit_is_refused_to_both_sides
    fault_words_of_armed_axes_are_read_every_100_ms
    garbage_and_wrong_checksums_on_rs485_are_no_replies
    link_silence_trips_even_while_the_setpoint_lives
    motion_that_nobody_acknowledges_trips_in_time
    native_changes_need_an_idle_axis
    native_reads_are_free_and_answered_from_the_motor
    no_timeout_and_an_unknown_one_need_each_a_permission_of_their_own
    noise_on_rs485_delays_a_stop_by_little
    of_two_hosts_one_commands_and_both_may_stop
    one_reading_of_standstill_confirms_nothing
    pings_do_not_feed_a_setpoint
    pings_of_another_host_keep_nobody_in_command
    raw_access_and_armed_axes_exclude_each_other
    raw_access_ends_with_a_stop_or_a_change
    raw_access_that_is_left_open_ends_with_its_host
    raw_frames_pass_only_if_they_read
    raw_frames_that_only_a_lenient_motor_obeys_are_refused
    readings_of_standstill_follow_each_other
    rmd_and_thruster_share_a_bus
    rounding_pushes_no_value_beyond_its_limit
    stop_and_disarm_go_through_stopping_to_idle
    stops_of_eleven_d5_motors_wait_for_their_replies_and_meet_none
    stops_of_many_axes_follow_each_other_without_a_gap
    stops_of_two_axes_on_rs485_follow_within_the_bound
    the_32_bit_time_wraps_around_without_harm
    the_e_stop_input_does_what_the_command_does
    the_enable_output_drops_when_a_motor_is_unreachable
    the_last_16_trips_and_starts_are_remembered
    the_latest_setpoint_takes_the_place_of_those_before
    the_link_silence_that_trips_outlives_a_reset
    the_manuals_bytes_come_out_for_host_commands
    three_replies_lost_in_a_row_trip_and_two_do_not
    two_motors_with_one_id_are_both_stopped
    unsafe_raw_access_needs_a_bus_without_axes
    unsolicited_frames_inside_an_exchange_are_no_replies
    what_held_goes_on_holding_after_a_reset
    what_a_thruster_only_reports_bars_and_trips_nothing
    what_may_have_changed_a_motor_makes_its_timeout_unknown
    zero_protection_does_not_keep_a_thruster_from_being_armed
}

#[test]
fn a_scenario_that_is_wrong_fails() {
    let failing = "four-axes\nmark\nrun 10 ms\nexpect wire 0 141#A1";
    let error = run(failing, 1).unwrap_err();
    assert!(error.contains("line 4") && error.contains("seen 0 times"), "{error}");
    for wrong in [
        "expect moving 0",
        "expect turned 0 0.1 1",
        "refused NotArmed arm 0",
        "refused NotArmed set 0 velocity 1.0\nexpect refusal Tripped",
        "unanswered 1 s ping",
        "as 1 refused NotInCommand ping",
        "mark\narm 0\nexpect no-wire 0 141#81",
        "mark\narm 0\nexpect wire-count 0 141#81 3",
        "mark\narm 0\nexpect wire-order 0 141#9A 141#81",
        "mark\narm 0\nkeep 0 velocity 1.0\nrun 200 ms\nexpect spacing 0 141#A2 1 ms 2 ms",
        "mark\narm 0\nrun 5 ms\nexpect no-event StateChanged { axis: 0, state: Armed",
        "inject 0 mute",
        "motor 0 rmd 2",
        "power 9 off",
        "release-backlog",
        "arm 0\nset 0 velocity 1.0\nsilence 200 ms\nrun 10 ms\nmark\nexpect trip-time 0 0 ms 1 s",
        "arm 0\nset 0 velocity 1.0\nsilence 200 ms\nexpect trip-values 0 velocity 5 6",
        "arm 0\nstop 0\nrun 100 ms\nexpect reaction 0 10 us",
        "expect reaction 0 1 s",
        "expect acknowledged 0 yes",
        "expect enable-output off",
        "expect incidents 2",
        "expect incident 0 Tripped",
        "expect boot Watchdog",
        "expect last-words gone",
        "await 0 141#A2",
        "dance",
    ] {
        assert!(run(&format!("four-axes\n{wrong}"), 1).is_err(), "{wrong}");
    }
}

#[test]
fn a_failure_is_told_so_that_a_person_can_follow_it() {
    let failing = "four-axes\narm 0\nmark\nkeep 0 velocity 1.0\nrun 50 ms\nexpect wire 0 141#81 within 30 ms";
    let error = run(failing, 3).unwrap_err();
    for part in [
        "line 6: expect wire 0 141#81 within 30 ms",
        "axis 0 is active",
        "bus 0  gateway   141#A2",
        "bus 0  motor 0   241#A2",
        "event",
        "StateChanged { axis: 0, state: Active }",
        "command 0xA2 velocity",
    ] {
        assert!(error.contains(part), "{part} is missing in\n{error}");
    }
}

#[test]
fn the_same_seed_gives_the_same_run_and_another_one_another() {
    let text = "four-axes\narm 0 1 2 3\nkeep 0 velocity 1.0\nrun 200 ms\nreconnect\nas 1 ping\nrun 50 ms";
    let trace = |seed| host_tests::scenario::trace(text, seed).unwrap();
    assert_eq!(trace(1), trace(1));
    assert_ne!(trace(1), trace(2));
}
