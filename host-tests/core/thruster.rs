//! A thruster as its manual has it, where it differs from the other motors.

use crate::bench::{self, state};
use crate::rig::{Instead, Rig};
use host_protocol::{
    AxisParameter, AxisState, Error, Event, FaultReading, Reply, Request, Setpoint, TripReason,
    Value, requests,
};

/// Has EF answered by this fault word, in bytes 6 and 7 (Thruster manual §3).
fn reports(rig: &mut Rig, word: &'static str) {
    let reply: &'static str = format!("28B#454600000000{word}").leak();
    rig.instead(
        move |text| {
            if text.starts_with("30B#4546") { Instead::Says(reply) } else { Instead::AsUsual }
        },
    );
}

fn try_arm(rig: &mut Rig) -> Result<Reply, Error> {
    rig.ask(Request::Arm(requests::Arm { axis: 0 }))
}

/// Thruster manual §3, the table of protections: bits 3, 4, 12 and 13 are "reported", all others do
/// something to the output.
#[test]
fn each_bit_of_the_fault_word_bars_arming_or_only_warns() {
    let barring = [
        "0001", "0002", "0004", "0040", "0080", "0100", "0200", "0400", "0800", // named
        "0020", "4000", "8000", // reserved: nobody knows
    ];
    let warning = ["0008", "0010", "1000", "2000", "3018"];
    for word in barring {
        let (mut rig, _) = bench::thruster();
        reports(&mut rig, word);
        let faults = u16::from_str_radix(word, 16).unwrap();
        assert_eq!(try_arm(&mut rig), Err(Error::MotorFault { axis: 0, faults }), "{word}");
        let FaultReading { word, warnings, .. } = state(&mut rig).faults.unwrap();
        assert_eq!((word, warnings), (faults, 0));
    }
    for text in warning {
        let (mut rig, _) = bench::thruster();
        reports(&mut rig, text);
        bench::arm(&mut rig);
        let FaultReading { word, warnings, .. } = state(&mut rig).faults.unwrap();
        assert_eq!((format!("{word:04X}").as_str(), warnings), (text, word));
    }
}

/// Thruster manual §3: one word has both kinds.
#[test]
fn a_warning_hides_no_fault() {
    let (mut rig, _) = bench::thruster();
    reports(&mut rig, "1040");
    assert_eq!(try_arm(&mut rig), Err(Error::MotorFault { axis: 0, faults: 0x1040 }));
    let FaultReading { word, warnings, .. } = state(&mut rig).faults.unwrap();
    assert_eq!((word, warnings), (0x1040, 0x1000));
}

#[test]
fn an_axis_can_be_set_to_treat_warnings_as_faults_and_a_limit_of_the_temperature_needs_its_sensors()
{
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::WarningsAreFaults, Value::Bool(true));
    reports(&mut rig, "0010");
    assert_eq!(try_arm(&mut rig), Err(Error::MotorFault { axis: 0, faults: 0x10 }));
    for (word, armed) in [("0010", true), ("1000", false), ("2000", false)] {
        let (mut rig, _) = bench::thruster();
        bench::parameter(&mut rig, 0, AxisParameter::TemperatureLimitC, Value::Float(90.0));
        reports(&mut rig, word);
        assert_eq!(try_arm(&mut rig).is_ok(), armed, "{word}");
    }
}

/// §3: a stall switches the output off and lasts. Of the word that was read before it nothing is
/// told, and that which the stop reads is the reason.
#[test]
fn a_refusal_is_told_with_the_fault_word_that_is_read_behind_it() {
    for (fault, word) in [(true, 0x40), (false, 0)] {
        let (mut rig, play) = bench::thruster();
        let epoch = bench::arm(&mut rig);
        let signal = Setpoint::Signal { fraction: 0.2 };
        bench::keep_moving(&mut rig, &[(0, epoch)], signal, 100_000);
        assert!(state(&mut rig).faults.is_some_and(|faults| faults.word == 0));
        (play.borrow_mut().refuses, play.borrow_mut().fault) = (true, fault);
        let refused = bench::setpoint(&rig, epoch, 80_000, Setpoint::Signal { fraction: 0.3 });
        let _ = rig.ask(refused);
        rig.run(20_000);
        let reason = |faults| TripReason::CommandRefused { faults };
        let told = rig.events().into_iter().find_map(|event| match event {
            Event::Tripped { trip, .. } => Some(trip.reason),
            _ => None,
        });
        assert_eq!(told, Some(reason(None)));
        assert_eq!(state(&mut rig).trip.map(|trip| trip.reason), Some(reason(Some(word))));
        assert_eq!(
            bench::listed(&mut rig, 0),
            AxisState::Tripped { confirmed: false },
            "a refusal confirms no stop"
        );
        // It is no longer the first word that was read, and no longer the reason.
        play.borrow_mut().fault = !fault;
        rig.run(200_000);
        assert_eq!(state(&mut rig).trip.map(|trip| trip.reason), Some(reason(Some(word))));
        // What only asks is kept out by the stop, which says so; what changes the motor by the trip.
        for (data, error) in [
            ("45460000", Error::StopNotConfirmed { axis: 0 }),
            ("43460000", Error::Tripped { axis: 0, reason: reason(Some(word)) }),
        ] {
            let request = bench::native(&rig, 0, data);
            assert_eq!(rig.ask(request), Err(error));
        }
        assert_eq!(bench::clear(&mut rig), Err(Error::StopNotConfirmed { axis: 0 }));
        // The unsafe way out, and then its fault is cleared: CF, and EF has nothing.
        (play.borrow_mut().refuses, play.borrow_mut().fault) = (false, false);
        let since = rig.now_us;
        let unreachable = requests::ClearUnreachable { axis: 0 };
        rig.ask(Request::ClearUnreachable(unreachable)).unwrap();
        bench::clear(&mut rig).unwrap();
        let sent = rig.sent_since(0, since);
        assert!(sent.contains(&"30B#43460000"), "{sent:?}");
        assert_eq!(bench::listed(&mut rig, 0), AxisState::Idle);
    }
}
