//! A host without authority looks on: what it asks and watches keeps nobody from acting, and no
//! axis from being looked after.

use crate::bench::{self, VELOCITY, arm, native, run_with_host, setpoint};
use crate::rig::Rig;
use gateway::Event;
use host_protocol::{
    AxisParameter, AxisState, Error, MAX_FRAME, Protocol, Request, Setpoint, StateField,
    StateFields, StopAction, TripReason, Value, requests,
};

/// The other host sends a request and reads all that it is told.
fn look_on(rig: &mut Rig, sequence: u16, request: &Request) {
    let mut out = [0; MAX_FRAME];
    let length = request.encode_frame(sequence, &mut out).unwrap();
    rig.handle(Event::HostBytes { link: 1, bytes: &out[..length] });
    while rig.gateway.poll_host(1, &mut out, &mut |_, _| {}).is_some() {}
}

#[test]
fn questions_and_changing_setpoints_together_starve_no_poll() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let since = rig.now_us;
    let question = native(&rig, 0, "9C00000000000000");
    let mut velocity_rad_s = 1.0;
    let mut go_on = |rig: &mut Rig, rounds: u16| {
        for round in 0..rounds {
            velocity_rad_s += 0.0001;
            let request = setpoint(rig, epoch, 80_000, Setpoint::Velocity { velocity_rad_s });
            rig.send(&request);
            look_on(rig, 100 + round, &question);
            rig.run(200);
        }
    };
    go_on(&mut rig, 5_000);
    let count =
        |command: &str| rig.sent_since(0, since).iter().filter(|t| t.starts_with(command)).count();
    assert!(count("141#9A") >= 9, "{} fault polls in 1 s", count("141#9A"));
    assert!(count("141#92") >= 6, "{} position polls in 1 s", count("141#92"));
    play.borrow_mut().fault = true;
    go_on(&mut rig, 600);
    assert_eq!(
        bench::state(&mut rig).trip.map(|trip| trip.reason),
        Some(TripReason::MotorFault { faults: 0x0002 })
    );
}

#[test]
fn a_question_under_way_makes_nobody_s_motion_busy() {
    let (mut rig, _) = bench::thruster();
    let epoch = arm(&mut rig);
    let question = native(&rig, 0, "51560000");
    for round in 0..200 {
        look_on(&mut rig, 100 + round, &question);
        rig.run(100);
        let zero = native(&rig, epoch, "5443000000000000");
        let sequence = rig.send(&zero);
        assert_ne!(rig.answer(sequence), Some(Err(Error::Busy { axis: 0 })));
        rig.run(400);
    }
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Active);
}

#[test]
fn watching_motors_that_do_not_answer_keeps_no_refresh_waiting() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::TtlUs, Value::Unsigned(500_000));
    bench::parameter(&mut rig, 0, AxisParameter::StatePollUs, Value::Unsigned(200_000));
    bench::configure_bus(&mut rig, 2, 2_000_000, &[Protocol::Rmd]);
    for axis in 1..16 {
        bench::configure_axis(&mut rig, axis, 2, Protocol::Rmd, axis + 1, StopAction::Hold);
    }
    let epoch = arm(&mut rig);
    let fields = StateFields::of(&[StateField::Position]);
    let watch = Request::Subscribe(requests::Subscribe { axes: 0xFFFF, fields, period_us: 50_000 });
    rig.ask_as(1, &watch).unwrap();
    let since = rig.now_us;
    for _ in 0..10 {
        let request = setpoint(&rig, epoch, 400_000, VELOCITY);
        rig.ask(request).unwrap();
        run_with_host(&mut rig, 100_000);
    }
    let longest_us = rig.longest_gap_us(2, since, "3E0108A2");
    assert!(longest_us <= 25_000, "{longest_us} µs between two frames of motion");
    assert!(
        rig.sent_since(2, since).iter().any(|text| text.starts_with("3E020892")),
        "nobody is watched"
    );
}
