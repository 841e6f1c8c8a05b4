//! What only a D5 motor does: acknowledgement levels, writes that wait, a timeout that is switched and read back.

use crate::bench::{self, D5_VELOCITY, arm_axis, keep_moving, listed, move_axis, run_with_host, stop};
use crate::rig::{FRAME_US, Instead, MOTOR_US};
use host_protocol::{AxisState, Error, MotorTimeout, Reply, Request, replies, requests};

#[test]
fn a_motor_that_answers_reads_only_confirms_by_reading_back() {
    let mut rig = bench::d5_that_answers_reads_only();
    move_axis(&mut rig, D5_VELOCITY);
    rig.run(1_000);
    let since = rig.now_us;
    stop(&mut rig);
    run_with_host(&mut rig, 100_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Idle);
    let sent = rig.sent_since(1, since);
    assert_eq!(sent.get(..2), Some(&["00B#D50B050320000033", "00B#D50B050220000032"][..]));
}

#[test]
fn a_motor_that_answers_reads_only_and_falls_silent_becomes_unreachable() {
    let mut rig = bench::d5_that_answers_reads_only();
    move_axis(&mut rig, D5_VELOCITY);
    rig.run(1_000);
    rig.instead(|_| Instead::Nothing);
    stop(&mut rig);
    bench::assert_becomes_unreachable(&mut rig);
}

#[test]
fn a_motor_that_keeps_another_speed_than_it_was_given_is_not_armed() {
    let mut rig = bench::d5_that_answers_reads_only();
    rig.instead(|text| match text {
        "00B#D50B050220000032" => Instead::Says("00B#5D0B05022058028C"), // 600 °/s
        "00B#D50B04022C00003D" => Instead::Says("00B#5D0B04022C01003E"), // an asynchronous write waits
        _ => Instead::AsUsual,
    });
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 0 })), Err(Error::CannotConfirm { axis: 0 }));
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

/// The id of a D5's reply is that of the request: sent together they would win the arbitration together and destroy each other for
/// ever.
#[test]
fn a_stop_waits_for_the_reply_that_has_its_id_and_no_longer_than_a_millisecond() {
    for answers in [true, false] {
        let (mut rig, _) = bench::d5();
        let epoch = arm_axis(&mut rig, 0);
        keep_moving(&mut rig, &[(0, epoch)], D5_VELOCITY, 30_000);
        if !answers {
            rig.instead(|_| Instead::Nothing);
        }
        // The moment at which a request to the motor has just left.
        let sent = rig.sent_since(1, 0).len();
        while rig.sent_since(1, 0).len() == sent {
            rig.run(10);
        }
        let (at, ..) = *rig.wire.last().unwrap();
        rig.run(at + FRAME_US + 10 - rig.now_us);
        let asked_at = rig.now_us;
        rig.send(&Request::EStop(requests::EStop {}));
        assert_eq!(rig.sent_since(1, asked_at), [""; 0], "answers: {answers}");
        rig.run(5_000);
        let stop = rig.wire.iter().find(|(when, ..)| *when >= asked_at).unwrap();
        assert_eq!(stop.2, "00B#D50B050320000033");
        let left_at = at + FRAME_US;
        let expected = if answers { left_at + MOTOR_US + FRAME_US } else { left_at + 1_000 };
        assert_eq!(stop.0, expected, "answers: {answers}");
    }
}
