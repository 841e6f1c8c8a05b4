//! Every scenario is a test of its own, and none is forgotten.

macro_rules! scenarios {
    ($($name:ident)+) => {
        $(
            #[test]
            fn $name() {
                let text = include_str!(concat!("../scenarios/", stringify!($name), ".txt"));
                if let Err(error) = host_tests::scenario::run(text) {
                    panic!("{error}");
                }
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
    a_cut_bus_trips_for_want_of_acknowledgement
    a_fault_bit_trips_and_clears_only_when_it_is_gone
    a_held_motor_that_turns_is_stopped_again
    a_holding_rmd_is_polled_so_that_its_own_timeout_does_not_drop_the_load
    a_late_reply_after_retry_is_ignored
    a_motor_that_ignores_its_first_command_after_a_timeout_is_armed_all_the_same
    a_mute_motor_trips_and_is_stopped_although_it_answers_nothing
    a_native_motion_obeys_the_rules_of_setpoints
    a_native_relative_move_goes_out_once_and_trips_when_unanswered
    a_native_stop_is_a_stop
    a_new_session_on_the_link_ends_the_authority_of_the_old_one
    a_relative_move_with_lost_reads_displaces_once
    a_shorted_bus_trips_as_bus_off_and_is_stopped_when_it_is_back
    a_silent_host_trips_every_moving_axis_and_each_stop_is_confirmed
    a_stuck_d5_that_ignores_the_stop_is_never_confirmed
    a_subscription_streams_and_ends_with_its_host
    a_thruster_that_refuses_is_not_stopped_by_its_refusal
    an_armed_axis_is_disarmed_by_silence_and_does_not_trip
    an_impedance_setpoint_holds_like_a_spring
    bad_configurations_are_refused_by_name
    bad_setpoints_are_refused_by_name_and_nothing_moves
    e_stop_stops_a_motor_that_something_else_set_in_motion
    e_stop_stops_all_and_bars_arming
    garbage_and_wrong_checksums_on_rs485_are_no_replies
    link_silence_trips_even_while_the_setpoint_lives
    native_changes_need_an_idle_axis
    native_reads_are_free_and_answered_from_the_motor
    pings_do_not_feed_a_setpoint
    raw_access_and_armed_axes_exclude_each_other
    rmd_and_thruster_share_a_bus
    the_manuals_bytes_come_out_for_host_commands
    zero_protection_does_not_keep_a_thruster_from_being_armed
}

#[test]
fn a_scenario_that_is_wrong_fails() {
    let failing = "four-axes\nmark\nrun 10 ms\nexpect wire 0 141#A1";
    let error = host_tests::scenario::run(failing).unwrap_err();
    assert!(error.contains("line 4") && error.contains("seen 0 times"), "{error}");
    assert!(host_tests::scenario::run("four-axes\nexpect moving 0").is_err());
    assert!(host_tests::scenario::run("four-axes\nrefused NotArmed arm 0").is_err());
    assert!(host_tests::scenario::run("dance").is_err());
}
