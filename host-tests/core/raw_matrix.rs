//! Raw access in every state, with every class of frame: what is answered, and what is on the wire
//! (GUARANTEES G10).

use crate::bench::{self, arm, disarm, e_stop, listed, move_axis, run_with_host, stop};
use crate::motors::Shared;
use crate::raw_access::{open, send_text};
use crate::raw_frames::{self, Class, Frame, RMD_ACTS, serial_reads};
use crate::rig::Rig;
use host_protocol::{
    AxisParameter, AxisState, Error, Protocol, Request, Setpoint, StopAction, Value, requests,
};

/// A bus with one axis, and the frames for it.
struct Case {
    bus: u8,
    rig: fn() -> (Rig, Shared),
    frames: fn() -> Vec<Frame>,
    setpoint: Setpoint,
    /// Its stop leaves the output of the motor on.
    holds: bool,
    /// It must hear something meanwhile.
    is_kept_holding: bool,
}

const CASES: [Case; 4] = [
    Case {
        bus: 0,
        rig: || bench::rmd(StopAction::Hold),
        frames: || [raw_frames::rmd_on_can(), raw_frames::thruster()].concat(),
        setpoint: bench::VELOCITY,
        holds: true,
        is_kept_holding: true,
    },
    Case {
        bus: 0,
        rig: || {
            let (mut rig, play) = bench::thruster();
            bench::configure_bus(&mut rig, 0, 500_000, &[Protocol::Rmd, Protocol::Thruster]);
            (rig, play)
        },
        frames: || [raw_frames::rmd_on_can(), raw_frames::thruster()].concat(),
        setpoint: Setpoint::Signal { fraction: 0.1 },
        holds: false,
        is_kept_holding: false,
    },
    Case {
        bus: 1,
        rig: bench::d5,
        frames: raw_frames::d5,
        setpoint: bench::D5_VELOCITY,
        holds: true,
        is_kept_holding: false,
    },
    Case {
        bus: 2,
        rig: || bench::rmd_serial(StopAction::Hold),
        frames: raw_frames::serial,
        setpoint: bench::VELOCITY,
        holds: true,
        is_kept_holding: true,
    },
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Unconfigured,
    Idle,
    Holding,
    Arming,
    Armed,
    Active,
    Stopping,
    Unconfirmed,
    Confirmed,
}

const STATES: [State; 9] = [
    State::Unconfigured,
    State::Idle,
    State::Holding,
    State::Arming,
    State::Armed,
    State::Active,
    State::Stopping,
    State::Unconfirmed,
    State::Confirmed,
];

/// A rig whose axis 0 is in this state.
fn rig_in(case: &Case, state: State) -> Rig {
    let (mut rig, play) = (case.rig)();
    match state {
        State::Unconfigured => {
            rig.ask(Request::RemoveAxis(requests::RemoveAxis { axis: 0 })).unwrap();
            bench::parameter(&mut rig, 0, AxisParameter::Bus, Value::Unsigned(case.bus.into()));
        }
        State::Idle => {}
        State::Holding => {
            arm(&mut rig);
            disarm(&mut rig);
            run_with_host(&mut rig, 200_000);
        }
        State::Arming => drop(rig.send(&Request::Arm(requests::Arm { axis: 0 }))),
        State::Armed => drop(arm(&mut rig)),
        State::Active => drop(move_axis(&mut rig, case.setpoint)),
        State::Stopping => {
            play.borrow_mut().mute = true;
            stop(&mut rig);
        }
        State::Unconfirmed | State::Confirmed => {
            move_axis(&mut rig, case.setpoint);
            rig.run(10_000);
            play.borrow_mut().mute = state == State::Unconfirmed;
            run_with_host(&mut rig, 600_000); // the setpoint expires
        }
    }
    let is = listed(&mut rig, 0);
    let meant = match state {
        State::Unconfigured => is == AxisState::Unconfigured,
        State::Idle => is == AxisState::Idle,
        State::Holding => is == if case.holds { AxisState::Holding } else { AxisState::Idle },
        State::Arming => is == AxisState::Arming,
        State::Armed => is == AxisState::Armed,
        State::Active => is == AxisState::Active,
        State::Stopping => is == AxisState::Stopping,
        State::Unconfirmed => is == AxisState::Tripped { confirmed: false },
        State::Confirmed => is == AxisState::Tripped { confirmed: true },
    };
    assert!(meant, "{state:?}: {is:?}");
    rig
}

/// Sends every frame on an open bus, and wants those on the wire that do not act, and only those.
fn send_all(rig: &mut Rig, case: &Case, state: State) {
    for (text, class) in (case.frames)() {
        rig.said.clear();
        rig.wire.clear();
        let sent = send_text(rig, case.bus, &text);
        rig.run(if case.bus == 2 { 15_000 } else { 6_000 });
        let on_wire = rig
            .wire
            .iter()
            .filter(|(_, bus, on_wire)| (*bus, on_wire) == (case.bus, &text))
            .count();
        if class == Class::Acts {
            assert_eq!(sent, Err(Error::RawNotHarmless { bus: case.bus }), "{state:?}: {text}");
            assert_eq!(on_wire, 0, "{state:?}: {text}");
        } else {
            assert!(sent.is_ok(), "{state:?}: {text} {class:?} {sent:?}");
            assert_eq!(on_wire, 1, "{state:?}: {text}");
        }
    }
}

/// Every frame class in every state of an axis, with and without an e-stop.
#[test]
fn raw_frames_of_every_class_in_every_state() {
    for case in &CASES {
        for state in STATES {
            for e_stopped in [false, true] {
                let mut rig = rig_in(case, state);
                if e_stopped {
                    e_stop(&mut rig);
                }
                let idle = match state {
                    State::Unconfigured | State::Idle => true,
                    State::Holding => !case.is_kept_holding,
                    _ => false,
                };
                let opened = open(&mut rig, case.bus);
                assert_eq!(
                    opened.is_ok(),
                    idle && !e_stopped,
                    "bus {} {state:?} {e_stopped}: {opened:?}",
                    case.bus
                );
                if opened.is_ok() {
                    send_all(&mut rig, case, state);
                    continue;
                }
                let expected = if e_stopped {
                    matches!(opened, Err(Error::EStopped {}))
                } else {
                    matches!(opened, Err(Error::NotIdle { axis: 0, .. }))
                };
                assert!(expected, "{state:?} {e_stopped}: {opened:?}");
                for (text, _) in (case.frames)() {
                    rig.said.clear();
                    assert_eq!(
                        send_text(&mut rig, case.bus, &text),
                        Err(Error::RawNotOpen { bus: case.bus })
                    );
                }
            }
        }
    }
}

/// A motor that finds a frame in whatever bytes it hears, wherever it begins to listen, and looks
/// at nothing but head, length and command: in no two reads that follow each other, be they ever so
/// close, it finds a command that acts.
#[test]
fn no_two_reads_on_a_serial_line_hold_a_command_that_acts() {
    let reads: Vec<_> = (1..=32).chain([0xCD]).flat_map(serial_reads).collect();
    for first in &reads {
        for second in &reads {
            let line = [first.as_slice(), second].concat();
            let hidden = line
                .windows(4)
                .enumerate()
                .filter(|(at, window)| at % 13 != 0 && window[0] == 0x3E && window[2] == 0x08);
            for (at, window) in hidden {
                assert!(!RMD_ACTS.contains(&window[3]), "{} at {at}", crate::text::hex(&line));
            }
        }
    }
}

/// What a motor does that obeys whatever it can make out: it takes extended ids for standard ones,
/// missing bytes for zeros, and looks at no checksum, length or unused byte. `protocols` are those
/// of the motors on the bus.
fn obeys(protocols: &[Protocol], id: u16, data: &[u8]) -> bool {
    let first = data.first().copied().unwrap_or(0);
    let command = [first, data.get(1).copied().unwrap_or(0)];
    protocols.iter().any(|protocol| match protocol {
        Protocol::Rmd => match id {
            0x401..=0x420 => true,
            0x141..=0x160 | 0x280 => RMD_ACTS.contains(&first),
            0x300 => first == 0x79 && data.get(2) != Some(&1),
            _ => false,
        },
        Protocol::Thruster => {
            (0x301..=0x37F).contains(&id)
                && [b"TC", b"VC", b"LA", b"LR", b"ST", b"CI", b"CB", b"SP", b"CF"]
                    .contains(&&command)
        }
        Protocol::D5 => first == 0xD5 && matches!(data.get(3), Some(0x03..=0x06)),
    })
}

/// Random frames, most of them near a command: whatever passes moves no lenient motor.
#[test]
fn no_frame_that_passes_is_obeyed_by_a_lenient_motor() {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut random = move |below: u64| rng.u64(..below);
    let buses: [(u8, &[Protocol], Vec<Frame>); 2] = [
        (
            0,
            &[Protocol::Rmd, Protocol::Thruster],
            [raw_frames::rmd_on_can(), raw_frames::thruster()].concat(),
        ),
        (1, &[Protocol::D5], raw_frames::d5()),
    ];
    for (bus, protocols, seeds) in buses {
        let mut rig = Rig::new();
        bench::hello(&mut rig);
        let bitrate = if bus == 0 { 500_000 } else { 210_526 };
        bench::configure_bus(&mut rig, bus, bitrate, protocols);
        open(&mut rig, bus).unwrap();
        let mut passed = 0;
        for _ in 0..30_000 {
            let (seed, _) = &seeds[usize::try_from(random(seeds.len() as u64)).unwrap()];
            let (id, data) = seed.split_once('#').unwrap();
            let mut id = u16::from_str_radix(id, 16).unwrap();
            let mut data = crate::text::unhex(data);
            for _ in 0..random(3) {
                match random(4) {
                    0 => id = u16::try_from(random(0x800)).unwrap(),
                    1 => data.truncate(usize::try_from(random(9)).unwrap()),
                    _ if !data.is_empty() => {
                        let at = usize::try_from(random(data.len() as u64)).unwrap();
                        data[at] = u8::try_from(random(256)).unwrap();
                    }
                    _ => {}
                }
            }
            rig.said.clear();
            rig.wire.clear();
            let text = format!("{id:03X}#{}", crate::text::hex(&data));
            if send_text(&mut rig, bus, &text).is_ok() {
                passed += 1;
                assert!(!obeys(protocols, id, &data), "{text}");
                rig.run(1_000);
            }
        }
        assert!(passed > 300, "{passed}");
    }
}
