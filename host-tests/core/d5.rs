//! What only a D5 motor does: acknowledgement levels, writes that wait, a timeout that is switched
//! and read back.

use crate::bench::{self, D5_VELOCITY, arm_axis, configure_axis, keep_moving, move_axis, stop};
use crate::rig::{FRAME_US, Instead, MOTOR_US, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, Event, MotorTimeout, NoReplyHint, Protocol, Reply, Request,
    Setpoint, StopAction, replies, requests,
};

#[test]
fn a_motor_that_answers_reads_only_and_falls_silent_becomes_unreachable() {
    let mut rig = bench::d5_that_answers_reads_only();
    move_axis(&mut rig, D5_VELOCITY);
    rig.run(1_000);
    rig.instead(|_| Instead::Nothing);
    stop(&mut rig);
    bench::assert_becomes_unreachable(&mut rig);
}

/// The commanded speed is read back and is not 0, as often as it is asked for.
fn stopped_and_keeps_its_speed() -> (Rig, u64) {
    let mut rig = bench::d5_that_answers_reads_only();
    move_axis(&mut rig, D5_VELOCITY);
    rig.run(1_000);
    rig.instead(|text| match text {
        READ_BACK => Instead::Says(KEPT),
        _ => Instead::AsUsual,
    });
    let since = rig.now_us;
    stop(&mut rig);
    (rig, since)
}

const READ_BACK: &str = "00B#D50B050220000032";
const KEPT: &str = "00B#5D0B05022058028C"; // 600 °/s

/// Each reading shows that the motor has not taken its stop, which counts like a refusal
/// (GUARANTEES G4).
#[test]
fn a_motor_that_answers_reads_only_and_keeps_its_speed_is_unreachable_after_ten_stops() {
    let (mut rig, since) = stopped_and_keeps_its_speed();
    bench::run_with_host(&mut rig, 400_000);
    let unreachable = Event::AxisUnreachable { axis: 0, stop_transmitted: true };
    assert_eq!(bench::outcomes(&rig), [unreachable]);
    let sent = rig.sent_since(1, since);
    let count = |text: &str| sent.iter().filter(|sent| **sent == text).count();
    assert_eq!((count(STOP_B), count(READ_BACK)), (10, 10), "{sent:?}");
    // The speed that it has is known meanwhile.
    assert_eq!((count("00B#D50B050226000038"), count("00B#D50B040212000023")), (8, 8), "{sent:?}");
}

#[test]
fn a_motor_that_answers_reads_only_and_has_missed_its_stop_is_sent_the_next_at_once() {
    let (mut rig, since) = stopped_and_keeps_its_speed();
    rig.run(5_000);
    let sent = rig.sent_since(1, since);
    assert_eq!(sent.get(..3), Some(&[STOP_B, READ_BACK, STOP_B][..]), "{sent:?}");
}

/// It turns on for a moment: what it is sent then is taken.
#[test]
fn a_motor_that_answers_reads_only_and_takes_a_later_stop_is_confirmed() {
    for (taken_after_us, unreachable) in [(100_000, false), (1_000_000, true)] {
        let (mut rig, _) = stopped_and_keeps_its_speed();
        bench::run_with_host(&mut rig, taken_after_us);
        rig.instead(|text| match text {
            READ_BACK => Instead::Says("00B#5D0B050220000032"),
            _ => Instead::AsUsual,
        });
        bench::run_with_host(&mut rig, 1_000_000);
        let outcomes = bench::outcomes(&rig);
        assert_eq!(outcomes.len(), 1 + usize::from(unreachable), "{outcomes:?}");
        assert!(matches!(outcomes.last(), Some(Event::StopConfirmed { .. })), "{outcomes:?}");
    }
}

#[test]
fn a_motor_that_keeps_another_speed_than_it_was_given_is_not_armed() {
    let mut rig = bench::d5_that_answers_reads_only();
    rig.instead(|text| match text {
        "00B#D50B050220000032" => Instead::Says("00B#5D0B05022058028C"), // 600 °/s
        "00B#D50B04022C00003D" => Instead::Says("00B#5D0B04022C01003E"), /* an asynchronous */
        // write waits
        _ => Instead::AsUsual,
    });
    assert_eq!(
        rig.ask(Request::Arm(requests::Arm { axis: 0 })),
        Err(Error::CannotConfirm { axis: 0 })
    );
    assert!(rig.sent_since(1, 0).contains(&"00B#D50B050420000034")); // what waits is overwritten
}

#[test]
fn a_timeout_counts_as_switched_on_only_if_it_reads_back_on() {
    let (mut rig, _) = bench::d5();
    let provision =
        Request::ProvisionMotorTimeout(requests::ProvisionMotorTimeout { axis: 0, timeout_ms: 1 });
    let verified = replies::MotorTimeoutReport { timeout: MotorTimeout::Verified };
    assert_eq!(rig.ask(provision.clone()), Ok(Reply::ProvisionMotorTimeout(verified)));
    rig.instead(|text| match text {
        "00B#D50B040211000022" => Instead::Says("00B#5D0B040211000022"),
        _ => Instead::AsUsual,
    });
    assert_eq!(rig.ask(provision), Err(Error::Refused { axis: 0, faults: None }));
}

/// The id of a D5's reply is that of the request: sent together they would win the arbitration
/// together and destroy each other for ever.
#[test]
fn a_stop_waits_for_the_reply_that_has_its_id_and_no_longer_than_a_millisecond() {
    for answers in [true, false] {
        let (mut rig, _) = bench::d5();
        let epoch = arm_axis(&mut rig, 0);
        keep_moving(&mut rig, &[(0, epoch)], D5_VELOCITY, 30_000);
        if !answers {
            rig.instead(|_| Instead::Nothing);
        }
        let left_at = just_asked(&mut rig, "00B#");
        let asked_at = rig.now_us;
        rig.send(&Request::EStop(requests::EStop {}));
        assert_eq!(rig.sent_since(1, asked_at), [""; 0], "answers: {answers}");
        rig.run(5_000);
        let stop = rig.wire.iter().find(|(when, ..)| *when >= asked_at).unwrap();
        assert_eq!(stop.2, "00B#D50B050320000033");
        let expected = if answers { left_at + MOTOR_US + FRAME_US } else { left_at + 1_000 };
        assert_eq!(stop.0, expected, "answers: {answers}");
    }
}

/// The moment at which a request to a motor has just left.
fn just_asked(rig: &mut Rig, motor: &str) -> u64 {
    let sent = rig.wire.len();
    let asked = |rig: &Rig| {
        rig.wire[sent..].iter().find(|(.., text)| text.starts_with(motor)).map(|(at, ..)| *at)
    };
    let left_at = loop {
        rig.run(10);
        if let Some(at) = asked(rig) {
            break at + FRAME_US;
        }
    };
    rig.run(left_at + 10 - rig.now_us);
    left_at
}

/// Motors 0x0B and 1 turn; of those named from now on no reply comes through. With the epoch of
/// axis 1.
fn two_that_turn(held_up: &'static [&'static str]) -> (Rig, u32) {
    let (mut rig, _) = bench::d5();
    configure_axis(&mut rig, 1, 1, Protocol::D5, 1, StopAction::Hold);
    let epochs = [0, 1].map(|axis| (axis, arm_axis(&mut rig, axis)));
    keep_moving(&mut rig, &epochs, D5_VELOCITY, 30_000);
    rig.instead(move |text| match held_up.iter().any(|motor| text.starts_with(motor)) {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    let (_, epoch) = epochs[1];
    (rig, epoch)
}

/// Somebody else keeps the bus from being quiet.
fn run_busy(rig: &mut Rig, us: u64) {
    const PERIOD_US: u64 = 500;
    for _ in 0..us / PERIOD_US {
        rig.receive(1, "000#");
        rig.run(PERIOD_US);
    }
}

const STOP_B: &str = "00B#D50B050320000033";
const STOP_1: &str = "001#D501050320000029";

/// The second stop of a lower id would outrank the reply that the first stop of the other motor
/// waits for.
#[test]
fn no_second_stop_goes_before_the_first_stop_of_who_waits_for_its_reply() {
    let (mut rig, _) = two_that_turn(&["00B#"]);
    just_asked(&mut rig, "00B#");
    let since = rig.now_us;
    rig.send(&Request::EStop(requests::EStop {}));
    rig.run(5_000);
    assert_eq!(rig.sent_since(1, since).get(..3), Some(&[STOP_1, STOP_B, STOP_1][..]));
}

/// In the second buffer it would wait for the end of the other frame, perhaps beside the reply.
#[test]
fn a_stop_that_has_not_heard_its_reply_goes_out_alone() {
    let (mut rig, _) = two_that_turn(&["00B#", "001#"]);
    just_asked(&mut rig, "00B#");
    let left_at = just_asked(&mut rig, "001#");
    let since = rig.now_us;
    rig.send(&Request::EStop(requests::EStop {}));
    rig.run(5_000);
    let stops: Vec<_> =
        rig.wire.iter().filter(|(at, ..)| *at >= since).map(|(at, ..)| *at).collect();
    // 1 ms and a frame of 135 bits, which may be the other motor's reply; then neither is coming.
    let first_at = left_at + 1_642;
    assert_eq!(stops.get(..2), Some(&[first_at, first_at + FRAME_US][..]));
    assert_eq!(rig.sent_since(1, since).get(..2), Some(&[STOP_1, STOP_B][..]));
}

/// Once the reply is overdue whatever goes out may hold it up; a motor that is dead holds nobody up
/// for longer than the frames of both axes can take (six of 135 bits), and 1 ms.
#[test]
fn while_a_reply_is_held_up_no_setpoint_goes_out() {
    let (mut rig, epoch) = two_that_turn(&["00B#"]);
    let left_at = just_asked(&mut rig, "00B#");
    run_busy(&mut rig, 1_000);
    let since = rig.now_us;
    turn_slower(&mut rig, epoch);
    run_busy(&mut rig, 3_000);
    assert_eq!(rig.sent_since(1, since), [""; 0]);
    run_busy(&mut rig, 2_000);
    let (at, _, text) = rig.wire.iter().find(|(at, ..)| *at > since).unwrap();
    assert_eq!((text.as_str(), at - left_at), ("001#D50105032073009C", 4_848));
}

#[test]
fn while_a_reply_is_held_up_the_first_stop_of_another_motor_goes_out() {
    let (mut rig, _) = two_that_turn(&["00B#"]);
    just_asked(&mut rig, "00B#");
    run_busy(&mut rig, 2_000);
    let since = rig.now_us;
    rig.send(&Request::EStop(requests::EStop {}));
    assert_eq!(rig.sent_since(1, since), [STOP_1]);
}

/// The bus was quiet when the reply window was over: what would have waited has passed.
#[test]
fn a_motor_that_does_not_answer_holds_nobody_up_behind_its_reply_window() {
    let (mut rig, epoch) = two_that_turn(&["00B#"]);
    for axis in [2, 3] {
        configure_axis(&mut rig, axis, 1, Protocol::D5, axis, StopAction::Hold);
    }
    just_asked(&mut rig, "00B#");
    rig.run(5_000);
    turn_slower(&mut rig, epoch);
    rig.run(FRAME_US + MOTOR_US + FRAME_US);
    let since = rig.now_us;
    keep_moving(&mut rig, &[(1, epoch)], D5_VELOCITY, 10);
    assert_eq!(rig.sent_since(1, since), ["001#D501050320580283"]);
}

/// Axis 1 gets another speed: 115 °/s.
fn turn_slower(rig: &mut Rig, epoch: u32) {
    keep_moving(rig, &[(1, epoch)], Setpoint::Velocity { velocity_rad_s: 2.007 }, 10);
}

/// The late reply is to the request before: that to the stop is still to come.
#[test]
fn a_late_reply_does_not_free_the_id_of_the_stop_that_is_under_way() {
    let (mut rig, _) = two_that_turn(&["00B#"]);
    for axis in [2, 3] {
        configure_axis(&mut rig, axis, 1, Protocol::D5, axis, StopAction::Hold);
    }
    just_asked(&mut rig, "00B#");
    rig.send(&Request::Stop(requests::Stop { target: host_protocol::StopTarget::Axis(0) }));
    rig.run(1_500);
    let (stop_at, _, text) = rig.wire.last().unwrap().clone();
    assert_eq!(text, STOP_B);
    rig.receive(1, "00B#5D0B05032058028D"); // 600 °/s
    run_busy(&mut rig, 20_000);
    let next = rig.wire.iter().find(|(at, _, text)| *at > stop_at && text.starts_with("00B#D5"));
    let again = next.unwrap();
    // Four axes, three frames each, and 1 ms; not when its window of 5 ms closes.
    assert!((8_500..9_500).contains(&(again.0 - stop_at)), "{} after {stop_at}", again.0);
}

/// It had to wait behind others for longer than its request is remembered.
#[test]
fn a_reply_that_comes_after_all_windows_frees_its_id() {
    let (mut rig, _) = two_that_turn(&["00B#"]);
    for axis in [2, 3] {
        configure_axis(&mut rig, axis, 1, Protocol::D5, axis, StopAction::Hold);
    }
    just_asked(&mut rig, "00B#");
    rig.send(&Request::Stop(requests::Stop { target: host_protocol::StopTarget::Axis(0) }));
    run_busy(&mut rig, 7_000);
    let since = rig.now_us;
    rig.receive(1, "00B#5D0B05032058028D"); // 600 °/s
    assert_eq!(rig.sent_since(1, since), [STOP_B]);
}

/// The first stop of a motor goes out, whose reply is still due.
fn stopped_without_a_reply() -> Rig {
    let (mut rig, _) = bench::d5();
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], D5_VELOCITY, 30_000);
    rig.instead(|_| Instead::Nothing);
    let left_at = just_asked(&mut rig, "00B#");
    stop(&mut rig);
    rig.run(left_at + 1_000 - rig.now_us);
    assert_eq!(
        rig.wire.last().map(|(at, _, text)| (*at, text.as_str())),
        Some((left_at + 1_000, STOP_B))
    );
    rig
}

/// A motor slower than 1 ms has begun its reply in the same bit as its stop.
#[test]
fn a_stop_that_has_met_its_reply_is_taken_back_and_follows_it() {
    let mut rig = stopped_without_a_reply();
    // While they destroy each other nothing leaves.
    rig.cut();
    rig.run(1_920);
    assert_eq!(rig.held_texts(), [STOP_B]);
    rig.run(10); // three times 642 µs
    assert_eq!(rig.held_texts(), [""; 0]);
    rig.mend();
    rig.run(FRAME_US);
    let since = rig.now_us;
    rig.receive(1, "00B#5D0B05032058028D"); // 600 °/s
    assert_eq!(rig.sent_since(1, since), [STOP_B]);
}

/// A stop that meets its reply is destroyed together with it, and no frame passes. This one loses
/// the arbitration.
#[test]
fn a_stop_that_waits_behind_the_frames_of_others_has_met_no_reply() {
    let mut rig = stopped_without_a_reply();
    rig.cut();
    let since = rig.now_us + 1;
    run_busy(&mut rig, 10_000);
    assert_eq!((rig.held_texts(), rig.sent_since(1, since)), (vec![STOP_B], vec![]));
    rig.run(1_420);
    assert_eq!(rig.held_texts(), [STOP_B]);
    rig.run(10); // three times 642 µs since the last of them
    assert_eq!(rig.held_texts(), [""; 0]);
}

/// The reply of each motor that stops may go before the stop with the highest id, which somebody
/// keeps out here.
#[test]
fn no_second_stop_goes_before_a_first_one_that_may_wait_for_the_replies_of_all() {
    let (mut rig, _) = bench::d5();
    configure_axis(&mut rig, 1, 1, Protocol::D5, 1, StopAction::Hold);
    configure_axis(&mut rig, 2, 1, Protocol::D5, 0x0D, StopAction::Hold);
    rig.run(10_000);
    rig.babble(Some(0x00C));
    let since = rig.now_us;
    rig.send(&Request::EStop(requests::EStop {}));
    rig.run(10_000);
    let sent: Vec<_> = rig.wire.iter().filter(|(at, ..)| *at >= since).collect();
    let texts: Vec<_> = sent.iter().map(|(.., text)| text.as_str()).collect();
    assert_eq!(texts.get(..4), Some(&[STOP_1, STOP_B, "00D#D50D050320000035", STOP_1][..]));
    // Four frames of 135 bits, and the replies of three motors.
    let left = rig.left.iter().find(|(at, _, text)| *at >= since && text == STOP_B).unwrap();
    assert_eq!(sent[3].0 - left.0, 4_494);
}

/// The bus is cut: there is no reply that it could meet.
#[test]
fn a_stop_is_taken_back_for_a_reply_once_and_then_stays_in_the_controller() {
    let mut rig = stopped_without_a_reply();
    rig.cut();
    rig.run(1_930 + 1_010);
    for _ in 0..15 {
        assert_eq!(rig.held_texts(), [STOP_B]);
        rig.run(1_000);
    }
}

/// D5 manual, quick start (2), register 0x10: level 1 answers reads only, and the manual does not
/// say which level answers its own change.
#[test]
fn a_change_of_the_ack_level_is_read_back_whether_it_is_answered_or_not() {
    const TO_READS: &str = "D50B040310010023";
    for answer in ["", "00B#5D0B040310010023"] {
        for level in ["00B#5D0B040210010022", "00B#5D0B040210020023"] {
            let (mut rig, _) = bench::d5();
            rig.instead(move |text| match text {
                "00B#D50B040310010023" if answer.is_empty() => Instead::Nothing,
                "00B#D50B040310010023" => Instead::Says(answer),
                "00B#D50B040210000021" => Instead::Says(level),
                _ => Instead::AsUsual,
            });
            let request = bench::native(&rig, 0, TO_READS);
            let told = rig.ask(request);
            match level {
                "00B#5D0B040210010022" => assert_eq!(bench::answered(told), "5D0B040210010022"),
                _ => assert_eq!(told, Err(Error::Refused { axis: 0, faults: None })),
            }
            let sent = ["00B#D50B040310010023", "00B#D50B040210000021"];
            assert_eq!(rig.sent_since(1, 0), sent);
        }
    }
}

/// At level 0 a motor answers nothing, not even a reading of that level.
#[test]
fn the_change_to_level_0_is_sent_and_not_read_back() {
    let (mut rig, _) = bench::d5();
    rig.instead(|_| Instead::Nothing);
    let request = bench::native(&rig, 0, "D50B040310000022");
    assert_eq!(bench::answered(rig.ask(request)), "");
    assert_eq!(rig.sent_since(1, 0), ["00B#D50B040310000022"]);
}

/// Another write that is not answered has a cause beside the cable.
#[test]
fn a_write_that_is_not_answered_points_to_the_ack_level() {
    let (mut rig, _) = bench::d5();
    rig.instead(|_| Instead::Nothing);
    let request = bench::native(&rig, 0, "D50B04031548006F");
    assert_eq!(rig.ask(request), Err(Error::NoReply { axis: 0, hint: NoReplyHint::AckLevelBelow }));
}

/// D5 manual, table row 5: a motor objects to a request for another. Its frame has the id of the
/// next one to it, which waits.
#[test]
fn the_frame_to_a_motor_that_objects_waits_for_its_objection() {
    let (mut rig, _) = bench::d5();
    configure_axis(&mut rig, 1, 1, Protocol::D5, 1, StopAction::Hold);
    rig.receive(1, "001#5D01050201EEEEE5"); // to a read, of somebody else
    rig.run(2_000);
    let since = rig.now_us;
    rig.send(&Request::ReadState(requests::ReadState { axis: 0 }));
    rig.run(FRAME_US + 10);
    rig.send(&Request::EStop(requests::EStop {}));
    rig.run(400);
    assert!(!rig.sent_since(1, since).iter().any(|sent| sent.starts_with("001#")));
    // To the read and to the stop of motor 0x0B.
    rig.receive(1, "001#5D01050201EEEEE5");
    rig.receive(1, "001#5D01050301EEEEE6");
    rig.run(10);
    assert!(rig.sent_since(1, since).contains(&STOP_1));
}

/// What objects counts in the load of the bus: a request to one of three motors takes four frames
/// of 135 bits, not two.
#[test]
fn objections_count_in_the_load_of_the_bus() {
    let needed = |objections: bool| {
        let (mut rig, _) = bench::d5();
        configure_axis(&mut rig, 1, 1, Protocol::D5, 1, StopAction::Hold);
        configure_axis(&mut rig, 2, 1, Protocol::D5, 2, StopAction::Hold);
        if objections {
            for reply in ["00B#5D0B050201EEEEEF", "001#5D01050201EEEEE5", "002#5D02050201EEEEE6"] {
                rig.receive(1, reply);
            }
        }
        let number = AxisParameter::RefreshUs.number();
        let value = host_protocol::Value::Unsigned(1_000);
        let request = requests::ConfigureAxis { axis: 0, parameter: number, value };
        match rig.ask(Request::ConfigureAxis(request)) {
            Err(Error::BusOverloaded { bus: 1, needed_permille, .. }) => needed_permille,
            other => panic!("{other:?}"),
        }
    };
    // 1 283 µs for two frames; 2 567 µs for four, and 1 ms and a frame in which nothing is to come.
    // In 1 ms for the refresh of one axis, in 20 ms for that of the others, in 90 ms for
    // the polls of all, and in 50 ms for two of each.
    let of = |us: u64| {
        let share = |period_us: u64| (us * 1_000).div_ceil(period_us);
        u32::try_from(share(1_000) + 2 * share(20_000) + 3 * (share(90_000) + share(25_000)))
            .unwrap()
    };
    assert_eq!((needed(false), needed(true)), (of(1_283), of(1_283 + 3 * 642 + 1_000)));
}

/// A frame that noise has changed on its way (D5 manual, table row 3) is sent again; a motor that
/// hears nothing else is not obeyed.
#[test]
fn a_motor_that_has_heard_a_wrong_checksum_is_asked_again() {
    for (wrong, state) in
        [(1, AxisState::Active), (u32::MAX, AxisState::Tripped { confirmed: true })]
    {
        let (mut rig, _) = bench::d5();
        let epoch = move_axis(&mut rig, D5_VELOCITY);
        rig.run(1_000);
        let mut left = wrong;
        rig.instead(move |text| match text.get(10..18) {
            Some("03205802") if left > 0 => {
                left -= 1;
                Instead::Says("00B#5D0B050307EEEEF6")
            }
            _ => Instead::AsUsual,
        });
        let since = rig.now_us;
        keep_moving(&mut rig, &[(0, epoch)], D5_VELOCITY, 300_000);
        assert_eq!(bench::listed(&mut rig, 0), state, "{wrong} times");
        let sent = rig.sent_since(1, since);
        assert!(sent.iter().filter(|text| text.contains("D50B050320")).count() >= 2, "{sent:?}");
    }
}
