//! Setpoints become the manuals' bytes, and the motors' answers SI units.

use crate::bench::{self, VELOCITY, arm, disarm, run_with_host, setpoint};
use host_protocol::{
    AxisParameter, AxisState, Reply, Request, Setpoint, StopAction, Value, requests,
};

#[test]
fn rmd_state_is_read_over_rs485_and_comes_back_in_si_units() {
    let (mut rig, play) = bench::rmd_serial(StopAction::Hold);
    play.borrow_mut().turning = true;
    let since = rig.now_us;
    let Ok(Reply::ReadState(state)) = rig.ask(Request::ReadState(requests::ReadState { axis: 0 }))
    else {
        panic!("no state");
    };
    // PROTOCOL-NOTES R1
    assert_eq!(rig.sent_since(2, since).first(), Some(&"3E01089C00000000000000F230"));
    assert_eq!(state.velocity_rad_s.unwrap().value, 8.726_646); // 500 °/s
    assert_eq!(state.current_a.unwrap().value, 1.0);
    // 36000 hundredths of a degree
    assert_eq!(state.position_rad.unwrap().value, core::f32::consts::TAU);
    assert_eq!(state.voltage_v.unwrap().value, 48.5);
    assert_eq!(state.motor_temperature_c.unwrap().value, 50.0);
    assert_eq!(state.faults.unwrap().word, 0);
}

#[test]
fn where_the_motors_timeout_is_unknown_motion_is_refreshed_every_20_ms_whatever_is_configured() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::RefreshUs, Value::Unsigned(1_000_000));
    bench::parameter(&mut rig, 0, AxisParameter::TtlUs, Value::Unsigned(10_000_000));
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let request = setpoint(&rig, epoch, 5_000_000, VELOCITY);
    rig.ask(request).unwrap();
    run_with_host(&mut rig, 200_000);
    let sent =
        rig.sent_since(0, since).iter().filter(|text| **text == "141#A200000010270000").count();
    assert!((10..=11).contains(&sent), "{sent} motion frames in 200 ms");
}

#[test]
fn arming_sends_each_protocols_sequence_and_no_motion() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let since = rig.now_us;
    arm(&mut rig);
    let stop = "141#8100000000000000";
    let [run_time, gain, model, ramp, velocity, position, faults] = [
        "141#B100000000000000",
        "141#3001000000000000",
        "141#B501010000000000",
        "141#4203000000000000",
        "141#9C00000000000000",
        "141#9200000000000000",
        "141#9A00000000000000",
    ];
    let sent =
        [stop, stop, run_time, gain, model, ramp, gain, model, ramp, velocity, position, faults];
    assert_eq!(rig.sent_since(0, since), sent);

    let (mut rig, _) = bench::thruster();
    let since = rig.now_us;
    arm(&mut rig);
    let stop = "30B#5443000000000000";
    let sent = ["30B#45460000", "30B#46520000", stop, "30B#45460000", "30B#51560000"];
    // Nothing was sent to it before: its stop comes first (`first_stop`).
    assert_eq!(rig.sent_since(0, since), [&[stop][..], &sent].concat());
    rig.run(1_000);
    disarm(&mut rig);
    rig.run(10_000);
    let since = rig.now_us;
    arm(&mut rig);
    assert_eq!(rig.sent_since(0, since), sent);

    let (mut rig, _) = bench::d5();
    let since = rig.now_us;
    arm(&mut rig);
    let sent = [
        "00B#D50B04021000002 1".replace(' ', ""), // 0B+04+02+10 = 21
        "00B#D50B040211000022".into(),
        "00B#D50B040212000023".into(),
        "00B#D50B04022B00003C".into(),
        "00B#D50B04022C00003D".into(),
        "00B#D50B050320000033".into(), // D5 manual, quick start 5
        "00B#D50B050220000032".into(),
        "00B#D50B050226000038".into(),
    ];
    assert_eq!(rig.sent_since(1, since), sent);
}

#[test]
fn state_and_fault_polls_go_on_while_setpoints_come_fast() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    for _ in 0..300 {
        let request = setpoint(&rig, epoch, 80_000, Setpoint::Current { current_a: 1.0 });
        rig.ask(request).unwrap();
        rig.run(1_000);
    }
    let sent = rig.sent_since(0, since);
    let count = |wanted: &str| sent.iter().filter(|text| **text == wanted).count();
    assert!(count("141#9A00000000000000") >= 2, "{sent:?}");
    assert!(count("141#9200000000000000") >= 2, "{sent:?}");
    assert!(count("141#A100000064000000") >= 250);
}

#[test]
fn a_reversed_axis_is_reversed_both_ways() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::Direction, Value::Signed(-1));
    let epoch = arm(&mut rig);
    play.borrow_mut().turning = true;
    let since = rig.now_us;
    let request =
        setpoint(&rig, epoch, 80_000, Setpoint::Velocity { velocity_rad_s: -1.745_329_3 });
    rig.ask(request).unwrap();
    assert_eq!(rig.sent_since(0, since).first(), Some(&"141#A200000010270000"));
    let Ok(Reply::ReadState(state)) = rig.ask(Request::ReadState(requests::ReadState { axis: 0 }))
    else {
        panic!("no state");
    };
    assert_eq!(state.velocity_rad_s.unwrap().value, -8.726_646);
    assert_eq!(state.state, AxisState::Active);
}
