//! A bus that carries nothing: cut cables, which acknowledge no frame, and short circuits, which
//! put a controller off its bus.

use crate::bench::{
    self, HOLD, VELOCITY, arm, arm_axis, assert_tripped, keep_moving, listed, move_axis, outcomes,
    run_with_host, setpoint, state, stop,
};
use crate::rig::Rig;
use host_protocol::{
    AxisState, BusState, Error, Event as HostEvent, NoReplyHint, Reply, Request, StopAction,
    TripReason, replies, requests,
};

fn trips(rig: &Rig) -> Vec<(u8, TripReason)> {
    let trip_of = |event: &HostEvent| match event {
        HostEvent::Tripped { axis, trip } => Some((*axis, trip.reason)),
        _ => None,
    };
    rig.events().into_iter().filter_map(trip_of).collect()
}

fn generation(rig: &Rig) -> u32 {
    rig.gateway.bus_setup(0).unwrap().generation
}

#[test]
fn a_cable_cut_under_a_poll_trips_too() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 30_000);
    let request = setpoint(&rig, epoch, 80_000, VELOCITY);
    rig.ask(request).unwrap();
    while rig.wire.last().is_none_or(|(at, _, text)| *at < rig.now_us || text.starts_with("141#A2"))
    {
        rig.run(10);
    }
    rig.cut();
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 50_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
    assert_eq!(trips(&rig), [(0, TripReason::NotAcknowledged)]);
}

#[test]
fn a_cut_cable_trips_every_armed_axis_behind_it() {
    let mut rig = bench::rmd_axes(3);
    let moving = [(0, arm_axis(&mut rig, 0)), (1, arm_axis(&mut rig, 1))];
    arm_axis(&mut rig, 2);
    keep_moving(&mut rig, &moving, VELOCITY, 30_000);
    rig.cut();
    keep_moving(&mut rig, &moving, VELOCITY, 50_000);
    let mut tripped = trips(&rig);
    tripped.sort_by_key(|(axis, _)| *axis);
    assert_eq!(tripped, [0, 1, 2].map(|axis| (axis, TripReason::NotAcknowledged)));
}

#[test]
fn a_motor_behind_a_cut_cable_becomes_unreachable() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.cut();
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: false }]);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}

#[test]
fn a_motor_that_does_not_answer_is_sent_its_stop_every_500_ms_however_long_its_own_timeout() {
    let silence_ms = |timeout_ms: Option<u32>| {
        let (mut rig, play) = bench::rmd(StopAction::Hold);
        if let Some(timeout_ms) = timeout_ms {
            bench::provision(&mut rig, timeout_ms).unwrap();
        }
        move_axis(&mut rig, VELOCITY);
        play.borrow_mut().mute = true;
        bench::assert_becomes_unreachable(&mut rig);
        let since = rig.now_us;
        run_with_host(&mut rig, 3_000_000);
        let sent: Vec<_> = rig.wire.iter().filter(|(at, ..)| *at >= since).collect();
        assert!(sent.iter().all(|(.., text)| text == HOLD), "{sent:?}");
        let mut gaps: Vec<_> =
            sent.windows(2).map(|pair| (pair[1].0 - pair[0].0) / 1_000).collect();
        gaps.sort_unstable();
        gaps.dedup();
        gaps
    };
    // The second stop follows when the reply window of the first, 5 ms, has closed.
    for timeout_ms in [None, Some(200), Some(10_000)] {
        assert_eq!(silence_ms(timeout_ms), [5, 500], "{timeout_ms:?}");
    }
}

#[test]
fn a_stop_that_could_never_leave_is_due_when_the_bus_is_back_however_long_the_motor_s_timeout() {
    let (mut rig, _) = bench::rmd_with_timeout(5_000);
    move_axis(&mut rig, VELOCITY);
    rig.shorted = true;
    rig.bus_off(0);
    run_with_host(&mut rig, 650_000);
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: false }]);
    let since = rig.now_us;
    rig.shorted = false;
    run_with_host(&mut rig, 100_000); // started again at 700 ms
    assert_eq!(rig.sent_since(0, since).first(), Some(&HOLD));
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
}

#[test]
fn a_mended_cable_lets_the_stop_be_confirmed() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.cut();
    run_with_host(&mut rig, 2_000_000);
    let since = rig.now_us;
    rig.mend();
    run_with_host(&mut rig, 1_000_000);
    assert_eq!(rig.sent_since(0, since).first(), Some(&HOLD));
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
}

#[test]
fn arming_over_a_cut_cable_is_answered() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.cut();
    let arming = rig.send(&Request::Arm(requests::Arm { axis: 0 }));
    run_with_host(&mut rig, 2_000_000);
    let no_reply = Error::NoReply { axis: 0, hint: NoReplyHint::NotAcknowledged };
    assert_eq!(rig.answer(arming), Some(Err(no_reply)));
    assert_eq!(listed(&mut rig, 0), AxisState::Idle);
}

#[test]
fn jobs_on_a_cut_bus_do_not_close_the_link() {
    let mut rig = bench::rmd_axes(9);
    rig.cut();
    let reads = [0, 1, 2, 3, 4, 5, 6, 7]
        .map(|axis| rig.send(&Request::ReadState(requests::ReadState { axis })));
    rig.run(1_000_000);
    for (axis, read) in (0..).zip(reads) {
        let no_reply = Error::NoReply { axis, hint: NoReplyHint::NotAcknowledged };
        assert_eq!(rig.answer(read), Some(Err(no_reply)));
    }
    assert!(matches!(
        rig.ask(Request::Ping(requests::Ping {})),
        Ok(Reply::Ping(replies::Pong { .. }))
    ));
}

#[test]
fn a_bus_that_stays_off_is_started_again_after_growing_pauses() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    rig.shorted = true;
    rig.bus_off(0);
    let pauses_ms = |rig: &mut Rig, count| -> Vec<u64> {
        let mut pauses = Vec::new();
        let mut started = (rig.now_us, generation(rig));
        while pauses.len() < count {
            run_with_host(rig, 1_000);
            if generation(rig) != started.1 {
                pauses.push((rig.now_us - started.0) / 1_000);
                started = (rig.now_us, generation(rig));
            }
        }
        pauses
    };
    assert_eq!(pauses_ms(&mut rig, 7), [100, 200, 400, 800, 1_600, 1_600, 1_600]);
    rig.shorted = false;
    run_with_host(&mut rig, 4_000_000);
    arm(&mut rig);
    // It has run for longer than 2 s: the pauses begin anew.
    rig.shorted = true;
    rig.bus_off(0);
    assert_eq!(pauses_ms(&mut rig, 2), [100, 200]);
}

#[test]
fn a_job_on_a_bus_that_goes_off_is_answered() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    play.borrow_mut().mute = true;
    let read = rig.send(&Request::ReadState(requests::ReadState { axis: 0 }));
    rig.run(200);
    rig.shorted = true;
    rig.bus_off(0);
    assert_eq!(rig.answer(read), Some(Err(Error::BusOff { bus: 0 })));
}

#[test]
fn a_bus_that_comes_back_by_itself_is_not_restarted_under_the_stop() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.bus_off(0);
    rig.run(99_950); // the core starts the bus again at 100 ms
    let before = generation(&rig);
    rig.bus_state(0, BusState::Active);
    run_with_host(&mut rig, 100_000);
    assert_eq!(generation(&rig), before);
    assert_tripped(&mut rig, TripReason::BusOff, true);
}

#[test]
fn a_restart_with_a_stop_in_the_controller_loses_no_stop() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.run(1_000);
    stop(&mut rig);
    rig.bus_off(0);
    run_with_host(&mut rig, 300_000);
    assert_tripped(&mut rig, TripReason::BusOff, true);
}

#[test]
fn a_reply_to_a_setpoint_of_0_that_left_before_does_not_acknowledge_the_stop() {
    let (mut rig, play) = bench::thruster_that_owes_the_reply_to_a_setpoint_of_0();
    rig.run(400); // the setpoint has left
    let since = rig.now_us;
    stop(&mut rig);
    rig.run(400); // the first stop too
    assert_eq!(rig.sent_since(0, since), ["30B#5443000000000000"]);
    rig.receive(0, "28B#5443000000000000");
    rig.run(400);
    play.borrow_mut().mute = false;
    assert!(!state(&mut rig).stop_acknowledged);
}
