//! Somebody else loads a CAN bus with an id between ours: the stops that win against it leave in
//! time, whichever were asked for first (GUARANTEES G4, G5).

use crate::bench::{
    self, D5_VELOCITY, VELOCITY, arm_axis, configure_axis, keep_moving, run_with_host,
};
use crate::motors;
use crate::rig::{FRAME_US, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, Event as HostEvent, Protocol, Request, StopAction, StopTarget,
    TripReason, Value, requests,
};

/// RMD nodes on CAN bus 0, the axes not in the order of their ids.
const NODES: [u8; 5] = [0x14, 0x0C, 0x01, 0x1C, 0x08];

fn rmd_id(node: u8) -> u16 {
    0x140 + u16::from(node)
}

fn rig() -> Rig {
    let mut rig = Rig::new();
    rig.motor = Box::new(motors::rmd(std::rc::Rc::default()));
    bench::hello(&mut rig);
    bench::configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd]);
    for (axis, node) in (0..).zip(NODES) {
        configure_axis(&mut rig, axis, 0, Protocol::Rmd, node, StopAction::Hold);
    }
    rig
}

/// g + F(2k - 1) until the k-th stop begins, and the frame itself (GUARANTEES G5).
fn bound_us(stops: u64) -> u64 {
    100 + 135 * (2 * stops - 1) + FRAME_US
}

/// When the first stop of a node had left, after `since_us`.
fn stopped_at(rig: &Rig, node: u8, since_us: u64) -> Option<u64> {
    let stop = format!("{:03X}#81", rmd_id(node));
    rig.left
        .iter()
        .find(|(at, _, text)| *at >= since_us && text.starts_with(&stop))
        .map(|(at, ..)| *at)
}

/// A host that commands nothing asks for a stop.
fn stop_as_other(rig: &mut Rig, axis: u8) {
    let request = Request::Stop(requests::Stop { target: StopTarget::Axis(axis) });
    rig.ask_as(1, &request).unwrap();
}

#[test]
fn the_stop_of_a_turning_motor_is_not_kept_out_by_stops_that_cannot_leave() {
    for (turning, node) in (0..).zip(NODES) {
        for foreign in [0x13F, 0x141, 0x145, 0x149, 0x150, 0x158, 0x15F] {
            let mut rig = rig();
            let epoch = arm_axis(&mut rig, turning);
            keep_moving(&mut rig, &[(turning, epoch)], VELOCITY, 55_000);
            rig.babble(Some(foreign));
            for axis in (0..5).filter(|axis| *axis != turning) {
                stop_as_other(&mut rig, axis);
            }
            rig.run(300);
            let since = rig.now_us;
            rig.send(&Request::EStop(requests::EStop {}));
            rig.run(20_000);
            let at = stopped_at(&rig, node, since);
            let case = format!(
                "axis {turning} turns, {foreign:03X} loads the bus: {:?}",
                rig.held_texts()
            );
            assert_eq!(at.is_some(), rmd_id(node) <= foreign, "{case}");
            assert!(
                at.is_none_or(|at| at - since <= bound_us(5)),
                "{case}: after {at:?} - {since}"
            );
        }
    }
}

#[test]
fn every_stop_that_wins_against_the_load_leaves_and_the_others_when_it_ends() {
    for foreign in [0x141, 0x145, 0x149, 0x150, 0x158] {
        let mut rig = rig();
        let moving = [(0, arm_axis(&mut rig, 0)), (2, arm_axis(&mut rig, 2))];
        keep_moving(&mut rig, &moving, VELOCITY, 55_000);
        rig.babble(Some(foreign));
        let since = rig.now_us;
        rig.send(&Request::EStop(requests::EStop {}));
        run_with_host(&mut rig, 300_000);
        for node in NODES {
            let at = stopped_at(&rig, node, since);
            assert_eq!(at.is_some(), rmd_id(node) <= foreign, "node {node}, {foreign:03X}");
            assert!(
                at.is_none_or(|at| at - since <= bound_us(5)),
                "node {node}, {foreign:03X}: {at:?} - {since}"
            );
        }
        let again = rig.now_us;
        rig.babble(None);
        run_with_host(&mut rig, 300_000);
        for node in NODES.iter().filter(|node| rmd_id(**node) > foreign) {
            let at = stopped_at(&rig, *node, again).expect("it is still owed");
            assert!(at - again <= bound_us(5), "node {node}, {foreign:03X}: {at} - {again}");
        }
    }
}

/// The first stops of the higher ids wait for ever; what stops the lower ones goes on: the second
/// stop, and the readings of standstill.
#[test]
fn a_first_stop_that_cannot_leave_keeps_no_other_from_being_confirmed() {
    let mut rig = rig();
    let epoch = arm_axis(&mut rig, 2);
    keep_moving(&mut rig, &[(2, epoch)], VELOCITY, 55_000);
    rig.babble(Some(0x145));
    rig.send(&Request::EStop(requests::EStop {}));
    run_with_host(&mut rig, 300_000);
    assert_eq!(bench::listed(&mut rig, 2), AxisState::Tripped { confirmed: true });
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Stopping);
}

/// The first stops of three motors lose to the load; two that win hold again, and are polled for
/// it. The next e-stop has still to reach those two when the bus is asked: their stops go first,
/// whatever is due there.
#[test]
fn behind_stops_that_cannot_leave_a_new_stop_goes_before_what_keeps_a_motor_holding() {
    let wins = ["141#", "148#"];
    let is_stop = |text: &&&str| text[4..].starts_with("81");
    let mut polls = 0;
    for after in (0..12_000).step_by(40) {
        let mut rig = rig();
        rig.babble(Some(0x14A));
        rig.send(&Request::EStop(requests::EStop {}));
        run_with_host(&mut rig, 100_000 + after);
        assert!(!rig.held_texts().is_empty());
        for axis in [2, 4] {
            assert_eq!(bench::listed(&mut rig, axis), AxisState::Holding);
        }
        let sent_before = rig.wire.len();
        rig.send(&Request::EStop(requests::EStop {}));
        for _ in 0..10 {
            rig.run_without_ticks(20);
            rig.receive(0, "14A#5555");
        }
        rig.run(2_000);
        let sent = rig.wire.split_off(sent_before);
        let sent: Vec<&str> = sent.iter().map(|(.., text)| text.as_str()).collect();
        for id in wins {
            let stop = sent.iter().position(|text| text.starts_with(id) && is_stop(&text));
            let (before, behind) = sent.split_at(stop.expect("it wins"));
            assert!(before.iter().all(|text| is_stop(&text)), "{id} after {after} µs: {sent:?}");
            polls += behind.iter().filter(|text| text.starts_with(id) && !is_stop(text)).count();
        }
    }
    assert!(polls > 0);
}

/// A stop that waits keeps motion and raw frames from the bus, as long as it waits.
#[test]
fn while_a_first_stop_waits_no_motion_goes_out() {
    let mut rig = rig();
    let epoch = arm_axis(&mut rig, 2);
    keep_moving(&mut rig, &[(2, epoch)], VELOCITY, 55_000);
    rig.babble(Some(0x145));
    stop_as_other(&mut rig, 0);
    let since = rig.now_us;
    keep_moving(&mut rig, &[(2, epoch)], bench::D5_VELOCITY, 15_000);
    let sent = rig.sent_since(0, since);
    assert!(!sent.iter().any(|text| text.starts_with("141#A2")), "{sent:?}");
}

/// The higher ids hold both places; then one with a lower id has to be repeated.
#[test]
fn a_second_stop_takes_the_place_of_one_that_loses_against_the_load() {
    let mut rig = rig();
    let epoch = arm_axis(&mut rig, 2);
    keep_moving(&mut rig, &[(2, epoch)], VELOCITY, 55_000);
    rig.babble(Some(0x145));
    let since = rig.now_us;
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(2) }));
    for axis in [0, 1, 3, 4] {
        stop_as_other(&mut rig, axis);
    }
    rig.run(30_000);
    let stops =
        rig.left.iter().filter(|(at, _, text)| *at >= since && text.starts_with("141#81")).count();
    assert!(stops >= 2, "{stops} stops of the motor that turned");
    assert_eq!(bench::listed(&mut rig, 2), AxisState::Holding);
}

/// The reply of a D5 that turned is due when the others wait: its stop must go alone.
#[test]
fn a_d5_whose_reply_is_missing_is_stopped_before_those_that_lose_against_the_load() {
    let (mut rig, _) = bench::d5();
    configure_axis(&mut rig, 1, 1, Protocol::D5, 1, StopAction::Hold);
    configure_axis(&mut rig, 2, 1, Protocol::D5, 9, StopAction::Hold);
    let epoch = arm_axis(&mut rig, 1);
    keep_moving(&mut rig, &[(1, epoch)], D5_VELOCITY, 30_000);
    rig.instead(|_| crate::rig::Instead::Nothing);
    let asked = rig.wire.len();
    while !rig.wire[asked..].iter().any(|(.., text)| text.starts_with("001#")) {
        rig.run(10);
    }
    rig.run(FRAME_US + 10);
    rig.babble(Some(0x005));
    stop_as_other(&mut rig, 0);
    stop_as_other(&mut rig, 2);
    let since = rig.now_us;
    rig.send(&Request::EStop(requests::EStop {}));
    rig.run(20_000);
    let stop =
        |(at, _, text): &&(u64, u8, String)| *at >= since && text.starts_with("001#D50105032000");
    let at = rig.left.iter().find(stop).map(|(at, ..)| *at - since);
    // g + F(2k - 1) + W, and 3F for each of the three axes that the reply may have waited for
    // (SAFETY.md).
    assert!(
        at.is_some_and(|at| at <= 100 + 642 * 5 + 1_000 + 642 * 9 + FRAME_US),
        "{at:?} {:?}",
        rig.held_texts()
    );
}

/// Stops wait on two buses, each behind its own load.
#[test]
fn a_loaded_bus_delays_no_other() {
    let mut rig = rig();
    bench::configure_bus(&mut rig, 1, 1_000_000, &[Protocol::Rmd]);
    configure_axis(&mut rig, 5, 1, Protocol::Rmd, 2, StopAction::Hold);
    configure_axis(&mut rig, 6, 1, Protocol::Rmd, 0x1E, StopAction::Hold);
    let moving = [(2, arm_axis(&mut rig, 2)), (5, arm_axis(&mut rig, 5))];
    keep_moving(&mut rig, &moving, VELOCITY, 55_000);
    rig.babble(Some(0x145));
    for axis in [0, 1, 3, 6] {
        stop_as_other(&mut rig, axis);
    }
    rig.run(1_000);
    let since = rig.now_us;
    rig.send(&Request::EStop(requests::EStop {}));
    rig.run(5_000);
    for (bus, stop, stops) in [(0, "141#81", 5), (1, "142#81", 2)] {
        let left = rig
            .left
            .iter()
            .find(|(at, on, text)| *at >= since && *on == bus && text.starts_with(stop));
        assert!(
            left.is_some_and(|(at, ..)| at - since <= bound_us(stops)),
            "bus {bus}: {left:?} - {since}"
        );
    }
}

const ONE_TURNS: u8 = 2;

/// Axis 2 turns, and its stop loses to the load; with the time at which it was due.
fn stop_that_cannot_leave() -> (Rig, u64) {
    let mut rig = rig();
    let epoch = arm_axis(&mut rig, ONE_TURNS);
    keep_moving(&mut rig, &[(ONE_TURNS, epoch)], VELOCITY, 55_000);
    rig.babble(Some(0x001));
    let since = rig.now_us;
    rig.send(&Request::EStop(requests::EStop {}));
    (rig, since)
}

/// g + F(2k - 1), the frame, and 100 ms (GUARANTEES G4).
#[test]
fn a_stop_that_could_not_be_sent_makes_its_axis_unreachable_unless_it_was_at_rest() {
    let (mut rig, _) = stop_that_cannot_leave();
    rig.run(100_000 + 100 + 135 * 2 * 5 - 1);
    assert_eq!(bench::outcomes(&rig), []);
    assert!(rig.gateway.enable_output());
    rig.run(1);
    assert_eq!(
        bench::outcomes(&rig),
        [HostEvent::AxisUnreachable { axis: ONE_TURNS, stop_transmitted: false }]
    );
    assert!(!rig.gateway.enable_output());
    run_with_host(&mut rig, 10_000_000);
    assert_eq!(bench::outcomes(&rig).len(), 1);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Stopping);
}

#[test]
fn stops_that_could_not_be_sent_are_owed_without_silences_and_leave_first() {
    for waited_us in [50_000, 150_000, 6_000_000] {
        let (mut rig, _) = stop_that_cannot_leave();
        run_with_host(&mut rig, waited_us);
        let again = rig.now_us;
        rig.babble(None);
        run_with_host(&mut rig, 60_000);
        for node in NODES {
            let at = stopped_at(&rig, node, again).expect("it is still owed");
            assert!(at - again <= bound_us(5), "node {node} after {waited_us}: {at} - {again}");
        }
        assert_eq!(bench::listed(&mut rig, ONE_TURNS), AxisState::Tripped { confirmed: true });
        assert_eq!(bench::listed(&mut rig, 0), AxisState::Holding);
        assert!(rig.gateway.enable_output());
    }
}

/// Three unconfirmed stops make this axis unreachable; none has been sent.
#[test]
fn what_has_not_left_is_not_counted_as_a_stop_that_the_motor_did_not_confirm() {
    let mut rig = rig();
    bench::parameter(
        &mut rig,
        ONE_TURNS,
        AxisParameter::StopsBeforeUnreachable,
        Value::Unsigned(3),
    );
    for _ in 0..8 {
        let epoch = arm_axis(&mut rig, ONE_TURNS);
        keep_moving(&mut rig, &[(ONE_TURNS, epoch)], VELOCITY, 55_000);
        rig.babble(Some(0x001));
        rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(ONE_TURNS) }));
        run_with_host(&mut rig, 95_000);
        rig.babble(None);
        run_with_host(&mut rig, 200_000);
        assert_eq!(bench::listed(&mut rig, ONE_TURNS), AxisState::Holding);
    }
}

/// Where a motor hears its stops and confirms none, hosts are told otherwise.
#[test]
fn a_stop_that_was_sent_and_cannot_be_repeated_is_not_sent_either() {
    let (mut rig, play) = bench::rmd(StopAction::Hold);
    bench::move_axis(&mut rig, VELOCITY);
    play.borrow_mut().turning = true;
    bench::stop(&mut rig);
    run_with_host(&mut rig, 60_000);
    rig.babble(Some(0x001));
    run_with_host(&mut rig, 140_000);
    assert_eq!(bench::outcomes(&rig), []);
    run_with_host(&mut rig, 70_000);
    assert_eq!(
        bench::outcomes(&rig),
        [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: false }]
    );
    bench::assert_tripped(&mut rig, TripReason::StopUnconfirmed, false);
}

/// Nobody can configure the bus while the stop of an axis at rest waits for it: who knows better
/// gives it up.
#[test]
fn the_stop_of_an_axis_at_rest_can_be_given_up_when_it_could_not_be_sent() {
    let (mut rig, _) = stop_that_cannot_leave();
    let give_up = Request::ClearUnreachable(requests::ClearUnreachable { axis: 0 });
    run_with_host(&mut rig, 50_000);
    assert_eq!(rig.ask(give_up.clone()), Err(Error::NothingToClear { axis: 0 }));
    run_with_host(&mut rig, 60_000);
    rig.ask(give_up).unwrap();
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Idle);
    assert!(!rig.held_texts().contains(&"154#8100000000000000"));
}

#[test]
fn an_e_stop_reaches_axes_at_rest_on_a_bus_that_is_off_when_it_is_back() {
    let mut rig = rig();
    rig.shorted = true;
    rig.bus_off(0);
    rig.run(10_000);
    rig.send(&Request::EStop(requests::EStop {}));
    run_with_host(&mut rig, 3_000_000);
    assert_eq!(bench::outcomes(&rig), []);
    let since = rig.now_us;
    rig.shorted = false;
    run_with_host(&mut rig, 2_000_000);
    for (axis, node) in (0..).zip(NODES) {
        assert!(stopped_at(&rig, node, since).is_some(), "node {node}");
        assert_eq!(bench::listed(&mut rig, axis), AxisState::Holding);
    }
}
