//! A reply window is what a motor takes: where a CAN bus has no room for the reply, it has longer to
//! come.

use crate::bench::{self, VELOCITY, arm_axis, axis_setpoint, e_stop, run_with_host};
use crate::rig::{Instead, Rig};
use host_protocol::{CycleResult, FixedU32, Reply, Request, StateFields, replies, requests};

/// Of the bus of [`bench::rmd_axes`].
const WINDOW_US: u64 = 5_000;
/// A frame and the reply to it, to each of the two other motors, each of 135 bits at 1 Mbit/s.
const BUS_US: u64 = 2 * 2 * 135;
/// What nobody here understands, with ids before all replies, and behind them.
const BEFORE: &str = "200#0000";
const BEHIND: &str = "7FF#0000";

/// Three motors, the second of which lets its replies to setpoints wait for whoever gives them.
fn rig() -> (Rig, u32) {
    let mut rig = bench::rmd_axes(3);
    let armed = rig.ask(Request::ArmTogether(requests::ArmTogether { axes: 0b111 })).unwrap();
    let Reply::ArmTogether(replies::ArmedTogether { epoch }) = armed else { panic!("{armed:?}") };
    run_with_host(&mut rig, 1_000);
    rig.instead(|text| match text.starts_with("142#A2") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    (rig, epoch)
}

/// What becomes of the second motor's part in a cycle, and how long after its request had left that
/// is told, to 10 µs. `others`: this frame comes from them again and again. `answers`: it does, so long
/// after.
fn part(others: Option<&str>, answers: Option<u64>) -> (CycleResult, u64) {
    let (mut rig, epoch) = rig();
    let since = rig.now_us;
    let cycle = rig.send(&Request::Cycle(requests::Cycle {
        epoch: FixedU32(epoch),
        expires_at_us: FixedU32(bench::expiry(&rig, 80_000)),
        fields: StateFields::NONE,
        axes: 0b111,
        setpoints: [VELOCITY; 3].into_iter().collect(),
    }));
    let (mut heard_at, mut answer) = (since, answers);
    loop {
        rig.run(10);
        let left = rig.left.iter().find(|(at, _, text)| *at >= since && text.starts_with("142#A2"));
        let left = left.map(|(at, ..)| *at);
        if let Some(told) = rig.answer(cycle) {
            let Ok(Reply::Cycle(report)) = told else { panic!("{told:?}") };
            return (report.states().nth(1).unwrap().result, rig.now_us - left.unwrap());
        }
        if let Some(frame) = others.filter(|_| heard_at + 200 <= rig.now_us) {
            heard_at = rig.now_us;
            rig.receive(0, frame);
        }
        if answer.take_if(|after| left.is_some_and(|left| left + *after <= rig.now_us)).is_some() {
            rig.receive(0, "242#A232000000000000");
        }
    }
}

#[test]
fn a_reply_is_missed_behind_its_window_where_the_bus_is_quiet() {
    let (result, after) = part(None, None);
    assert_eq!(result, CycleResult::NoReply);
    assert!((WINDOW_US..WINDOW_US + 20).contains(&after), "{after} µs");
}

#[test]
fn a_reply_has_longer_where_the_bus_is_busy_and_not_for_ever() {
    let (result, after) = part(Some(BEFORE), None);
    assert_eq!(result, CycleResult::NoReply);
    let latest = WINDOW_US + BUS_US;
    assert!((latest..latest + 20).contains(&after), "{after} µs");
}

/// It would have gone before them.
#[test]
fn a_reply_is_missed_behind_its_window_where_the_bus_carries_what_it_goes_before() {
    let (result, after) = part(Some(BEHIND), None);
    assert_eq!(result, CycleResult::NoReply);
    assert!((WINDOW_US..WINDOW_US + 220).contains(&after), "{after} µs");
}

#[test]
fn a_reply_that_had_to_wait_for_the_bus_counts() {
    let (result, after) = part(Some(BEFORE), Some(WINDOW_US + BUS_US - 20));
    assert_eq!(result, CycleResult::Answered);
    assert!(after > WINDOW_US, "{after} µs");
}

#[test]
fn what_stops_again_waits_for_a_late_reply_and_no_longer_than_the_bus_is_busy() {
    let mut rig = bench::rmd_axes(3);
    let epoch = arm_axis(&mut rig, 0);
    rig.ask(axis_setpoint(&rig, 0, epoch, 80_000, VELOCITY)).unwrap();
    rig.run(20_000);
    rig.instead(|text| match text.starts_with("143#") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    let since = rig.now_us;
    e_stop(&mut rig);
    let third_left = |rig: &Rig| {
        rig.left.iter().find(|(at, _, text)| *at >= since && text.starts_with("143#81")).cloned()
    };
    while third_left(&rig).is_none() {
        rig.run(10);
    }
    let late_at = third_left(&rig).unwrap().0 + WINDOW_US;
    let mut heard_at = 0;
    while rig.now_us < late_at + BUS_US + 2_000 {
        rig.run(10);
        if heard_at + 200 <= rig.now_us && rig.now_us > late_at - 300 {
            heard_at = rig.now_us;
            rig.receive(0, BEFORE);
        }
    }
    let begins = |from: u64, to: u64| {
        let begun = rig.wire.iter().filter(|(at, ..)| (from..to).contains(at));
        begun.map(|(_, _, text)| text.as_str()).collect::<Vec<_>>()
    };
    assert_eq!(begins(late_at, late_at + BUS_US), Vec::<&str>::new());
    assert_ne!(begins(late_at + BUS_US, late_at + BUS_US + 2_000), Vec::<&str>::new());
}
