//! That the search finds what is to be found, and leaves out nothing.

use super::*;
use crate::action::{Action, Ask};
use crate::world::World;
use gateway::Outgoing;
use promise_model::Check;
use std::collections::HashSet;
use std::sync::atomic::AtomicBool;

const START_US: u64 = 1_000;
const RMD_COAST: u8 = 0x80;

fn is_output_off(frame: &Outgoing) -> bool {
    matches!(frame, Outgoing::Can(frame) if frame.data().first() == Some(&RMD_COAST))
}

fn checks_found(world: &World, letters: &[Letter], depth: u8) -> Vec<Option<Check>> {
    let stop = AtomicBool::new(false);
    let mut search = Search::new(letters, 2, &stop);
    search.run(world, depth);
    search.found.iter().map(|found| found.what.check()).collect()
}

#[test]
fn a_stop_that_is_forgotten_is_found() {
    let (mut world, _) = prepare(START_US, &PAIRS[0], Prepared::Active).unwrap();
    let letters = [
        Letter::Next,
        Letter::Pause(1_000),
        Letter::Now(Action::Ask { link: 0, ask: Ask::Stop { axis: 0 } }),
    ];
    assert_eq!(checks_found(&world, &letters, 3), []);
    world.swallows = Some(is_output_off);
    assert_eq!(checks_found(&world, &letters, 2), [Some(Check::StopLate)]);
}

#[test]
fn events_that_follow_from_each_other_without_end_are_found() {
    let (mut world, _) = prepare(START_US, &PAIRS[0], Prepared::Active).unwrap();
    world.returns = true;
    let letters = [Letter::Now(Action::Ask { link: 0, ask: Ask::StopAll })];
    assert_eq!(checks_found(&world, &letters, 1), [Some(Check::Restless)]);
}

/// After a loss of power the stored configuration counts; where it is lost, that is found.
#[test]
fn a_stored_configuration_that_is_lost_is_found() {
    let (mut world, _) = prepare(START_US, &PAIRS[0], Prepared::Idle).unwrap();
    world.act(&Action::Ask { link: 0, ask: Ask::Save });
    world.act(&Action::Stored { done: true });
    let letters = [Letter::Now(Action::PowerLoss), Letter::Pause(100_000)];
    assert_eq!(checks_found(&world, &letters, 2), []);
    world.forget_stored();
    assert!(checks_found(&world, &letters, 2).contains(&Some(Check::ResetForgot)));
}

#[test]
fn what_is_found_is_replayed() {
    let (mut world, _) = prepare(START_US, &PAIRS[0], Prepared::Active).unwrap();
    world.swallows = Some(is_output_off);
    let letters = alphabet(&PAIRS[0]);
    let stop = AtomicBool::new(false);
    let mut search = Search::new(&letters, 2, &stop);
    search.run(&world, 1);
    // An expiry alone ends in a stop.
    let found =
        search.found.iter().find(|found| found.letters == [Letter::Pause(100_000)]).unwrap();
    found.letters.iter().for_each(|letter| letter.happen(&mut world));
    assert_eq!(Some(&found.what), world.broken().cloned().map(What::Broken).as_ref());
}

/// Every state that some sequence leads to is gone on from, once.
#[test]
fn cutting_off_leaves_out_no_state() {
    const DEPTH: u8 = 2;
    let (world, _) = prepare(START_US, &PAIRS[2], Prepared::Stopping).unwrap();
    let letters: Vec<Letter> = alphabet(&PAIRS[2]).into_iter().step_by(5).collect();
    let axes = 4;
    let stop = AtomicBool::new(false);
    let mut search = Search::new(&letters, axes, &stop);
    search.run(&world, DEPTH + 1);
    assert!(search.cut > 0);

    let mut states = HashSet::new();
    let mut worlds = vec![world];
    for _ in 0..=DEPTH {
        let mut next = Vec::new();
        for world in worlds {
            states.insert(world.state_key(axes, &mut String::new()));
            for letter in &letters {
                let mut after = world.clone();
                letter.happen(&mut after);
                next.push(after);
            }
        }
        worlds = next;
    }
    assert_eq!(search.states(), states.len());
}

#[test]
fn every_pair_comes_into_every_state() {
    for pair in &PAIRS {
        for prepared in Prepared::ALL {
            let (world, steps) = prepare(START_US, pair, prepared).unwrap();
            assert!(world.broken().is_none() && !steps.is_empty(), "{}, {prepared:?}", pair.name);
        }
    }
}
