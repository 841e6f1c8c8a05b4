//! A reset in mid-motion: what the gateway remembers, and that it stops its motors before it speaks
//! to anybody.

use crate::bench::{self, HOLD, VELOCITY, arm_axis, keep_moving, listed, run_with_host};
use crate::rig::{BOARD_AGAIN, BOARD_WITHOUT_CAN, Instead, Rig};
use gateway::{Event, Gateway};
use host_protocol::{
    AxisParameter, AxisState, BootReason, BusState, ClearTarget, Error, Incident, Protocol, Reply,
    Request, StopAction, StopTarget, StoredState, Trip, TripReason, Value, requests,
};

const NODE_2_HOLD: &str = "142#8100000000000000";

fn clear(rig: &mut Rig, axis: u8) -> Result<Reply, Error> {
    rig.ask(Request::Clear(requests::Clear { target: ClearTarget::Axis(axis) }))
}

/// The axes that are configured.
fn axes(rig: &mut Rig) -> Vec<u8> {
    match rig.ask(Request::ListAxes(requests::ListAxes { first: 0 })) {
        Ok(Reply::ListAxes(list)) => list.axes.iter().map(|axis| axis.axis).collect(),
        other => panic!("{other:?}"),
    }
}

/// Axis 0 moves, axis 1 is idle.
fn moving() -> Rig {
    let mut rig = bench::rmd_axes(2);
    let epoch = arm_axis(&mut rig, 0);
    keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 30_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Active);
    rig
}

#[test]
fn what_was_in_motion_trips_and_every_configured_axis_is_stopped_before_the_hosts_are_heard() {
    let mut rig = moving();
    rig.reset();
    assert!(rig.gateway.stops_under_way());
    rig.run(1_000);
    assert!(!rig.gateway.stops_under_way());
    let mut first = rig.sent_since(0, 0)[..2].to_vec();
    first.sort_unstable();
    assert_eq!(first, [HOLD, NODE_2_HOLD]);
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    assert_eq!(listed(&mut rig, 1), AxisState::Holding);
    let page = bench::incidents(&mut rig, 0);
    assert!(
        matches!(
            page.incidents.as_slice(),
            [
                Incident::Tripped {
                    start: 2,
                    axis: 0,
                    trip: Trip { reason: TripReason::Reset, .. }
                },
                Incident::Started { start: 2, boot: BootReason::Watchdog, has_crash_report: true },
                Incident::Started {
                    start: 1,
                    boot: BootReason::Simulated,
                    has_crash_report: false
                },
            ]
        ),
        "{page:?}"
    );
    assert_eq!(page.next, None);
    clear(&mut rig, 0).unwrap();
    arm_axis(&mut rig, 0);
}

#[test]
fn many_trips_are_stored_in_parts_and_a_reset_between_them_finds_what_tripped_in_motion() {
    for parts in 0..=2 {
        let mut rig = bench::rmd_axes(3);
        (0..3).for_each(|axis| {
            arm_axis(&mut rig, axis);
        });
        let off = Event::BusState {
            bus: 0,
            state: BusState::BusOff,
            transmit_errors: 0,
            receive_errors: 0,
        };
        rig.take_in(off);
        let all = (0..parts).map(|_| rig.save_some()).fold(false, |_, all| all);
        assert_eq!(all, parts == 2);
        rig.reset();
        bench::hello(&mut rig);
        run_with_host(&mut rig, 50_000);
        let page = bench::incidents(&mut rig, 0);
        let trips = |wanted: TripReason| {
            let reason = |incident: &Incident| match incident {
                Incident::Tripped { trip, .. } => Some(trip.reason),
                Incident::Started { .. } => None,
            };
            page.incidents.iter().filter(|incident| reason(incident) == Some(wanted)).count()
        };
        // What has been stored as tripped needs no other incident.
        let expected = [(0, 3), (2, 3), (3, 0)][parts];
        assert_eq!(
            (trips(TripReason::BusOff), trips(TripReason::Reset)),
            expected,
            "{parts} parts"
        );
        for axis in 0..3 {
            assert_eq!(
                listed(&mut rig, axis),
                AxisState::Tripped { confirmed: true },
                "{parts} parts"
            );
        }
    }
}

#[test]
fn an_e_stop_and_who_may_move_are_stored_before_a_frame_that_follows_can_be_taken() {
    let mut rig = bench::rmd_axes(4);
    (0..3).for_each(|axis| {
        arm_axis(&mut rig, axis);
    });
    // What is idle is stopped too: its motor may move.
    rig.take_in(Event::EStopInput { open: true });
    assert!(rig.gateway.poll_transmit(rig.now(), 0).is_some());
    rig.reset();
    rig.handle(Event::EStopInput { open: false });
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    for axis in 0..4 {
        assert_eq!(listed(&mut rig, axis), AxisState::Tripped { confirmed: true }, "axis {axis}");
        clear(&mut rig, axis).unwrap();
    }
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 0 })), Err(Error::EStopped {}));
}

#[test]
fn nothing_is_armed_and_an_epoch_from_before_moves_nothing() {
    let mut rig = bench::rmd_axes(1);
    let epoch = arm_axis(&mut rig, 0);
    rig.reset();
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    let setpoint = bench::setpoint(&rig, epoch, 50_000, VELOCITY);
    assert!(matches!(
        rig.ask(setpoint),
        Err(Error::Tripped { axis: 0, reason: TripReason::Reset })
    ));
}

#[test]
fn an_epoch_from_before_is_none_of_a_later_arming() {
    let mut rig = bench::rmd_axes(1);
    let epoch = arm_axis(&mut rig, 0);
    rig.reset();
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    clear(&mut rig, 0).unwrap();
    let current = arm_axis(&mut rig, 0);
    let setpoint = bench::setpoint(&rig, epoch, 50_000, VELOCITY);
    assert_eq!(rig.ask(setpoint), Err(Error::StaleEpoch { axis: 0, current }));
}

#[test]
fn hello_tells_the_boot_the_crash_report_and_how_much_is_remembered() {
    let mut rig = moving();
    rig.reset();
    let hello = requests::Hello { protocol_major: 1, protocol_minor: 0, session: 8 };
    let Ok(Reply::Hello(hello)) = rig.ask(Request::Hello(hello)) else { panic!("{:?}", rig.said) };
    assert_eq!(
        (hello.boot, hello.has_crash_report, hello.trips_recorded),
        (BootReason::Watchdog, true, 3)
    );
    let words = rig.ask(Request::ReadCrashReport(requests::ReadCrashReport {}));
    let Ok(Reply::ReadCrashReport(words)) = words else { panic!("{words:?}") };
    assert_eq!(words.text, "no check-in from bus 1");
    let status = rig.ask(Request::GatewayStatus(requests::GatewayStatus {}));
    let Ok(Reply::GatewayStatus(status)) = status else { panic!("{status:?}") };
    assert_eq!((status.starts, status.holder), (2, None));
}

#[test]
fn a_trip_keeps_its_reason_and_its_place_in_the_history_once() {
    let mut rig = moving();
    run_with_host(&mut rig, 200_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    rig.reset();
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    let Ok(Reply::ReadState(report)) = rig.ask(Request::ReadState(requests::ReadState { axis: 0 }))
    else {
        panic!("{:?}", rig.said)
    };
    assert_eq!(report.trip.map(|trip| trip.reason), Some(TripReason::SetpointExpired));
    let trips = bench::incidents(&mut rig, 0);
    let trips =
        trips.incidents.iter().filter(|incident| matches!(incident, Incident::Tripped { .. }));
    assert_eq!(trips.count(), 1);
}

#[test]
fn a_latched_e_stop_stays_latched() {
    let mut rig = bench::rmd_axes(1);
    bench::e_stop(&mut rig);
    rig.reset();
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 0 })), Err(Error::EStopped {}));
}

#[test]
fn the_configuration_is_the_same_to_the_last_parameter() {
    let mut rig = bench::rmd_axes(2);
    bench::parameter(&mut rig, 1, AxisParameter::VelocityLimitRadS, Value::Float(3.5));
    bench::parameter(&mut rig, 1, AxisParameter::Direction, Value::Signed(-1));
    let all = |rig: &mut Rig| -> Vec<_> {
        let read = |axis, parameter: &AxisParameter| requests::ReadAxisParameter {
            axis,
            parameter: parameter.number(),
        };
        let wanted = (0..3)
            .flat_map(|axis| AxisParameter::ALL.iter().map(move |parameter| read(axis, parameter)));
        wanted.map(|request| rig.ask(Request::ReadAxisParameter(request)).unwrap()).collect()
    };
    let before = all(&mut rig);
    rig.reset();
    bench::hello(&mut rig);
    assert_eq!(all(&mut rig), before);
    // Twice in a row, and with a change between: the newer copy counts.
    bench::hello_again(&mut rig);
    run_with_host(&mut rig, 50_000);
    bench::parameter(&mut rig, 1, AxisParameter::VelocityLimitRadS, Value::Float(4.5));
    let before = all(&mut rig);
    rig.reset();
    bench::hello(&mut rig);
    assert_eq!(all(&mut rig), before);
}

#[test]
fn a_removed_axis_does_not_come_back() {
    let mut rig = bench::rmd_axes(2);
    rig.ask(Request::RemoveAxis(requests::RemoveAxis { axis: 1 })).unwrap();
    rig.reset();
    bench::hello(&mut rig);
    assert_eq!(axes(&mut rig), [0]);
    run_with_host(&mut rig, 50_000);
    assert!(!rig.sent_since(0, 0).contains(&NODE_2_HOLD));
}

#[test]
fn memory_without_power_is_believed_nowhere() {
    let garbage: [fn(u32) -> u32; 4] =
        [|_| 0, |_| u32::MAX, |index| index, |index| index.wrapping_mul(0x9E37_79B9)];
    for word in garbage {
        let mut rig = moving();
        rig.memory = (0..).map(word).take(rig.memory.len()).collect();
        rig.reset();
        assert!(!rig.gateway.stops_under_way());
        bench::hello(&mut rig);
        run_with_host(&mut rig, 50_000);
        assert_eq!(rig.wire, []);
        assert_eq!(axes(&mut rig), []);
        assert_eq!(bench::incidents(&mut rig, 0).incidents.len(), 1);
    }
}

#[test]
fn a_flipped_bit_costs_one_change_and_never_makes_something_up() {
    let rig = moving();
    let memory = rig.memory;
    for bit in (0..memory.len() * 32).step_by(97) {
        let mut rig = moving();
        rig.memory.clone_from(&memory);
        rig.memory[bit / 32] ^= 1 << (bit % 32);
        rig.reset();
        rig.run(20_000);
        for (_, bus, text) in &rig.wire {
            assert_eq!(*bus, 0);
            assert!(text.starts_with("141#") || text.starts_with("142#"), "bit {bit}: {text}");
            assert!(["81", "9C"].contains(&&text[4..6]), "bit {bit}: {text}");
        }
    }
}

#[test]
fn a_motor_that_is_gone_after_the_reset_does_not_keep_the_hosts_out_for_ever() {
    let mut rig = moving();
    rig.cut();
    rig.reset();
    rig.run(100_000);
    // The board opens its links now: 100 ms have passed.
    assert!(rig.gateway.stops_under_way());
    bench::hello(&mut rig);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}

#[test]
fn a_tripped_motor_that_stays_mute_becomes_unreachable_again() {
    let mut rig = moving();
    rig.instead(|_| Instead::Nothing);
    rig.reset();
    bench::hello(&mut rig);
    run_with_host(&mut rig, 600_000);
    assert!(!rig.gateway.enable_output());
}

#[test]
fn buses_of_all_kinds_and_protocols_are_stopped() {
    let mut rig = bench::rmd_axes(1);
    bench::configure_bus(&mut rig, 1, 210_526, &[Protocol::D5]);
    bench::configure_axis(&mut rig, 1, 1, Protocol::D5, 0x0B, StopAction::Hold);
    bench::configure_bus(&mut rig, 2, 115_200, &[Protocol::Rmd]);
    bench::configure_axis(&mut rig, 2, 2, Protocol::Rmd, 1, StopAction::Coast);
    bench::configure_axis(&mut rig, 3, 0, Protocol::Thruster, 0x0B, StopAction::Coast);
    rig.reset();
    rig.run(10_000);
    let mut first = rig.sent_since(0, 0)[..2].to_vec();
    first.sort_unstable();
    assert_eq!(first, [HOLD, "30B#5443000000000000"]);
    assert_eq!(rig.sent_since(1, 0)[0], "00B#D50B050320000033");
    assert_eq!(rig.sent_since(2, 0)[0], "3E01088000000000000000F369");
}

#[test]
fn on_a_bus_that_the_board_can_no_longer_run_what_moved_is_unreachable_until_it_can() {
    let mut rig = moving();
    bench::configure_bus(&mut rig, 2, 115_200, &[Protocol::Rmd]);
    bench::configure_axis(&mut rig, 2, 2, Protocol::Rmd, 1, StopAction::Coast);
    rig.reset_as(&BOARD_WITHOUT_CAN);
    assert!(!rig.gateway.enable_output(), "nothing stops the motor on CAN");
    rig.run(10_000);
    assert_eq!(rig.sent_since(2, 0)[0], "3E01088000000000000000F369", "RS485 runs");
    assert_eq!(rig.sent_since(0, 0), [""; 0]);
    assert_eq!(rig.gateway.bus_setup(0), None, "no port starts it");
    bench::hello(&mut rig);
    assert_eq!(axes(&mut rig), [0, 1, 2]);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
    let not_confirmed = Err(Error::StopNotConfirmed { axis: 0 });
    assert_eq!(clear(&mut rig, 0), not_confirmed);
    let arm = rig.ask(Request::Arm(requests::Arm { axis: 1 }));
    assert!(arm.is_err(), "{arm:?}");
    // It has its clock again.
    rig.reset();
    rig.run(1_000);
    assert!(rig.sent_since(0, 0).contains(&HOLD));
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    assert!(rig.gateway.enable_output());
}

/// The same when power comes: what is stored is all that is known of the motors.
#[test]
fn a_stored_can_bus_that_the_board_cannot_run_costs_no_stop_on_another() {
    let mut rig = bench::rmd_axes(1);
    bench::configure_bus(&mut rig, 2, 115_200, &[Protocol::Rmd]);
    bench::configure_axis(&mut rig, 2, 2, Protocol::Rmd, 1, StopAction::Coast);
    let rows = rig.rows();
    rig.power_on_as(&BOARD_WITHOUT_CAN, &rows);
    rig.handle(Event::EStopInput { open: false });
    rig.run(10_000);
    assert_eq!(rig.sent_since(2, 0)[0], "3E01088000000000000000F369", "RS485 runs");
    assert_eq!((rig.sent_since(0, 0), rig.gateway.bus_setup(0)), (vec![], None));
    bench::hello(&mut rig);
    assert_eq!(axes(&mut rig), [0, 2]);
    let stored = rig.ask(Request::ReadStored(requests::ReadStored {}));
    let Ok(Reply::ReadStored(stored)) = stored else { panic!("{stored:?}") };
    assert_eq!(stored.state, StoredState::Kept { differs: false });
    assert_eq!(rig.rows(), rows);
    // It has its clock again.
    rig.reset();
    rig.run(1_000);
    assert!(rig.sent_since(0, 0).contains(&HOLD));
    assert!(rig.gateway.enable_output());
}

/// Words that are remembered stand for what is stored elsewhere, so they must be whole by then.
#[test]
fn a_reset_in_the_first_event_after_power_came_leaves_what_is_stored_to_be_loaded() {
    let mut rig = bench::rmd_axes(2);
    let rows = rig.rows();
    rig.power_on_as(&BOARD_AGAIN, &rows);
    let (now, mut words, mut remembered) = (rig.now(), rig.memory.clone(), Vec::new());
    let mut stored = 0;
    let event = Event::EStopInput { open: false };
    rig.gateway.handle(now, event, &mut |index, word| {
        words[index] = word;
        stored += 1;
        if Gateway::is_remembered(&words) {
            remembered.push((stored, words.clone()));
        }
    });
    assert!(stored > 1_000 && remembered.len() <= 2, "{} of {stored}", remembered.len());
    for (behind, words) in remembered {
        rig.memory = words;
        rig.reset();
        bench::hello(&mut rig);
        assert_eq!(axes(&mut rig), [0, 1], "behind {behind} words");
        let status = rig.ask(Request::GatewayStatus(requests::GatewayStatus {}));
        let Ok(Reply::GatewayStatus(status)) = status else { panic!("{status:?}") };
        assert!(!status.e_stop_latched && !status.memory_damaged, "behind {behind} words");
    }
}

/// Its motor answers no stop: in one event it trips and is out of reach, and the board is reset
/// before the history is stored.
#[test]
fn an_axis_that_becomes_unreachable_in_the_event_before_a_reset_is_unreachable_after_it() {
    let stopping = || {
        let mut rig = moving();
        rig.instead(|_| Instead::Nothing);
        rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
        rig
    };
    let mut rig = stopping();
    while rig.gateway.enable_output() {
        assert!(rig.now_us < 5_000_000, "{:?}", listed(&mut rig, 0));
        rig.run(100);
    }
    let at = rig.now_us;
    let mut rig = stopping();
    while rig.now_us + 100 < at {
        rig.run(100);
    }
    rig.now_us = at;
    rig.take_in(Event::Tick);
    assert!(!rig.gateway.enable_output(), "nothing stops the motor");
    rig.reset();
    assert!(!rig.gateway.enable_output(), "nothing did before");
    bench::hello(&mut rig);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}

/// Nobody's axis is on it, and it is open for raw frames.
#[test]
fn a_bus_without_axes_runs_after_a_reset() {
    for is_open in [false, true] {
        let mut rig = Rig::new();
        bench::hello(&mut rig);
        bench::configure_bus(&mut rig, 0, 1_000_000, &[host_protocol::Protocol::Rmd]);
        if is_open {
            rig.ask(Request::RawOpen(requests::RawOpen { bus: 0, unsafe_access: true })).unwrap();
        }
        rig.reset();
        assert!(rig.gateway.bus_setup(0).is_some(), "{is_open}");
    }
}
