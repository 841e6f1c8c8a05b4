//! No promise is without a planted fault: that its check can fail is shown for each.

use super::*;

/// A test that breaks the promise on purpose.
fn planted(check: Check) -> fn() {
    match check {
        Check::MotionUnarmed => motion::motion_of_an_axis_that_was_never_armed,
        Check::MotionExpired => motion::a_refresh_after_the_expiry,
        Check::MotionAfterStop => motion::motion_after_a_stop,
        Check::MotionStale => motion::a_refresh_of_another_setpoint_than_the_newest,
        Check::MotionTwice => motion::a_distance_that_is_sent_twice,
        Check::MotionKept => motion::motion_that_waits_in_the_controller_and_is_not_asked_back,
        Check::Broadcast => motion::broadcast_motion,
        Check::StartUnproved => together::each_thing_that_is_missing_before_a_start,
        Check::StopLate => stops::a_stop_that_comes_late,
        Check::StopNotFirst => stops::a_poll_that_goes_before_a_stop,
        Check::StopOnce => stops::a_stop_that_is_confirmed_though_it_was_sent_once,
        Check::StopForgotten => stops::a_tripped_axis_whose_stop_is_not_repeated,
        Check::ConfirmedUnproved => stops::one_reading_of_standstill_is_too_little,
        Check::WrongStopAction => stops::an_axis_that_is_to_hold_is_let_go,
        Check::UnsentUntold => stops::a_stop_that_cannot_leave_and_nobody_is_told,
        Check::TripForgotten => stops::a_trip_that_ends_by_itself,
        Check::ArmedUnasked => hosts::an_axis_that_is_armed_unasked,
        Check::ArmedUnproved => arming::each_question_left_out,
        Check::EStopIgnored => hosts::arming_while_the_e_stop_is_latched,
        Check::EpochIgnored => hosts::the_epoch_of_an_earlier_arming,
        Check::ExpiryIgnored => hosts::a_setpoint_that_expires_later_than_the_axis_allows,
        Check::AuthorityIgnored => hosts::a_link_that_is_not_in_command_is_obeyed,
        Check::ResultUnasked => hosts::a_second_result,
        Check::ResultMissing => hosts::a_request_without_a_result,
        Check::ResultChanged => hosts::a_repeated_request_that_gets_other_bytes,
        Check::ToldInPart => hosts::half_a_frame_and_an_event_that_is_lost,
        Check::RawUnopened => motion::a_raw_frame_on_a_bus_that_is_not_open,
        Check::RawHarmful => others::raw_frames_that_a_lenient_motor_obeys,
        Check::WrongMotor => others::a_frame_to_no_axis_that_frees_the_brake_of_one,
        Check::IdShared => others::a_request_id_on_which_another_motor_acts,
        Check::BusShared => others::a_bus_that_d5_motors_share_or_that_is_too_fast_for_them,
        Check::LeftBehind => {
            others::a_change_that_is_sent_when_its_axis_has_been_moved_to_another_motor
        }
        Check::NotDelivered => others::a_setpoint_that_is_accepted_and_never_sent,
        Check::FaultsUnread => others::faults_that_are_not_read,
        Check::LimitOnWire => others::a_limit_that_is_exceeded_by_rounding,
        Check::LimitBlind => others::a_limit_that_nothing_can_measure,
        Check::StandstillBlind => others::a_threshold_of_standstill_below_what_the_motor_can_tell,
        Check::EpochRepeated => others::an_epoch_that_is_given_again_after_a_loss_of_power,
        Check::ChangedWhileArmed => motion::a_change_of_the_motor_while_its_axis_is_armed,
        Check::NotInDialect => motion::what_the_dialect_of_an_axis_lacks,
        Check::BusOffIgnored => counts::a_bus_that_goes_off_and_trips_nothing,
        Check::CountWrong => counts::each_counter_that_is_wrong,
        Check::ResetForgot => starts::a_reset_that_loses_an_axis,
        Check::Restless => others::events_that_follow_from_each_other_without_end,
        Check::Panicked => others::a_panic_of_the_core,
        Check::NotNamed => others::a_frame_for_which_nobody_was_told_to_ask,
        Check::HistoryWrong => history::a_list_that_ends_too_early,
        Check::PowerLossKept => starts::a_loss_of_power_after_which_an_axis_is_configured,
        Check::StoredInMotion => stored::a_configuration_that_is_stored_while_an_axis_is_armed,
    }
}

#[test]
fn every_check_can_fail() {
    for check in Check::ALL {
        BROKEN.take();
        planted(*check)();
        assert!(BROKEN.take().contains(check), "{check:?} was not broken by its planted fault");
    }
}
