//! The free-running cycle: periods of the gateway's own, and setpoints that end as ever (GUARANTEES
//! G2, G3, G9; PROTOCOL.md, the free-running cycle).

use crate::bench::{self, VELOCITY, arm_axis, expiry, listed, periods, run_cycle, run_with_host};
use crate::rig::{Instead, Rig, Said};
use host_protocol::{
    AxisState, CycleEvent, CycleResult, Error, FixedU32, Quantity, Reply, Request, Setpoint,
    StateField, StateFields, StopTarget, TripReason, replies, requests,
};

const FIELDS: StateFields = StateFields::of(&[StateField::Position, StateField::Velocity]);
const PERIOD_US: u32 = 2_000;
const MOTION: &str = "141#A200000010270000";

/// RMD nodes 1 to `count`, armed in one epoch.
fn armed(count: u8) -> (Rig, u32) {
    let mut rig = bench::rmd_axes(count);
    let axes = (1 << count) - 1;
    let request = Request::ArmTogether(requests::ArmTogether { axes });
    let Ok(Reply::ArmTogether(replies::ArmedTogether { epoch })) = rig.ask(request) else {
        panic!("not armed")
    };
    run_with_host(&mut rig, 1_000);
    (rig, epoch)
}

fn set(rig: &mut Rig, epoch: u32, axes: u32, lives_us: u64) {
    let request = Request::Cycle(requests::Cycle {
        epoch: FixedU32(epoch),
        expires_at_us: FixedU32(expiry(rig, lives_us)),
        fields: FIELDS,
        axes,
        setpoints: (0..axes.count_ones()).map(|_| VELOCITY).collect(),
    });
    rig.send(&request);
}

fn results(event: &CycleEvent) -> Vec<CycleResult> {
    event.states().map(|state| state.result).collect()
}

#[test]
fn every_period_sends_each_setpoint_once_and_tells_every_state() {
    let (mut rig, epoch) = armed(3);
    run_cycle(&mut rig, 0b111, FIELDS, PERIOD_US).unwrap();
    set(&mut rig, epoch, 0b111, 80_000);
    rig.run(3_000);
    rig.said.clear();
    let since = rig.now_us;
    rig.run(40_000);
    let told = periods(&rig);
    assert_eq!(told.len(), 20);
    for pair in told.windows(2) {
        assert_eq!(pair[1].period, pair[0].period + 1);
        assert_eq!(pair[1].due_us.0, pair[0].due_us.0 + PERIOD_US);
    }
    for event in &told {
        assert_eq!((event.axes, event.late_us, event.jitter_us), (0b111, 0, 0));
        assert_eq!(results(event), [CycleResult::Answered; 3]);
        assert!(event.took_us < 1_500, "{}", event.took_us);
        // Each was told in this very period.
        assert!(event.states().all(|s| s.age_us <= 1_500 && s.state == AxisState::Active));
        let degrees = event.states().next().unwrap().position_rad.unwrap().to_degrees();
        assert!((degrees - 360.0).abs() < 0.1, "{degrees}");
    }
    assert_eq!(told.last().unwrap().overruns, host_protocol::Overruns::default());
    let sent = rig.sent_since(0, since);
    assert_eq!(sent.iter().filter(|text| **text == MOTION).count(), 20);
    assert_eq!(rig.longest_gap_us(0, since, "141#A2"), 2_000);
    // No speed is read beside them.
    assert!(!sent.iter().any(|text| text.contains("#9C")));
}

/// From the bytes of the vector to those on the bus, and back: RunCycle of axes 0 and 3, each
/// millisecond. Armed, without a setpoint, they are read (RMD V3.6 §2.13).
#[test]
fn the_bytes_of_a_request_become_frames_in_each_period() {
    const REQUEST: [u8; 16] = [
        0x00, 0x05, 0x01, 0x52, 0x02, 0x47, 0x09, 0x09, 0x0F, 0xE8, 0x07, 0xAB, 0x93, 0xBF, 0x4E,
        0x00,
    ];
    let mut rig = bench::rmd_axes(4);
    arm_axis(&mut rig, 0);
    arm_axis(&mut rig, 3);
    let since = rig.now_us;
    rig.handle(gateway::Event::HostBytes { link: 0, bytes: &REQUEST });
    rig.run(4_900);
    let done = Reply::RunCycle(replies::Done {});
    let is_done = |said: &Said| matches!(said, Said::Reply(0x0252, reply) if **reply == done);
    assert_eq!(rig.said.iter().filter(|said| is_done(said)).count(), 1);
    for frame in ["141#9C00000000000000", "144#9C00000000000000"] {
        let sent = rig.sent_since(0, since);
        assert_eq!(sent.iter().filter(|text| **text == frame).count(), 5, "{frame}");
    }
    let told = periods(&rig);
    assert_eq!((told.len(), told[0].axes, told[4].period), (5, 0b1001, 4));
}

#[test]
fn what_is_told_of_every_axis_and_what_of_one() {
    let (mut rig, _) = armed(1);
    let fields = StateFields::of(&[StateField::Velocity, StateField::Voltage]);
    run_cycle(&mut rig, 1, fields, PERIOD_US).unwrap();
    rig.run(1_000);
    let event = periods(&rig)[0].clone();
    let slow = event.slow.unwrap();
    assert_eq!(slow.voltage_v.map(|reading| reading.value), Some(48.5));
    assert_eq!((slow.axis, slow.faults), (0, None));
    assert_eq!(event.fields, StateFields::of(&[StateField::Velocity]));
    // Armed, answered; 0 rad/s.
    assert_eq!((event.states[0], event.states.len()), (0x03, 3));
}

/// What went to the controller before a period may leave in it. Its answer is not that to a
/// setpoint that was accepted before the period as well.
#[test]
fn a_period_is_answered_by_the_setpoint_in_force_when_it_began() {
    let of_frame = |text: &str| {
        let value = text.strip_prefix("141#A2000000")?;
        Some(u32::from_str_radix(value, 16).unwrap().swap_bytes())
    };
    let mut random = fastrand::Rng::with_seed(3);
    let (mut rig, epoch) = armed(3);
    run_cycle(&mut rig, 0b111, FIELDS, PERIOD_US).unwrap();
    let mut accepted = Vec::new();
    for value in 1..=1_000_u16 {
        let velocity_rad_s = (f32::from(value) / 100.0).to_radians();
        let setpoint = Setpoint::Velocity { velocity_rad_s };
        let expires_at_us = FixedU32(expiry(&rig, 80_000));
        let setpoints = [setpoint; 3].into_iter().collect();
        let epoch = FixedU32(epoch);
        let cycle =
            requests::Cycle { epoch, expires_at_us, fields: FIELDS, axes: 0b111, setpoints };
        rig.send(&Request::Cycle(cycle));
        accepted.push((rig.now_us, u32::from(value)));
        // Others keep the bus for a while.
        rig.run(random.u64(200..1_500));
        rig.babble(Some(1));
        rig.run(random.u64(200..2_500));
        rig.babble(None);
    }
    let frames: Vec<(u64, u32)> =
        rig.left.iter().filter_map(|(at, _, text)| Some((*at, of_frame(text)?))).collect();
    let mut answered = 0;
    let of_first = |event: &&CycleEvent| results(event).first() == Some(&CycleResult::Answered);
    for event in periods(&rig).into_iter().filter(of_first) {
        let begin = u64::from(event.due_us.0 + event.late_us);
        let Some((_, owed)) = accepted.iter().rev().find(|(at, _)| *at < begin) else { continue };
        let end = begin + u64::from(event.took_us);
        let sent = |(at, value): &&(u64, u32)| *value >= *owed && *at <= end;
        assert!(frames.iter().any(|frame| sent(&frame)), "{owed} was not sent by {end}: {event:?}");
        answered += 1;
    }
    assert!(answered > 500, "{answered}");
}

/// The largest age stands for it, also soon after a start, when the gateway itself is younger.
#[test]
fn what_was_never_read_is_older_than_the_gateway() {
    let mut rig = bench::rmd_axes(1);
    let axes = 1 << 5;
    run_cycle(&mut rig, axes, FIELDS, PERIOD_US).unwrap();
    rig.run(10_000);
    let told = periods(&rig);
    assert!(rig.now_us < 163_000 && told.len() > 2, "{}", rig.now_us);
    for event in told {
        assert!(event.states().all(|state| state.age_us == 163_830), "{event:?}");
    }
}

/// What changes slowly is told of one axis in a period, with its age.
#[test]
fn slow_fields_come_in_turns() {
    let (mut rig, _) = armed(3);
    run_cycle(&mut rig, 0b101, StateFields::of(StateField::ALL), PERIOD_US).unwrap();
    run_with_host(&mut rig, 150_000);
    let told = periods(&rig);
    let axes: Vec<u8> = told.iter().filter_map(|event| Some(event.slow?.axis)).collect();
    assert_eq!(axes[..4], [0, 2, 0, 2]);
    let slow = told.last().unwrap().slow.unwrap();
    assert!(slow.faults.unwrap().age_us <= 102_000, "{slow:?}");
    assert!(slow.motor_temperature_c.unwrap().age_us <= 4_000, "{slow:?}");
    assert!(slow.driver_temperature_c.is_none());
}

/// Armed axes without a setpoint are read, others only told of.
#[test]
fn what_is_not_armed_is_not_driven() {
    let mut rig = bench::rmd_axes(2);
    arm_axis(&mut rig, 0);
    run_cycle(&mut rig, 0b11, FIELDS, PERIOD_US).unwrap();
    run_with_host(&mut rig, 2_000);
    let since = rig.now_us;
    run_with_host(&mut rig, 20_000);
    let sent = rig.sent_since(0, since);
    // Those of the cycle, and one now and then of the polls.
    let read = sent.iter().filter(|text| text.starts_with("141#9C")).count();
    assert!((10..=11).contains(&read), "{read}");
    assert!(!sent.iter().any(|text| text.starts_with("142")), "{sent:?}");
    let not_armed = Error::NotArmed { axis: 1, state: AxisState::Idle }.number();
    let refused = CycleResult::Refused { error: not_armed };
    let told = periods(&rig);
    assert_eq!(results(told.last().unwrap()), [CycleResult::Answered, refused]);
}

/// A cycle sends on, and extends nothing.
#[test]
fn a_cycle_extends_no_setpoint() {
    let (mut rig, epoch) = armed(2);
    run_cycle(&mut rig, 0b11, FIELDS, PERIOD_US).unwrap();
    set(&mut rig, epoch, 0b11, 30_000);
    let expires = rig.now_us + 30_000;
    run_with_host(&mut rig, 60_000);
    let last = rig.wire.iter().rfind(|(_, _, text)| text.contains("#A2")).unwrap().0;
    assert!(last < expires, "{last} {expires}");
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    let report = rig.ask(Request::ReadState(requests::ReadState { axis: 0 })).unwrap();
    let Reply::ReadState(report) = report else { panic!() };
    assert_eq!(report.trip.unwrap().reason, TripReason::SetpointExpired);
    // The cycle itself goes on.
    let told = periods(&rig);
    let tripped = CycleResult::Refused { error: 12 };
    assert_eq!(results(told.last().unwrap()), [tripped, tripped]);
    assert!(told.iter().any(|event| results(event).contains(&CycleResult::Stopped)));
}

#[test]
fn a_setpoint_waits_for_the_next_period_and_no_longer() {
    let (mut rig, epoch) = armed(1);
    run_cycle(&mut rig, 1, FIELDS, PERIOD_US).unwrap();
    rig.run(700);
    let since = rig.now_us;
    set(&mut rig, epoch, 1, 80_000);
    rig.run(3_000);
    let at = rig.wire.iter().find(|(at, _, text)| *at >= since && text == MOTION).unwrap().0;
    let told = periods(&rig);
    let due = u64::from(told[0].due_us.0);
    assert!(at > since && (at - due).is_multiple_of(u64::from(PERIOD_US)), "{at} {due}");
}

/// One that comes when the period has begun, and before the one in force has left, takes its place
/// in this period: no period goes without.
#[test]
fn a_setpoint_that_comes_as_a_period_begins_misses_none() {
    let (mut rig, epoch) = armed(3);
    run_cycle(&mut rig, 0b111, FIELDS, PERIOD_US).unwrap();
    set(&mut rig, epoch, 0b111, 80_000);
    rig.run(7_000);
    let due = u64::from(periods(&rig).last().unwrap().due_us.0) + u64::from(PERIOD_US);
    // The first frame of the period is on the bus, the others wait behind it.
    rig.run(due + 50 - rig.now_us);
    assert_eq!(rig.now_us, due + 50);
    set(&mut rig, epoch, 0b111, 80_000);
    rig.said.clear();
    rig.run(10_000);
    for event in periods(&rig) {
        assert_eq!(results(event), [CycleResult::Answered; 3], "{event:?}");
    }
    for node in 1..=3 {
        let motion = format!("14{node}#A2");
        assert!(rig.longest_gap_us(0, due - 4_000, &motion) <= 2_500);
    }
}

/// A period longer than half the time in which a setpoint is due on the wire holds up none.
#[test]
fn a_long_period_holds_up_no_setpoint() {
    let (mut rig, epoch) = armed(1);
    run_cycle(&mut rig, 1, FIELDS, 20_000).unwrap();
    rig.run(3_000);
    let since = rig.now_us;
    set(&mut rig, epoch, 1, 80_000);
    rig.run(500);
    assert!(rig.sent_since(0, since).contains(&MOTION));
}

#[test]
fn a_mute_motor_costs_nobody_elses_result_and_is_counted() {
    let (mut rig, epoch) = armed(3);
    run_cycle(&mut rig, 0b111, FIELDS, PERIOD_US).unwrap();
    set(&mut rig, epoch, 0b111, 80_000);
    rig.run(5_000);
    rig.instead(|text| match text.starts_with("142") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    rig.said.clear();
    rig.run(20_000);
    let told = periods(&rig);
    assert!(told.len() >= 9, "{}", told.len());
    let (first, third) = (CycleResult::Answered, CycleResult::Answered);
    for event in &told[1..] {
        let results = results(event);
        assert_eq!((results[0], results[2]), (first, third));
        assert!(matches!(results[1], CycleResult::Superseded | CycleResult::NoReply));
    }
    assert!(told.iter().any(|event| results(event)[1] == CycleResult::NoReply));
    let overruns = told.last().unwrap().overruns;
    assert!(overruns.motor >= 4 && overruns.bus == 0 && overruns.gateway == 0, "{overruns:?}");
    for _ in 0..4 {
        set(&mut rig, epoch, 0b101, 80_000);
        rig.run(40_000);
    }
    assert!(matches!(listed(&mut rig, 1), AxisState::Tripped { .. }));
    assert_eq!([0, 2].map(|axis| listed(&mut rig, axis)), [AxisState::Active; 2]);
}

/// Half a reply is none; on the next period the axis is whole again.
#[test]
fn a_reply_that_is_lost_in_mid_cycle_is_one_period_late() {
    let (mut rig, epoch) = armed(2);
    run_cycle(&mut rig, 0b11, FIELDS, 6_000).unwrap();
    set(&mut rig, epoch, 0b11, 80_000);
    rig.run(7_000);
    let mut lost = false;
    rig.instead(move |text| {
        match text.starts_with("142#A2") && !std::mem::replace(&mut lost, true) {
            true => Instead::Says("242#A2326400"),
            false => Instead::AsUsual,
        }
    });
    rig.said.clear();
    rig.run(30_000);
    let of_second: Vec<_> = periods(&rig).iter().map(|event| results(event)[1]).collect();
    let missed = |result: &&CycleResult| !result.is_answered();
    assert_eq!(of_second.iter().filter(missed).count(), 1, "{of_second:?}");
    // It may be the late one to the setpoint before.
    assert_eq!(of_second.last(), Some(&CycleResult::Ambiguous));
}

#[test]
fn a_stop_and_an_e_stop_in_mid_cycle_are_told_and_go_out_as_ever() {
    for (stop, both) in [
        (Request::Stop(requests::Stop { target: StopTarget::Axis(1) }), false),
        (Request::EStop(requests::EStop {}), true),
    ] {
        let (mut rig, epoch) = armed(2);
        run_cycle(&mut rig, 0b11, FIELDS, PERIOD_US).unwrap();
        set(&mut rig, epoch, 0b11, 80_000);
        rig.run(6_100);
        let since = rig.now_us;
        rig.send(&stop);
        rig.run(10_000);
        let sent = rig.sent_since(0, since);
        let stops = sent.iter().position(|text| *text == "142#8100000000000000").unwrap();
        assert!(stops <= 2, "{sent:?}");
        assert!(!sent[stops..].iter().any(|text| text.starts_with("142#A2")), "{sent:?}");
        assert_eq!(listed(&mut rig, 0) == AxisState::Active, !both);
    }
}

#[test]
fn another_epoch_moves_nothing_and_stops_no_cycle() {
    let (mut rig, epoch) = armed(2);
    run_cycle(&mut rig, 0b11, FIELDS, PERIOD_US).unwrap();
    set(&mut rig, epoch.wrapping_add(1), 0b11, 80_000);
    rig.run(10_000);
    assert!(!rig.wire.iter().any(|(_, _, text)| text.contains("#A2")));
    assert_eq!([0, 1].map(|axis| listed(&mut rig, axis)), [AxisState::Armed; 2]);
    assert!(periods(&rig).len() >= 4);
}

#[test]
fn a_silent_host_is_silent_whatever_the_cycle_does() {
    let (mut rig, _) = armed(2);
    run_cycle(&mut rig, 0b11, FIELDS, PERIOD_US).unwrap();
    rig.run(240_000);
    let running = periods(&rig).len();
    assert!(running > 100);
    rig.run(300_000);
    assert!(matches!(listed(&mut rig, 0), AxisState::Idle | AxisState::Holding));
    // It ended with authority.
    let after = periods(&rig).len();
    assert!(after - running <= 6, "{running} {after}");
    rig.run(50_000);
    assert_eq!(periods(&rig).len(), after);
}

#[test]
fn one_host_runs_a_cycle_and_another_none() {
    let (mut rig, epoch) = armed(1);
    run_cycle(&mut rig, 1, FIELDS, PERIOD_US).unwrap();
    set(&mut rig, epoch, 1, 80_000);
    let other = Request::RunCycle(requests::RunCycle { axes: 1, fields: FIELDS, period_us: 1_000 });
    assert_eq!(rig.ask_as(1, &other), Err(Error::NotInCommand { holder: 0 }));
    rig.run(10_000);
    assert_eq!(rig.longest_gap_us(0, rig.now_us - 8_000, "141#A2"), 2_000);
    // Giving authority back ends it.
    rig.ask(Request::ReleaseAuthority(requests::ReleaseAuthority {})).unwrap();
    rig.said.clear();
    rig.run(20_000);
    assert!(periods(&rig).is_empty());
}

#[test]
fn a_period_that_no_bus_could_keep_is_refused_with_the_numbers() {
    let mut rig = bench::rmd_axes(6);
    let all = 0b11_1111;
    let refused = run_cycle(&mut rig, all, FIELDS, 1_000);
    // Six exchanges of 222 bits, and as many polls of fault words every 90 ms: 1352 µs.
    let expected =
        Error::BusOverloaded { bus: 0, needed_permille: 1_352, available_permille: 1_000 };
    assert_eq!(refused, Err(expected));
    for (period_us, value) in [(249, 249.0), (20_001, 20_001.0), (0, 0.0)] {
        let error =
            Error::OutOfRange { quantity: Quantity::Period, value, min: 250.0, max: 20_000.0 };
        assert_eq!(run_cycle(&mut rig, 1, FIELDS, period_us), Err(error));
    }
    let unknown = run_cycle(&mut rig, 0x1FFFF, FIELDS, PERIOD_US);
    assert_eq!(unknown, Err(Error::BadBody { number: 0x0047 }));
    assert!(run_cycle(&mut rig, all, FIELDS, 1_351).is_err());
    assert_eq!(run_cycle(&mut rig, all, FIELDS, 1_352), Ok(()));
    // None ends it, whatever else it says.
    assert_eq!(run_cycle(&mut rig, 0, FIELDS, 0), Ok(()));
}

/// What a bus might keep and a motor does not is counted, and the motor is asked all the same: here
/// an exchange takes 360 µs, and at its best 222.
#[test]
fn a_period_that_the_motor_does_not_keep_is_counted_as_overruns() {
    let (mut rig, epoch) = armed(1);
    run_cycle(&mut rig, 1, FIELDS, 250).unwrap();
    set(&mut rig, epoch, 1, 80_000);
    rig.run(30_000);
    let overruns = periods(&rig).last().unwrap().overruns;
    assert!(overruns.motor > 50 && overruns.gateway == 0, "{overruns:?}");
    let gap = rig.longest_gap_us(0, rig.now_us - 20_000, "141#A2");
    assert!(gap <= 750, "{gap}");
}

/// Who comes late begins on the grid, and says how late.
#[test]
fn periods_that_nobody_began_are_counted_and_passed_over() {
    let (mut rig, _) = armed(1);
    run_cycle(&mut rig, 1, FIELDS, PERIOD_US).unwrap();
    rig.run(1_000);
    let begun = u64::from(periods(&rig)[0].due_us.0);
    rig.said.clear();
    // The gateway was busy for three periods and a half.
    rig.now_us = begun + 7_000;
    rig.handle(gateway::Event::Tick);
    rig.run(900);
    let told = periods(&rig);
    let last = told.last().unwrap();
    assert_eq!((last.period, last.late_us, last.jitter_us), (3, 1_000, 1_000));
    assert_eq!(last.overruns.gateway, 2);
    assert_eq!(u64::from(last.due_us.0), begun + 6_000);
}
