//! Native commands: the manuals' bytes, under the rules of what they do (GUARANTEES G2).

use crate::bench::{self, VELOCITY, answered, arm, listed, native, run_with_host};
use crate::rig::{BOARD_AGAIN, Instead, Rig};
use gateway::Event;
use host_protocol::{
    AxisParameter, AxisState, Error, Event as HostEvent, MotorTimeout, NoReplyHint, Protocol,
    Quantity, Reply, Request, Setpoint, StopAction, TripReason, Value, requests,
};

/// Frames on a bus since a time that are exactly this.
fn count(rig: &Rig, bus: u8, since_us: u64, text: &str) -> usize {
    rig.sent_since(bus, since_us).iter().filter(|sent| **sent == text).count()
}

fn tripped(rig: &mut Rig) -> Option<TripReason> {
    bench::state(rig).trip.map(|trip| trip.reason)
}

/// RMD node 1, which answers a relative move too.
fn rmd_that_answers_0xa8() -> Rig {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.instead(|text| match text.get(4..6) {
        Some("A8") => Instead::Says("241#A8326400F4012D00"),
        _ => Instead::AsUsual,
    });
    rig
}

#[test]
fn a_question_that_is_lost_is_asked_again_and_then_given_up() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.instead(|text| if text.contains("#B2") { Instead::Nothing } else { Instead::AsUsual });
    let since = rig.now_us;
    let request = native(&rig, 0, "B200000000000000");
    assert_eq!(rig.ask(request), Err(Error::NoReply { axis: 0, hint: NoReplyHint::None }));
    assert_eq!(count(&rig, 0, since, "141#B200000000000000"), 3);
}

#[test]
fn the_direction_of_the_axis_turns_the_limits_and_not_the_bytes() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::Direction, Value::Signed(-1));
    bench::parameter(&mut rig, 0, AxisParameter::PositionMinRad, Value::Float(-7.0));
    bench::parameter(&mut rig, 0, AxisParameter::PositionMaxRad, Value::Float(0.0));
    let epoch = arm(&mut rig);
    // 360° of the motor is −2π of the axis; −360° would be beyond its limit.
    let request = native(&rig, epoch, "A400F401A08C0000");
    assert_eq!(answered(rig.ask(request)), "A432640000006801");
    let request = native(&rig, epoch, "A400F4016073FFFF");
    let refused = rig.ask(request);
    assert!(
        matches!(refused, Err(Error::OutOfRange { quantity: Quantity::Position, .. })),
        "{refused:?}"
    );
}

#[test]
fn a_relative_move_goes_out_once_and_ends_with_its_permission() {
    let mut rig = rmd_that_answers_0xa8();
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = native(&rig, epoch, "A800F40110270000"); // 100° on, at 500 °/s
    assert_eq!(answered(rig.ask(request)), "A8326400F4012D00");
    run_with_host(&mut rig, 70_000);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Active);
    // The motor's own timeout is not known, so it hears something every 20 ms.
    assert!(rig.longest_gap_us(0, since, "141#") <= 21_000);
    run_with_host(&mut rig, 500_000);
    assert_eq!(count(&rig, 0, since, "141#A800F40110270000"), 1);
    assert_eq!(tripped(&mut rig), Some(TripReason::SetpointExpired));
}

#[test]
fn a_relative_move_that_is_thrown_back_is_refused_and_not_sent_again() {
    let (mut rig, _) = bench::rmd(StopAction::Hold); // this motor throws 0xA8 back
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = native(&rig, epoch, "A800F40110270000");
    let reason = TripReason::CommandRefused { faults: Some(0) };
    assert_eq!(rig.ask(request), Err(Error::Tripped { axis: 0, reason }));
    run_with_host(&mut rig, 100_000);
    assert_eq!(count(&rig, 0, since, "141#A800F40110270000"), 1);
}

#[test]
fn the_thruster_s_relative_move_and_the_d5_s_execute_go_out_once_too() {
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::PositionDevice, Value::Bool(true));
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = native(&rig, epoch, "4C52001E000000C8"); // 30 rpm, 20°
    assert_eq!(answered(rig.ask(request)), "4C52001E000000C8");
    run_with_host(&mut rig, 60_000);
    assert_eq!(count(&rig, 0, since, "30B#4C52001E000000C8"), 1);

    let (mut rig, _) = bench::d5();
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = native(&rig, epoch, "D50B05042058028E"); // speed 600, to wait
    answered(rig.ask(request));
    let request = native(&rig, epoch, "D50B050500000015"); // now
    answered(rig.ask(request));
    run_with_host(&mut rig, 60_000);
    assert_eq!(count(&rig, 1, since, "00B#D50B05042058028E"), 1);
    assert_eq!(count(&rig, 1, since, "00B#D50B050500000015"), 1);
}

#[test]
fn a_change_takes_away_what_was_known_of_the_motor_s_own_timeout() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::provision(&mut rig, 200).unwrap();
    assert_eq!(bench::state(&mut rig).motor_timeout, MotorTimeout::Written { timeout_ms: 200 });
    let request = native(&rig, 0, "B3000000D0070000");
    assert_eq!(answered(rig.ask(request)), "B3000000D0070000");
    assert_eq!(bench::state(&mut rig).motor_timeout, MotorTimeout::Unknown);
}

#[test]
fn what_is_no_command_of_the_manual_is_refused() {
    let refused = |rig: &mut Rig, protocol, data: &str| {
        let since = rig.now_us;
        let request = native(rig, 0, data);
        assert_eq!(rig.ask(request), Err(Error::NotACommand { axis: 0, protocol }), "{data}");
        assert_eq!(rig.sent_since(0, since).len() + rig.sent_since(1, since).len(), 0, "{data}");
    };
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    for data in
        ["", "9A", "9A000000000000", "AA00000000000000", "7900000000000000", "2009000000000000"]
    {
        refused(&mut rig, Protocol::Rmd, data);
    }
    let (mut rig, _) = bench::thruster();
    for data in ["5156", "4142000000000000", "4342000000000003", "5354000000000001"] {
        refused(&mut rig, Protocol::Thruster, data);
    }
    let (mut rig, _) = bench::d5();
    // A wrong checksum, a register that is only read, an unknown command.
    for data in
        ["D50B05032058028E", "D50B0503260000 39".replace(' ', "").as_str(), "D50B050900000019"]
    {
        refused(&mut rig, Protocol::D5, data);
    }
}

/// D5 manual, table row 12 and register 0x20: half a speed, at once or later, from the register
/// below, and into the one above. No limit can be checked against it, armed or not.
#[test]
fn a_part_of_a_d5_speed_is_motion_and_refused() {
    let (mut rig, _) = bench::d5();
    for armed in [false, true] {
        let epoch = if armed { arm(&mut rig) } else { 0 };
        for data in [
            "D50B0404218400B8",
            "D50B04032058008A",
            "D50B05031F00588A",
            "D50B050321020036",
            "D50B05041F00588B",
        ] {
            let since = rig.now_us;
            let request = native(&rig, epoch, data);
            let refused = Err(Error::CannotCheckLimit { axis: 0, quantity: Quantity::Velocity });
            assert_eq!(rig.ask(request), refused, "{data}");
            assert!(!rig.sent_since(1, since).iter().any(|sent| sent.ends_with(data)));
        }
    }
}

/// D5 manual, quick start (3), table rows 11 and 12: what waits is a speed. Another id, level or
/// switch would wait for a 05 of anybody, when nobody looks any more what it meets.
#[test]
fn nothing_but_a_speed_may_wait_in_a_d5() {
    let (mut rig, _) = bench::d5();
    bench::configure_axis(&mut rig, 1, 1, Protocol::D5, 12, StopAction::Hold);
    let since = rig.now_us;
    for data in [
        "D50B0504030C0023", // its id, that of axis 1
        "D50B0504030D0024", // one that is free
        "D50B040410000023", // the level of answers
        "D50B040411000024", // the timeout's switch
        "D50B04041901002D", // clears protection
        "D50B0504154848B9", // both accelerations
    ] {
        let refused = Err(Error::NotACommand { axis: 0, protocol: Protocol::D5 });
        let request = native(&rig, 0, data);
        assert_eq!(rig.ask(request), refused, "{data}");
    }
    assert_eq!(rig.sent_since(1, since), [""; 0]);
}

/// D5 manual, table row 7 has 0x15 and 0x16 in one frame. Sum of 0B 05 03 15 48 48.
#[test]
fn acceleration_and_deceleration_of_a_d5_are_written_at_once() {
    let (mut rig, _) = bench::d5();
    rig.instead(|text| match text {
        "00B#D50B0503154848B8" => Instead::Says("00B#5D0B0503154848B8"),
        _ => Instead::AsUsual,
    });
    let request = native(&rig, 0, "D50B0503154848B8");
    assert_eq!(answered(rig.ask(request)), "5D0B0503154848B8");
}

#[test]
fn what_is_for_another_motor_or_for_all_is_refused() {
    let (mut rig, _) = bench::d5();
    let epoch = arm(&mut rig);
    for data in ["D50C05032058028E", "D5FE050500000008", "D5FE050320580280"] {
        let since = rig.now_us;
        let request = native(&rig, epoch, data);
        assert_eq!(rig.ask(request), Err(Error::NotThisNode { axis: 0, node: 0x0B }), "{data}");
        assert!(!rig.sent_since(1, since).iter().any(|sent| sent.ends_with(data)));
    }
}

#[test]
fn a_limit_that_could_be_broken_unnoticed_bars_the_command() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::VelocityLimitRadS, Value::Float(20.0));
    bench::parameter(&mut rig, 0, AxisParameter::PositionMaxRad, Value::Float(7.0));
    let epoch = arm(&mut rig);
    let request = native(&rig, epoch, "A300000010270000"); // a position as fast as the motor can
    assert_eq!(
        rig.ask(request),
        Err(Error::CannotCheckLimit { axis: 0, quantity: Quantity::Velocity })
    );
    // Where a distance ends depends on where it begins.
    let request = native(&rig, epoch, "A800F40110270000");
    assert_eq!(
        rig.ask(request),
        Err(Error::CannotCheckLimit { axis: 0, quantity: Quantity::Position })
    );
    let request = native(&rig, epoch, "A400000010270000");
    assert_eq!(rig.ask(request), Err(Error::SpeedLimitZero { axis: 0 }));
}

#[test]
fn a_newer_setpoint_takes_the_place_of_a_native_motion() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.instead(|text| if text.contains("#A1") { Instead::Nothing } else { Instead::AsUsual });
    let epoch = arm(&mut rig);
    let current = native(&rig, epoch, "A100000064000000");
    let sequence = rig.send(&current);
    let velocity = bench::setpoint(&rig, epoch, 80_000, bench::VELOCITY);
    rig.ask(velocity).unwrap();
    assert_eq!(rig.answer(sequence), Some(Err(Error::Superseded { axis: 0 })));
}

#[test]
fn the_e_stop_bars_native_motion_and_relative_moves() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::e_stop(&mut rig);
    run_with_host(&mut rig, 100_000);
    let request = native(&rig, 1, "A200000010270000");
    assert_eq!(rig.ask(request), Err(Error::EStopped {}));
}

#[test]
fn one_host_asks_while_the_other_one_commands() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = bench::move_axis(&mut rig, Setpoint::Current { current_a: 1.0 });
    let other = |rig: &mut Rig, data| {
        let request = native(rig, epoch, data);
        rig.ask_as(1, &request)
    };
    assert_eq!(answered(other(&mut rig, "9A00000000000000")), "9A320001E5010000");
    assert_eq!(other(&mut rig, "A200000010270000"), Err(Error::NotInCommand { holder: 0 }));
    assert_eq!(other(&mut rig, "6400000000000000"), Err(Error::NotInCommand { holder: 0 }));
    assert_eq!(
        other(&mut rig, "8100000000000000").map(|reply| matches!(reply, Reply::Native(_))),
        Ok(true)
    );
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Stopping);
}

#[test]
fn a_setpoint_of_0_is_motion_with_the_epoch_of_an_armed_axis_and_else_a_stop() {
    let zero = "5443000000000000";
    let (mut rig, _) = bench::thruster();
    let epoch = bench::move_axis(&mut rig, Setpoint::Signal { fraction: 0.1 });
    let request = native(&rig, epoch, zero);
    assert_eq!(answered(rig.ask(request)), zero);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Active);
    let request = native(&rig, 0, zero);
    assert_eq!(answered(rig.ask(request)), "");
    run_with_host(&mut rig, 50_000);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Idle);
    let request = native(&rig, 0, zero);
    assert_eq!(answered(rig.ask(request)), zero);

    let (mut rig, _) = bench::d5();
    bench::move_axis(&mut rig, bench::D5_VELOCITY);
    let request = native(&rig, 0, "D50B050320000033");
    assert_eq!(answered(rig.ask(request)), "");
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Stopping);
}

#[test]
fn the_reply_to_a_superseded_move_does_not_answer_the_same_move_asked_for_again() {
    let mut rig = rmd_that_answers_0xa8();
    let epoch = arm(&mut rig);
    rig.run(3_000);
    let since = rig.now_us;
    let request = native(&rig, epoch, "A800F40110270000");
    let first = rig.send(&request);
    let velocity = bench::setpoint(&rig, epoch, 80_000, bench::VELOCITY);
    rig.ask(velocity).unwrap();
    let request = native(&rig, epoch, "A800F40110270000");
    let second = rig.send(&request);
    rig.run(370); // the first has been answered; the second is only handed over
    assert_eq!(rig.answer(first), Some(Err(Error::Superseded { axis: 0 })));
    assert_eq!(rig.answer(second), None);
    rig.run(2_000);
    assert_eq!(answered(rig.answer(second).unwrap()), "A8326400F4012D00");
    assert_eq!(count(&rig, 0, since, "141#A800F40110270000"), 2);
}

#[test]
fn a_newer_native_motion_takes_the_place_of_one_that_is_not_answered() {
    let (mut rig, _) = bench::thruster();
    rig.instead(|text| if text.ends_with("000A") { Instead::Nothing } else { Instead::AsUsual });
    let epoch = arm(&mut rig);
    let request = native(&rig, epoch, "544300000000000A");
    let first = rig.send(&request);
    rig.run(1_000);
    let request = native(&rig, epoch, "5443000000000000");
    assert_eq!(answered(rig.ask(request)), "5443000000000000");
    assert_eq!(rig.answer(first), Some(Err(Error::Superseded { axis: 0 })));
}

/// D5 manual, register 0x03: the reply to a change of the id comes from the new id.
#[test]
fn a_new_id_is_confirmed_from_the_new_id() {
    let (mut rig, _) = bench::d5();
    rig.instead(|text| match text {
        "00B#D50B05030305001B" => Instead::Says("005#5D05050303050015"),
        _ => Instead::AsUsual,
    });
    let request = native(&rig, 0, "D50B05030305001B");
    assert_eq!(answered(rig.ask(request)), "5D05050303050015");
}

#[test]
fn nothing_is_changed_while_the_e_stop_is_latched() {
    let (mut rig, _) = bench::rmd(StopAction::Brake);
    bench::e_stop(&mut rig);
    run_with_host(&mut rig, 2_000_000);
    let since = rig.now_us;
    let release_brake = native(&rig, 0, "7700000000000000");
    assert_eq!(rig.ask(release_brake), Err(Error::EStopped {}));
    assert_eq!(count(&rig, 0, since, "141#7700000000000000"), 0);
    let question = native(&rig, 0, "9A00000000000000");
    assert!(rig.ask(question).is_ok());
}

#[test]
fn a_thruster_without_encoder_takes_no_position_natively() {
    let (mut rig, _) = bench::thruster();
    let epoch = arm(&mut rig);
    for data in ["4C41001E000000C8", "4C52001E000000C8"] {
        let request = native(&rig, epoch, data);
        let unsupported = Error::Unsupported { axis: 0, protocol: Protocol::Thruster };
        assert_eq!(rig.ask(request), Err(unsupported), "{data}");
    }
}

#[test]
fn a_native_stop_is_carried_out_although_there_is_no_place_for_its_reply() {
    let mut rig = bench::rmd_axes(9);
    let epoch = bench::move_axis(&mut rig, VELOCITY);
    rig.instead(|text| if text.starts_with("141#") { Instead::AsUsual } else { Instead::Nothing });
    let reads = [1, 2, 3, 4, 5, 6, 7, 8]
        .map(|axis| rig.send(&Request::ReadState(requests::ReadState { axis })));
    let since = rig.now_us;
    let moving = native(&rig, epoch, "A200000020A10700");
    let moving = rig.send(&moving);
    let stopping = native(&rig, 0, "8100000000000000");
    let stopping = rig.send(&stopping);
    rig.run(1_000);
    assert!(rig.sent_since(0, since).contains(&bench::HOLD));
    assert!(!rig.sent_since(0, since).iter().any(|text| text.ends_with("A200000020A10700")));
    assert_eq!((rig.answer(moving), rig.answer(stopping)), (None, None));
    run_with_host(&mut rig, 1_000_000);
    assert!(reads.iter().all(|read| rig.answer(*read).is_some()));
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
    assert!(rig.events().iter().any(|event| matches!(event, HostEvent::RequestDropped { .. })));
}

/// What changes a motor waits like any change of the configuration; what stops it does not.
#[test]
fn while_something_is_stored_a_native_command_changes_nothing_and_stops() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let rows = rig.rows();
    rig.power_on_as(&BOARD_AGAIN, &rows);
    rig.handle(Event::EStopInput { open: false });
    bench::hello(&mut rig);
    run_with_host(&mut rig, 100_000);
    bench::output_off(&mut rig).unwrap();
    rig.send(&Request::SaveConfiguration(requests::SaveConfiguration {}));
    assert!(rig.gateway.take_save().is_some());
    let since = rig.now_us;
    // 0xB3 (RMD V3.6 §2.30): the motor's own timeout.
    let change = native(&rig, 0, "B3000000F4010000");
    assert_eq!(rig.ask(change.clone()), Err(Error::Saving {}));
    assert_eq!(rig.sent_since(0, since), [""; 0]);
    let stop = native(&rig, 0, "8000000000000000");
    rig.ask(stop).unwrap();
    assert_eq!(rig.sent_since(0, since), ["141#8000000000000000"]);
    rig.handle(Event::Saved { result: Ok(()) });
    rig.ask(change).unwrap();
}

/// The manual stops by word 0: what 0x8000, the other zero, does to a motor it does not say.
#[test]
fn the_other_zero_of_a_d5_is_a_motion() {
    const MINUS_ZERO: &str = "D50B0503200080B3";
    let (mut rig, _) = bench::d5();
    let request = native(&rig, 0, MINUS_ZERO);
    assert_eq!(rig.ask(request), Err(Error::NotArmed { axis: 0, state: AxisState::Idle }));
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = native(&rig, epoch, MINUS_ZERO);
    answered(rig.ask(request));
    assert_eq!(rig.sent_since(1, since).first(), Some(&"00B#D50B0503200080B3"));
}
