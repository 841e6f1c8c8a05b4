//! Scans in virtual time.

use std::cell::RefCell;
use std::rc::Rc;

use mgw_client::Interrupt;
use mgw_sim::{Injection, SimTransport, Turning, World};

use super::*;
use crate::args::FactoryMotor;
use crate::four_motors;
use crate::output::Output;

const SECOND: Duration = Duration::from_secs(1);
/// Of the bus monitoring mode.
const LISTEN: Duration = Duration::from_millis(1_200);

fn motor(protocol: Protocol, node: u8, bitrate: Option<u32>) -> FactoryMotor {
    FactoryMotor { bus: 0, protocol, node, dialect: None, bitrate }
}

fn world(motors: &[FactoryMotor]) -> (Rc<RefCell<World>>, Session) {
    let world = four_motors::of(motors).expect("they can be");
    let transport = Box::new(SimTransport::new(Rc::clone(&world), 0));
    let session = Session::on(transport, Interrupt::default(), Output::none());
    (world, session.expect("a session"))
}

/// What a scan of bus 0 at these bitrates finds, and how long it takes.
fn scanned(
    world: &Rc<RefCell<World>>,
    session: &mut Session,
    bitrates: &[u32],
    wanted: Wanted,
) -> (Vec<Scanned>, Duration) {
    let bitrates = Bitrates::Named(bitrates.to_vec());
    let wanted = Wanted { targets: vec![ScanTarget { bus: 0, bitrates }], ..wanted };
    let (began, mut all) = (world.borrow().now(), Vec::new());
    let result = scan(session, &wanted, |_, scanned| {
        all.push(scanned);
        Ok(())
    });
    result.expect("it is scanned");
    let ended = world.borrow().now();
    (all, Duration::from_micros(ended.as_micros() - began.as_micros()))
}

fn usual() -> Wanted {
    Wanted { targets: Vec::new(), listen: LISTEN, thrusters: true, force: false }
}

#[test]
fn one_bus_at_one_bitrate_with_three_motors_takes_less_than_2_s_beside_listening() {
    let (rmd, thruster) = (Protocol::Rmd, Protocol::Thruster);
    let motors = [motor(rmd, 1, None), motor(rmd, 32, None), motor(thruster, 11, None)];
    let (world, mut session) = world(&motors);
    let (all, took) = scanned(&world, &mut session, &[1_000_000], usual());
    let nodes: Vec<u8> = all[0].motors.iter().map(|motor| motor.node).collect();
    assert_eq!(nodes, [1, 32, 11]);
    assert!(took < LISTEN + 2 * SECOND, "{took:?}");
    // It is not configured any more, as before.
    assert_eq!(session.client.bus_status(0).expect("status").config, None);
}

/// A motor at 500 kbit/s that sends by itself, and another that acknowledges it.
fn talking() -> (Rc<RefCell<World>>, Session) {
    let motors = [1, 2].map(|node| motor(Protocol::Rmd, node, Some(500_000)));
    let (world, session) = world(&motors);
    world.borrow_mut().inject(0, Injection::ActiveReplies(true));
    (world, session)
}

#[test]
fn a_bus_that_talks_at_another_bitrate_is_not_asked_and_not_disturbed() {
    let (world, mut session) = talking();
    let (all, took) = scanned(&world, &mut session, &[1_000_000, 250_000], usual());
    assert_eq!(all.len(), 1);
    assert_eq!((all[0].not_asked, all[0].motors.len()), (Some(NotAsked::Busy), 0));
    assert!((LISTEN * 2..LISTEN * 2 + SECOND).contains(&took), "{took:?}");
    let status = session.client.bus_status(0).expect("status");
    assert_eq!((status.counters.transmitted, status.counters.cancelled), (0, 0));

    // Where nobody has listened it is not asked either.
    let unheard = Wanted { listen: Duration::ZERO, ..usual() };
    let (all, _) = scanned(&world, &mut session, &[1_000_000], unheard);
    assert_eq!(all[0].not_asked, Some(NotAsked::NotListened));

    // Forced: two frames, each once.
    let forced = Wanted { force: true, ..usual() };
    let (all, _) = scanned(&world, &mut session, &[1_000_000], forced);
    assert!(all[0].unacknowledged && all[0].not_asked.is_none());
    let status = session.client.bus_status(0).expect("status");
    assert_eq!((status.counters.transmitted, status.counters.cancelled), (0, 2));
}

#[test]
fn the_bitrate_at_which_something_is_heard_is_the_one_that_is_asked_at() {
    let (world, mut session) = talking();
    let (all, _) = scanned(&world, &mut session, &[1_000_000, 500_000, 250_000], usual());
    assert_eq!(all.len(), 1);
    let nodes: Vec<u8> = all[0].motors.iter().map(|motor| motor.node).collect();
    assert_eq!((all[0].bitrate, nodes), (Some(500_000), vec![1, 2]));
}

#[test]
fn a_silent_bus_is_asked_at_each_bitrate_until_motors_are_found() {
    let (world, mut session) = world(&[motor(Protocol::Rmd, 7, Some(250_000))]);
    let (all, _) = scanned(&world, &mut session, &[1_000_000, 500_000, 250_000, 210_526], usual());
    let of = |scanned: &Scanned| (scanned.bitrate, scanned.unacknowledged, scanned.motors.len());
    let all: Vec<_> = all.iter().map(of).collect();
    assert_eq!(
        all,
        [(Some(1_000_000), true, 0), (Some(500_000), true, 0), (Some(250_000), false, 1)]
    );
}

#[test]
fn the_first_read_counts_as_asked_and_its_answer_as_none_unasked() {
    let (world, mut session) = world(&[motor(Protocol::Rmd, 1, None)]);
    let (all, _) = scanned(&world, &mut session, &[1_000_000], usual());
    let [found] = all[0].motors.as_slice() else { panic!("{all:?}") };
    assert_eq!((found.unasked.as_slice(), found.doubled), ([].as_slice(), None));
}

#[test]
fn a_motor_that_sends_alone_is_heard_although_nobody_acknowledges_it() {
    let (world, mut session) = world(&[motor(Protocol::Rmd, 1, Some(500_000))]);
    world.borrow_mut().inject(0, Injection::ActiveReplies(true));
    // It repeats its frame without end until somebody acknowledges it.
    let (all, _) = scanned(&world, &mut session, &[1_000_000, 500_000], usual());
    assert_eq!((all.len(), all[0].bitrate, all[0].motors.len()), (1, Some(500_000), 1));
}

#[test]
fn a_motor_that_turns_is_told() {
    let motors = [motor(Protocol::Rmd, 1, None), motor(Protocol::Rmd, 2, None)];
    let (world, mut session) = world(&motors);
    let turning = Turning { speed: 3_000, turns: SECOND * 60, holds: Duration::ZERO };
    world.borrow_mut().inject(1, Injection::Turning(Some(turning)));
    let (all, _) = scanned(&world, &mut session, &[1_000_000], usual());
    let turns: Vec<bool> = all[0].motors.iter().map(|motor| motor.turns().is_some()).collect();
    assert_eq!(turns, [false, true]);
    let notes = crate::commands::notes(&all[0], &all[0].motors[1]);
    assert!(notes.iter().any(|note| note.contains("it turns, at 3.")), "{notes:?}");
}

#[test]
fn a_line_with_three_motors_takes_less_than_2_s_beside_listening() {
    for (protocol, nodes) in [(Protocol::Rmd, [1, 5, 32]), (Protocol::D5, [11, 12, 42])] {
        let on_line = |node| FactoryMotor { bus: 2, ..motor(protocol, node, Some(115_200)) };
        let (world, mut session) = world(&nodes.map(on_line));
        let began = world.borrow().now();
        let bitrates = Bitrates::Named(vec![115_200]);
        let wanted = Wanted { targets: vec![ScanTarget { bus: 2, bitrates }], ..usual() };
        let mut found = Vec::new();
        scan(&mut session, &wanted, |_, scanned| {
            found.extend(scanned.motors.iter().map(|motor| motor.node));
            Ok(())
        })
        .expect("it is scanned");
        let took = Duration::from_micros(world.borrow().now().as_micros() - began.as_micros());
        assert_eq!(found, nodes);
        assert!(took < LISTEN + 2 * SECOND, "{protocol}: {took:?}");
    }
}

#[test]
fn bitrates_behind_the_one_with_motors_are_told_as_not_tried() {
    let (world, mut session) = world(&[motor(Protocol::Rmd, 7, None)]);
    let (all, _) = scanned(&world, &mut session, &[1_000_000, 500_000], usual());
    assert_eq!(all[0].left_out, [500_000]);
}
