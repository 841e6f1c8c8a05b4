//! A cable that loses frames, programs that ask for much at once, and what each is told.

use std::time::Duration;

use mgw_client::Transport;
use mgw_client::host_protocol::requests as ask;
use mgw_client::host_protocol::{
    AxisParameter, AxisState, Call, CycleEvent, Kind, StateFields, StopTarget, TripReason,
};

use crate::rig::{Bench, LONG, TURNING, frame, turn};
use crate::{MS, frames};

/// The low half of the gateway's time so long from now, µs.
fn expiry(bench: &Bench, valid: Duration) -> u32 {
    let at = bench.0.borrow().world.now().as_micros() + u64::try_from(valid.as_micros()).unwrap();
    u32::try_from(at & 0xFFFF_FFFF).unwrap()
}

/// Setpoints and pings that nobody repeats, as who holds an axis sends them. Three of a hundred
/// frames are lost on each way: one setpoint in seventeen has no result.
#[test]
fn losses_on_the_cable_take_neither_command_nor_setpoints_from_who_holds_an_axis() {
    let bench = Bench::new();
    let mut first = bench.program();
    let epoch = turn(&mut first);
    bench.0.borrow_mut().lost_per_mille = [30; 2];
    for round in 0..2_000u16 {
        let expires_at_us = expiry(&bench, 90 * MS);
        let setpoint = ask::Setpoint { axis: 0, epoch, expires_at_us, setpoint: TURNING };
        let wire = first.transport_mut();
        wire.send(&frame(10_000 + round, &setpoint)).unwrap();
        if round.is_multiple_of(5) {
            wire.send(&frame(20_000 + round, &ask::Ping {})).unwrap();
        }
        bench.run(10 * MS);
    }
    bench.0.borrow_mut().lost_per_mille = [0; 2];
    assert_eq!(first.read_state(0).unwrap().state, AxisState::Active);
    let asked = bench.now();
    first.stop(StopTarget::All).unwrap();
    assert!(bench.now() - asked < 10 * MS);
}

/// Sixty stops are lost, and each is another request: the one that comes through is answered.
#[test]
fn the_result_of_a_stop_comes_back_although_many_before_it_were_lost() {
    let bench = Bench::new();
    let (mut first, mut other) = (bench.program(), bench.program());
    turn(&mut first);
    frames(other.transport_mut());
    bench.0.borrow_mut().lost_per_mille = [1_000, 0];
    for sequence in 0..60 {
        let stop = frame(1_000 + sequence, &ask::Stop { target: StopTarget::All });
        other.transport_mut().send(&stop).unwrap();
        bench.run(25 * MS);
    }
    bench.0.borrow_mut().lost_per_mille = [0; 2];
    let stop = frame(2_000, &ask::Stop { target: StopTarget::All });
    other.transport_mut().send(&stop).unwrap();
    bench.run(25 * MS);
    let results = frames(other.transport_mut());
    assert!(results.iter().any(|(kind, sequence, ..)| (*kind, *sequence) == (Kind::Reply, 2_000)));
}

#[test]
fn sixteen_setpoints_in_one_piece_all_have_their_results() {
    let bench = Bench::new();
    let mut first = bench.program();
    turn(&mut first);
    frames(first.transport_mut());
    for turn in 0..10 {
        let expires_at_us = expiry(&bench, LONG);
        let setpoint = |axis| ask::Setpoint { axis, epoch: 1, expires_at_us, setpoint: TURNING };
        let sequences = 500 + turn * 16..516 + turn * 16;
        let bytes: Vec<u8> = (0..16)
            .zip(sequences.clone())
            .flat_map(|(axis, sequence)| frame(sequence, &setpoint(axis)))
            .collect();
        first.transport_mut().send(&bytes).unwrap();
        bench.run(20 * MS);
        let results = frames(first.transport_mut());
        let answered = |of: u16| {
            results.iter().any(|(kind, sequence, ..)| *kind != Kind::Event && *sequence == of)
        };
        assert!(sequences.clone().all(answered), "turn {turn}: {results:?}");
    }
}

#[test]
fn of_the_periods_of_a_cycle_the_newest_waits_for_who_does_not_read() {
    let bench = Bench::new();
    let (mut first, mut other) = (bench.program(), bench.program());
    let epoch = turn(&mut first);
    first.run_cycle(&[0], StateFields::default(), 5 * MS).unwrap();
    bench.set_reads(first.transport().id, false);
    for sequence in 0..20 {
        let expires_at_us = expiry(&bench, LONG);
        let setpoint = ask::Setpoint { axis: 0, epoch, expires_at_us, setpoint: TURNING };
        first.transport_mut().send(&frame(3_000 + sequence, &setpoint)).unwrap();
        bench.run(20 * MS);
    }
    let is_cycle = |frames: &[(Kind, u16, u16, Vec<u8>)]| {
        frames.iter().filter(|(.., number, _)| *number == CycleEvent::NUMBER).count()
    };
    assert!(is_cycle(&frames(other.transport_mut())) > 50);
    bench.set_reads(first.transport().id, true);
    bench.run(MS);
    assert!((1..3).contains(&is_cycle(&frames(first.transport_mut()))));
}

#[test]
fn a_stop_of_a_connection_that_is_over_goes_out() {
    let bench = Bench::new();
    let mut deaf = bench.program();
    bench.set_reads(deaf.transport().id, false);
    bench.reset();
    bench.run(1_500 * MS);
    assert!(bench.is_over(deaf.transport().id));
    let mut first = bench.program();
    let axis = mgw_client::host_protocol::ClearTarget::Axis(0);
    first.clear(axis).unwrap();
    turn(&mut first);
    assert!(bench.speed() > 1.0);
    deaf.transport_mut().send(&frame(77, &ask::EStop {})).unwrap();
    assert!(bench.speed().abs() < 0.05);
}

/// The gateway may have forgotten what is repeated, and must not do it twice; it hears from who
/// repeats it all the same.
#[test]
fn who_repeats_a_request_that_must_not_be_done_twice_is_not_silent() {
    let bench = Bench::new();
    let (mut first, mut other) = (bench.program(), bench.program());
    turn(&mut first);
    bench.0.borrow_mut().lost_per_mille = [0, 1_000];
    let since = bench.now();
    for round in 0..25u16 {
        first.transport_mut().send(&frame(900, &ask::Arm { axis: 1 })).unwrap();
        for request in 0..4 {
            let read = frame(5_000 + round * 4 + request, &ask::ReadState { axis: 0 });
            other.transport_mut().send(&read).unwrap();
        }
        bench.run(80 * MS);
    }
    let rig = bench.0.borrow();
    let commands = rig.cable.iter().filter(|(at, kind, _)| *at >= since && *kind == Kind::Request);
    let times: Vec<Duration> = commands.clone().map(|(at, ..)| *at).collect();
    assert!(times.len() > 20, "{times:?}");
    let longest = times.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
    assert!(longest < 250 * MS, "{longest:?} of silence");
    let arms = commands.filter(|(_, _, number)| *number == ask::Arm::NUMBER).count();
    assert!(arms < 10, "{arms}: what may be done twice");
}

/// What it has left behind waits for results that do not come, and goes out one after the other.
#[test]
fn what_a_program_that_hangs_has_left_behind_does_not_live_for_it() {
    let bench = Bench::new();
    let (mut first, mut watcher) = (bench.program(), bench.program());
    turn(&mut first);
    bench.0.borrow_mut().lost_per_mille = [0, 1_000];
    let parameter = AxisParameter::TtlUs.number();
    let reads: Vec<u8> = (0..30)
        .flat_map(|more| frame(4_000 + more, &ask::ReadAxisParameter { axis: 0, parameter }))
        .collect();
    first.transport_mut().send(&reads).unwrap();
    let hung = bench.now();
    bench.run(3_000 * MS);
    let last = |kind: Kind| {
        let rig = bench.0.borrow();
        rig.cable.iter().rev().find(|(_, of, _)| *of == kind).unwrap().0
    };
    assert!(last(Kind::Request) <= hung + 100 * MS, "{:?}", last(Kind::Request) - hung);
    bench.0.borrow_mut().lost_per_mille = [0; 2];
    let trip = watcher.read_state(0).unwrap().trip.expect("it has tripped");
    assert_eq!(trip.reason, TripReason::HostSilent);
    let tripped_after = Duration::from_micros(trip.time_us) - hung;
    assert!(tripped_after < 355 * MS, "{tripped_after:?}");
    // It goes on: what it repeats is asked, and what it asked in between is not lost to it for ever.
    frames(first.transport_mut());
    first.transport_mut().send(&reads).unwrap();
    bench.run(50 * MS);
    let answered = frames(first.transport_mut()).into_iter();
    let answered: Vec<u16> = answered.filter(|one| one.0 == Kind::Reply).map(|one| one.1).collect();
    assert!((4_000..4_030).all(|one| answered.contains(&one)), "{answered:?}");
}
