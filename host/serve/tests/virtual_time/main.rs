//! The server in virtual time, against the core of the gateway.

mod crowd;
mod losses;
mod rig;
mod waits;

use std::time::Duration;

use mgw_client::Transport;
use mgw_client::host_protocol::requests as ask;
use mgw_client::host_protocol::{
    AxisState, Call, Deframer, Error, Event, EventMessage, Kind, MAX_FRAME, StateField,
    StateFields, StopTarget, TripReason, encode,
};
use mgw_serve::{News, SERVER};

use rig::{Bench, LONG, TURNING, Wire, frame, refusal, turn};

const MS: Duration = Duration::from_millis(1);

/// What a program has been sent: kind, sequence, number, body.
fn frames(wire: &mut Wire) -> Vec<(Kind, u16, u16, Vec<u8>)> {
    let (mut deframer, mut frames) = (Deframer::new(), Vec::new());
    let mut buffer = [0; 4_096];
    while let Ok(count @ 1..) = wire.receive(&mut buffer, Duration::ZERO) {
        let mut bytes = &buffer[..count];
        while !bytes.is_empty() {
            if let Some(frame) = deframer.take(&mut bytes) {
                let frame = frame.unwrap();
                frames.push((frame.kind, frame.sequence, frame.number, frame.body.to_vec()));
            }
        }
    }
    frames
}

/// Every frame of the cable is copied, with the number of the program that has asked.
#[test]
fn who_records_sees_what_each_program_asks_and_is_answered() {
    let bench = Bench::new();
    assert_eq!(bench.0.borrow_mut().multiplexer.take_seen(), [], "nobody has asked for copies");
    bench.0.borrow_mut().multiplexer.copy_frames();
    let (mut first, mut second) = (bench.program(), bench.program());
    turn(&mut first);
    second.read_state(0).unwrap();
    bench.run(1_500 * MS);
    let ids = [&first, &second].map(|program| program.transport().id);
    let seen = bench.0.borrow_mut().multiplexer.take_seen();
    let of = |kinds: &[Kind], number: u16| -> Vec<Option<u64>> {
        let alike = seen.iter().filter(|one| kinds.contains(&one.kind) && one.number == number);
        alike.map(|one| one.program).collect()
    };
    let asks = [Kind::Request, Kind::WatcherRequest];
    assert_eq!(of(&asks, ask::ReadState::NUMBER), of(&[Kind::Reply], ask::ReadState::NUMBER));
    // Arming is refused first, as nobody is in command, and asked again by the server.
    assert_eq!(of(&asks, ask::Arm::NUMBER), [Some(ids[0]); 2]);
    assert_eq!(of(&[Kind::Error], Error::NobodyInCommand {}.number()), [Some(ids[0])]);
    assert_eq!(of(&[Kind::Reply], ask::Arm::NUMBER), [Some(ids[0])]);
    assert_eq!(of(&asks, ask::ReadState::NUMBER).last(), Some(&Some(ids[1])));
    assert!(of(&asks, ask::Ping::NUMBER).contains(&Some(SERVER)), "it asks by itself, too");
    let changed = Event::StateChanged { axis: 0, state: AxisState::Armed }.number();
    assert!(!of(&[Kind::Event], changed).is_empty());
    assert!(bench.0.borrow_mut().multiplexer.take_seen().is_empty(), "each once");
}

#[test]
fn one_commands_and_the_others_watch() {
    let bench = Bench::new();
    let (mut first, mut second) = (bench.program(), bench.program());
    turn(&mut first);
    assert!((bench.speed() - 2.0).abs() < 0.3);
    assert_eq!(second.read_state(0).unwrap().state, AxisState::Active);
    assert_eq!(refusal(second.arm(0)), Error::NotInCommand { holder: 0 });
    assert_eq!(
        refusal(second.clear(mgw_client::host_protocol::ClearTarget::Axis(0))),
        Error::NotInCommand { holder: 0 }
    );
    // What it gives back it does not have.
    second.release_authority().unwrap();
    first.ping().unwrap();
    assert_eq!(first.read_state(0).unwrap().state, AxisState::Active);
    // Given back, it is the other's.
    first.release_authority().unwrap();
    bench.run(500 * MS);
    second.arm(0).unwrap();
    assert_eq!(refusal(first.arm(0)), Error::NotInCommand { holder: 0 });
}

#[test]
fn the_one_in_command_dies_and_its_axes_trip_in_its_own_silence() {
    let bench = Bench::new();
    let (mut first, mut watcher) = (bench.program(), bench.program());
    turn(&mut first);
    let died = bench.now();
    bench.close(&first);
    // The watcher is as lively as can be, and asks for the right to command all the time.
    while bench.now() < died + 200 * MS {
        watcher.ping().unwrap();
        assert_eq!(refusal(watcher.arm(0)), Error::NotInCommand { holder: 0 });
        assert_eq!(watcher.read_state(0).unwrap().state, AxisState::Active);
    }
    while bench.now() < died + 300 * MS {
        watcher.ping().unwrap();
    }
    assert_eq!(bench.trip(), Some(TripReason::HostSilent));
    bench.run(500 * MS);
    assert!(bench.speed().abs() < 0.05);
    // Now it is the watcher's.
    watcher.clear(mgw_client::host_protocol::ClearTarget::Axis(0)).unwrap();
    turn(&mut watcher);
    assert!((bench.speed() - 2.0).abs() < 0.3);
}

#[test]
fn the_one_in_command_hangs_and_comes_back() {
    let bench = Bench::new();
    let mut first = bench.program();
    let epoch = turn(&mut first);
    bench.run(400 * MS);
    assert_eq!(bench.trip(), Some(TripReason::HostSilent));
    assert!(matches!(refusal(first.set(0, epoch, TURNING, LONG)), Error::Tripped { axis: 0, .. }));
}

#[test]
fn a_hello_of_the_one_in_command_ends_its_authority_like_silence() {
    let bench = Bench::new();
    let mut first = bench.program();
    turn(&mut first);
    first.info().unwrap();
    for _ in 0..30 {
        first.ping().unwrap();
        bench.run(10 * MS);
    }
    assert_eq!(bench.trip(), Some(TripReason::HostSilent));
}

#[test]
fn a_hello_that_cannot_be_read_ends_nothing() {
    let bench = Bench::new();
    let mut first = bench.program();
    turn(&mut first);
    let mut out = [0; MAX_FRAME];
    let length = encode(Kind::Request, 30_000, ask::Hello::NUMBER, &1_u8, &mut out).unwrap();
    first.transport_mut().send(&out[..length]).unwrap();
    for _ in 0..30 {
        first.ping().unwrap();
        bench.run(10 * MS);
    }
    assert_eq!(bench.trip(), None);
}

#[test]
fn no_program_changes_the_rate_of_the_cable() {
    let bench = Bench::new();
    let (mut first, mut watcher) = (bench.program(), bench.program());
    turn(&mut first);
    for program in [&mut first, &mut watcher] {
        assert_eq!(
            refusal(program.request(&ask::SetBaud { baud: 2_000_000 })),
            Error::LinkHasNoBaud {}
        );
    }
    let sent = |number| bench.0.borrow().cable.iter().any(|(_, _, of)| *of == number);
    assert!(sent(ask::Arm::NUMBER) && !sent(ask::SetBaud::NUMBER));
}

#[test]
fn a_watcher_stops_while_the_one_in_command_floods() {
    let bench = Bench::new();
    let (mut first, mut watcher) = (bench.program(), bench.program());
    turn(&mut first);
    for sequence in 0..4_000u16 {
        let axis = u8::try_from(sequence % 4).unwrap();
        let flood = frame(20_000 + sequence, &ask::ReadState { axis });
        first.transport_mut().send(&flood).unwrap();
    }
    let asked = bench.now();
    watcher.estop().unwrap();
    let (at, _, _) =
        *bench.0.borrow().cable.iter().find(|(_, _, n)| *n == ask::EStop::NUMBER).unwrap();
    assert_eq!(at, asked, "it is the next frame on the cable");
    assert!(bench.now() - asked < 10 * MS);
    bench.run(500 * MS);
    assert!(bench.speed().abs() < 0.05);
    assert_eq!(bench.trip(), Some(TripReason::EStop));
}

#[test]
fn a_flood_of_watchers_keeps_the_one_in_command_going() {
    let bench = Bench::new();
    let mut first = bench.program();
    let mut others: Vec<_> = (0..31).map(|_| bench.program()).collect();
    let epoch = turn(&mut first);
    let ttl = 40 * MS;
    for round in 0..100u16 {
        for other in &mut others {
            for request in 0..20 {
                let sequence = round.wrapping_mul(20).wrapping_add(request).wrapping_add(30_000);
                let bytes = frame(sequence, &ask::ReadState { axis: 0 });
                other.transport_mut().send(&bytes).unwrap();
            }
        }
        first.set(0, epoch, TURNING, ttl).unwrap();
        bench.run(10 * MS);
    }
    while let Some(EventMessage { event, .. }) = first.poll_event(Duration::ZERO).unwrap() {
        assert!(!matches!(event, Event::Tripped { .. }), "{event:?}");
    }
    // Each of the others had its turn.
    for other in &mut others {
        let wire = other.transport_mut();
        assert!(frames(wire).iter().filter(|(kind, ..)| *kind != Kind::Event).count() > 4);
    }
}

#[test]
fn a_program_that_does_not_read_loses_events_and_blocks_nobody() {
    let bench = Bench::new();
    let (mut first, mut slow) = (bench.program(), bench.program());
    bench.set_reads(slow.transport().id, false);
    for _ in 0..150 {
        first.arm(0).unwrap();
        first.disarm(0).unwrap();
        bench.run(100 * MS);
        while first.poll_event(Duration::ZERO).unwrap().is_some() {}
    }
    bench.set_reads(slow.transport().id, true);
    let mut told = 0;
    let mut dropped = 0;
    while let Some(EventMessage { dropped: lost, .. }) = slow.poll_event(MS).unwrap() {
        told += 1;
        dropped += lost;
    }
    assert_eq!(told, 256);
    assert!(dropped > 200, "{dropped}");
    assert_eq!(slow.losses().events_lost, 0, "they are counted, not missing");
    // The other one has lost nothing.
    assert_eq!(first.losses().events_lost, 0);
}

#[test]
fn a_stop_goes_out_although_its_program_says_hello_or_goes_right_after_it() {
    let stop = frame(3, &ask::Stop { target: StopTarget::All });
    let hello = ask::Hello { protocol_major: 1, protocol_minor: 0, session: 5 };
    for goes in [false, true] {
        let bench = Bench::new();
        let (mut first, mut other) = (bench.program(), bench.program());
        turn(&mut first);
        let id = other.transport_mut().id;
        {
            // All of it at once, before the cable is looked at.
            let mut rig = bench.0.borrow_mut();
            let now = Duration::from_micros(rig.world.now().as_micros());
            let bytes = if goes { stop.clone() } else { [stop.clone(), frame(4, &hello)].concat() };
            rig.multiplexer.program_bytes(now, id, &bytes);
            if goes {
                rig.multiplexer.program_closed(id);
            }
        }
        bench.run(100 * MS);
        assert!(bench.speed().abs() < 0.05, "gone: {goes}");
    }
}

#[test]
fn the_same_request_gets_the_same_result() {
    let bench = Bench::new();
    let (mut one, mut other) = (bench.wire(), bench.wire());
    let hello = ask::Hello { protocol_major: 1, protocol_minor: 0, session: 5 };
    let ping = frame(2, &ask::Ping {});
    for wire in [&mut one, &mut other] {
        wire.send(&frame(1, &hello)).unwrap();
        wire.send(&ping).unwrap();
    }
    bench.run(20 * MS);
    let (first, others) = (frames(&mut one), frames(&mut other));
    let pong = |frames: &[(Kind, u16, u16, Vec<u8>)]| {
        frames.iter().find(|(_, sequence, ..)| *sequence == 2).unwrap().clone()
    };
    assert_ne!(pong(&first), pong(&others), "each its own");
    bench.run(20 * MS);
    one.send(&ping).unwrap();
    bench.run(20 * MS);
    assert_eq!(frames(&mut one), [pong(&first)], "the pong of then, byte for byte");
    let pings = bench.0.borrow().cable.iter().filter(|(_, _, n)| *n == ask::Ping::NUMBER).count();
    assert!(pings < 12, "{pings}: it did not go to the gateway again");
    // A stop does each time it comes, and is answered the same.
    let stop = frame(3, &ask::Stop { target: StopTarget::All });
    for _ in 0..3 {
        one.send(&stop).unwrap();
        bench.run(20 * MS);
        assert_eq!(frames(&mut one).iter().filter(|(k, ..)| *k == Kind::Reply).count(), 1);
    }
    let stops = bench.0.borrow().cable.iter().filter(|(_, _, n)| *n == ask::Stop::NUMBER).count();
    assert_eq!(stops, 3);
}

#[test]
fn the_board_resets_and_programs_are_told() {
    let bench = Bench::new();
    let (mut first, mut watcher) = (bench.program(), bench.program());
    turn(&mut first);
    bench.reset();
    bench.run(1_500 * MS);
    assert!(bench.0.borrow().news.contains(&News::Lost("it has started anew")));
    assert!(bench.is_over(first.transport().id) && bench.is_over(watcher.transport().id));
    assert!(first.ping().is_err() && watcher.ping().is_err());
    assert!(bench.speed().abs() < 0.05);
    // Who comes now finds the gateway again, and it has stopped what was in motion.
    assert_eq!(bench.trip(), Some(TripReason::Reset));
}

#[test]
fn the_cable_is_cut_and_plugged_in_again() {
    let bench = Bench::new();
    let mut first = bench.program();
    turn(&mut first);
    bench.unplug();
    assert!(bench.is_over(first.transport().id));
    bench.run(1_000 * MS);
    assert!(bench.speed().abs() < 0.05, "the gateway stops by itself");
    // Who comes now is told so, in words.
    let away = bench.try_program().err().unwrap();
    assert!(away.to_string().contains("the server has lost the gateway"), "{away}");
    // A stop is not refused: it goes out when the gateway is back.
    let mut wire = bench.wire();
    let stop = frame(3, &ask::Stop { target: StopTarget::All });
    wire.send(&stop).unwrap();
    bench.run(100 * MS);
    assert_eq!(frames(&mut wire), []);
    bench.plug();
    bench.run(100 * MS);
    assert_eq!(frames(&mut wire).first().map(|(kind, ..)| *kind), Some(Kind::Reply));
    assert_eq!(bench.trip(), Some(TripReason::HostSilent));
}

#[test]
fn a_gateway_that_hangs_is_given_up() {
    let bench = Bench::new();
    let mut watcher = bench.program();
    bench.0.borrow_mut().world.hang();
    bench.run(5_000 * MS);
    assert!(bench.0.borrow().news.contains(&News::Lost("it does not answer any more")));
    assert!(watcher.ping().is_err());
}

#[test]
fn each_program_has_its_own_samples() {
    let bench = Bench::new();
    let (mut fast, mut slow) = (bench.program(), bench.program());
    let fields = |field: StateField| StateFields::of(&[field]);
    fast.subscribe(&[0], fields(StateField::Velocity), 20 * MS).unwrap();
    slow.subscribe(&[0], fields(StateField::Position), 100 * MS).unwrap();
    bench.run(2_000 * MS);
    let count = |program: &mut rig::Program, there: StateField, not: StateField| {
        let mut samples = 0;
        while let Some(EventMessage { event, .. }) = program.poll_event(Duration::ZERO).unwrap() {
            if let Event::Sample { .. } = event {
                samples += 1;
                assert!(event.reading(not).is_none());
                assert!(samples < 5 || event.reading(there).is_some());
            }
        }
        samples
    };
    let fast_ones = count(&mut fast, StateField::Velocity, StateField::Position);
    let slow_ones = count(&mut slow, StateField::Position, StateField::Velocity);
    assert!((95..=103).contains(&fast_ones), "{fast_ones}");
    assert!((19..=22).contains(&slow_ones), "{slow_ones}");
    // A period that is none is refused, and changes nothing.
    let error = refusal(slow.subscribe(&[0], fields(StateField::Position), 20_000 * MS));
    assert!(matches!(error, Error::OutOfRange { .. }));
    assert!(matches!(fast.poll_event(50 * MS).unwrap().unwrap().event, Event::Sample { .. }));
    // Who has gone is sampled for no more.
    bench.close(&fast);
    bench.close(&slow);
    bench.run(10 * MS);
    assert!(bench.0.borrow().cable.iter().rev().any(|(_, _, n)| *n == ask::Subscribe::NUMBER));
}

#[test]
fn the_server_itself_is_no_sign_of_life() {
    let bench = Bench::new();
    let mut first = bench.program();
    turn(&mut first);
    let start = bench.now();
    bench.run(10_000 * MS);
    let rig = bench.0.borrow();
    let own: Vec<_> = rig.cable.iter().filter(|(at, ..)| *at > start).collect();
    assert!(own.len() >= 8, "it looks whether the gateway is there");
    assert!(own.iter().all(|(_, kind, _)| *kind == Kind::WatcherRequest), "{own:?}");
}

#[test]
fn without_the_token_nothing_is_asked_of_the_gateway() {
    let bench = Bench::new();
    let mut wire = bench.wire();
    let unproved = bench.0.borrow_mut().multiplexer.program_opened(Duration::ZERO, false);
    wire.id = unproved;
    let before = bench.0.borrow().cable.len();
    wire.send(&frame(3, &ask::Stop { target: StopTarget::All })).unwrap();
    let answer = bench.0.borrow_mut().multiplexer.poll_program(unproved);
    assert!(answer.is_none_or(|frame| frame.len() > 9));
    assert!(bench.is_over(unproved));
    assert_eq!(bench.0.borrow().cable.len(), before);
}
