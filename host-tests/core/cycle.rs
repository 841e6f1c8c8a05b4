//! Axes armed in one epoch and served by one request (GUARANTEES G2, G9).

use crate::bench::{self, VELOCITY, arm_axis, expiry, listed, run_with_host};
use crate::rig::{Instead, Rig};
use gateway::{Event, Set};
use host_protocol::{
    AxisParameter, AxisState, ClearTarget, CycleResult, CycleState, Error, FixedU32, Reply,
    Request, Setpoint, StateField, StateFields, StopTarget, TripReason, Value, replies, requests,
};
use std::cell::Cell;
use std::rc::Rc;

const FIELDS: StateFields = StateFields::of(&[StateField::Velocity, StateField::Current]);
/// 100 °/s of nodes 1 to 3 (RMD V3.6 §2.18.4, example 1).
const MOTIONS: [&str; 3] = ["141#A200000010270000", "142#A200000010270000", "143#A200000010270000"];
const LIVES_US: u64 = 80_000;

fn arm_together(rig: &mut Rig, axes: u32) -> Result<u32, Error> {
    match rig.ask(Request::ArmTogether(requests::ArmTogether { axes }))? {
        Reply::ArmTogether(replies::ArmedTogether { epoch }) => Ok(epoch),
        other => panic!("{other:?}"),
    }
}

/// RMD nodes 1 to 3 as axes 0 to 2, armed in the epoch.
fn three() -> (Rig, u32) {
    let mut rig = bench::rmd_axes(3);
    let epoch = arm_together(&mut rig, 0b111).unwrap();
    run_with_host(&mut rig, 1_000);
    (rig, epoch)
}

fn cycle_of(rig: &Rig, epoch: u32, axes: u32, setpoints: &[Setpoint], us: u64) -> Request {
    Request::Cycle(requests::Cycle {
        epoch: FixedU32(epoch),
        expires_at_us: FixedU32(expiry(rig, us)),
        fields: FIELDS,
        axes,
        setpoints: setpoints.iter().copied().collect(),
    })
}

fn cycle(rig: &Rig, epoch: u32) -> Request {
    cycle_of(rig, epoch, 0b111, &[VELOCITY; 3], LIVES_US)
}

fn states(answer: Result<Reply, Error>) -> Vec<CycleState> {
    match answer {
        Ok(Reply::Cycle(report)) => report.states().collect(),
        other => panic!("{other:?}"),
    }
}

fn results(answer: Result<Reply, Error>) -> Vec<CycleResult> {
    states(answer).into_iter().map(|state| state.result).collect()
}

const fn refused(error: u16) -> CycleResult {
    CycleResult::Refused { error }
}

#[test]
fn axes_are_armed_in_one_epoch_and_each_obeys_it() {
    let (mut rig, epoch) = three();
    assert_eq!([0, 1, 2].map(|axis| listed(&mut rig, axis)), [AxisState::Armed; 3]);
    let request = bench::setpoint(&rig, epoch, LIVES_US, VELOCITY);
    assert_eq!(rig.ask(request), Ok(Reply::Setpoint(replies::Done {})));
}

#[test]
fn where_one_axis_may_not_be_armed_none_is() {
    let mut rig = bench::rmd_axes(2);
    assert_eq!(arm_together(&mut rig, 0), Err(Error::BadBody { number: 0x0038 }));
    let bus = AxisParameter::Bus.number();
    let not_configured = Error::NotConfigured { axis: 2, parameter: bus };
    assert_eq!(arm_together(&mut rig, 0b111), Err(not_configured));
    let armed = arm_axis(&mut rig, 1);
    let not_idle = Error::NotIdle { axis: 1, state: AxisState::Armed };
    assert_eq!(arm_together(&mut rig, 0b11), Err(not_idle));
    assert_eq!([0, 1].map(|axis| listed(&mut rig, axis)), [AxisState::Idle, AxisState::Armed]);
    assert!(armed != 0);
}

/// What is refused at once moves nothing: no motor is energised and stopped for it.
#[test]
fn where_one_axis_is_busy_nothing_is_sent() {
    let mut rig = bench::rmd_axes(2);
    rig.send(&Request::Clear(requests::Clear { target: ClearTarget::Axis(1) }));
    let since = rig.now_us;
    assert_eq!(arm_together(&mut rig, 0b11), Err(Error::Busy { axis: 1 }));
    run_with_host(&mut rig, 50_000);
    let to_node_1 = |text: &&&str| text.starts_with("141#");
    assert_eq!(rig.sent_since(0, since).iter().filter(to_node_1).count(), 0);
    assert_eq!([0, 1].map(|axis| listed(&mut rig, axis)), [AxisState::Idle; 2]);
    arm_together(&mut rig, 0b11).unwrap();
}

#[test]
fn a_motor_that_fails_while_they_are_armed_disarms_the_others() {
    let mut rig = bench::rmd_axes(3);
    // Node 2 tells a stall (RMD V3.6 §2.25.3, 0x0002).
    rig.instead(|text| match text {
        "142#9A00000000000000" => Instead::Says("242#9A320001E5010200"),
        _ => Instead::AsUsual,
    });
    let failed = Err(Error::MotorFault { axis: 1, faults: 2 });
    assert_eq!(arm_together(&mut rig, 0b111), failed);
    run_with_host(&mut rig, 200_000);
    let at_rest = |state| matches!(state, AxisState::Idle | AxisState::Holding);
    assert!((0..3).all(|axis| at_rest(listed(&mut rig, axis))));
    let again = arm_together(&mut rig, 0b101);
    assert!(again.is_ok(), "{again:?}");
}

#[test]
fn a_second_arming_of_several_waits_for_the_first() {
    let mut rig = bench::rmd_axes(4);
    rig.send(&Request::ArmTogether(requests::ArmTogether { axes: 0b0011 }));
    assert_eq!(arm_together(&mut rig, 0b1100), Err(Error::Busy { axis: 0 }));
}

#[test]
fn a_cycle_is_answered_when_every_motor_has() {
    let (mut rig, epoch) = three();
    let since = rig.now_us;
    let request = cycle(&rig, epoch);
    let states = states(rig.ask(request));
    let told = states.iter().map(|s| (s.axis, s.state, s.result)).collect::<Vec<_>>();
    let answered = |axis| (axis, AxisState::Active, CycleResult::Answered);
    assert_eq!(told, [0, 1, 2].map(answered));
    assert!(states.iter().all(|s| s.velocity_rad_s == Some(0.0) && s.current_a == Some(1.0)));
    assert!(states.iter().all(|s| s.position_rad.is_none() && s.age_us < 2_000), "{states:?}");
    let sent = rig.sent_since(0, since);
    assert!(MOTIONS.into_iter().all(|motion| sent.iter().filter(|s| **s == motion).count() == 1));
    assert!(rig.now_us - since < 2_000, "{} µs", rig.now_us - since);
}

#[test]
fn a_late_answer_to_one_setpoint_is_not_told_as_that_to_the_next() {
    let (mut rig, epoch) = three();
    let is_lost = Rc::new(Cell::new(true));
    let lost = is_lost.clone();
    rig.instead(move |text| match text.starts_with("142#A2") && lost.take() {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    let second = |rig: &mut Rig| {
        let request = cycle(rig, epoch);
        results(rig.ask(request))[1]
    };
    assert_eq!(second(&mut rig), CycleResult::NoReply);
    // Up to 300 ms after it the motor may answer the setpoint that was lost (GUARANTEES).
    let until = rig.now_us + 299_000;
    while rig.now_us < until {
        assert_eq!(second(&mut rig), CycleResult::Ambiguous);
        run_with_host(&mut rig, 4_000);
    }
    run_with_host(&mut rig, 5_000);
    assert_eq!(second(&mut rig), CycleResult::Answered);
}

#[test]
fn a_mute_motor_costs_its_own_time_and_nobody_elses_result() {
    let (mut rig, epoch) = three();
    rig.instead(|text| match text.starts_with("142#A2") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    let since = rig.now_us;
    let request = cycle(&rig, epoch);
    let [first, second, third] = results(rig.ask(request)).try_into().unwrap();
    assert_eq!((first, third), (CycleResult::Answered, CycleResult::Answered));
    assert_eq!(second, CycleResult::NoReply);
    // The reply window of the bus, and the frames before.
    assert!(rig.now_us - since < 6_000, "{} µs", rig.now_us - since);
}

#[test]
fn what_is_refused_of_a_cycle_keeps_nothing_else_from_it() {
    let (mut rig, epoch) = three();
    bench::disarm_axis(&mut rig, 2);
    run_with_host(&mut rig, 200_000);
    let other = arm_axis(&mut rig, 2);
    assert_ne!(other, epoch);
    let fast = Setpoint::Velocity { velocity_rad_s: f32::NAN };
    let setpoints = [VELOCITY, fast, VELOCITY];
    let request = cycle_of(&rig, epoch, 0b111, &setpoints, LIVES_US);
    let not_a_number = Error::NotANumber { quantity: host_protocol::Quantity::Velocity }.number();
    let stale = Error::StaleEpoch { axis: 2, current: other }.number();
    let [a, b, c] = results(rig.ask(request)).try_into().unwrap();
    assert_eq!([a, b, c], [CycleResult::Answered, refused(not_a_number), refused(stale)]);
    let states = [0, 1, 2].map(|axis| listed(&mut rig, axis));
    assert_eq!(states, [AxisState::Active, AxisState::Armed, AxisState::Armed]);
}

#[test]
fn a_refused_axis_keeps_the_setpoint_that_it_had() {
    let (mut rig, epoch) = three();
    let first = cycle(&rig, epoch);
    rig.ask(first).unwrap();
    parameter_refused(&mut rig);
    let late = cycle_of(&rig, epoch, 0b001, &[VELOCITY], 10_000_000);
    let expiry = Error::OutOfRange {
        quantity: host_protocol::Quantity::Expiry,
        value: 0.0,
        min: 0.0,
        max: 0.0,
    };
    assert_eq!(results(rig.ask(late)), [refused(expiry.number())]);
    let since = rig.now_us;
    rig.run(30_000);
    // Refreshed as before.
    assert!(rig.sent_since(0, since).contains(&MOTIONS[0]));
}

/// Of an axis that moves nothing is configured.
fn parameter_refused(rig: &mut Rig) {
    let value = Value::Float(1.0);
    let parameter = AxisParameter::VelocityLimitRadS.number();
    let request = requests::ConfigureAxis { axis: 0, parameter, value };
    assert!(rig.ask(Request::ConfigureAxis(request)).is_err());
}

#[test]
fn a_stop_and_a_trip_in_mid_cycle_end_their_axes_part() {
    for stop in [
        Request::Stop(requests::Stop { target: StopTarget::Axis(1) }),
        Request::EStop(requests::EStop {}),
    ] {
        let (mut rig, epoch) = three();
        rig.instead(|text| match text.starts_with("142#A2") {
            true => Instead::Nothing,
            false => Instead::AsUsual,
        });
        let request = cycle(&rig, epoch);
        let asked = rig.send(&request);
        rig.run(1_500);
        assert_eq!(rig.answer(asked), None);
        rig.send(&stop);
        rig.run(0);
        let [first, second, _] = results(rig.answer(asked).unwrap()).try_into().unwrap();
        assert_eq!((first, second), (CycleResult::Answered, CycleResult::Stopped));
    }
}

#[test]
fn a_setpoint_that_expires_in_mid_cycle_trips_its_axis_and_is_told_so() {
    let (mut rig, epoch) = three();
    rig.instead(|text| match text.contains("#A2") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    let request = cycle_of(&rig, epoch, 0b010, &[VELOCITY], 2_000);
    let [state] = states(rig.ask(request)).try_into().unwrap();
    assert_eq!(state.result, CycleResult::Stopped);
    assert_eq!(state.state, AxisState::Tripped { confirmed: false });
    let report = rig.ask(Request::ReadState(requests::ReadState { axis: 1 })).unwrap();
    let Reply::ReadState(report) = report else { panic!("{report:?}") };
    assert_eq!(report.trip.map(|trip| trip.reason), Some(TripReason::SetpointExpired));
}

#[test]
fn the_next_cycle_or_setpoint_ends_the_one_that_is_not_answered() {
    let (mut rig, epoch) = three();
    rig.instead(|text| match text.starts_with("141#A2") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    let request = cycle(&rig, epoch);
    let asked = rig.send(&request);
    rig.run(1_500);
    assert_eq!(rig.answer(asked), None);
    let next = cycle_of(&rig, epoch, 0b110, &[VELOCITY; 2], LIVES_US);
    rig.send(&next);
    let superseded = [CycleResult::Superseded, CycleResult::Answered, CycleResult::Answered];
    assert_eq!(results(rig.answer(asked).unwrap()), superseded);

    let (mut rig, epoch) = three();
    rig.instead(|text| match text.starts_with("141#A2") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    let asked = rig.send(&cycle_of(&rig, epoch, 0b001, &[VELOCITY], LIVES_US));
    rig.run(1_500);
    rig.send(&bench::setpoint(&rig, epoch, LIVES_US, VELOCITY));
    assert_eq!(results(rig.answer(asked).unwrap()), [CycleResult::Superseded]);
}

#[test]
fn a_cycle_that_says_nothing_of_what_it_is_for_is_refused_whole() {
    let (mut rig, epoch) = three();
    let bad = Err(Error::BadBody { number: 0x0046 });
    for (axes, setpoints) in [(0b111, 2), (0b011, 3), (0, 0)] {
        let request = cycle_of(&rig, epoch, axes, &[VELOCITY; 3][..setpoints], LIVES_US);
        assert_eq!(rig.ask(request), bad);
    }
    let request = cycle(&rig, epoch);
    assert_eq!(rig.ask_as(1, &request), Err(Error::NotInCommand { holder: 0 }));
    assert_eq!([0, 1, 2].map(|axis| listed(&mut rig, axis)), [AxisState::Armed; 3]);
}

#[test]
fn a_cycle_on_a_cut_bus_has_an_end() {
    let (mut rig, epoch) = three();
    rig.cut();
    let request = cycle(&rig, epoch);
    let asked = rig.send(&request);
    rig.run(400_000);
    let told = results(rig.answer(asked).unwrap());
    let unsent =
        |result: &CycleResult| matches!(result, CycleResult::NoReply | CycleResult::Stopped);
    assert!(told.iter().all(unsent), "{told:?}");
}

#[test]
fn setpoints_that_expire_together_stop_one_axis_of_a_bus_first_and_all_at_their_time() {
    let (mut rig, epoch) = three();
    let request = cycle(&rig, epoch);
    rig.send(&request);
    rig.run(LIVES_US - 1);
    assert_eq!(rig.gateway.moving().len(), 3);
    rig.now_us += 1;
    let at = rig.now_us;
    rig.handle(Event::Tick);
    assert_eq!(rig.gateway.tripped(), Set::of(0u8));
    rig.run_without_ticks(1_000);
    let trips = rig.gateway.trips(rig.gateway.tripped());
    let trips = trips.map(|(axis, trip)| (axis, trip.reason, trip.time_us)).collect::<Vec<_>>();
    assert_eq!(trips, [0, 1, 2].map(|axis| (axis, TripReason::SetpointExpired, at)));
    let sent = rig.sent_since(0, at);
    assert_eq!(sent[..3], [1, 2, 3].map(|node| format!("14{node}#8100000000000000")));
    assert!(sent.iter().all(|text| !text.contains("#A2")), "{sent:?}");
}
