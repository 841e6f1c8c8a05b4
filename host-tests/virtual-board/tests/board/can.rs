//! The image and its two CAN controllers: it starts them, sends, receives, and survives a bus that
//! fails.

use std::time::Duration;

use host_protocol::{BusMode, BusState, CanFrame, Protocol, ProtocolSet, RawFrame};
use rigless::chip::can::Pattern;
use virtual_board::board::Board;
use virtual_board::machine::{CanPort, Machine};
use virtual_board::usual;
use virtual_stm32::fdcan::{BitTime, FrameEnd, Sender, Wiring};

use crate::bench::{BITRATE, Bench, data_frame, wired};
use crate::gaps;

/// Cuts the bus, sends, and waits until the controller is in the middle of an attempt.
fn sending_alone(mut lab: Bench) -> Bench {
    lab.wire(Wiring::Cut);
    lab.send(0, 0x141, &[1, 2, 3, 4, 5, 6, 7, 8]);
    let sending = |machine: &mut Machine| machine.can(CanPort::Bus0).is_sending();
    assert!(lab.machine.borrow_mut().run_until(Duration::from_millis(5), sending));
    lab
}

fn opened() -> Bench {
    Bench::of(Machine::builder()).opened()
}

#[test]
fn every_controller_leaves_init_at_the_rate_that_the_host_chose() {
    let mut lab = opened();
    let ports = Board::chosen().can_ports;
    (1..)
        .zip(&ports[1..])
        .for_each(|(bus, _)| usual::start_rmd_bus(&mut lab.client, bus, 210_526).expect("runs"));
    lab.run_for(Duration::from_millis(1));
    // 4 × 20 and 19 × 20 cycles a bit, or 4 × 21 and 19 × 21.
    let (hz, fast, slow) = match Board::chosen() {
        Board::NucleoH743zi => (80_000_000, 80, 380),
        Board::NucleoG474re => (84_000_000, 84, 399),
    };
    let machine = lab.machine.borrow();
    for (bus, port) in ports.iter().enumerate() {
        let cycles = if bus == 0 { fast } else { slow };
        assert_eq!(machine.can(*port).bit_time(), BitTime::of_cycles(cycles, hz), "bus {bus}");
        assert!(machine.can(*port).is_on_bus(), "bus {bus}");
    }
    drop(machine);
    let met = gaps::met(&mut lab.machine.borrow_mut());
    gaps::check_known(&met, gaps::known()).unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn a_raw_frame_goes_out_and_its_answer_comes_in() {
    let mut lab = opened();
    lab.send(0, 0x141, &[0x9C, 0, 0, 0, 0, 0, 0, 0]);
    lab.run_for(Duration::from_millis(1));
    let asked = data_frame(0x141, &[0x9C, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(lab.machine.borrow_mut().node(lab.node).heard()[0].1, asked);
    lab.offer([data_frame(0x241, &[1, 2, 3])]);
    lab.run_for(Duration::from_millis(1));
    let received = lab.client.raw_receive(0).expect("frames").frames;
    let frames: Vec<RawFrame> = received.iter().map(|received| received.frame.clone()).collect();
    assert_eq!(frames, [RawFrame::Can(CanFrame::standard(0x241, &[1, 2, 3]).expect("a frame"))]);
    let status = lab.status();
    assert_eq!(
        (status.state, status.transmit_errors, status.receive_errors),
        (BusState::Active, 0, 0)
    );
    assert_eq!((status.counters.transmitted, status.counters.received), (1, 1));
    let log = lab.machine.borrow_mut().can_mut(CanPort::Bus0).take_log();
    assert_eq!(
        log.iter().map(|record| record.sender).collect::<Vec<_>>(),
        [Sender::Controller, Sender::Node(0)]
    );
}

#[test]
fn a_frame_leaves_on_each_bus() {
    let mut builder = Machine::builder();
    let ports = Board::chosen().can_ports;
    for port in &ports[1..] {
        builder.can_node(*port, Pattern::default(), Some(BITRATE));
    }
    let mut lab = Bench::of(builder);
    for (bus, port) in (0..).zip(ports) {
        lab.configure(bus).expect("it runs");
        lab.client.raw_open_unsafe(bus).expect("open");
        let data = [0xAB, bus];
        lab.send(bus, 0x123, &data);
        lab.run_for(Duration::from_millis(2));
        let machine = lab.machine.borrow();
        let record =
            machine.can(*port).log().last().unwrap_or_else(|| panic!("nothing on bus {bus}"));
        assert_eq!(record.outcome, FrameEnd::Acknowledged, "bus {bus}");
        assert_eq!(record.frame, data_frame(0x123, &data), "bus {bus}");
    }
}

#[test]
fn without_acknowledgement_the_bus_is_passive_and_active_again_with_it() {
    let mut lab = opened();
    lab.wire(Wiring::Cut);
    lab.send(0, 0x141, &[1]);
    lab.run_for(Duration::from_millis(30));
    let status = lab.status();
    assert_eq!((status.state, status.transmit_errors), (BusState::Passive, 128));
    assert!(lab.ends().iter().all(|end| *end == FrameEnd::Unacknowledged));
    lab.wire(Wiring::Connected);
    for _ in 0..40 {
        lab.send(0, 0x142, &[2]);
        lab.run_for(Duration::from_millis(1));
    }
    lab.run_for(Duration::from_millis(20));
    assert_eq!(lab.status().state, BusState::Active);
    assert!(lab.heard().len() >= 40);
}

#[test]
fn destroyed_frames_put_the_bus_off_and_the_core_starts_it_again() {
    let pattern = Pattern::default().disturbing(32);
    let mut lab = Bench::with(Machine::builder(), pattern, BITRATE).opened();
    lab.send(0, 0x141, &[1]);
    lab.run_until_on_bus(false, Duration::from_millis(10));
    assert_eq!(lab.ends(), [FrameEnd::Destroyed; 32]);
    let status = lab.status();
    assert_eq!(status.state, BusState::BusOff);
    assert_eq!(status.counters.bus_offs, 1);
    lab.run_until_on_bus(true, Duration::from_secs(2));
    lab.run_for(Duration::from_millis(20));
    assert_eq!(lab.status().state, BusState::Active);
    lab.send(0, 0x142, &[2]);
    lab.run_for(Duration::from_millis(1));
    assert_eq!(lab.heard(), [0x142], "the frame from before was taken back");
}

#[test]
fn a_short_puts_the_bus_off_until_it_is_mended() {
    let mut lab = opened();
    lab.wire(Wiring::Shorted);
    lab.send(0, 0x141, &[1]);
    lab.run_for(Duration::from_millis(5));
    assert_eq!(lab.status().state, BusState::BusOff);
    lab.wire(Wiring::Connected);
    lab.run_until_on_bus(true, Duration::from_secs(2));
    lab.run_for(Duration::from_millis(20));
    lab.send(0, 0x142, &[2]);
    lab.run_for(Duration::from_millis(1));
    assert_eq!(lab.status().state, BusState::Active);
    assert_eq!(lab.heard(), [0x142]);
}

#[test]
fn a_node_at_another_rate_brings_errors_and_no_answer() {
    let mut lab = Bench::with(Machine::builder(), Pattern::default(), 500_000).opened();
    lab.send(0, 0x141, &[1]);
    lab.run_for(Duration::from_millis(30));
    let status = lab.status();
    assert_eq!(status.state, BusState::Passive);
    assert!(lab.heard().is_empty());
    assert!(lab.ends().contains(&FrameEnd::Destroyed));
}

#[test]
fn a_core_that_is_too_slow_loses_frames_and_counts_that() {
    const FRAMES: u32 = 400;
    // 50 µs a frame: 800 instructions, and still enough for every loop to feed the watchdog.
    let builder = Machine::builder().instructions_per_second(16_000_000);
    let mut lab = Bench::of(builder).opened();
    lab.offer((0..FRAMES).map(|_| data_frame(0x555, &[])));
    lab.run_for(Duration::from_millis(500));
    let counters = lab.status().counters;
    assert_eq!(lab.ends().len(), FRAMES as usize, "each was acknowledged");
    assert!(counters.receive_overflows > 0, "{counters:?}");
    assert!(counters.received > 0 && counters.received < FRAMES, "{counters:?}");
}

#[test]
fn a_snapshot_in_mid_frame_goes_on_alike() {
    let lab = sending_alone(opened());
    let node = lab.node;
    let mut original = lab.machine.borrow_mut();
    let snapshot = original.snapshot();
    let (builder, copied_node, _) = wired(Machine::builder(), Pattern::default(), BITRATE);
    let mut copy = builder.resume(&snapshot);
    assert!(copy.can(CanPort::Bus0).is_sending());
    for machine in [&mut *original, &mut copy] {
        machine.wire_can(CanPort::Bus0, Wiring::Connected);
        machine.run_for(Duration::from_millis(100));
    }
    assert_eq!(copy.can(CanPort::Bus0).log(), original.can(CanPort::Bus0).log());
    assert_eq!(copy.node(copied_node).heard(), original.node(node).heard());
    assert_eq!(original.node(node).heard().len(), 1);
    assert_eq!(copy.access_digest(), original.access_digest());
    assert_eq!(copy.instructions(), original.instructions());
}

#[test]
fn a_reset_in_mid_frame_breaks_the_frame_off_and_leaves_the_nodes_alone() {
    let lab = sending_alone(opened());
    let mut machine = lab.machine.borrow_mut();
    machine.wire_can(CanPort::Bus0, Wiring::Connected);
    let before = machine.can_mut(CanPort::Bus0).take_log();
    assert!(before.iter().all(|record| record.outcome == FrameEnd::Unacknowledged), "{before:?}");
    assert!(machine.can(CanPort::Bus0).is_sending());
    machine.reset_by_pin();
    machine.run_for(Duration::from_millis(20));
    let ends: Vec<FrameEnd> =
        machine.can(CanPort::Bus0).log().iter().map(|record| record.outcome).collect();
    assert_eq!(ends, [FrameEnd::Destroyed]);
    assert!(machine.can(CanPort::Bus0).is_on_bus(), "configured as before");
    assert_eq!(machine.node(lab.node).heard(), []);
}

/// Two nodes at 500 kbit/s, one of which talks; the gateway runs at 1 Mbit/s.
fn beside_nodes_of_another_bitrate(mode: BusMode) -> Bench {
    const OTHER: u32 = BITRATE / 2;
    let mut builder = Machine::builder();
    builder.can_node(CanPort::Bus0, Pattern::default(), Some(OTHER));
    let mut lab = Bench::with(builder, Pattern::default(), OTHER);
    let rmd = ProtocolSet::of(&[Protocol::Rmd]);
    lab.client.raw_open_at(0, BITRATE, rmd, 5_000, mode).expect("open");
    lab.run_for(Duration::from_millis(5));
    lab.machine.borrow_mut().can_mut(CanPort::Bus0).take_log();
    lab
}

#[test]
fn a_gateway_that_listens_at_a_wrong_bitrate_drives_no_bit() {
    let mut lab = beside_nodes_of_another_bitrate(BusMode::ListenOnly);
    lab.offer((0..20).map(|n| data_frame(0x241, &[n])));
    lab.run_for(Duration::from_millis(20));
    let ends = lab.ends();
    assert_eq!(ends, [FrameEnd::Acknowledged; 20]);
    let by_us = |machine: &Machine| {
        machine.can(CanPort::Bus0).log().iter().any(|record| record.sender == Sender::Controller)
    };
    assert!(!by_us(&lab.machine.borrow()));
    assert!(lab.status().receive_errors > 0, "it has heard what it cannot read");
    // At its own bitrate it acknowledges nothing: the nodes are not alone there, so all is well.
    let rmd = ProtocolSet::of(&[Protocol::Rmd]);
    lab.client.raw_open_at(0, BITRATE / 2, rmd, 5_000, BusMode::ListenOnly).expect("open");
    lab.run_for(Duration::from_millis(5));
    lab.offer([data_frame(0x241, &[0x9A])]);
    lab.run_for(Duration::from_millis(5));
    assert_eq!(lab.client.raw_receive(0).expect("frames").frames.len(), 1);

    // In normal operation each frame is destroyed, again and again.
    let lab = beside_nodes_of_another_bitrate(BusMode::Normal);
    lab.offer([data_frame(0x241, &[1])]);
    lab.run_for(Duration::from_millis(2));
    assert_eq!(lab.ends().first(), Some(&FrameEnd::Destroyed));
}

#[test]
fn a_gateway_that_only_listens_acknowledges_nothing() {
    let mut lab = Bench::of(Machine::builder());
    let rmd = ProtocolSet::of(&[Protocol::Rmd]);
    lab.client.raw_open_at(0, BITRATE, rmd, 5_000, BusMode::ListenOnly).expect("open");
    lab.run_for(Duration::from_millis(5));
    lab.offer([data_frame(0x241, &[1])]);
    lab.run_for(Duration::from_millis(2));
    assert!(!lab.ends().is_empty());
    assert!(lab.ends().iter().all(|end| *end == FrameEnd::Unacknowledged));
}

#[test]
fn a_probe_is_sent_once() {
    for wiring in [Wiring::Connected, Wiring::Cut] {
        let mut lab = beside_nodes_of_another_bitrate(BusMode::OneShot);
        lab.wire(wiring);
        lab.send(0, 0x141, &[0x9A, 0, 0, 0, 0, 0, 0, 0]);
        lab.run_for(Duration::from_millis(50));
        assert_eq!(lab.ends().len(), 1, "{wiring:?}");
        let status = lab.status();
        assert_eq!((status.counters.transmitted, status.counters.cancelled), (0, 1), "{wiring:?}");
        // And the next one too.
        lab.send(0, 0x142, &[0x9A, 0, 0, 0, 0, 0, 0, 0]);
        lab.run_for(Duration::from_millis(50));
        assert_eq!(lab.ends().len(), 2, "{wiring:?}");
    }
    // Where somebody acknowledges, it has left.
    let mut lab = Bench::of(Machine::builder());
    let rmd = ProtocolSet::of(&[Protocol::Rmd]);
    lab.client.raw_open_at(0, BITRATE, rmd, 5_000, BusMode::OneShot).expect("open");
    lab.run_for(Duration::from_millis(5));
    lab.send(0, 0x141, &[0x9A, 0, 0, 0, 0, 0, 0, 0]);
    lab.run_for(Duration::from_millis(5));
    let status = lab.status();
    assert_eq!((status.counters.transmitted, status.counters.cancelled), (1, 0));
}
