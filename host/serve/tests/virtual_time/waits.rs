//! What a stop waits for on the cable, whatever has been written before it.

use std::time::Duration;

use mgw_client::Transport;
use mgw_client::host_protocol::requests as ask;
use mgw_client::host_protocol::{Call, Kind, MAX_FRAME, StopTarget, encode_body};

use crate::rig::{Bench, Wire, frame, turn};
use crate::{MS, frames};

/// A longest request and seven stops at 921600 bit/s, and the stop itself.
const LONGEST: Duration = Duration::from_micros(6_700 + 150);

/// A request whose body is garbage.
fn garbage(sequence: u16, number: u16, length: usize) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let body = vec![0xAA; length];
    let length = encode_body(Kind::Request, sequence, number, &body, &mut out).unwrap();
    out[..length].to_vec()
}

/// How long an e-stop of one more program takes to the other end of the cable.
fn estop_takes(bench: &Bench, last: &mut Wire) -> Duration {
    let asked = bench.now();
    last.send(&frame(1, &ask::EStop {})).unwrap();
    bench.run(200 * MS);
    let rig = bench.0.borrow();
    let first = rig.passed.iter().find(|(_, number)| *number == ask::EStop::NUMBER);
    first.expect("it goes out").0 - asked
}

#[test]
fn a_stop_waits_for_no_stops_that_cannot_be_read() {
    let bench = Bench::new();
    let mut wires: Vec<Wire> = (0..9).map(|_| bench.wire()).collect();
    let (last, others) = wires.split_last_mut().unwrap();
    for wire in &mut *others {
        wire.send(&garbage(1, ask::Stop::NUMBER, 480)).unwrap();
    }
    let takes = estop_takes(&bench, last);
    assert!(takes <= LONGEST, "{takes:?}");
    // They are refused, as by a gateway.
    for wire in others {
        assert_eq!(frames(wire).iter().filter(|(kind, ..)| *kind == Kind::Error).count(), 1);
    }
}

#[test]
fn a_stop_waits_for_one_long_request_of_whoever() {
    let bench = Bench::new();
    let (mut first, mut watcher) = (bench.program(), bench.wire());
    turn(&mut first);
    bench.run(20 * MS);
    first.transport_mut().send(&garbage(900, ask::Ping::NUMBER, 500)).unwrap();
    watcher.send(&garbage(900, ask::Ping::NUMBER, 500)).unwrap();
    let takes = estop_takes(&bench, &mut bench.wire());
    assert!(takes <= LONGEST, "{takes:?}");
    assert!(frames(&mut watcher).iter().any(|(kind, ..)| *kind == Kind::Error));
}

#[test]
fn a_stop_waits_for_no_repetitions() {
    let bench = Bench::new();
    let (mut first, mut watcher) = (bench.program(), bench.wire());
    turn(&mut first);
    bench.run(20 * MS);
    bench.0.borrow_mut().lost_per_mille = [1_000, 0];
    let asked: Vec<u8> =
        (0..3).flat_map(|one| garbage(900 + one, ask::Ping::NUMBER, 150)).collect();
    let stops: Vec<u8> =
        (0..7).flat_map(|axis| frame(axis, &ask::Stop { target: StopTarget::Axis(0) })).collect();
    for _ in 0..20 {
        first.transport_mut().send(&asked).unwrap();
        watcher.send(&stops).unwrap();
    }
    let takes = estop_takes(&bench, &mut bench.wire());
    assert!(takes <= LONGEST, "{takes:?}");
}

/// Programs that come, stop with ever other bodies, and go.
#[test]
fn a_stop_of_who_lives_takes_turns_with_those_of_who_has_gone() {
    let bench = Bench::new();
    let mut live = bench.wire();
    for axis in 0..32 {
        let wire = bench.wire();
        let mut rig = bench.0.borrow_mut();
        let now = Duration::from_micros(rig.world.now().as_micros());
        for sequence in 0..4 {
            let stop = ask::Stop { target: StopTarget::Axis(axis) };
            rig.multiplexer.program_bytes(now, wire.id, &frame(sequence, &stop));
        }
        rig.multiplexer.program_closed(wire.id);
    }
    bench.0.borrow_mut().lost_per_mille = [1_000, 0];
    let takes = estop_takes(&bench, &mut live);
    assert!(takes <= LONGEST, "{takes:?}");
    let rig = bench.0.borrow();
    let stops = rig.cable.iter().filter(|(.., number)| *number == ask::Stop::NUMBER);
    assert_eq!(stops.count(), 32, "each of them goes out once, those of axes that are none too");
}

/// Who commands and who watches take turns where the cable is full.
#[test]
fn long_requests_of_the_one_in_command_hold_up_nobody_for_ever() {
    let bench = Bench::new();
    let (mut first, mut watcher) = (bench.program(), bench.wire());
    turn(&mut first);
    for round in 0..100u16 {
        for more in 0..4 {
            let long = garbage(1_000 + round * 4 + more, ask::Ping::NUMBER, 500);
            first.transport_mut().send(&long).unwrap();
        }
        if round == 50 {
            watcher.send(&garbage(1, ask::Ping::NUMBER, 500)).unwrap();
        }
        bench.run(10 * MS);
    }
    assert!(frames(&mut watcher).iter().any(|(kind, ..)| *kind == Kind::Error));
}
