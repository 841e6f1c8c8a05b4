//! The flight recorder: what the board has kept of a trip is read over a host link, and played again
//! by the core of a computer and by the image, every reason to trip that an armed axis has but the
//! core's own mistakes. (`Group` is another axis's trip, which is kept instead.)

use std::collections::HashSet;
use std::mem::discriminant;
use std::time::Duration;

use flight_recorder::Recording;
use host_protocol::{
    AxisParameter, CanFrame, ClearTarget, Error, Setpoint, StopTarget, TripReason, Value,
};
use mgw_cli::flight::{Replayed, play, told};
use mgw_client::{Client, ClientError};
use mgw_sim::{Injection, Turning};
use virtual_board::board::Board;
use virtual_board::machine::{CanPort, Machine};
use virtual_board::replay::replay;
use virtual_board::transport::BoardTransport;
use virtual_board::usb_session;
use virtual_stm32::fdcan::Wiring;

use crate::lab::{self, AXES, D5, Lab, RMD, RMD_RS485, SEED, THRUSTER};
use crate::part::{Part, part_of};

/// Enough for a stop and its confirmation, where there is one.
const STOP: Duration = Duration::from_millis(300);
/// Enough for a host to count as silent, and for all to stop.
const SILENCE: Duration = Duration::from_millis(800);
/// Enough for a stop to count as unconfirmed.
const UNCONFIRMED: Duration = Duration::from_millis(5_200);
/// Bytes of noise, some 130 ms without a pause.
const NOISE: usize = 1_500;
/// Frames of another node, some 100 ms without a gap.
const FLOOD: usize = 800;
/// A stall (RMD V3.6 §2.33.4, fault bits).
const STALLED: u16 = 0x0002;
/// By how much the trip of the image may differ here.
const CLOSE_US: i64 = 100;
/// What is no call of a recording.
const NO_CALL: u8 = 0x1E;
/// Of the sixteen reasons those that are the first of an armed axis.
const KINDS: usize = 13;
const MONTH_US: u64 = 30 * 24 * 3_600 * 1_000_000;

/// What a computer makes of what the board has kept.
#[track_caller]
fn replayed(lab: &mut Lab) -> (usize, Replayed, Vec<u8>) {
    let file = lab.client.flight_record().expect("it is read").expect("a trip was kept");
    let recording = Recording::read_file(&file).expect("a recording");
    let replayed = play(&recording, |_, _| {}).expect("a core of this build");
    assert!(replayed.is_same(), "{replayed:?}");
    let halves = recording.halves.len();
    drop(recording);
    (halves, replayed, file)
}

/// What the image makes of it.
#[track_caller]
fn replayed_on_image(file: &[u8]) {
    let replayed = replay(file).expect("an image of this build");
    assert!(replayed.is_same() && replayed.left_out.is_empty(), "{replayed:#?}");
    // Half of what is promised, so that what drifts is seen.
    assert!(replayed.late_us().is_some_and(|late| late.abs() <= CLOSE_US), "{replayed:#?}");
}

/// Has an axis of a board trip in mid-motion, and plays that again: on the core of a computer and on
/// the image. Returns which axis it was, and why.
#[track_caller]
fn trips_again(mut lab: Lab, fault: impl FnOnce(&mut Lab)) -> (u8, TripReason) {
    let holds = lab.moving(&AXES);
    fault(&mut lab);
    lab.keep(&holds, STOP);
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(STOP);
    found_again(&mut lab)
}

/// Plays what a board has kept again.
#[track_caller]
fn found_again(lab: &mut Lab) -> (u8, TripReason) {
    let (_, replayed, file) = replayed(lab);
    let (axis, recorded) = replayed.recorded.expect("a trip");
    let (from, to) = replayed.span_us;
    assert!(from < recorded.time_us && recorded.time_us < to, "{replayed:?}");
    assert_eq!(lab.report(axis).trip.map(told), Some(told(recorded)));
    replayed_on_image(&file);
    (axis, recorded.reason)
}

fn inject(axis: u8, injection: Injection) -> impl FnOnce(&mut Lab) {
    move |lab| lab.outside.inject(&mut lab.machine.borrow_mut(), axis.into(), injection)
}

/// The same with a fault of one motor.
#[track_caller]
fn trips_by(axis: u8, injection: Injection) -> TripReason {
    let (tripped, reason) = trips_again(Lab::configured(), inject(axis, injection));
    assert_eq!(tripped, axis, "{reason:?}");
    reason
}

fn limited(lab: &mut Lab, axis: u8, parameter: AxisParameter, limit: f32) {
    lab.client.configure_axis(axis, parameter, Value::Float(limit)).expect("a limit");
}

/// Every reason, and other causes of some.
const REASONS: [fn() -> TripReason; 16] = [
    a_silent_motor_on_each_bus,
    a_setpoint_that_expires,
    a_silent_host,
    an_e_stop_of_a_host_and_one_of_the_button,
    a_shorted_bus,
    a_cut_bus,
    a_fault_of_a_motor,
    a_motor_that_refuses,
    a_limit_that_is_exceeded,
    a_stop_that_a_motor_ignores,
    a_motor_that_turns_without_a_setpoint,
    a_frame_that_others_keep_from_the_bus,
    a_motor_that_restarts,
    a_setpoint_that_noise_keeps_from_its_line,
    a_silent_motor_of_a_quiet_host,
    what_came_over_usb_after_a_month,
];

/// 12 s of a processor each: see `part.rs`.
#[test]
fn every_reason_is_played_again_by_the_core_and_by_the_image() {
    let reasons = part_of(REASONS).map(|played_again| discriminant(&played_again()));
    let reasons: HashSet<_> = reasons.collect();
    assert!(Part::chosen().of > 1 || reasons.len() == KINDS, "{reasons:?}");
}

fn a_silent_motor_on_each_bus() -> TripReason {
    for axis in [RMD_RS485, D5] {
        assert_eq!(trips_by(axis, Injection::Mute(true)), TripReason::MotorSilent);
    }
    TripReason::MotorSilent
}

fn a_setpoint_that_expires() -> TripReason {
    let (_, reason) = trips_again(Lab::configured(), |lab| lab.stay(STOP));
    assert_eq!(reason, TripReason::SetpointExpired);
    reason
}

fn a_silent_host() -> TripReason {
    let mut lab = Lab::configured();
    AXES.into_iter().for_each(|axis| lab.set_ttl(axis, Duration::from_secs(10)));
    lab.moving(&AXES);
    lab.run_for(SILENCE);
    lab.client.reconnect().expect("hello");
    let (_, reason) = found_again(&mut lab);
    assert_eq!(reason, TripReason::HostSilent);
    reason
}

fn an_e_stop_of_a_host_and_one_of_the_button() -> TripReason {
    let (_, reason) = trips_again(Lab::configured(), |lab| lab.client.estop().expect("stopped"));
    assert_eq!(reason, TripReason::EStop);
    let (_, reason) =
        trips_again(Lab::configured(), |lab| lab.machine.borrow_mut().open_e_stop(true));
    assert_eq!(reason, TripReason::EStop);
    reason
}

fn a_shorted_bus() -> TripReason {
    let (axis, reason) = trips_again(Lab::configured(), |lab| {
        lab.machine.borrow_mut().wire_can(CanPort::Bus0, Wiring::Shorted);
    });
    assert!(axis == RMD || axis == THRUSTER, "{axis}");
    assert_eq!(reason, TripReason::BusOff);
    reason
}

fn a_cut_bus() -> TripReason {
    let (axis, reason) = trips_again(Lab::configured(), |lab| {
        lab.machine.borrow_mut().wire_can(CanPort::Bus1, Wiring::Cut);
    });
    assert_eq!((axis, reason), (D5, TripReason::NotAcknowledged));
    reason
}

fn a_fault_of_a_motor() -> TripReason {
    let reason = trips_by(RMD, Injection::FaultBits(STALLED));
    assert_eq!(reason, TripReason::MotorFault { faults: STALLED });
    reason
}

fn a_motor_that_refuses() -> TripReason {
    let reason = trips_by(THRUSTER, Injection::Refuse(true));
    assert!(matches!(reason, TripReason::CommandRefused { .. }), "{reason:?}");
    reason
}

fn a_limit_that_is_exceeded() -> TripReason {
    let mut lab = Lab::configured();
    limited(&mut lab, RMD, AxisParameter::TemperatureLimitC, 60.0);
    let (axis, reason) = trips_again(lab, inject(RMD, Injection::MotorTemperature(Some(80))));
    assert_eq!(axis, RMD);
    assert!(matches!(reason, TripReason::LimitExceeded { .. }), "{reason:?}");
    reason
}

fn a_stop_that_a_motor_ignores() -> TripReason {
    let mut lab = Lab::configured();
    lab.moving(&[RMD]);
    inject(RMD, Injection::IgnoreStop(true))(&mut lab);
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(UNCONFIRMED);
    assert_eq!(found_again(&mut lab), (RMD, TripReason::StopUnconfirmed));
    TripReason::StopUnconfirmed
}

fn a_motor_that_turns_without_a_setpoint() -> TripReason {
    let mut lab = Lab::configured();
    lab.arm(&AXES);
    lab.stay(STOP);
    let turning = Turning { speed: 3_000, turns: Duration::from_secs(1), holds: Duration::ZERO };
    inject(RMD, Injection::Turning(Some(turning)))(&mut lab);
    lab.stay(STOP);
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(STOP);
    assert_eq!(found_again(&mut lab), (RMD, TripReason::Uncommanded));
    TripReason::Uncommanded
}

fn a_frame_that_others_keep_from_the_bus() -> TripReason {
    let (axis, reason) = trips_again(Lab::configured(), |lab| {
        let (at, node) = (lab.now(), lab.probes[0]);
        let urgent = CanFrame::standard(0, &[0; 8]).expect("a frame");
        lab.machine.borrow_mut().drive_node(node, |probe, _| {
            (0..FLOOD).for_each(|_| probe.send(at, &urgent));
        });
    });
    assert!(axis == RMD || axis == THRUSTER, "{axis}");
    assert_eq!(reason, TripReason::NotAcknowledged);
    reason
}

fn a_setpoint_that_noise_keeps_from_its_line() -> TripReason {
    let (axis, reason) = trips_again(Lab::configured(), |lab| {
        // Between frames.
        lab.run_for(Duration::from_millis(5));
        let rs485 = lab.outside.rs485;
        lab.machine
            .borrow_mut()
            .drive_line(rs485, |line, timeline| line.disturb(&[0x55; NOISE], false, timeline));
    });
    assert_eq!((axis, reason), (RMD_RS485, TripReason::NotDelivered));
    reason
}

fn a_motor_that_restarts() -> TripReason {
    let mut lab = Lab::configured();
    let holds = lab.moving(&[RMD]);
    lab.keep(&holds, Duration::from_secs(1));
    lab.outside.power_cycle(&mut lab.machine.borrow_mut(), RMD.into());
    // Its run time is asked for every second.
    lab.keep(&holds, Duration::from_millis(1_300));
    assert_eq!(found_again(&mut lab), (RMD, TripReason::MotorRestarted));
    TripReason::MotorRestarted
}

/// Two axes, positions every 100 ms: the gateway's own polls decide when the silence is noticed.
fn a_silent_motor_of_a_quiet_host() -> TripReason {
    let (mut lab, ttl) = (Lab::configured(), Duration::from_secs(1));
    let axes = [RMD, RMD_RS485];
    axes.into_iter().for_each(|axis| lab.set_ttl(axis, ttl));
    let epochs = axes.map(|axis| lab.client.arm(axis).expect("armed").epoch);
    for step in 0..8 {
        if step == 5 {
            inject(RMD_RS485, Injection::Mute(true))(&mut lab);
        }
        let target = Setpoint::Position { position_rad: 0.1, speed_limit_rad_s: 1.0 };
        for (axis, epoch) in axes.into_iter().zip(epochs) {
            match lab.client.set(axis, epoch, target, ttl) {
                Ok(()) | Err(ClientError::Gateway(Error::Tripped { .. })) => {}
                Err(error) => panic!("{error:?}"),
            }
        }
        lab.stay(Duration::from_millis(100));
    }
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(STOP);
    assert_eq!(found_again(&mut lab), (RMD_RS485, TripReason::MotorSilent));
    TripReason::MotorSilent
}

/// A board that has run for a month, commanded over USB.
fn what_came_over_usb_after_a_month() -> TripReason {
    let (board, outside, probes) = lab::wired(SEED);
    let mut machine = board.power_on();
    machine.start_ahead(MONTH_US, Machine::builder().power_on());
    machine.run_for(Duration::from_millis(200));
    usb_session::connect(&mut machine);
    let mut lab = Lab::around(machine, outside, probes);
    lab.configure();
    lab.client.release_authority().expect("released");
    let mut usb = Client::connect_as(BoardTransport::usb(&lab.machine), 7, 1).expect("hello");
    let epoch = usb.arm(RMD).expect("armed").epoch;
    for _ in 0..20 {
        usb.set(RMD, epoch, lab::turning(RMD), lab::TTL).expect("set");
        lab.run_for(Duration::from_millis(20));
    }
    lab.run_for(STOP);
    assert_eq!(found_again(&mut lab), (RMD, TripReason::SetpointExpired));
    let at = lab.report(RMD).trip.expect("a trip").time_us;
    assert!(at > MONTH_US, "{at}");
    TripReason::SetpointExpired
}

/// Whoever takes half of the calls out of a recording has an image that does not trip as it did.
#[test]
fn an_image_that_does_otherwise_is_not_taken_for_the_same() {
    let mut lab = Lab::configured();
    let holds = lab.moving(&[RMD]);
    lab.keep(&holds, Duration::from_secs(1));
    lab.client.estop().expect("stopped");
    lab.stay(STOP);
    let (.., mut file) = replayed(&mut lab);
    let recording = Recording::read_file(&file).expect("a recording");
    let calls = recording.halves[0].bytes();
    let (begin, calls) = (calls.as_ptr().addr() - file.as_ptr().addr(), calls.len());
    drop(recording);
    file[begin + calls / 2..begin + calls].fill(NO_CALL);
    let length = file.len() - 4;
    let checksum = Recording::checksum(&file[..length]);
    file[length..].copy_from_slice(&checksum);
    let replayed = replay(&file).expect("an image of this build");
    assert_eq!(replayed.recorded.1.reason, TripReason::EStop);
    assert!(!replayed.is_same(), "{replayed:#?}");
}

#[test]
fn a_long_motion_keeps_the_latest_of_it_in_two_halves() {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    let error = lab.client.flight_record().expect_err("an axis moves");
    assert!(matches!(error, ClientError::Gateway(Error::FlightRecording {})), "{error:?}");
    for _ in 0..4 {
        lab.keep(&holds, Duration::from_secs(1));
        // It is told why this run was started, which the next one must not know otherwise.
        drop(lab.second_client());
    }
    lab.client.estop().expect("stopped");
    lab.stay(STOP);
    let first = &replayed(&mut lab);
    let (halves, kept, _) = first;
    assert_eq!(*halves, 2, "{kept:?}");
    let (from, to) = kept.span_us;
    println!("the last {} ms of it, {} calls", (to - from) / 1_000, kept.calls);
    let at_least = if Board::chosen() == Board::NucleoH743zi { 3_000_000 } else { 150_000 };
    assert!(to - from > at_least, "{kept:?}");
    // It stays until an axis is armed again, also over a reset.
    assert_eq!(&replayed(&mut lab), first);
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(Duration::from_millis(500));
    lab.client.reconnect().expect("hello");
    assert_eq!(&replayed(&mut lab), first);
    lab.client.clear(ClearTarget::Gateway).expect("cleared");
    lab.client.clear(ClearTarget::Axis(RMD_RS485)).expect("cleared");
    lab.arm(&[RMD_RS485]);
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(STOP);
    assert_eq!(lab.client.flight_record().expect("it is read"), None);
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(Duration::from_millis(500));
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.flight_record().expect("it is read"), None);
}
