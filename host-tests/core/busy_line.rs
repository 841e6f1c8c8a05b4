//! An RS485 line that does not fall silent: a stop waits for the bytes that may rightly be on it
//! and not longer (GUARANTEES G5).

use crate::bench::{self, VELOCITY, move_axis};
use crate::rig::{Echo, FRAME_US, MOTOR_US, Rig};
use gateway::{Event, Outgoing, Then};
use host_protocol::{Request, StopAction, StopTarget, requests};

/// 0x81 to RMD node 1, with its checksum.
const HOLD: &str = "3E0108810000000000000032A5";
/// One byte at 115200 baud, rounded down, µs.
const BYTE_US: u64 = 86;
/// g + 2C + W + 20 / baud at 115200 baud with at most 1 ms of W, µs.
const BOUND_US: u64 = 3_600;

/// Lets time pass while somebody sends bytes without a pause.
fn run_with_chatter(rig: &mut Rig, us: u64) {
    let end = rig.now_us + us;
    while rig.now_us < end {
        rig.receive(2, "55");
        rig.run(BYTE_US);
    }
}

fn stops_since(rig: &Rig, since_us: u64) -> Vec<u64> {
    rig.wire
        .iter()
        .filter(|(at, _, text)| *at >= since_us && text == HOLD)
        .map(|(at, ..)| at - since_us)
        .collect()
}

#[test]
fn bytes_without_a_pause_hold_a_stop_back_no_longer_than_the_bound() {
    for phase_us in (0..4_000).step_by(50) {
        let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
        rig.echo = Echo::BehindNoise;
        move_axis(&mut rig, VELOCITY);
        run_with_chatter(&mut rig, 10_000);
        rig.run(phase_us % BYTE_US);
        run_with_chatter(&mut rig, phase_us);
        let since = rig.now_us;
        rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
        run_with_chatter(&mut rig, 20_000);
        let stops = stops_since(&rig, since);
        assert!(stops.first().is_some_and(|at| *at <= BOUND_US), "phase {phase_us}: {stops:?}");
        // What was lost in the collision is sent again, as long as it is not confirmed.
        assert!(stops.len() >= 2, "phase {phase_us}: {stops:?}");
    }
}

/// A motor that moves has just been sent a request. Returns when it began, too.
fn just_asked() -> (Rig, u64) {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.run(10_000);
    let sent = rig.wire.len();
    while rig.wire.len() == sent {
        rig.run(10);
    }
    let (asked_at, ..) = *rig.wire.last().unwrap();
    (rig, asked_at)
}

#[test]
fn a_stop_does_not_talk_into_the_reply_that_was_asked_for() {
    let (mut rig, _) = just_asked();
    rig.motor = Box::new(|_, _, _| None);
    rig.run(200); // the request has left, its reply has not begun
    let since = rig.now_us;
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
    for _ in 0..8 {
        assert_eq!(stops_since(&rig, since), Vec::<u64>::new());
        run_with_chatter(&mut rig, BYTE_US);
    }
    rig.run(200);
    assert_eq!(
        stops_since(&rig, since),
        Vec::<u64>::new(),
        "the reply window delays a stop by 1 ms"
    );
    rig.run(1_000);
    assert_eq!(stops_since(&rig, since).len(), 1);
}

/// The reply to a request whose place the stop has taken is not waited for any longer than it takes.
#[test]
fn a_stop_leaves_behind_the_reply_to_what_it_has_preempted() {
    let (mut rig, asked_at) = just_asked();
    rig.run(150); // the request has left, its reply has not begun
    let since = rig.now_us;
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
    rig.run(2_000);
    let answered_after = asked_at + 2 * FRAME_US + MOTOR_US - since;
    assert_eq!(stops_since(&rig, since).first(), Some(&(answered_after + 174)));
}

#[test]
fn a_stop_on_a_quiet_line_leaves_at_once() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.run(50_000);
    while rig.wire.last().is_none_or(|(at, ..)| rig.now_us - *at < 1_000) {
        rig.run(10);
    }
    let since = rig.now_us;
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
    assert_eq!(stops_since(&rig, since), [0]);
}

/// The pause is 20 bits, 174 µs; a byte takes 10.
#[test]
fn a_line_that_its_port_has_seen_idle_for_a_byte_has_had_half_of_the_pause() {
    for (then, waits_us) in [(Then::Bytes, 174), (Then::Idle, 87)] {
        let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
        move_axis(&mut rig, VELOCITY);
        rig.run(50_000);
        while rig.wire.last().is_none_or(|(at, ..)| rig.now_us - *at < 3_000) {
            rig.run(10);
        }
        rig.handle(Event::SerialReceived { bus: 2, bytes: &[0x55], then });
        let since = rig.now_us;
        rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
        rig.run(1_000);
        assert_eq!(stops_since(&rig, since).first(), Some(&waits_us));
    }
}

#[test]
fn a_port_that_loses_a_frame_is_started_again_and_the_stop_goes_out() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    let before = rig.gateway.bus_setup(2).unwrap().generation;
    let lost = loop {
        rig.now_us += 50;
        rig.gateway.handle(rig.now(), Event::Tick, &mut |_, _| {});
        // Taken, and never reported.
        if let Some(transmit) = rig.gateway.poll_transmit(rig.now(), 2) {
            break transmit;
        }
    };
    assert!(matches!(lost.frame, Outgoing::Serial(_)));
    let since = rig.now_us;
    rig.run(200_000);
    assert_eq!(rig.gateway.bus_setup(2).unwrap().generation, before + 1);
    let first = stops_since(&rig, since)[0];
    assert!((20_000..=30_000).contains(&first), "{first}");
}

/// A frame takes 1129 µs. Its reply has 1 ms from then on to begin, however late the port says that
/// the frame has left.
#[test]
fn a_port_that_reports_a_frame_late_holds_no_stop_back() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.motor = Box::new(|_, _, _| None);
    let taken = loop {
        rig.now_us += 50;
        rig.gateway.handle(rig.now(), Event::Tick, &mut |_, _| {});
        if let Some(transmit) = rig.gateway.poll_transmit(rig.now(), 2) {
            break transmit;
        }
    };
    let since = rig.now_us;
    rig.send(&Request::Stop(requests::Stop { target: StopTarget::Axis(0) }));
    rig.now_us = since + 1_129 + 500;
    rig.gateway.handle(rig.now(), Event::Transmitted { bus: 2, slot: taken.slot }, &mut |_, _| {});
    while rig.gateway.poll_transmit(rig.now(), 2).is_none() {
        rig.now_us += 10;
        rig.gateway.handle(rig.now(), Event::Tick, &mut |_, _| {});
    }
    let waited = rig.now_us - since;
    assert!((2_129..=2_139).contains(&waited), "{waited}");
}
