//! Memory that a reset should have left alone, and that is not as it was left (GUARANTEES G8).

use crate::bench::{self, VELOCITY, arm_axis, keep_moving, listed, run_with_host};
use crate::rig::{BOARD_AGAIN, Instead, Rig};
use gateway::{Event, Gateway, Light};
use host_protocol::{
    AxisParameter, AxisState, ClearTarget, Error, Protocol, Reply, Request, StopAction, Value,
    replies::GatewayReport, requests,
};

/// Words that say nothing of the gateway: the mark of the layout, and the slot that is being
/// written.
const MARK_WORDS: usize = 4;
/// Behind the two copies of the states.
const STATES_END: usize = MARK_WORDS + 16;

fn status(rig: &mut Rig) -> GatewayReport {
    match rig.ask(Request::GatewayStatus(requests::GatewayStatus {})) {
        Ok(Reply::GatewayStatus(report)) => report,
        other => panic!("{other:?}"),
    }
}

/// What a gateway is like that has just taken over such words.
fn restored(words: &[u32]) -> Gateway {
    let mut gateway = Gateway::new(&BOARD_AGAIN, Some(7));
    gateway.restore(gateway::Instant::from_micros(500), words);
    gateway
}

/// The memory of a gateway with an axis in each of its states, and with the e-stop latched.
fn memories() -> Vec<(&'static str, Vec<u32>)> {
    let configured = || {
        let mut rig = bench::rmd_axes(1);
        // More than one write of each slot.
        bench::parameter(&mut rig, 0, AxisParameter::VelocityLimitRadS, Value::Float(3.5));
        rig
    };
    let active = || {
        let mut rig = configured();
        let epoch = arm_axis(&mut rig, 0);
        keep_moving(&mut rig, &[(0, epoch)], VELOCITY, 30_000);
        rig
    };
    let mut memories = Vec::new();
    let mut keep = |rig: &mut Rig, wanted: fn(AxisState) -> bool, name| {
        assert!(wanted(listed(rig, 0)), "{name}: {:?}", listed(rig, 0));
        memories.push((name, rig.memory.clone()));
    };
    keep(&mut configured(), |state| state == AxisState::Idle, "idle");
    let mut rig = configured();
    rig.instead(|_| Instead::Nothing);
    rig.send(&Request::Arm(requests::Arm { axis: 0 }));
    keep(&mut rig, |state| state == AxisState::Arming, "arming");
    let mut rig = configured();
    arm_axis(&mut rig, 0);
    keep(&mut rig, |state| state == AxisState::Armed, "armed");
    keep(&mut active(), |state| state == AxisState::Active, "active");
    let mut rig = active();
    rig.instead(|_| Instead::Nothing);
    rig.send(&Request::Stop(requests::Stop { target: host_protocol::StopTarget::Axis(0) }));
    keep(&mut rig, |state| state == AxisState::Stopping, "stopping");
    let mut rig = active();
    run_with_host(&mut rig, 200_000);
    keep(&mut rig, |state| state == AxisState::Tripped { confirmed: true }, "tripped");
    let mut rig = active();
    rig.instead(|_| Instead::Nothing);
    run_with_host(&mut rig, 800_000);
    keep(&mut rig, |state| state == AxisState::Tripped { confirmed: false }, "unreachable");
    let mut rig = active();
    bench::e_stop(&mut rig);
    run_with_host(&mut rig, 50_000);
    keep(&mut rig, |state| state == AxisState::Tripped { confirmed: true }, "after an e-stop");
    memories
}

/// The bits of a word that are tried: of one that is in use all where the states lie, else another
/// one in each word. With `MGW_ALL_BITS` every bit of every word.
fn bits(index: usize, word: u32) -> std::ops::Range<u32> {
    let some = u32::try_from(index).unwrap() % u32::BITS;
    match index {
        _ if std::env::var_os("MGW_ALL_BITS").is_some() => 0..u32::BITS,
        MARK_WORDS..STATES_END => 0..u32::BITS,
        _ if word != 0 || index.is_multiple_of(16) => some..some + 1,
        _ => 0..0,
    }
}

#[test]
fn a_flipped_bit_of_any_word_in_any_state_latches_the_e_stop_and_trips_every_axis() {
    for (name, mut words) in memories() {
        for index in MARK_WORDS..words.len() {
            for bit in bits(index, words[index]) {
                words[index] ^= 1 << bit;
                let gateway = restored(&words);
                words[index] ^= 1 << bit;
                assert_eq!(gateway.light(), Light::EStopped, "{name}: word {index}, bit {bit}");
                assert!(!gateway.all_at_rest(), "{name}: word {index}, bit {bit}");
                assert!(gateway.stops_under_way(), "{name}: word {index}, bit {bit}");
            }
        }
    }
}

#[test]
fn a_flipped_bit_of_the_mark_costs_nothing() {
    for (name, mut words) in memories() {
        let before = restored(&words).light();
        for index in 0..MARK_WORDS {
            for bit in 0..u32::BITS {
                words[index] ^= 1 << bit;
                let gateway = restored(&words);
                words[index] ^= 1 << bit;
                assert_eq!(gateway.light(), before, "{name}: word {index}, bit {bit}");
                assert!(gateway.stops_under_way(), "{name}: word {index}, bit {bit}");
            }
        }
    }
}

/// At each word that the start stores after it has found the damage.
#[test]
fn a_reset_of_the_start_that_finds_damage_does_not_forget_it() {
    let (name, memory) = memories().swap_remove(0);
    let mut cuts = 0;
    for index in (MARK_WORDS..memory.len()).filter(|index| memory[*index] != 0) {
        let mut words = memory.clone();
        words[index] ^= 1 << (index % 32);
        let mut gateway = restored(&words);
        let now = gateway::Instant::from_micros(600);
        gateway.handle(now, Event::EStopInput { open: false }, &mut |at, word| {
            words[at] = word;
            cuts += 1;
            assert_eq!(
                restored(&words).light(),
                Light::EStopped,
                "{name}: word {index}, then {at}"
            );
        });
    }
    assert!(cuts > 1_000, "{cuts}");
}

#[test]
fn damage_is_told_cleared_by_a_person_and_mended_in_the_memory() {
    let mut rig = bench::rmd_axes(2);
    rig.memory[MARK_WORDS + 3] ^= 1 << 20;
    rig.reset();
    bench::hello(&mut rig);
    run_with_host(&mut rig, 50_000);
    let report = status(&mut rig);
    assert_eq!((report.memory_damaged, report.e_stop_latched, report.starts), (true, true, 2));
    for axis in 0..2 {
        assert_eq!(listed(&mut rig, axis), AxisState::Tripped { confirmed: true });
    }
    for target in [ClearTarget::Gateway, ClearTarget::Axis(0), ClearTarget::Axis(1)] {
        rig.ask(Request::Clear(requests::Clear { target })).unwrap();
    }
    arm_axis(&mut rig, 0);
    rig.ask(Request::Disarm(requests::Disarm { axis: 0 })).unwrap();
    run_with_host(&mut rig, 50_000);
    rig.reset();
    bench::hello(&mut rig);
    let report = status(&mut rig);
    assert_eq!((report.memory_damaged, report.e_stop_latched, report.starts), (false, false, 3));
}

/// The words that change with an axis or a bus: both copies of its slot.
fn slot_of(change: impl Fn(&mut Rig)) -> Vec<usize> {
    let mut rig = bench::rmd_axes(2);
    let before = rig.memory.clone();
    change(&mut rig);
    (STATES_END..before.len()).filter(|index| rig.memory[*index] != before[*index]).collect()
}

fn slot_of_axis(axis: u8) -> Vec<usize> {
    slot_of(|rig| {
        bench::parameter(rig, axis, AxisParameter::VelocityLimitRadS, Value::Float(3.5));
    })
}

fn slot_of_the_bus() -> Vec<usize> {
    slot_of(|rig| bench::configure_bus(rig, 0, 500_000, &[Protocol::Rmd]))
}

#[test]
fn what_both_copies_have_lost_of_axes_and_buses_is_found_in_the_flash_and_stopped() {
    for (what, slot) in [
        ("axis 0", slot_of_axis(0)),
        ("axis 1", slot_of_axis(1)),
        ("the bus", slot_of_the_bus()),
        ("all", [slot_of_axis(0), slot_of_axis(1), slot_of_the_bus()].concat()),
    ] {
        for is_stored in [true, false] {
            let mut rig = bench::rmd_axes(2);
            let epoch = arm_axis(&mut rig, 1);
            keep_moving(&mut rig, &[(1, epoch)], VELOCITY, 30_000);
            let rows = if is_stored { rig.rows() } else { Vec::new() };
            slot.iter().for_each(|index| rig.memory[*index] ^= 1);
            rig.reset();
            rig.handle(Event::EStopInput { open: false });
            rig.run(1_000);
            assert!(!rig.gateway.enable_output(), "{what}");
            rig.load(&rows);
            bench::hello(&mut rig);
            rig.run(200_000);
            let report = status(&mut rig);
            assert_eq!((report.memory_damaged, report.e_stop_latched), (true, true), "{what}");
            assert_eq!(rig.gateway.enable_output(), is_stored, "{what}");
            if is_stored {
                for axis in [0, 1] {
                    let tripped = AxisState::Tripped { confirmed: true };
                    assert_eq!(listed(&mut rig, axis), tripped, "{what}, axis {axis}");
                }
                assert!(rig.sent_since(0, 0).contains(&"142#8100000000000000"), "{what}");
            }
            // Before anybody has cleared it another reset finds the same.
            rig.reset();
            rig.handle(Event::EStopInput { open: false });
            assert_eq!(rig.gateway.light(), Light::EStopped, "{what}");
            if !is_stored {
                rig.run(1_000);
                assert!(!rig.gateway.enable_output(), "{what}");
                bench::hello(&mut rig);
                let clear = requests::Clear { target: ClearTarget::Gateway };
                rig.ask(Request::Clear(clear)).unwrap();
                rig.run(1_000);
            }
        }
    }
}

/// Its motor may be in motion, whoever knows it again.
#[test]
fn a_lost_axis_that_a_host_configures_is_stopped_and_has_tripped() {
    let mut rig = bench::rmd_axes(2);
    slot_of_axis(1).iter().for_each(|index| rig.memory[*index] ^= 1);
    rig.reset();
    rig.handle(Event::EStopInput { open: false });
    bench::hello(&mut rig);
    rig.run(50_000);
    bench::parameter(&mut rig, 1, AxisParameter::VelocityLimitRadS, Value::Float(3.5));
    rig.run(1_000);
    assert!(!rig.gateway.enable_output(), "nobody knows where it is");
    for (parameter, number) in [
        (AxisParameter::Bus, 0),
        (AxisParameter::Protocol, Protocol::Rmd.number()),
        (AxisParameter::Node, 2),
        (AxisParameter::StopAction, StopAction::Hold.number()),
    ] {
        bench::parameter(&mut rig, 1, parameter, Value::Unsigned(number.into()));
    }
    rig.run(100_000);
    assert_eq!(listed(&mut rig, 1), AxisState::Tripped { confirmed: true });
    assert!(rig.sent_since(0, 0).contains(&"142#8100000000000000"));
    assert!(rig.gateway.enable_output());
}

/// A board has fewer buses than there is room for.
#[test]
fn a_damaged_place_of_a_bus_that_the_board_does_not_have_is_mended() {
    let mut rig = bench::rmd_axes(1);
    let (bus, buses) = (slot_of_the_bus(), gateway::MAX_BUSES);
    let words = bus[bus.len() - 1] + 1 - bus[0];
    let behind_the_buses = bus[0] + words.div_ceil(2) * 2 * buses;
    for index in bus[0]..behind_the_buses {
        rig.memory[index] ^= 1 << 7;
        rig.reset();
        rig.handle(Event::EStopInput { open: false });
        bench::hello(&mut rig);
        rig.run(10_000);
        let clear = requests::Clear { target: ClearTarget::Gateway };
        rig.ask(Request::Clear(clear)).unwrap();
        rig.reset();
        rig.handle(Event::EStopInput { open: false });
        assert_ne!(rig.gateway.light(), Light::EStopped, "word {index}");
    }
}

#[test]
fn a_gateway_without_a_random_number_arms_nothing_and_says_so() {
    let mut rig = bench::rmd_axes(1);
    rig.replace_gateway(Gateway::new(&BOARD_AGAIN, None));
    rig.gateway.restore(rig.now(), &rig.memory);
    rig.handle(Event::EStopInput { open: false });
    bench::hello_again(&mut rig);
    run_with_host(&mut rig, 50_000);
    assert!(!status(&mut rig).random_number);
    assert_eq!(rig.ask(Request::Arm(requests::Arm { axis: 0 })), Err(Error::NoRandomNumber {}));
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
    assert_eq!(rig.gateway.take_log(), Some(gateway::LogEntry::NoRandomNumber));
}

#[test]
fn epochs_count_from_the_random_number_over_the_end_of_their_range() {
    let mut rig = bench::rmd_axes(1);
    rig.replace_gateway(Gateway::new(&BOARD_AGAIN, Some(u32::MAX - 1)));
    rig.gateway.restore(rig.now(), &rig.memory);
    rig.handle(Event::EStopInput { open: false });
    bench::hello_again(&mut rig);
    run_with_host(&mut rig, 50_000);
    for expected in [u32::MAX, 0, 1] {
        assert_eq!(arm_axis(&mut rig, 0), expected);
        rig.ask(Request::Disarm(requests::Disarm { axis: 0 })).unwrap();
        run_with_host(&mut rig, 50_000);
    }
}
