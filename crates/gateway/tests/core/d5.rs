//! What only a D5 motor does: acknowledgement levels, writes that wait, a timeout that is switched and read back.

use crate::bench::{self, D5_VELOCITY, listed, move_axis, outcomes, run_with_host, stop};
use crate::rig::Instead;
use host_protocol::{AxisState, Error, Event as HostEvent, MotorTimeout, Reply, Request, replies, requests};

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
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0 }]);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
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
