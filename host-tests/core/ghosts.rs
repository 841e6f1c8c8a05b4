//! Whatever is under way for an axis belongs to the bus that carries it: an axis that is moved,
//! re-addressed or removed leaves nothing behind (GUARANTEES G7).

use crate::bench::{self, D5_VELOCITY, VELOCITY, arm_axis, configure_axis, keep_moving};
use crate::motors;
use crate::rig::{FRAME_US, Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Protocol, ProtocolSet, Request, Setpoint, StateField, StateFields,
    StopAction, StopTarget, Value, requests,
};
use std::cell::Cell;
use std::rc::Rc;

/// How far the poll of axis 0 is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum UnderWay {
    InTheController,
    OnTheWire,
    WaitsForItsReply,
    Displaced,
}

const UNDER_WAY: [UnderWay; 4] = [
    UnderWay::InTheController,
    UnderWay::OnTheWire,
    UnderWay::WaitsForItsReply,
    UnderWay::Displaced,
];

/// What a host does to axis 0 meanwhile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Change {
    Bus,
    Node,
    Protocol,
    RequestId,
    Removed,
    BusAgain,
}

/// A long reply window, so that nothing ends by itself.
const WINDOW_US: u32 = 200_000;

fn configure_bus(rig: &mut Rig, bus: u8, protocols: &[Protocol]) {
    let request = requests::ConfigureBus {
        bus,
        bitrate: if protocols == [Protocol::D5] { 210_526 } else { 1_000_000 },
        protocols: ProtocolSet::of(protocols),
        exclusive: false,
        reply_window_us: WINDOW_US,
    };
    rig.ask(Request::ConfigureBus(request)).unwrap();
}

fn stop_action(protocol: Protocol) -> StopAction {
    if protocol == Protocol::D5 { StopAction::Hold } else { StopAction::Coast }
}

/// Axis 0 is watched, and another one shares its bus.
fn rig(protocol: Protocol) -> Rig {
    let mut rig = Rig::new();
    let (mut rmd, mut d5) = (motors::rmd(Rc::default()), motors::d5(Rc::default()));
    rig.motor = Box::new(move |now, bus, text| rmd(now, bus, text).or_else(|| d5(now, bus, text)));
    bench::hello(&mut rig);
    let here: &[Protocol] = if protocol == Protocol::D5 {
        &[Protocol::D5]
    } else {
        &[Protocol::Rmd, Protocol::Thruster]
    };
    configure_bus(&mut rig, 0, here);
    configure_bus(&mut rig, 1, here);
    configure_axis(&mut rig, 0, 0, protocol, 1, stop_action(protocol));
    configure_axis(&mut rig, 1, 0, protocol, 5, stop_action(protocol));
    let fields = StateFields::NONE.with(StateField::Velocity);
    rig.ask(Request::Subscribe(requests::Subscribe { axes: 1, fields, period_us: 50_000 }))
        .unwrap();
    rig
}

/// The poll of axis 0 is as far as wanted; its motor answers it only where that is displaced by a
/// stop, and everything else.
fn bring(rig: &mut Rig, id: &'static str, under_way: UnderWay) {
    let answers = Rc::new(Cell::new(false));
    let answers_now = answers.clone();
    rig.instead(move |text| {
        if text.starts_with(id) && !answers_now.get() { Instead::Nothing } else { Instead::AsUsual }
    });
    rig.run(2 * u64::from(WINDOW_US) + 100_000);
    if under_way == UnderWay::InTheController {
        rig.babble(Some(0));
    }
    let sent = rig.wire.len();
    while !rig.wire[sent..].iter().any(|(.., text)| text.starts_with(id)) {
        rig.run(10);
    }
    match under_way {
        UnderWay::InTheController | UnderWay::OnTheWire => {}
        UnderWay::WaitsForItsReply => rig.run(FRAME_US + 10),
        UnderWay::Displaced => {
            rig.run(FRAME_US + 10);
            answers.set(true);
            rig.ask(Request::Stop(requests::Stop { target: StopTarget::Axis(0) })).unwrap();
            // The reply to the poll may still be taken for that to the stop's own reading.
            rig.run(5 * u64::from(WINDOW_US));
        }
    }
    answers.set(true);
}

fn unsigned(value: u8) -> Value {
    Value::Unsigned(u32::from(value))
}

/// Returns the bus and the id on which axis 0 is from now on.
fn change(rig: &mut Rig, protocol: Protocol, change: Change) -> (u8, &'static str) {
    let d5 = protocol == Protocol::D5;
    let id = if d5 { "001#" } else { "141#" };
    match change {
        Change::Bus => bench::parameter(rig, 0, AxisParameter::Bus, unsigned(1)),
        Change::Node => bench::parameter(rig, 0, AxisParameter::Node, unsigned(2)),
        Change::Protocol => {
            bench::parameter(rig, 0, AxisParameter::Protocol, unsigned(Protocol::Thruster.number()))
        }
        Change::RequestId => bench::parameter(rig, 0, AxisParameter::D5RequestId, unsigned(0x20)),
        Change::Removed => {
            rig.ask(Request::RemoveAxis(requests::RemoveAxis { axis: 0 })).unwrap();
            configure_axis(rig, 0, 1, protocol, 1, stop_action(protocol));
        }
        Change::BusAgain => {
            configure_bus(
                rig,
                0,
                if d5 { &[Protocol::D5] } else { &[Protocol::Rmd, Protocol::Thruster] },
            );
        }
    }
    match change {
        Change::Bus | Change::Removed => (1, id),
        Change::Node => (0, if d5 { "002#" } else { "142#" }),
        Change::Protocol => (0, "301#"),
        Change::RequestId => (0, "020#"),
        Change::BusAgain => (0, id),
    }
}

fn leaves_nothing_behind(protocol: Protocol, under_way: UnderWay, what: Change) {
    let case = format!("{protocol:?}, {under_way:?}, {what:?}");
    let velocity: Setpoint = if protocol == Protocol::D5 { D5_VELOCITY } else { VELOCITY };
    let id = if protocol == Protocol::D5 { "001#" } else { "141#" };
    let mut rig = rig(protocol);
    bring(&mut rig, id, under_way);
    let (bus, new_id) = change(&mut rig, protocol, what);
    if what != Change::BusAgain {
        assert!(
            !rig.held_on(0).iter().any(|text| text.starts_with(id)),
            "{case}: {:?}",
            rig.held_on(0)
        );
    }
    rig.babble(None);
    // It is served at once, and so is who shares its bus. The same motor may still answer what it
    // was asked.
    let within_us = if what == Change::BusAgain { 2 * u64::from(WINDOW_US) } else { 2_000 };
    let since = rig.now_us;
    rig.send(&Request::ReadState(requests::ReadState { axis: 0 }));
    rig.run(within_us);
    let sent = rig.sent_since(bus, since);
    assert!(sent.iter().any(|text| text.starts_with(new_id)), "{case}: {sent:?}");
    rig.run(1_000_000);
    bench::hello_again(&mut rig);
    let other = (1, arm_axis(&mut rig, 1));
    if what == Change::Protocol {
        // There is no such motor.
        keep_moving(&mut rig, &[other], velocity, 300_000);
    } else {
        let moving = [(0, arm_axis(&mut rig, 0)), other];
        keep_moving(&mut rig, &moving, velocity, 300_000);
        assert_eq!(bench::listed(&mut rig, 0), AxisState::Active, "{case}");
    }
    assert_eq!(bench::listed(&mut rig, 1), AxisState::Active, "{case}");
}

#[test]
fn an_rmd_axis_that_is_changed_leaves_no_request_behind() {
    for under_way in UNDER_WAY {
        for what in [Change::Bus, Change::Node, Change::Protocol, Change::Removed, Change::BusAgain]
        {
            leaves_nothing_behind(Protocol::Rmd, under_way, what);
        }
    }
}

#[test]
fn a_d5_axis_that_is_changed_leaves_no_request_behind() {
    for under_way in UNDER_WAY {
        for what in
            [Change::Bus, Change::Node, Change::RequestId, Change::Removed, Change::BusAgain]
        {
            leaves_nothing_behind(Protocol::D5, under_way, what);
        }
    }
}

/// What was under way on the old bus ends there, and is not taken for what is under way on the new
/// one: both have the same place.
#[test]
fn a_frame_that_leaves_the_old_bus_is_not_taken_for_one_on_the_new_one() {
    let mut rig = rig(Protocol::Rmd);
    bring(&mut rig, "141#", UnderWay::OnTheWire);
    bench::parameter(&mut rig, 0, AxisParameter::Bus, unsigned(1));
    // On the new bus nothing leaves.
    rig.babble(Some(0));
    let read = rig.send(&Request::ReadState(requests::ReadState { axis: 0 }));
    rig.run(FRAME_US + 10);
    rig.receive(1, "241#9A320001E5010000");
    rig.receive(1, "241#9C32640000002D00");
    rig.run(1_000);
    assert_eq!(rig.answer(read), None);
}

/// Nobody has acknowledged the poll of axis 0 when it comes back. What is sent next is another
/// axis's, later than that poll might have waited, and has its own time.
#[test]
fn an_axis_that_is_removed_leaves_no_deadline_to_others() {
    let mut rig = bench::rmd_axes(1);
    // It coasts: one that holds would be asked every 20 ms.
    configure_axis(&mut rig, 1, 0, Protocol::Rmd, 2, StopAction::Coast);
    for slow in [AxisParameter::StatePollUs, AxisParameter::FaultPollUs] {
        bench::parameter(&mut rig, 1, slow, Value::Unsigned(1_000_000));
    }
    let fields = StateFields::NONE.with(StateField::Velocity);
    let watched = requests::Subscribe { axes: 1, fields, period_us: 50_000 };
    rig.ask(Request::Subscribe(watched)).unwrap();
    arm_axis(&mut rig, 1);
    bench::run_with_host(&mut rig, 200_000);
    rig.babble(Some(0));
    while !rig.held_texts().iter().any(|text| text.starts_with("141#")) {
        rig.run(10);
    }
    rig.run(500);
    rig.ask(Request::RemoveAxis(requests::RemoveAxis { axis: 0 })).unwrap();
    assert_eq!(rig.held_texts(), Vec::<&str>::new());
    rig.babble(None);
    let since = rig.now_us;
    bench::run_with_host(&mut rig, 2_000_000);
    assert!(rig.sent_since(0, since).iter().any(|text| text.starts_with("142#")));
    assert_eq!(bench::listed(&mut rig, 1), AxisState::Armed);
}
