//! What a user does, on every bus, with the bytes on the wires as the motors' manuals print them.

use std::time::Duration;

use host_protocol::{
    AxisParameter, AxisState, BootReason, BusKind, BusState, CanFrame, Change, Error, Event,
    MotorTimeout, RawFrame, Reading, Setpoint, StopTarget, TripReason, Value,
};
use mgw_client::{ClientError, Hold};
use mgw_sim::{Motor, MotorEvent};
use virtual_board::board::Board;

use crate::lab::{
    AXES, BUS_D5, BUS_RMD_AND_THRUSTER, D5, Lab, NAMES, RMD, RMD_RS485, SEED, SPEEDS_RAD_S, STOPS,
    THRUSTER, TTL, bus_of, bus_rs485, trips,
};
use crate::reaction::stop_within;
use crate::wire;

/// From the end of a frame until the core has heard of it.
const TOLD: Duration = Duration::from_micros(100);
const SETTLE: Duration = Duration::from_millis(20);

#[test]
fn hello_names_the_board_the_build_and_the_buses() {
    let lab = Lab::power_on(SEED);
    let hello = lab.client.hello();
    assert_eq!(hello.board, Board::chosen().name());
    assert!(!hello.build_id.is_empty() && !hello.firmware.is_empty());
    assert_eq!(hello.boot, BootReason::PowerOn);
    let buses: Vec<_> = hello.buses.iter().map(|bus| (bus.kind, bus.bitrates.to_vec())).collect();
    let can = vec![1_000_000, 800_000, 500_000, 250_000, 210_526, 125_000, 100_000, 50_000];
    let rs485 = vec![115_200, 500_000, 1_000_000, 1_500_000, 2_000_000];
    let mut expected = vec![(BusKind::Can, can); Board::chosen().can_ports.len()];
    expected.push((BusKind::Rs485, rs485));
    assert_eq!(buses, expected);
    assert!((60_000..1_000_000).contains(&hello.time_us), "{} µs", hello.time_us);
}

/// RMD V3.6 §2.17.4 (current 1 A), thruster manual §1.3 (signal −5 %), D5 manual, common commands 2
/// (600 °/s), and RMD V3.6 §2.13.4 over RS485 (read status 2).
#[test]
fn the_manuals_bytes_are_on_the_wires() {
    let mut lab = Lab::configured();
    let since = lab.now();
    let holds = lab.arm(&[RMD, THRUSTER, D5]);
    let setpoints = [
        Setpoint::Current { current_a: 1.0 },
        Setpoint::Signal { fraction: -0.05 },
        Setpoint::Velocity { velocity_rad_s: 10.471_976 },
    ];
    for (hold, setpoint) in holds.into_iter().zip(setpoints) {
        let Hold { axis, epoch, ttl, .. } = hold;
        lab.client.set(axis, epoch, setpoint, ttl).expect("taken over");
    }
    lab.report(RMD_RS485);
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(Duration::from_millis(50));
    let expected = [
        (BUS_RMD_AND_THRUSTER, "141#A100000064000000"),
        (BUS_RMD_AND_THRUSTER, "30B#544300000000FFFB"),
        (BUS_D5, "00B#D50B05032058028D"),
        (bus_rs485(), "3E01089C00000000000000F230"),
    ];
    for (bus, text) in
        expected.into_iter().chain(AXES.map(|axis| (bus_of(axis), STOPS[usize::from(axis)])))
    {
        lab.first(bus, since, text);
    }
}

/// A list of changes is refused as a whole and made as a whole; a bus that is no longer configured
/// stops, with its controller, and starts again.
#[test]
fn changes_of_the_configuration_are_made_together_or_not_at_all() {
    let mut lab = Lab::configured();
    let set = |axis, parameter: AxisParameter, value| Change::Axis {
        axis,
        parameter: parameter.number(),
        value: Some(Value::Float(value)),
    };
    let limit = set(RMD, AxisParameter::VelocityLimitRadS, 9.0);
    let is_limited = |lab: &mut Lab| {
        let (settings, _) = lab.client.axis_settings(RMD).expect("told");
        let number = AxisParameter::VelocityLimitRadS.number();
        settings.iter().any(|setting| setting.parameter == number)
    };
    let make = |lab: &mut Lab, changes: &[Change]| {
        lab.client.begin_changes().expect("begun");
        lab.client.add_changes(changes).expect("added");
        lab.client.apply_changes()
    };
    // An RMD has no signal to limit.
    let off = Change::Bus { bus: BUS_D5, config: None };
    let refused = make(
        &mut lab,
        &[limit.clone(), off.clone(), set(RMD_RS485, AxisParameter::SignalLimit, 0.5)],
    );
    let parameter = AxisParameter::SignalLimit.number();
    let expected = Error::CannotMeasure { axis: RMD_RS485, parameter };
    assert!(
        matches!(refused, Err(ClientError::Gateway(error)) if error == expected),
        "{refused:?}"
    );
    assert!(!is_limited(&mut lab));
    let running = lab.client.bus_status(BUS_D5).expect("told").config;
    assert!(running.is_some());
    make(&mut lab, &[limit, off]).expect("made");
    assert!(is_limited(&mut lab));
    assert_eq!(lab.client.bus_status(BUS_D5).expect("told").state, BusState::Unconfigured);
    assert!(lab.client.arm(D5).is_err());
    make(&mut lab, &[Change::Bus { bus: BUS_D5, config: running }]).expect("made");
    lab.stay(SETTLE);
    lab.moving(&[RMD, D5]);
    lab.client.stop(StopTarget::All).expect("stopped");
}

/// The controller and the probe count a frame's bits apart.
#[test]
fn a_frame_takes_the_time_of_its_bits() {
    let mut lab = Lab::configured();
    let since = lab.now();
    lab.report(RMD);
    let request = lab.first(BUS_RMD_AND_THRUSTER, since, "141#9C00000000000000");
    let heard = {
        let mut machine = lab.machine.borrow_mut();
        let heard = machine
            .node(lab.probes[0])
            .heard()
            .iter()
            .find(|heard| heard.valid_at > since)
            .copied();
        heard.expect("the probe hears it too")
    };
    assert_eq!(heard.first_bit(1e6), request.first_bit);
    // Valid one bit before its end.
    assert_eq!(heard.valid_at + Duration::from_micros(1), request.end);
    // 108 bits of frame (8 bytes, 11-bit id), and 13 stuff bits: 64 bits of data, nearly all zeros,
    // get one for every four.
    assert_eq!(request.end - request.first_bit, Duration::from_micros(108 + 13));
}

#[test]
fn four_kinds_of_motor_turn_as_fast_as_they_are_told() {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    lab.keep(&holds, Duration::from_millis(200));
    for axis in AXES {
        lab.assert_turning(axis);
        assert_eq!(lab.report(axis).state, AxisState::Active);
    }
    assert_eq!(trips(&lab.events()), []);
}

#[test]
fn states_are_told_in_si_units() {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    for (axis, name) in AXES.into_iter().zip(NAMES) {
        lab.keep(&holds, Duration::from_millis(40));
        let report = lab.report(axis);
        let (speed, position) =
            lab.motor(axis, |motor| (motor.speed_rad_s(), motor.position_rad()));
        let told = |reading: Option<Reading>| f64::from(reading.expect("it was read").value);
        // D5 tells whole degrees per second, the thruster whole revolutions per minute.
        assert!(
            (told(report.velocity_rad_s) - speed).abs() < 0.15,
            "{name}: {report:?}, really {speed}"
        );
        if axis != THRUSTER {
            // As far as it turned while the answer was on its way.
            let turned = (SPEEDS_RAD_S[usize::from(axis)] * 0.02).abs();
            assert!(
                (told(report.position_rad) - position).abs() < turned,
                "{name}: {report:?}, really {position}"
            );
        }
        assert_eq!(report.faults.expect("it was read").word, 0, "{name}");
        assert_eq!(report.trip, None);
        let timeout = if axis == D5 {
            MotorTimeout::Verified
        } else {
            MotorTimeout::Written { timeout_ms: 1_000 }
        };
        assert_eq!(report.motor_timeout, timeout, "{name}");
    }
    let report = lab.report(RMD);
    let volts = report.voltage_v.expect("it was read").value;
    assert!((20.0..60.0).contains(&volts), "{volts} V");
    let celsius = report.motor_temperature_c.expect("it was read").value;
    assert!((10.0..60.0).contains(&celsius), "{celsius} °C");
}

#[test]
fn a_position_is_reached_and_held() {
    const TARGET_RAD: f32 = 1.0;
    let mut lab = Lab::configured();
    let mut holds = lab.arm(&[RMD, RMD_RS485]);
    let from = [RMD, RMD_RS485].map(|axis| lab.motor(axis, Motor::position_rad));
    assert_eq!(from, [0.0; 2]);
    for hold in &mut holds {
        hold.setpoint = Setpoint::Position { position_rad: TARGET_RAD, speed_limit_rad_s: 5.0 };
    }
    lab.keep(&holds, Duration::from_secs(1));
    for axis in [RMD, RMD_RS485] {
        let (position, speed) =
            lab.motor(axis, |motor| (motor.position_rad(), motor.speed_rad_s()));
        assert!((position - f64::from(TARGET_RAD)).abs() < 0.02, "axis {axis}: {position} rad");
        assert!(speed.abs() < 0.01, "axis {axis}: {speed} rad/s");
    }
}

#[test]
fn raw_frames_pass_both_ways_on_can() {
    let mut lab = Lab::configured();
    let since = lab.now();
    lab.client.raw_open(BUS_RMD_AND_THRUSTER).expect("open");
    let request = CanFrame::standard(0x141, &[0x9C, 0, 0, 0, 0, 0, 0, 0]).expect("a frame");
    lab.client.raw_send(BUS_RMD_AND_THRUSTER, RawFrame::Can(request)).expect("taken over");
    lab.stay(SETTLE);
    let foreign = CanFrame::extended(0x1234_5678, &[1, 2, 3]).expect("a frame");
    let now = lab.now();
    let probe = lab.probes[0];
    lab.machine.borrow_mut().node(probe).send(now, &foreign);
    lab.stay(SETTLE);
    let sent = lab.first(BUS_RMD_AND_THRUSTER, since, "141#9C00000000000000");
    let frames = lab.client.raw_receive(BUS_RMD_AND_THRUSTER).expect("frames");
    assert_eq!(frames.dropped, 0);
    let on_wire = lab.wire(BUS_RMD_AND_THRUSTER, sent.end);
    let [reply, stranger] = &on_wire[..] else { panic!("{on_wire:?}") };
    assert_eq!(&reply.text[..6], "241#9C");
    assert_eq!(stranger.text, "12345678#010203");
    let received: Vec<_> = frames.frames.iter().map(|received| received.frame.clone()).collect();
    let RawFrame::Can(first) = &received[0] else { panic!("{received:?}") };
    assert_eq!(wire::hex(first.data()), reply.text[4..]);
    assert_eq!(received[1], RawFrame::Can(foreign));
    // In gateway time, as far apart as they were on the wire.
    let apart = frames.frames[1].time_us - frames.frames[0].time_us;
    let really = (stranger.end - reply.end).as_micros();
    assert!(u128::from(apart).abs_diff(really) <= 20, "{apart} µs, really {really} µs");
}

#[test]
fn raw_frames_pass_both_ways_on_rs485() {
    const READ_STATUS_2: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    let mut lab = Lab::configured();
    let since = lab.now();
    lab.client.raw_open(bus_rs485()).expect("open");
    let bytes = host_protocol::Bytes::from_slice(&READ_STATUS_2).expect("short enough");
    lab.client.raw_send(bus_rs485(), RawFrame::Serial(bytes)).expect("taken over");
    lab.stay(SETTLE);
    lab.first(bus_rs485(), since, "3E01089C00000000000000F230");
    let mut received = Vec::new();
    for frame in lab.client.raw_receive(bus_rs485()).expect("frames").frames {
        let RawFrame::Serial(bytes) = frame.frame else { panic!("{:?}", frame.frame) };
        received.extend_from_slice(&bytes);
    }
    // Head, command, 25 °C, no current, speed and angle 0, and a checksum. The port hears itself,
    // but tells only of others.
    assert_eq!(wire::hex(&received), "3E01089C190000000000007AF1");
}

#[test]
fn an_expired_setpoint_trips_and_the_stop_is_confirmed_and_in_the_motors_own_log() {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    lab.events();
    let since = lab.now();
    lab.stay(Duration::from_millis(800));
    let events = lab.events();
    assert_eq!(trips(&events), AXES.map(|axis| (axis, TripReason::SetpointExpired)));
    for axis in AXES {
        let stop = lab.first_stop(axis, since);
        assert!(stop.first_bit <= since + TTL + stop_within(axis), "{stop:?} after {since:?}");
        let confirmed = events.iter().find_map(|event| match event {
            Event::StopConfirmed { axis: of, reaction_us, .. } if *of == axis => Some(*reaction_us),
            _ => None,
        });
        let reaction = Duration::from_micros(confirmed.expect("a confirmation").into());
        assert!(
            reaction <= stop_within(axis) + (stop.end - stop.first_bit) + TOLD,
            "axis {axis}: {reaction:?}"
        );
        lab.assert_stopped_by_gateway(axis, since);
        let log = lab.motor_log(axis, since);
        let stop = ["0x81 stop", "TC 0", "03 speed 0", "0x81 stop"][usize::from(axis)];
        assert!(log.contains(&MotorEvent::CommandReceived { name: stop }), "axis {axis}: {log:?}");
        assert_eq!(lab.trip(axis), Some((TripReason::SetpointExpired, true)));
    }
}
