use super::*;

const MBIT: u32 = 1_000_000;
const A: Station = Station::Motor(0);
const B: Station = Station::Motor(1);

fn frame(id: u16, data: &[u8]) -> CanFrame {
    CanFrame::standard(id, data).unwrap()
}

fn us(us: u64) -> Duration {
    Duration::from_micros(us)
}

/// A bus at 1 Mbit/s with these stations, their start already reported.
fn bus(stations: &[Station]) -> CanBus {
    let mut bus = CanBus::default();
    for station in stations {
        bus.start(Duration::ZERO, *station, MBIT);
    }
    while bus.poll().is_some() {}
    bus
}

/// Runs until nothing happens any more or `until` is reached.
fn run(bus: &mut CanBus, until: Duration) -> Vec<CanOutcome> {
    let mut outcomes = Vec::new();
    while let Some(at) = bus.next_event().filter(|at| *at <= until) {
        bus.finish(at);
        bus.arbitrate(at);
        outcomes.extend(std::iter::from_fn(|| bus.poll()));
    }
    outcomes
}

/// Senders and ids of the frames sent, with start and end in µs.
fn sent(outcomes: &[CanOutcome]) -> Vec<(Station, String, u128, u128)> {
    outcomes
        .iter()
        .filter_map(|outcome| match outcome {
            CanOutcome::Sent { from, frame, start, end, .. } => {
                Some((*from, frame.to_string(), start.as_micros(), end.as_micros()))
            }
            CanOutcome::State { .. }
            | CanOutcome::Cancelled { .. }
            | CanOutcome::Overheard { .. } => None,
        })
        .collect()
}

fn last_state(outcomes: &[CanOutcome], of: Station) -> Option<(BusState, u16)> {
    outcomes.iter().rev().find_map(|outcome| match outcome {
        CanOutcome::State { station, state, transmit, .. } if *station == of => {
            Some((*state, *transmit))
        }
        _ => None,
    })
}

/// Id 0 without data: 44 bits and 6 stuff bits; the next frame starts 3 bits later.
#[test]
fn the_lowest_id_goes_first_and_intermission_follows() {
    let mut bus = bus(&[Station::Gateway, A, B]);
    bus.send(B, 0, frame(0x555, &[]), false);
    bus.send(A, 0, frame(0x000, &[]), false);
    let outcomes = run(&mut bus, us(1_000));
    let length = u128::from(FrameBits::of(&frame(0x555, &[])).frame());
    assert_eq!(sent(&outcomes), [(A, "000#".into(), 0, 50), (B, "555#".into(), 53, 53 + length)]);
}

#[test]
fn a_sender_does_not_hear_itself() {
    let mut bus = bus(&[Station::Gateway, A, B]);
    bus.send(A, 0, frame(0x241, &[1]), false);
    let outcomes = run(&mut bus, us(1_000));
    assert!(
        matches!(&outcomes[0], CanOutcome::Sent { to, .. } if *to == [Station::Gateway, B]),
        "{outcomes:?}"
    );
}

/// A frame that waits in the gateway's controller is overtaken by one of higher priority, one on
/// its way is not.
#[test]
fn the_gateways_frames_go_by_priority_the_motors_by_age() {
    let mut bus = bus(&[Station::Gateway, A]);
    bus.send(Station::Gateway, 0, frame(0x30B, &[]), false);
    run(&mut bus, Duration::ZERO);
    bus.send(Station::Gateway, 1, frame(0x141, &[]), false);
    bus.send(A, 0, frame(0x28B, &[]), false);
    bus.send(A, 0, frame(0x281, &[]), false);
    let order: Vec<_> =
        sent(&run(&mut bus, us(1_000))).into_iter().map(|(_, frame, ..)| frame).collect();
    assert_eq!(order, ["30B#", "141#", "28B#", "281#"]);
}

/// 108 bits without stuff bits; those up to the ACK slot and an error frame make one attempt.
#[test]
fn without_another_station_nothing_is_acknowledged_and_it_tries_for_ever() {
    let mut bus = bus(&[Station::Gateway]);
    bus.send(Station::Gateway, 0, frame(0x141, &[0x80, 0, 0, 0, 0, 0, 0, 0]), false);
    let outcomes = run(&mut bus, us(50_000));
    assert_eq!(sent(&outcomes), []);
    assert_eq!(last_state(&outcomes, Station::Gateway), Some((BusState::Passive, 128)));
    assert!(bus.is_running(Station::Gateway));

    bus.start(us(50_000), A, MBIT);
    let outcomes = run(&mut bus, us(51_000));
    assert_eq!(sent(&outcomes).len(), 1);
    assert_eq!(last_state(&outcomes, Station::Gateway), Some((BusState::Warning, 127)));
}

#[test]
fn a_cut_leaves_the_motors_among_themselves_until_it_is_repaired() {
    let mut bus = bus(&[Station::Gateway, A, B]);
    bus.set_fault(Duration::ZERO, BusFault::Cut);
    bus.send(Station::Gateway, 0, frame(0x141, &[]), false);
    bus.send(A, 0, frame(0x241, &[]), false);
    let outcomes = run(&mut bus, us(1_000));
    assert!(matches!(sent(&outcomes).as_slice(), [(A, ..)]));
    bus.set_fault(us(1_000), BusFault::None);
    assert!(matches!(sent(&run(&mut bus, us(2_000))).as_slice(), [(Station::Gateway, ..)]));
}

#[test]
fn a_short_ends_in_bus_off_and_drops_what_waits() {
    let mut bus = bus(&[Station::Gateway, A]);
    bus.set_fault(Duration::ZERO, BusFault::Short);
    bus.send(Station::Gateway, 0, frame(0x141, &[]), false);
    let outcomes = run(&mut bus, us(10_000));
    assert_eq!(last_state(&outcomes, Station::Gateway), Some((BusState::BusOff, 256)));
    assert!(!bus.is_running(Station::Gateway));

    // Repaired but not started again, it stays off; started, it is back after 128 × 11 bits.
    bus.set_fault(us(10_000), BusFault::None);
    assert_eq!(bus.next_event(), None);
    bus.start(us(11_000), Station::Gateway, MBIT);
    assert_eq!(bus.next_event(), Some(us(11_000 + 1_408)));
    let outcomes = run(&mut bus, us(13_000));
    assert_eq!(outcomes.len(), 1);
    assert_eq!(last_state(&outcomes, Station::Gateway), Some((BusState::Active, 0)));
}

#[test]
fn a_start_while_shorted_waits_for_the_repair() {
    let mut bus = bus(&[Station::Gateway, A]);
    bus.set_fault(Duration::ZERO, BusFault::Short);
    bus.send(Station::Gateway, 0, frame(0x141, &[]), false);
    run(&mut bus, us(10_000));
    bus.start(us(10_000), Station::Gateway, MBIT);
    assert_eq!(bus.next_event(), None);
    bus.set_fault(us(20_000), BusFault::None);
    assert_eq!(bus.next_event(), Some(us(20_000 + 1_408)));
}

#[test]
fn another_bitrate_is_deaf() {
    let mut bus = bus(&[Station::Gateway, A]);
    bus.start(Duration::ZERO, Station::Gateway, 500_000);
    bus.send(Station::Gateway, 0, frame(0x141, &[]), false);
    assert_eq!(sent(&run(&mut bus, us(5_000))), []);
    bus.start(us(5_000), A, 500_900);
    assert_eq!(sent(&run(&mut bus, us(10_000))).len(), 1);
}

/// Two stations send different data under one id: both count an error and try again, together,
/// until both are off.
#[test]
fn one_id_with_different_data_collides() {
    let mut bus = bus(&[Station::Gateway, A, B]);
    bus.send(Station::Gateway, 0, frame(0x00B, &[0xD5]), false);
    bus.send(A, 0, frame(0x00B, &[0x5D]), false);
    let outcomes = run(&mut bus, us(100));
    assert_eq!(sent(&outcomes), []);
    let outcomes = run(&mut bus, us(20_000));
    assert_eq!(last_state(&outcomes, Station::Gateway), Some((BusState::BusOff, 256)));
}

#[test]
fn one_id_with_the_same_data_passes_as_one_frame() {
    let mut bus = bus(&[Station::Gateway, A, B]);
    bus.send(A, 0, frame(0x241, &[0x80]), false);
    bus.send(B, 0, frame(0x241, &[0x80]), false);
    let outcomes = run(&mut bus, us(1_000));
    let sent = sent(&outcomes);
    assert_eq!(sent.len(), 2);
    assert_eq!((sent[0].2, sent[0].3), (sent[1].2, sent[1].3));
}

#[test]
fn a_corrupt_frame_reaches_nobody_and_is_not_repeated() {
    let mut bus = bus(&[Station::Gateway, A]);
    bus.send(A, 0, frame(0x241, &[]), true);
    let outcomes = run(&mut bus, us(1_000));
    assert_eq!(sent(&outcomes), []);
    assert_eq!(last_state(&outcomes, A), Some((BusState::Active, 8)));
    assert_eq!(bus.next_event(), None);
}

#[test]
fn an_unplugged_station_neither_hears_nor_acknowledges() {
    let mut bus = bus(&[Station::Gateway, A]);
    bus.set_plugged(Duration::ZERO, A, false);
    bus.send(Station::Gateway, 0, frame(0x141, &[]), false);
    assert_eq!(sent(&run(&mut bus, us(5_000))), []);
    bus.set_plugged(us(5_000), A, true);
    assert_eq!(sent(&run(&mut bus, us(6_000))).len(), 1);
}

/// A frame that waits is cancelled at once; one that no node acknowledges, at the end of its
/// attempt; one that is acknowledged has been sent.
#[test]
fn frames_are_cancelled_unless_they_are_transmitted_all_the_same() {
    let cancelled = |outcomes: &[CanOutcome]| -> Vec<u8> {
        let slot_of = |outcome: &CanOutcome| match outcome {
            CanOutcome::Cancelled { station: Station::Gateway, slot } => Some(*slot),
            _ => None,
        };
        outcomes.iter().filter_map(slot_of).collect()
    };
    let at = Duration::from_micros;
    let mut bus = bus(&[Station::Gateway, A]);
    bus.send(Station::Gateway, 0, frame(0x100, &[]), false);
    bus.send(Station::Gateway, 1, frame(0x200, &[]), false);
    bus.arbitrate(Duration::ZERO);
    bus.cancel(Station::Gateway, 0);
    bus.cancel(Station::Gateway, 1);
    let mut outcomes: Vec<_> = std::iter::from_fn(|| bus.poll()).collect();
    assert_eq!(cancelled(&outcomes), [1]);
    outcomes = run(&mut bus, at(1_000));
    assert_eq!(cancelled(&outcomes), []);
    assert_eq!(sent(&outcomes).len(), 1);

    bus.set_fault(at(1_000), BusFault::Cut);
    bus.send(Station::Gateway, 0, frame(0x100, &[]), false);
    bus.arbitrate(at(1_000));
    bus.cancel(Station::Gateway, 0);
    let outcomes = run(&mut bus, at(3_000));
    assert_eq!(cancelled(&outcomes), [0]);
    assert_eq!(sent(&outcomes).len(), 0);
    bus.set_fault(at(3_000), BusFault::None);
    assert_eq!(sent(&run(&mut bus, at(5_000))).len(), 0);
}

/// A bus with a gateway at another bitrate than its motors.
fn beside(mode: BusMode) -> CanBus {
    let mut bus = bus(&[A, B]);
    bus.start_in(Duration::ZERO, Station::Gateway, MBIT / 2, mode);
    while bus.poll().is_some() {}
    bus
}

#[test]
fn a_gateway_at_a_wrong_bitrate_destroys_frames_unless_it_only_listens() {
    let mut bus = beside(BusMode::ListenOnly);
    bus.send(A, 0, frame(0x241, &[1]), false);
    let outcomes = run(&mut bus, us(10_000));
    assert_eq!(sent(&outcomes).len(), 1);
    assert_eq!(last_state(&outcomes, A), None, "A has seen no error");
    let heard = outcomes.iter().find_map(|outcome| match outcome {
        CanOutcome::State { station: Station::Gateway, receive, .. } => Some(*receive),
        _ => None,
    });
    assert_eq!(heard, Some(1), "it has heard something that it cannot read");

    let mut bus = beside(BusMode::Normal);
    bus.send(A, 0, frame(0x241, &[1]), false);
    assert!(sent(&run(&mut bus, us(1_000))).is_empty());
}

#[test]
fn who_only_listens_acknowledges_nothing_and_hears_what_others_acknowledge() {
    let mut bus = bus(&[A]);
    bus.start_in(Duration::ZERO, Station::Gateway, MBIT, BusMode::ListenOnly);
    bus.send(A, 0, frame(0x241, &[1]), false);
    let outcomes = run(&mut bus, us(2_000));
    assert!(sent(&outcomes).is_empty());
    // 16 attempts end in an active error flag, which spoils the frame for who listens, too.
    let overheard = |outcome: &CanOutcome| match outcome {
        CanOutcome::Overheard { to, .. } => *to == [Station::Gateway],
        _ => false,
    };
    assert_eq!(last_state(&outcomes, A), Some((BusState::Passive, 128)));
    let passive = outcomes.iter().position(|outcome| {
        matches!(outcome, CanOutcome::State { station, transmit: 128, .. } if *station == A)
    });
    assert!(outcomes.iter().position(overheard) > passive, "{outcomes:?}");
    bus.start(us(2_000), B, MBIT);
    let outcomes = run(&mut bus, us(10_000));
    let to = outcomes.iter().find_map(|outcome| match outcome {
        CanOutcome::Sent { to, .. } => Some(to.clone()),
        _ => None,
    });
    assert_eq!(to, Some(vec![Station::Gateway, B]));
}

#[test]
fn what_is_sent_once_is_given_back_where_it_does_not_leave() {
    let mut bus = beside(BusMode::OneShot);
    bus.send(Station::Gateway, 1, frame(0x141, &[0x9A]), false);
    let outcomes = run(&mut bus, us(10_000));
    assert!(sent(&outcomes).is_empty());
    let cancelled = CanOutcome::Cancelled { station: Station::Gateway, slot: 1 };
    assert_eq!(outcomes.iter().filter(|outcome| **outcome == cancelled).count(), 1);
    assert_eq!(last_state(&outcomes, Station::Gateway), Some((BusState::Active, 8)), "one error");
}
