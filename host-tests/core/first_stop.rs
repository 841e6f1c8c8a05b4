//! A thruster that was told to move before it became an axis's may stand because its own timeout
//! has acted, and go on with its old setpoint when it hears something: it hears its stop first.

use crate::bench::{self, native, parameter, provision, run_with_host};
use crate::motors::Shared;
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, NoReplyHint, Protocol, Request, Setpoint, StateField,
    StateFields, Value, requests,
};

/// TC 0 and LS to node 11 (Thruster manual §2.1, §4.1).
const STOP: &str = "30B#5443000000000000";
const END: &str = "30B#4C53000000000000";

fn ask_state(rig: &mut Rig) {
    rig.ask(Request::ReadState(requests::ReadState { axis: 0 })).unwrap();
}

type Asks = fn(&mut Rig);
/// All that sends an idle axis's motor something.
const ASKS: [(&str, Asks); 6] = [
    ("its state", ask_state),
    ("its timeout", |rig| {
        provision(rig, 300).unwrap();
    }),
    ("a native read", |rig| {
        let request = native(rig, 0, "5156000000000000");
        rig.ask(request).unwrap();
    }),
    ("a native change", |rig| {
        let request = native(rig, 0, "535400000000012C");
        rig.ask(request).unwrap();
    }),
    ("arming", |rig| {
        bench::arm(rig);
    }),
    ("a subscription", |rig| {
        let fields = StateFields::of(&[StateField::Velocity]);
        let request = requests::Subscribe { axes: 1, fields, period_us: 20_000 };
        rig.ask(Request::Subscribe(request)).unwrap();
        run_with_host(rig, 100_000);
    }),
];

#[test]
fn whatever_a_thruster_that_is_new_is_asked_it_hears_its_stop_before() {
    for position_device in [false, true] {
        for (what, ask) in ASKS {
            let (mut rig, _) = bench::thruster();
            let device = Value::Bool(position_device);
            parameter(&mut rig, 0, AxisParameter::PositionDevice, device);
            assert_eq!(rig.sent_since(0, 0), Vec::<&str>::new(), "{what}");
            ask(&mut rig);
            let sent = rig.sent_since(0, 0);
            let stops = if position_device { &[STOP, END][..] } else { &[STOP] };
            assert!(sent.len() > stops.len() && sent.starts_with(stops), "{what}: {sent:?}");
            // Once.
            let since = rig.now_us;
            ask_state(&mut rig);
            let again = rig.sent_since(0, since);
            assert!(!again.is_empty() && !again.contains(&STOP), "{what}: {again:?}");
        }
    }
}

#[test]
fn what_answers_at_another_bitrate_hears_its_stop_too() {
    let (mut rig, _) = bench::thruster();
    ask_state(&mut rig);
    bench::configure_bus(&mut rig, 0, 500_000, &[Protocol::Rmd, Protocol::Thruster]);
    let since = rig.now_us;
    ask_state(&mut rig);
    assert_eq!(rig.sent_since(0, since).first(), Some(&STOP));
}

#[test]
fn another_motor_on_the_axis_hears_its_stop_too() {
    let (mut rig, _) = bench::thruster();
    ask_state(&mut rig);
    parameter(&mut rig, 0, AxisParameter::Node, Value::Unsigned(0x0C));
    parameter(&mut rig, 0, AxisParameter::Node, Value::Unsigned(0x0B));
    let since = rig.now_us;
    ask_state(&mut rig);
    assert_eq!(rig.sent_since(0, since).first(), Some(&STOP));
    // What changes nothing of how it is reached leaves it the same motor.
    parameter(&mut rig, 0, AxisParameter::VelocityLimitRadS, Value::Float(50.0));
    let since = rig.now_us;
    ask_state(&mut rig);
    assert!(!rig.sent_since(0, since).contains(&STOP));
}

/// An armed thruster at half its signal whose cable is cut behind another node, which goes on
/// acknowledging: given up, and cleared without a confirmed stop.
fn given_up() -> (Rig, Shared) {
    let (mut rig, play) = bench::thruster();
    bench::move_axis(&mut rig, Setpoint::Signal { fraction: 0.5 });
    play.borrow_mut().mute = true;
    bench::stop(&mut rig);
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
    rig.ask(Request::ClearUnreachable(requests::ClearUnreachable { axis: 0 })).unwrap();
    (rig, play)
}

#[test]
fn a_thruster_that_was_unreachable_hears_its_stop_before_anything_else() {
    for (what, ask) in ASKS {
        let (mut rig, play) = given_up();
        run_with_host(&mut rig, 100_000);
        play.borrow_mut().mute = false;
        let since = rig.now_us;
        ask(&mut rig);
        let sent = rig.sent_since(0, since);
        assert!(sent.len() > 1 && sent[0] == STOP, "{what}: {sent:?}");
    }
}

/// A stop that leaves and is not answered may not have been heard.
#[test]
fn a_thruster_that_does_not_answer_is_stopped_before_each_question_until_it_does() {
    let (mut rig, play) = given_up();
    let fields = StateFields::of(&[StateField::Velocity]);
    let request = requests::Subscribe { axes: 1, fields, period_us: 20_000 };
    rig.ask(Request::Subscribe(request)).unwrap();
    run_with_host(&mut rig, 3_500_000);
    play.borrow_mut().mute = false;
    let since = rig.now_us;
    run_with_host(&mut rig, 2_000_000);
    let sent = rig.sent_since(0, since);
    assert!(sent.len() > 2 && sent[0] == STOP, "{sent:?}");
    assert!(!sent[1..].contains(&STOP), "once it has answered: {sent:?}");
}

#[test]
fn who_asks_a_new_thruster_that_does_not_answer_is_told_so() {
    let (mut rig, play) = bench::thruster();
    play.borrow_mut().mute = true;
    let result = rig.ask(Request::ReadState(requests::ReadState { axis: 0 }));
    assert_eq!(result, Err(Error::NoReply { axis: 0, hint: NoReplyHint::None }));
    assert_eq!(bench::listed(&mut rig, 0), AxisState::Idle);
}

/// What is lost has not been heard: the question would be the first that the thruster hears.
#[test]
fn a_thruster_whose_first_stop_was_lost_hears_it_again_before_the_question() {
    for (what, ask) in ASKS {
        for lost in [STOP, END] {
            let (mut rig, _) = bench::thruster();
            parameter(&mut rig, 0, AxisParameter::PositionDevice, Value::Bool(true));
            let mut was_lost = false;
            rig.instead(move |text| match text == lost && !was_lost {
                true => {
                    was_lost = true;
                    Instead::Nothing
                }
                false => Instead::AsUsual,
            });
            ask(&mut rig);
            run_with_host(&mut rig, 1_500_000);
            let sent = rig.sent_since(0, 0);
            let question = sent.iter().position(|text| ![STOP, END].contains(text));
            let before = &sent[..question.expect(what)];
            let again = before.iter().filter(|text| **text == lost).count();
            assert_eq!(again, 2, "{what}, {lost} is lost: {sent:?}");
            assert!(before.contains(&STOP) && before.contains(&END), "{what}: {sent:?}");
        }
    }
}

/// Nor is anything asked of one that answers no stop.
#[test]
fn a_thruster_that_is_new_and_mute_hears_its_stop_alone() {
    let fields = StateFields::of(&[StateField::Velocity]);
    for request in [
        Request::ReadState(requests::ReadState { axis: 0 }),
        Request::Arm(requests::Arm { axis: 0 }),
        Request::Subscribe(requests::Subscribe { axes: 1, fields, period_us: 20_000 }),
    ] {
        let (mut rig, _) = bench::thruster();
        rig.instead(|_| Instead::Nothing);
        rig.send(&request);
        run_with_host(&mut rig, 3_000_000);
        let sent = rig.sent_since(0, 0);
        assert!(sent.len() > 2 && sent.iter().all(|text| *text == STOP), "{request:?}: {sent:?}");
    }
}

/// One that is set to return nothing can only be sent it, and one that returns frames for it hears.
#[test]
fn what_a_thruster_returns_for_its_first_stop_shows_that_it_hears() {
    for (return_mode, tc) in [(0x0100, None), (0, Some("28B#5401000000F00000"))] {
        let (mut rig, _) = bench::thruster();
        parameter(&mut rig, 0, AxisParameter::ReturnMode, Value::Unsigned(return_mode));
        rig.instead(move |text| match (text.starts_with("30B#5443"), tc) {
            (true, Some(tc)) => Instead::Says(tc),
            (true, None) => Instead::Nothing,
            _ => Instead::AsUsual,
        });
        ask_state(&mut rig);
        let sent = rig.sent_since(0, 0);
        assert!(sent.len() > 1 && sent[0] == STOP && sent[1] != STOP, "{sent:?}");
    }
}
