//! What a period of the free-running cycle reads beside its setpoint, and what that costs (PROTOCOL.md,
//! the free-running cycle).

use crate::bench::{self, arm, listed, parameter, periods, run_cycle, run_with_host};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, CycleResult, Error, Protocol, Request, Setpoint, StateField,
    StateFields, Value, requests,
};

const SPEED: StateFields = StateFields::of(&[StateField::Velocity]);
const SIGNAL: Setpoint = Setpoint::Signal { fraction: 0.1 };
const PERIOD_US: u32 = 5_000;
/// A read of a D5's speed, and the motor's answer that it does not know the command (D5 manual,
/// table row 4).
const READ: &str = "00B#D50B050226000038";
const UNKNOWN: &str = "00B#5D0B050203EEEEF1";

fn last_result(rig: &Rig) -> CycleResult {
    periods(rig).last().unwrap().states().next().unwrap().result
}

/// Of motors whose polls are few, too, and without a subscription.
#[test]
fn what_is_told_in_turns_is_read() {
    let fields = StateFields::of(StateField::ALL);
    for (mut rig, _) in [bench::thruster(), bench::d5()] {
        arm(&mut rig);
        run_cycle(&mut rig, 1, fields, PERIOD_US).unwrap();
        run_with_host(&mut rig, 2_000_000);
        let slow = periods(&rig).last().unwrap().slow.unwrap();
        for reading in [slow.driver_temperature_c, slow.motor_temperature_c] {
            assert!(reading.unwrap().age_us < 1_200_000, "{slow:?}");
        }
    }
}

#[test]
fn a_read_that_the_motor_refuses_is_over() {
    let (mut rig, _) = bench::d5();
    arm(&mut rig);
    rig.instead(|text| if text == READ { Instead::Says(UNKNOWN) } else { Instead::AsUsual });
    run_cycle(&mut rig, 1, SPEED, 20_000).unwrap();
    run_with_host(&mut rig, 30_000);
    let (since, told) = (rig.now_us, periods(&rig).len());
    run_with_host(&mut rig, 100_000);
    let error = Error::Refused { axis: 0, faults: None }.number();
    assert_eq!(last_result(&rig), CycleResult::Refused { error });
    assert_eq!(periods(&rig).len() - told, 5);
    // Those of the cycle, and the polls that ask the same.
    let reads = rig.sent_since(1, since).into_iter().filter(|text| *text == READ).count();
    assert!((5..=10).contains(&reads), "{reads}");
}

/// The next read waits until the reply that is missing can come no more: that is the motor's doing.
#[test]
fn what_a_silent_motor_keeps_up_is_counted_so() {
    let (mut rig, _) = bench::thruster();
    arm(&mut rig);
    let fields = StateFields::of(&[StateField::Velocity, StateField::Current]);
    run_cycle(&mut rig, 1, fields, PERIOD_US).unwrap();
    run_with_host(&mut rig, 20_000);
    rig.instead(|text| match text.starts_with("30B#5156") {
        true => Instead::Nothing,
        false => Instead::AsUsual,
    });
    run_with_host(&mut rig, 60_000);
    let overruns = periods(&rig).last().unwrap().overruns;
    assert!(overruns.motor >= 5 && overruns.bus == 0, "{overruns:?}");
}

/// A setpoint that the next period would find expired goes out at once.
#[test]
fn a_short_life_is_not_waited_away() {
    let (mut rig, _) = bench::thruster();
    parameter(&mut rig, 0, AxisParameter::RefreshUs, Value::Unsigned(40_000));
    bench::provision(&mut rig, 1_000).unwrap();
    let epoch = arm(&mut rig);
    run_cycle(&mut rig, 1, SPEED, 20_000).unwrap();
    run_with_host(&mut rig, 2_000);
    let since = rig.now_us;
    let request = bench::setpoint(&rig, epoch, 10_000, SIGNAL);
    rig.ask(request).unwrap();
    rig.run(1_000);
    assert!(rig.sent_since(0, since).contains(&"30B#544300000000000A"), "{:?}", rig.wire);
    let request = bench::setpoint(&rig, epoch, 100_000, SIGNAL);
    rig.ask(request).unwrap();
    rig.run(15_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Active);
}

/// Until the next period was due, however late somebody looks.
#[test]
fn a_period_takes_no_longer_than_it_is() {
    let (mut rig, _) = bench::thruster();
    arm(&mut rig);
    run_cycle(&mut rig, 1, SPEED, PERIOD_US).unwrap();
    run_with_host(&mut rig, 18_000);
    // Others keep the bus.
    rig.babble(Some(1));
    let due = u64::from(periods(&rig).last().unwrap().due_us.0) + u64::from(PERIOD_US);
    rig.run(due + 500 - rig.now_us);
    rig.said.clear();
    // The gateway was busy.
    rig.now_us = due + u64::from(PERIOD_US) + 300;
    rig.handle(gateway::Event::Tick);
    assert_eq!(periods(&rig)[0].took_us, PERIOD_US);
}

/// Frames of a stream are frames and no exchanges; a D5 at level 1 answers reads only. On CAN at
/// 210526 bit/s a frame without a bit stuffed takes 111 of them.
#[test]
fn a_period_is_refused_for_what_is_on_the_wire_and_for_nothing_else() {
    let shortest = |rig: &mut Rig, fields| {
        let refused = run_cycle(rig, 1, fields, 250);
        let Err(Error::BusOverloaded { needed_permille, .. }) = refused else {
            panic!("{refused:?}")
        };
        needed_permille / 4
    };
    // One exchange of 222 bits, and one more for each read; polls of 222 each 90 ms, 11.7 ‰.
    let (mut rig, _) = bench::d5();
    assert_eq!(shortest(&mut rig, StateFields::of(&[])), 1_067);
    let two = StateFields::of(&[StateField::Velocity, StateField::Position]);
    assert_eq!(shortest(&mut rig, two), 3_202);
    let mut rig = bench::d5_that_answers_reads_only();
    assert_eq!(shortest(&mut rig, StateFields::of(&[])), 534);
    // SR with one frame each millisecond: at 500 kbit/s 222 µs of 1,000. An exchange of 8 and 8 data
    // bytes takes 444 µs, the poll of the fault word, with 4, 380 of each 90 ms: 444 / 0.774.
    let (mut rig, _) = bench::thruster();
    parameter(&mut rig, 0, AxisParameter::Stream, Value::Unsigned(0x01_0001));
    assert_eq!(shortest(&mut rig, StateFields::of(&[])), 573);
}

/// A line is kept for an answer that does not come, for the whole window.
#[test]
fn a_line_is_as_full_as_its_window_makes_it() {
    let mut rig = Rig::new();
    bench::hello(&mut rig);
    bench::configure_bus(&mut rig, 2, 2_000_000, &[Protocol::D5]);
    for axis in 0..2 {
        let hold = host_protocol::StopAction::Hold;
        bench::configure_axis(&mut rig, axis, 2, Protocol::D5, axis + 1, hold);
        parameter(&mut rig, axis, AxisParameter::D5AckLevel, Value::Unsigned(1));
    }
    // 5 ms of each 20 for each axis: a third does not fit.
    let bus = requests::ConfigureAxis {
        axis: 2,
        parameter: AxisParameter::D5AckLevel.number(),
        value: Value::Unsigned(1),
    };
    bench::configure_axis(&mut rig, 2, 2, Protocol::D5, 3, host_protocol::StopAction::Hold);
    let refused = rig.ask(Request::ConfigureAxis(bus));
    assert!(matches!(refused, Err(Error::BusOverloaded { bus: 2, .. })), "{refused:?}");
}
