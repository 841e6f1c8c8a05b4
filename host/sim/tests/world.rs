//! The simulated world by itself: timing on the wire, determinism, broken cables, the motors' own
//! logs.

mod four_motors;
mod lives;
mod strangers;

use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use four_motors::Rig;
use host_protocol::{BusState, CanFrame, RawFrame};
use mgw_client::{Client, Transport};
use mgw_sim::{BusFault, Injection, MotorEvent, SimTransport, Station, TraceEntry, Wiring, World};

fn lines(trace: &[TraceEntry]) -> Vec<String> {
    trace.iter().map(|entry| format!("{} {:?} {}", entry.bus, entry.from, entry.wire)).collect()
}

/// 108 bits, one stuff bit in the id, eleven in the zeros of the data, and those of the checksum;
/// the answer follows after the motor's 100 to 200 µs.
#[test]
fn frames_take_their_time_on_the_wire() {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.world.borrow_mut().trace();
    rig.client.raw_open(0).unwrap();
    let frame = CanFrame::standard(0x141, &[0x9C, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    rig.client.raw_send(0, RawFrame::Can(frame)).unwrap();
    rig.silence(2);
    let trace = rig.world.borrow_mut().trace();
    assert_eq!(
        lines(&trace),
        ["0 Gateway 141#9C00000000000000", "0 Motor(0) 241#9C19000000000000"]
    );
    let [request, reply] = trace.as_slice() else { panic!("two frames") };
    assert!((120..=123).contains(&(request.end_us - request.time_us)), "{request:?}");
    assert!((100..=200).contains(&(reply.time_us - request.end_us)), "{reply:?}");
}

/// Two threads, a host link each: the world's time is that of both.
#[test]
fn threads_may_share_a_world() {
    let world = Arc::new(Mutex::new(World::new(Wiring::four_motors())));
    let ends = [0, 1].map(|link| {
        let world = world.clone();
        thread::spawn(move || {
            let mut client = Client::connect(SimTransport::new(world, link)).unwrap();
            for _ in 0..20 {
                client.ping().unwrap();
            }
            client.now()
        })
    });
    let ends = ends.map(|thread| thread.join().unwrap());
    let now = Duration::from_micros(world.lock().unwrap().now().as_micros());
    assert!(ends.iter().all(|end| *end <= now) && ends.contains(&now), "{ends:?} {now:?}");
}

/// It was no whole number of microseconds to the end: who waits in a loop gets there.
#[test]
fn a_wait_of_less_than_a_microsecond_passes() {
    let world = Arc::new(Mutex::new(World::new(Wiring::four_motors())));
    let mut transport = SimTransport::new(world, 0);
    let end = transport.now() + Duration::from_nanos(1);
    assert_eq!(transport.receive(&mut [0], Duration::from_nanos(1)).unwrap(), 0);
    assert!(transport.now() >= end);
}

#[test]
fn the_same_seed_gives_the_same_run() {
    let run = |seed| {
        let mut rig = Rig::new(Wiring { seed, ..Wiring::four_motors() });
        rig.move_for(Duration::from_millis(500));
        rig.silence(500);
        rig.world.borrow_mut().trace()
    };
    let first = run(1);
    assert_eq!(first, run(1));
    assert_ne!(first, run(2));
}

/// Run in one piece or looked at every 137 µs: the same frames at the same times, the same shaft to
/// the last bit.
#[test]
fn a_run_does_not_depend_on_how_it_is_cut_into_pieces() {
    let run = |piece: Duration| {
        let mut rig = Rig::new(Wiring::four_motors());
        rig.move_for(Duration::from_millis(300));
        let mut world = rig.world.borrow_mut();
        let end = world.now() + gateway::Duration::from_millis(300);
        while world.now() < end {
            let rest = Duration::from_micros(end.since(world.now()).as_micros());
            world.run_for(piece.min(rest));
        }
        let shafts: Vec<_> =
            world.motors().iter().map(|motor| motor.position_rad().to_bits()).collect();
        (world.trace(), shafts)
    };
    assert_eq!(run(Duration::from_secs(1)), run(Duration::from_micros(137)));
}

#[test]
fn every_motor_logs_its_own_stop_when_the_host_is_gone() {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.move_for(Duration::from_secs(1));
    let speeds = rig.speeds();
    assert!(speeds.iter().all(|speed| *speed > 1.9), "{speeds:?}");

    let silent_from = rig.world.borrow().now().as_micros();
    rig.silence(2_000);
    let world = rig.world.borrow();
    for motor in world.motors() {
        let moves = |what: &MotorEvent| {
            matches!(what, MotorEvent::Moving { .. } | MotorEvent::Stopped { .. })
        };
        let last = motor.log().entries().rfind(|entry| moves(&entry.what)).copied();
        assert!(
            last.is_some_and(|last| {
                matches!(last.what, MotorEvent::Stopped { .. }) && last.time_us > silent_from
            }),
            "{motor}: {last:?}"
        );
    }
}

/// The gateway's stop cannot pass: the second layer is the motor's own timeout, here 1 s.
#[test]
fn behind_a_cut_cable_the_motors_own_timeout_acts() {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.move_for(Duration::from_secs(1));
    for bus in 0..3 {
        rig.world.borrow_mut().set_bus_fault(bus, BusFault::Cut);
    }
    rig.silence(800);
    assert!(rig.speeds().iter().all(|speed| *speed > 1.9), "{:?}", rig.speeds());
    rig.silence(2_000);
    assert_eq!(rig.speeds(), [0.0; 4]);
    let world = rig.world.borrow();
    for motor in world.motors() {
        let timeout = MotorEvent::Timeout { after_ms: 1_000 };
        assert!(motor.log().entries().any(|entry| entry.what == timeout), "{motor}");
    }
}

#[test]
fn a_short_is_bus_off_and_a_cut_is_not() {
    let mut rig = Rig::new(Wiring::four_motors());
    let mut state_with = |fault| {
        rig.world.borrow_mut().set_bus_fault(0, fault);
        // Arming sends the first frames; it cannot succeed.
        rig.client.arm(0).unwrap_err();
        rig.client.bus_status(0).unwrap().state
    };
    assert_eq!(state_with(BusFault::Cut), BusState::Passive);
    assert_eq!(state_with(BusFault::Short), BusState::BusOff);
    rig.world.borrow_mut().set_bus_fault(0, BusFault::None);
    rig.silence(5_000);
    rig.client.ping().unwrap();
    assert_eq!(rig.client.bus_status(0).unwrap().state, BusState::Active);
}

#[test]
fn an_unplugged_motor_is_silent_and_the_others_are_not() {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.world.borrow_mut().inject(0, Injection::Unplugged(true));
    rig.client.arm(0).unwrap_err();
    rig.client.arm(1).unwrap();
    assert!(
        rig.world
            .borrow_mut()
            .trace()
            .iter()
            .all(|entry| { entry.from != Station::Motor(0) || entry.time_us < 20_000 })
    );
}

/// A host link carries 92160 bytes per second, no more.
#[test]
fn host_links_have_the_pace_of_a_uart() {
    let mut world = World::new(Wiring::four_motors());
    world.host_send(0, &[0xFF; 10_000]);
    world.run_for(Duration::from_millis(100));
    assert_eq!(world.host_backlog(0), 10_000 - 9_216);
    world.run_for(Duration::from_millis(10));
    assert_eq!(world.host_backlog(0), 0);
}

#[test]
fn a_wiring_that_cannot_be_is_refused_with_its_reason() {
    use host_protocol::Protocol;
    let refused = |bus, protocol, node| {
        let wiring = Wiring::on(&mgw_sim::BOARD).with(bus, protocol, node);
        World::try_new(wiring).err().map(|error| error.to_string())
    };
    assert_eq!(refused(4, Protocol::Rmd, 1).unwrap(), "there is no bus 4: the board has 4");
    assert_eq!(refused(0, Protocol::Rmd, 33).unwrap(), "no rmd motor can have the id 33");
    let thruster = refused(2, Protocol::Thruster, 11).unwrap();
    assert_eq!(thruster, "the simulated thruster motor speaks CAN only");
    assert_eq!(refused(2, Protocol::D5, 11), None);
    assert_eq!(refused(0, Protocol::Thruster, 127), None);
}
