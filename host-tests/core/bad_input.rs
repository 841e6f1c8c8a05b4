//! Bad input is named and moves nothing.

use crate::bench::{self, arm, setpoint};
use crate::rig::{Rig, Said};
use host_protocol::{
    AuthorityLossReason, AxisParameter, Bytes, Error, Event as HostEvent, FixedU32, Kind,
    MAX_FRAME, Protocol, Quantity, RawFrame, Reply, Request, Setpoint, StateFields, StopAction,
    Value, encode_body, requests,
};

const CURRENT: Setpoint = Setpoint::Current { current_a: 1.0 };

/// Nothing that could move a motor of any protocol has been sent on any bus, since the start.
fn no_motion(rig: &Rig) {
    for text in (0..3).flat_map(|bus| rig.sent_since(bus, 0)) {
        assert!(!moves(text), "{text}");
    }
}

/// RMD 0xA1 to 0xA8, thruster VC, LA and TC other than 0, D5 speeds other than 0, written at once
/// or to wait.
fn moves(text: &str) -> bool {
    let data = match text.split_once('#') {
        Some((_, data)) => data,
        None => text.strip_prefix("3E0108").unwrap_or(text),
    };
    let d5_speed = data.starts_with("D5") && matches!(data.get(6..10), Some("0320" | "0420"));
    data.starts_with('A')
        || data.starts_with("5643")
        || data.starts_with("4C41")
        || (data.starts_with("5443") && data != "5443000000000000")
        || (d5_speed && data.get(10..14) != Some("0000"))
}

#[test]
fn what_moves_is_told_from_what_does_not() {
    let moving = [
        "141#A100000064000000",
        "3E0108A20000006216",
        "30B#544300000000FFFB",
        "30B#564300000000001E",
        "30B#4C41012CFFFFF8F9",
        "00B#D50B05032058028D",
        "00B#D50B05042058028E",
    ];
    assert!(moving.into_iter().all(moves));
    let still = [
        "141#8100000000000000",
        "3E01089C00000000000000F230",
        "30B#5443000000000000",
        "30B#51560000",
        "00B#D50B050320000033",
        "00B#D50B050226000038",
    ];
    assert!(!still.into_iter().any(moves));
}

#[test]
fn an_unknown_axis_is_named_with_how_many_there_are() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let request = Request::Arm(requests::Arm { axis: 32 });
    assert_eq!(rig.ask(request), Err(Error::UnknownAxis { axis: 32, max_axes: 32 }));
}

#[test]
fn nan_and_out_of_limit_setpoints_are_refused_with_the_bounds() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::CurrentLimitA, Value::Float(2.0));
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 80_000, Setpoint::Current { current_a: f32::NAN });
    assert_eq!(rig.ask(request), Err(Error::NotANumber { quantity: Quantity::Current }));
    let request = setpoint(&rig, epoch, 80_000, Setpoint::Current { current_a: 2.5 });
    let refused =
        Error::OutOfRange { quantity: Quantity::Current, value: 2.5, min: -2.0, max: 2.0 };
    assert_eq!(rig.ask(request), Err(refused));
    no_motion(&rig);
}

#[test]
fn what_the_wire_cannot_carry_is_refused_not_clamped() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 80_000, Setpoint::Current { current_a: 400.0 });
    let limit = 327.67;
    let refused =
        Error::OutOfRange { quantity: Quantity::Current, value: 400.0, min: -limit, max: limit };
    assert_eq!(rig.ask(request), Err(refused));
    no_motion(&rig);
}

#[test]
fn modes_a_protocol_does_not_have_are_unsupported() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 80_000, Setpoint::Signal { fraction: 0.1 });
    assert_eq!(rig.ask(request), Err(Error::Unsupported { axis: 0, protocol: Protocol::Rmd }));
    no_motion(&rig);
    let (mut rig, _) = bench::thruster();
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 80_000, CURRENT);
    assert_eq!(rig.ask(request), Err(Error::Unsupported { axis: 0, protocol: Protocol::Thruster }));
    no_motion(&rig);
}

#[test]
fn a_slow_thruster_speed_is_refused_with_what_is_allowed() {
    let (mut rig, _) = bench::thruster();
    let epoch = arm(&mut rig);
    // 9.5 rpm
    let request = setpoint(&rig, epoch, 80_000, Setpoint::Velocity { velocity_rad_s: 1.0 });
    let Err(Error::OutOfRange { quantity: Quantity::Velocity, min, .. }) = rig.ask(request) else {
        panic!()
    };
    assert_eq!(min, core::f32::consts::PI); // 30 rpm
    no_motion(&rig);
}

/// -4370 rpm has the bytes with which a thruster refuses (§1.3): the range does not hold it.
#[test]
fn the_thruster_speed_that_reads_as_a_refusal_is_refused_with_what_is_allowed() {
    let rpm = |rpm: f32| rpm * core::f32::consts::PI / 30.0;
    for direction in [1, -1] {
        let (mut rig, _) = bench::thruster();
        bench::parameter(&mut rig, 0, AxisParameter::Direction, Value::Signed(direction));
        let epoch = arm(&mut rig);
        let value = if direction < 0 { rpm(4370.0) } else { rpm(-4370.0) };
        let request = setpoint(&rig, epoch, 80_000, Setpoint::Velocity { velocity_rad_s: value });
        let Err(Error::OutOfRange { quantity: Quantity::Velocity, min, max, .. }) =
            rig.ask(request)
        else {
            panic!("no refusal with a range")
        };
        no_motion(&rig);
        assert!(!(min..=max).contains(&value), "{value} in {min} to {max}");
        for allowed in [min, max] {
            assert!((29.9..4369.1).contains(&(allowed.abs() / rpm(1.0))), "{allowed}");
            let velocity = Setpoint::Velocity { velocity_rad_s: allowed };
            rig.ask(setpoint(&rig, epoch, 80_000, velocity)).expect("allowed");
        }
    }
}

#[test]
fn a_position_without_speed_limit_is_refused() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let position = Setpoint::Position { position_rad: 1.0, speed_limit_rad_s: 0.0 };
    let request = setpoint(&rig, epoch, 80_000, position);
    assert_eq!(rig.ask(request), Err(Error::SpeedLimitZero { axis: 0 }));
    no_motion(&rig);
}

#[test]
fn an_axis_without_stop_action_is_not_armed() {
    let mut rig = Rig::new();
    bench::hello(&mut rig);
    bench::configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd]);
    for (parameter, value) in
        [(AxisParameter::Bus, 0), (AxisParameter::Protocol, 1), (AxisParameter::Node, 1)]
    {
        bench::parameter(&mut rig, 0, parameter, Value::Unsigned(value));
    }
    let missing = Error::NotConfigured { axis: 0, parameter: AxisParameter::StopAction.number() };
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 0 })), Err(missing));
}

#[test]
fn a_stop_action_the_protocol_does_not_have_is_refused() {
    let (mut rig, _) = bench::thruster();
    let hold = requests::ConfigureAxis {
        axis: 0,
        parameter: AxisParameter::StopAction.number(),
        value: Value::Unsigned(2),
    };
    let refused = Err(Error::Unsupported { axis: 0, protocol: Protocol::Thruster });
    assert_eq!(rig.ask(Request::ConfigureAxis(hold)), refused);
}

#[test]
fn an_empty_raw_frame_is_refused() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    rig.ask(Request::RawOpen(requests::RawOpen { bus: 2, unsafe_access: false })).unwrap();
    let empty = RawFrame::Serial(Bytes::new());
    let refused =
        Error::OutOfRange { quantity: Quantity::FrameLength, value: 0.0, min: 1.0, max: 64.0 };
    assert_eq!(rig.ask(Request::RawSend(requests::RawSend { bus: 2, frame: empty })), Err(refused));
    assert!(rig.wire.is_empty());
}

#[test]
fn a_million_random_bytes_do_nothing_and_the_next_frame_is_answered() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let (wire, mut random) = (rig.wire.len(), fastrand::Rng::with_seed(1));
    for _ in 0..1_000 {
        let chunk: Vec<u8> = std::iter::repeat_with(|| random.u8(..)).take(1_000).collect();
        rig.bytes(&chunk);
    }
    assert_eq!(rig.wire.len(), wire);
    assert!(matches!(rig.ask(Request::Ping(requests::Ping {})), Ok(Reply::Ping(_))));
    assert!(
        rig.said.iter().any(|said| matches!(said, Said::Event(HostEvent::FrameRejected { .. })))
    );
}

#[test]
fn another_major_version_is_refused() {
    let mut rig = Rig::new();
    let hello = requests::Hello { protocol_major: 2, protocol_minor: 0, session: 1 };
    let refused = Error::UnsupportedVersion { gateway_major: 1, host_major: 2 };
    assert_eq!(rig.ask(Request::Hello(hello)), Err(refused));
}

/// Requests that nobody can read, cut off or at odds with themselves, are no sign of a host that
/// knows what it does (GUARANTEES G3); what is repeated, is.
#[test]
fn a_host_that_sends_rubbish_is_silent() {
    let cut_off = (0x40, &[0, 1][..]);
    let no_setpoints = (0x46, &[0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0][..]);
    let ping = (0x02, &[][..]);
    for (sent, lost) in
        [(cut_off, true), (no_setpoints, true), ((0xFFF, &[][..]), true), (ping, false)]
    {
        let (mut rig, _) = bench::rmd(StopAction::Hold);
        arm(&mut rig);
        let mut frame = [0; MAX_FRAME];
        let length = encode_body(Kind::Request, 1, sent.0, sent.1, &mut frame).unwrap();
        for _ in 0..40 {
            rig.bytes(&frame[..length]);
            rig.run(10_000);
        }
        let silent = HostEvent::AuthorityLost { reason: AuthorityLossReason::Silence };
        assert_eq!(rig.events().contains(&&silent), lost, "{sent:?}");
    }
}

/// What there is is named, and nothing else changes.
#[test]
fn fields_that_there_are_not_are_refused() {
    let mut rig = bench::rmd_axes(1);
    let fields = StateFields::from_bits(0x81);
    let refused =
        Err(Error::OutOfRange { quantity: Quantity::Fields, value: 129.0, min: 0.0, max: 127.0 });
    let requests = [
        requests::Subscribe { axes: 1, fields, period_us: 10_000 }.into(),
        requests::RunCycle { axes: 1, fields, period_us: 10_000 }.into(),
        Request::Cycle(requests::Cycle {
            epoch: FixedU32(1),
            expires_at_us: FixedU32(0),
            fields,
            axes: 1,
            setpoints: [CURRENT].into_iter().collect(),
        }),
    ];
    for request in requests {
        assert_eq!(rig.ask(request), refused);
    }
}

/// The range with which a setpoint is refused is about this one.
fn assert_range(rig: &mut Rig, epoch: u32, value: Setpoint, (low, high): (f32, f32)) {
    let request = setpoint(rig, epoch, 80_000, value);
    let Err(Error::OutOfRange { min, max, .. }) = rig.ask(request) else { panic!("{value:?}") };
    assert!((min - low).abs() < 0.01 && (max - high).abs() < 0.01, "{value:?}: {min} to {max}");
}

/// The range is that of the motor and of the axis, whichever is narrower, and never an empty one.
#[test]
fn a_refusal_names_what_the_axis_takes() {
    const RPM: f32 = core::f32::consts::PI / 30.0;
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::PositionDevice, Value::Bool(true));
    let epoch = arm(&mut rig);
    let velocity = |velocity_rad_s| Setpoint::Velocity { velocity_rad_s };
    assert_range(&mut rig, epoch, velocity(1.0), (30.0 * RPM, 32_767.0 * RPM));
    assert_range(&mut rig, epoch, velocity(-1.0), (-32_767.0 * RPM, -30.0 * RPM));
    // 0xEEEE would read as a refusal.
    assert_range(&mut rig, epoch, velocity(-4_370.0 * RPM), (-4_369.0 * RPM, -30.0 * RPM));
    bench::disarm(&mut rig);
    rig.run(100_000);
    for (limit, range) in [(10.0, (30.0 * RPM, 10.0)), (2.0, (0.0, 0.0))] {
        bench::parameter(&mut rig, 0, AxisParameter::VelocityLimitRadS, Value::Float(limit));
        let epoch = arm(&mut rig);
        assert_range(&mut rig, epoch, velocity(1.0), range);
        bench::disarm(&mut rig);
        rig.run(100_000);
    }

    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    let impedance = |stiffness_nm_per_rad, damping_nm_s_per_rad| Setpoint::Impedance {
        position_rad: 0.0,
        velocity_rad_s: 0.0,
        stiffness_nm_per_rad,
        damping_nm_s_per_rad,
        torque_nm: 0.0,
    };
    assert_range(&mut rig, epoch, impedance(-1.0, 0.0), (0.0, 500.0));
    assert_range(&mut rig, epoch, impedance(0.0, -1.0), (0.0, 5.0));
}

#[test]
fn the_speed_limit_of_a_setpoint_is_never_rounded_up() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let epoch = arm(&mut rig);
    for (speed, sent) in
        [(1.0_f32, "0100"), (1.9, "0100"), (2.0, "0200"), (359.9, "6701"), (360.0, "6801")]
    {
        let since = rig.now_us;
        let position =
            Setpoint::Position { position_rad: 0.0, speed_limit_rad_s: speed.to_radians() };
        let request = setpoint(&rig, epoch, 80_000, position);
        rig.ask(request).unwrap();
        rig.run(1_000);
        let sent = format!("141#A400{sent}00000000");
        assert!(rig.sent_since(0, since).contains(&sent.as_str()), "{speed}");
    }
    // Below one unit there is nothing.
    let range = (1.0_f32.to_radians(), 65_535.0_f32.to_radians());
    for speed_limit_rad_s in [-1.0, 0.8_f32.to_radians(), 1e-9] {
        let value = Setpoint::Position { position_rad: 0.1, speed_limit_rad_s };
        assert_range(&mut rig, epoch, value, range);
    }
}
