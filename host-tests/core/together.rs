//! Several D5 motors started by one frame (D5 manual, quick start (3), (4) and (7); GUARANTEES G2,
//! G10).

use crate::bench::{
    self, D5_VELOCITY, arm_axis, configure_axis, keep_moving, listed, run_with_host,
};
use crate::rig::{Instead, Rig};
use gateway::{Event, Set};
use host_protocol::requests::{Member, StartTogether};
use host_protocol::{
    AxisParameter, AxisState, Error, Protocol, ProtocolSet, Quantity, Reply, Request, Setpoint,
    StopAction, TogetherBar, TripReason, Value, replies, requests,
};

const EXECUTE_ALL: &str = "0FE#D5FE050500000008";
/// 600 °/s of 0x0B and −600 °/s of 0x0C, to wait and at once.
const WAIT: [&str; 2] = ["00B#D50B05042058028E", "00C#D50C05042058820F"];
const NOW: [&str; 2] = ["00B#D50B05032058028D", "00C#D50C05032058820E"];
const STOPS: [&str; 2] = ["00B#D50B050320000033", "00C#D50C050320000034"];
const RAD_S: f32 = 10.471_976;

/// Motors 0x0B, 0x0C and 1 on bus 1 as axes 0, 1 and 2; each tells whether a write waits in it.
fn three() -> Rig {
    let (mut rig, _) = bench::d5();
    configure_bus(&mut rig, true);
    configure_axis(&mut rig, 1, 1, Protocol::D5, 0x0C, StopAction::Hold);
    configure_axis(&mut rig, 2, 1, Protocol::D5, 1, StopAction::Hold);
    let mut usual = std::mem::replace(&mut rig.motor, Box::new(|_, _, _| None));
    let mut waits = Vec::<String>::new();
    rig.motor = Box::new(move |now, bus, text| {
        let (id, command) = (text.get(6..8)?.to_owned(), text.get(10..12)?);
        match command {
            "04" => waits.push(id.clone()),
            "05" if id == "FE" => waits.clear(),
            "05" => waits.retain(|waiting| *waiting != id),
            _ => {}
        }
        if id == "FE" {
            return None;
        }
        let reply = usual(now, bus, text)?;
        if text.get(8..14) != Some("04022C") || !waits.contains(&id) {
            return Some(reply);
        }
        let sum = u8::from_str_radix(&id, 16).unwrap() + 0x33;
        Some(format!("{}#5D{id}04022C0100{sum:02X}", text.get(..3)?))
    });
    rig
}

fn configure_bus(rig: &mut Rig, exclusive: bool) {
    let protocols = ProtocolSet::of(&[Protocol::D5]);
    let request = requests::ConfigureBus {
        bus: 1,
        bitrate: 210_526,
        protocols,
        exclusive,
        reply_window_us: 5_000,
    };
    rig.ask(Request::ConfigureBus(request)).unwrap();
}

fn together(rig: &Rig, members: &[(u8, u32, f32)]) -> Request {
    let members = members
        .iter()
        .map(|(axis, epoch, velocity_rad_s)| Member {
            axis: *axis,
            epoch: *epoch,
            velocity_rad_s: *velocity_rad_s,
        })
        .collect();
    Request::StartTogether(StartTogether { expires_at_us: bench::expiry(rig, 90_000), members })
}

/// Axes 0 and 1, armed.
fn two_armed(rig: &mut Rig) -> [(u8, u32, f32); 2] {
    [(0, arm_axis(rig, 0), RAD_S), (1, arm_axis(rig, 1), -RAD_S)]
}

fn place(rig: &Rig, since_us: u64, text: &str) -> usize {
    let sent = rig.sent_since(1, since_us);
    sent.iter()
        .position(|sent| *sent == text)
        .unwrap_or_else(|| panic!("{text} is not among {sent:?}"))
}

#[test]
fn each_speed_waits_before_one_frame_starts_both() {
    let mut rig = three();
    let members = two_armed(&mut rig);
    let since = rig.now_us;
    let request = together(&rig, &members);
    assert_eq!(rig.ask(request), Ok(Reply::StartTogether(replies::Done {})));
    run_with_host(&mut rig, 10_000);
    let execute = place(&rig, since, EXECUTE_ALL);
    for (wait, read) in WAIT.into_iter().zip(["00B#D50B04022C00003D", "00C#D50C04022C00003E"]) {
        assert!(place(&rig, since, wait) < place(&rig, since, read));
        assert!(place(&rig, since, read) < execute);
    }
    // The motor that must not move is at speed 0, and nothing waits in it.
    assert!(
        place(&rig, since, "001#D501050320000029") < place(&rig, since, "001#D50104022C000033")
    );
    assert!(place(&rig, since, "001#D50104022C000033") < execute);
    // From then on each is a setpoint.
    assert!(NOW.into_iter().all(|now| place(&rig, since, now) > execute));
    let executes = rig.sent_since(1, since).iter().filter(|sent| **sent == EXECUTE_ALL).count();
    assert_eq!(executes, 1);
    assert_eq!([0, 1].map(|axis| listed(&mut rig, axis)), [AxisState::Active; 2]);
    run_with_host(&mut rig, 100_000);
    bench::assert_tripped(&mut rig, TripReason::SetpointExpired, true);
    assert!(STOPS.into_iter().all(|stop| place(&rig, since, stop) > execute));
}

/// One that came would have the id of the stop, which lets it have its turn: 1 ms and a frame of
/// 135 bits after the start, however busy the bus is.
#[test]
fn a_stop_waits_once_for_an_answer_to_the_common_start_that_no_manual_prints() {
    let mut rig = three();
    let members = two_armed(&mut rig);
    let request = together(&rig, &members);
    rig.ask(request).unwrap();
    let (started_at, ..) = *rig.left.iter().find(|(.., text)| text == EXECUTE_ALL).unwrap();
    rig.send(&Request::EStop(requests::EStop {}));
    for _ in 0..8 {
        rig.receive(1, "000#");
        rig.run(500);
    }
    let stops = rig
        .wire
        .iter()
        .filter(|(at, _, text)| *at >= started_at && STOPS.iter().any(|stop| stop == text));
    let waited: Vec<_> = stops.map(|(at, ..)| at - started_at).collect();
    assert_eq!(waited.first(), Some(&1_642), "{waited:?}");
}

/// What waits in a motor at rest is overwritten by speed 0 and carried out, so that nothing waits
/// (D5 manual, quick start (7)).
#[test]
fn what_waits_in_a_motor_at_rest_is_cleared_first() {
    let mut rig = three();
    let members = two_armed(&mut rig);
    // A stranger has had 600 °/s wait in motor 1.
    let _ = (rig.motor)(0, 1, "001#D501050420580284");
    let since = rig.now_us;
    let request = together(&rig, &members);
    assert_eq!(rig.ask(request), Ok(Reply::StartTogether(replies::Done {})));
    let overwritten = place(&rig, since, "001#D50105042000002A");
    let carried_out = place(&rig, since, "001#D50105050000000B");
    assert!(overwritten < carried_out && carried_out < place(&rig, since, EXECUTE_ALL));
}

#[test]
fn nothing_starts_while_a_speed_waits_in_a_motor_that_moves_otherwise() {
    let mut rig = three();
    let members = two_armed(&mut rig);
    let epoch = arm_axis(&mut rig, 2);
    keep_moving(&mut rig, &[(2, epoch)], D5_VELOCITY, 10_000);
    let _ = (rig.motor)(0, 1, "001#D501050420580284");
    let since = rig.now_us;
    let request = together(&rig, &members);
    let refused = Err(Error::CannotStartTogether { axis: 2, reason: TogetherBar::WriteWaits });
    assert_eq!(rig.ask(request), refused);
    run_with_host(&mut rig, 50_000);
    assert!(!rig.sent_since(1, since).contains(&EXECUTE_ALL));
    // In the two a speed may wait: they are stopped, which overwrites it.
    assert!(STOPS.into_iter().all(|stop| rig.sent_since(1, since).contains(&stop)));
    assert!(rig.sent_since(1, since).contains(&"00B#D50B050420000034"));
}

/// At whatever moment the e-stop comes, nothing starts behind it.
#[test]
fn an_e_stop_while_it_is_prepared_starts_nothing() {
    for after_us in (0..6_000).step_by(250) {
        let mut rig = three();
        let members = two_armed(&mut rig);
        let request = together(&rig, &members);
        rig.send(&request);
        rig.run(after_us);
        rig.send(&Request::EStop(requests::EStop {}));
        let since = rig.now_us;
        run_with_host(&mut rig, 100_000);
        assert!(!rig.sent_since(1, since).contains(&EXECUTE_ALL), "{after_us}");
        assert!(!NOW.into_iter().any(|now| rig.sent_since(1, since).contains(&now)), "{after_us}");
    }
}

#[test]
fn what_bars_a_start_is_named_and_nothing_is_sent() {
    let mut rig = three();
    bench::parameter(&mut rig, 1, AxisParameter::VelocityLimitRadS, Value::Float(11.0));
    let members = two_armed(&mut rig);
    let [first, second] = members;
    let since = rig.now_us;
    let barred = |axis, reason| Error::CannotStartTogether { axis, reason };
    let fast = (1, second.1, 12.0);
    for (members, error) in [
        (&[][..], barred(0, TogetherBar::TooFew)),
        (&[first], barred(0, TogetherBar::TooFew)),
        (&[first, first], barred(0, TogetherBar::Twice)),
        (&[first, (1, second.1 + 1, 1.0)], Error::StaleEpoch { axis: 1, current: second.1 }),
        (&[first, (2, 0, 1.0)], Error::NotArmed { axis: 2, state: AxisState::Idle }),
        (
            &[first, fast],
            Error::OutOfRange { quantity: Quantity::Velocity, value: 12.0, min: -11.0, max: 11.0 },
        ),
    ] {
        let request = together(&rig, members);
        assert_eq!(rig.ask(request), Err(error));
    }
    let sent = rig.sent_since(1, since);
    assert!(!sent.iter().any(|sent| WAIT.contains(sent) || *sent == EXECUTE_ALL), "{sent:?}");
}

#[test]
fn a_bus_that_others_use_too_is_no_place_for_it() {
    let mut rig = three();
    configure_bus(&mut rig, false);
    let members = two_armed(&mut rig);
    let request = together(&rig, &members);
    let refused = Err(Error::CannotStartTogether { axis: 0, reason: TogetherBar::SharedBus });
    assert_eq!(rig.ask(request), refused);
}

/// At level 1 nothing shows which speed waits.
#[test]
fn a_motor_that_does_not_answer_writes_takes_no_part() {
    let mut rig = three();
    bench::parameter(&mut rig, 1, AxisParameter::D5AckLevel, Value::Unsigned(1));
    rig.instead(|text| match text {
        "00C#D50C040210000022" => Instead::Says("00C#5D0C040210010023"),
        _ => Instead::AsUsual,
    });
    let members = two_armed(&mut rig);
    let request = together(&rig, &members);
    assert_eq!(rig.ask(request), Err(Error::CannotConfirm { axis: 1 }));
}

/// Both expire in one event, which reaches one axis; what the other is about to be told is asked
/// back all the same.
#[test]
fn no_speed_is_prepared_for_a_motor_whose_setpoint_has_expired() {
    let mut rig = three();
    let mut members = two_armed(&mut rig);
    let request = together(&rig, &members);
    let expires_at = rig.now_us + 90_000;
    rig.ask(request).unwrap();
    run_with_host(&mut rig, 50_000);
    members.iter_mut().for_each(|(.., speed)| *speed /= 2.0);
    rig.run(expires_at - 5_000 - rig.now_us);
    rig.cut();
    let request = together(&rig, &members);
    rig.send(&request);
    rig.run(expires_at - 1 - rig.now_us);
    // −300 °/s of the second, to wait.
    assert_eq!(rig.held_on(1), ["00C#D50C0504202C81E2"]);
    rig.now_us += 1;
    rig.handle(Event::Tick);
    assert_eq!(rig.gateway.tripped(), Set::of(0u8));
    assert_eq!(rig.held_on(1), [STOPS[0]]);
}

/// A setpoint would be overtaken by the speed that waits.
#[test]
fn no_setpoint_comes_between() {
    let mut rig = three();
    let members = two_armed(&mut rig);
    let request = together(&rig, &members);
    let started = rig.send(&request);
    let request = requests::Setpoint {
        axis: 0,
        epoch: members[0].1,
        expires_at_us: bench::expiry(&rig, 90_000),
        setpoint: Setpoint::Velocity { velocity_rad_s: 1.0 },
    };
    let between = rig.send(&Request::Setpoint(request));
    run_with_host(&mut rig, 30_000);
    assert_eq!(rig.answer(between), Some(Err(Error::Busy { axis: 0 })));
    assert_eq!(rig.answer(started), Some(Ok(Reply::StartTogether(replies::Done {}))));
}

/// At level 0 nothing tells whether a write waits, and at level 1 nothing whether it was overwritten
/// before it is carried out.
#[test]
fn beside_a_motor_that_does_not_answer_writes_nobody_starts() {
    for level in [0, 1] {
        let mut rig = three();
        bench::parameter(&mut rig, 2, AxisParameter::D5AckLevel, Value::Unsigned(level));
        let members = two_armed(&mut rig);
        // A stranger has had 600 °/s wait in motor 1.
        let _ = (rig.motor)(0, 1, "001#D501050420580284");
        rig.instead(move |text| match (text.get(..3), text.get(10..12)) {
            (Some("001"), Some("04")) => Instead::Nothing,
            (Some("001"), _) if level == 0 => Instead::Nothing,
            _ => Instead::AsUsual,
        });
        let since = rig.now_us;
        let request = together(&rig, &members);
        assert_eq!(rig.ask(request), Err(Error::CannotConfirm { axis: 2 }), "level {level}");
        run_with_host(&mut rig, 20_000);
        let sent = rig.sent_since(1, since);
        let carries_out = |text: &&str| [EXECUTE_ALL, "001#D50105050000000B"].contains(text);
        assert!(!sent.iter().any(carries_out), "level {level}: {sent:?}");
    }
}
