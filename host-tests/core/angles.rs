//! The position of an RMD from the angle in its replies to setpoints, and where that is not taken
//! (PROTOCOL.md, positions of RMD motors).

use crate::bench::{self, VELOCITY, arm, setpoint};
use crate::rig::Rig;
use host_protocol::{Event as HostEvent, Reply, Request, StopAction, replies, requests};
use std::cell::Cell;
use std::rc::Rc;

/// What the motor does with an angle that 16 bits do not hold.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Beyond {
    /// Starts again at the other end, two's complement.
    Wraps,
    /// Stays at ±32 767.
    Stays,
    /// Starts again, and its zero is so many degrees away from that of 0x92.
    OffBy(f64),
}

/// Where the shaft is, degrees.
type Shaft = Rc<Cell<f64>>;

/// An armed RMD, its shaft at `degrees`.
#[allow(clippy::cast_possible_truncation)] // 16 bits are what it plays
fn at(degrees: f64, beyond: Beyond) -> (Rig, u32, Shaft) {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let shaft = Shaft::new(Cell::new(degrees));
    let mut usual = std::mem::replace(&mut rig.motor, Box::new(|_, _, _| None));
    let seen = shaft.clone();
    rig.motor = Box::new(move |now, bus, text| {
        let reply = usual(now, bus, text)?;
        let degrees = seen.get();
        let angle = match beyond {
            Beyond::Wraps => degrees as i64 as i16,
            Beyond::Stays => degrees.clamp(-32_767.0, 32_767.0) as i16,
            Beyond::OffBy(off) => (degrees + off) as i64 as i16,
        };
        Some(match reply.get(4..6)? {
            "92" => format!("241#92000000{:08X}", ((degrees * 100.0) as i32).swap_bytes()),
            // Its current, so that this is no request thrown back, and 500 °/s.
            "9C" | "A2" => format!("{}{:04X}", &reply[..16], angle.swap_bytes()),
            _ => reply,
        })
    });
    let epoch = arm(&mut rig);
    (rig, epoch, shaft)
}

/// The motor goes on by `degrees` in so many steps of 20 ms, told its setpoint in each.
fn drive(rig: &mut Rig, epoch: u32, shaft: &Shaft, degrees: f64, steps: u32) {
    for _ in 0..steps {
        shaft.set(shaft.get() + degrees / f64::from(steps));
        let request = setpoint(rig, epoch, 80_000, VELOCITY);
        rig.ask(request).unwrap();
        rig.run(20_000);
    }
}

/// What a host is told of axis 0: its position in degrees, and how old that is, µs.
fn told(rig: &mut Rig) -> (f64, u32) {
    let report = rig.ask(Request::ReadState(requests::ReadState { axis: 0 })).unwrap();
    let Reply::ReadState(replies::AxisReport { position_rad, .. }) = report else { panic!() };
    let reading = position_rad.unwrap();
    (f64::from(reading.value).to_degrees(), reading.age_us)
}

fn sample(rig: &mut Rig) -> (f64, u32) {
    let axes = 1;
    let fields = host_protocol::StateFields::of(&[host_protocol::StateField::Position]);
    let request = requests::Subscribe { axes, fields, period_us: 10_000_000 };
    rig.ask(Request::Subscribe(request)).unwrap();
    let mut samples = rig.events().into_iter().filter_map(|event| match event {
        HostEvent::Sample { position_rad, .. } => *position_rad,
        _ => None,
    });
    let reading = samples.next_back().unwrap();
    (f64::from(reading.value).to_degrees(), reading.age_us)
}

fn mismatches(rig: &Rig) -> Vec<(f32, f32)> {
    let mismatch = |event: &HostEvent| match event {
        HostEvent::AngleMismatch { axis: 0, angle_rad, position_rad } => {
            Some((angle_rad.to_degrees().round(), position_rad.to_degrees().round()))
        }
        _ => None,
    };
    rig.events().into_iter().filter_map(mismatch).collect()
}

/// Replies to setpoints carry the position over the ends of their range, and both ways.
#[test]
fn an_angle_that_starts_again_is_followed() {
    for (start, way) in [(32_000.0, 2_000.0), (-32_000.0, -2_000.0), (98_000.0, -100_000.0)] {
        let (mut rig, epoch, shaft) = at(start, Beyond::Wraps);
        for _ in 0..20 {
            drive(&mut rig, epoch, &shaft, way / 20.0, 5);
            shaft.set(shaft.get() + 3.0);
            let request = setpoint(&rig, epoch, 80_000, VELOCITY);
            rig.ask(request).unwrap();
            rig.run(1_000);
            // The motor is asked for nothing by this, and 0x92 is polled each 50 ms.
            let (position, age) = sample(&mut rig);
            assert!((position - shaft.get()).abs() <= 2.0, "{position} at {}", shaft.get());
            assert!(age < 3_000, "{age} µs");
        }
    }
}

/// A motor whose angle stays at the end of its range tells no position there.
#[test]
fn an_angle_at_the_end_of_its_range_says_nothing() {
    let (mut rig, epoch, shaft) = at(32_000.0, Beyond::Stays);
    for _ in 0..20 {
        drive(&mut rig, epoch, &shaft, 1_000.0, 100);
        let (position, _) = told(&mut rig);
        assert!((position - shaft.get()).abs() <= 2.0, "{position} at {}", shaft.get());
    }
    assert!(mismatches(&rig).is_empty());
}

/// An angle with another zero than 0x92 is told once and never used.
#[test]
fn an_angle_that_disagrees_is_told_and_not_used() {
    let (mut rig, epoch, shaft) = at(720.0, Beyond::OffBy(-360.0));
    for _ in 0..10 {
        drive(&mut rig, epoch, &shaft, 20.0, 10);
        let (position, _) = sample(&mut rig);
        // What 0x92 told at most 60 ms ago.
        assert!((position - shaft.get()).abs() <= 6.0, "{position} at {}", shaft.get());
    }
    assert_eq!(mismatches(&rig), [(360.0, 720.0)]);
}

/// The first reading after arming finds one degree right and five wrong.
#[test]
fn an_angle_may_be_off_by_its_rounding_alone() {
    for (off, is_told) in [(0.0, false), (1.0, false), (-1.0, false), (5.0, true), (-5.0, true)] {
        let (mut rig, epoch, shaft) = at(100.0, Beyond::OffBy(off));
        drive(&mut rig, epoch, &shaft, 0.0, 20);
        assert_eq!(!mismatches(&rig).is_empty(), is_told, "{off}");
    }
}

/// At rest the hundredths of a degree of 0x92 stay.
#[test]
fn what_0x92_tells_finer_stays() {
    let (mut rig, epoch, shaft) = at(123.45, Beyond::Wraps);
    drive(&mut rig, epoch, &shaft, 0.0, 20);
    let (position, age) = sample(&mut rig);
    assert!((position - 123.45).abs() < 0.01, "{position}");
    assert!(age < 21_000, "{age} µs");
}

/// While replies to setpoints tell the speed it is not polled beside them.
#[test]
fn no_speed_is_polled_beside_setpoints_that_are_answered() {
    let (mut rig, epoch, shaft) = at(0.0, Beyond::Wraps);
    let since = rig.now_us;
    drive(&mut rig, epoch, &shaft, 10.0, 100);
    let sent = rig.sent_since(0, since);
    let count = |of: &str| sent.iter().filter(|text| text.starts_with(of)).count();
    assert!(count("141#A2") >= 100, "{}", count("141#A2"));
    assert_eq!(count("141#9C"), 0);
    // Position every 50 ms, faults every 100 ms, run time each second.
    assert!((39..=41).contains(&count("141#92")), "{}", count("141#92"));
    assert!((18..=22).contains(&count("141#9A")), "{}", count("141#9A"));
    assert!(count("141#B1") >= 1, "{}", count("141#B1"));
}
