//! More bytes than the firmware can read in time, and what must act all the same.

use std::time::Duration;

use host_protocol::{MAX_FRAME, Request, StopTarget, requests};
use virtual_board::board::Board;
use virtual_board::machine::{Fault, Machine, Place};

use crate::lab::{BUS_RMD_AND_THRUSTER, Lab, RMD, STOPS, wire_of};
use crate::log;
use crate::wire;

/// Pings of one round of the flood, after an e-stop.
const PINGS: u16 = 9;
/// The core does nothing else for 4.2 million instructions: `MOVW r3, #0xFFFF`, `LSLS r3, r3, #5`,
/// `SUBS r3, #1`, `BNE` to it, `BX lr`. The rings hold 11 ms.
const STALL: [u16; 6] = [0xF64F, 0x73FF, 0x015B, 0x3B01, 0xD1FD, 0x4770];
/// At 250 and 168 million a second 17 and 25 ms.
fn stalled() -> Duration {
    match Board::chosen() {
        Board::NucleoH743zi => Duration::from_millis(18),
        Board::NucleoG474re => Duration::from_millis(26),
    }
}

/// Has the firmware do nothing for longer than a ring holds, once. It stalls where nothing is
/// returned: what the planted code leaves in the place of a value is anything.
fn stall(machine: &mut Machine) {
    let handle = Place::Function("motor_gateway::shared_gateway::SharedGateway::handle");
    machine.plant(handle, &Fault::Code(STALL.to_vec()));
    assert!(
        machine.run_until(Duration::from_millis(50), |machine| machine.struck().is_some()),
        "stalled"
    );
    machine.heal();
    machine.run_for(stalled());
}

fn frame(request: &Request, sequence: u16) -> Vec<u8> {
    let mut bytes = [0; MAX_FRAME];
    let length = request.encode_frame(sequence, &mut bytes).expect("room");
    bytes[..length].to_vec()
}

/// Requests without a pause between their bytes.
fn pings(count: u16) -> Vec<u8> {
    (0..count).flat_map(|sequence| frame(&Request::Ping(requests::Ping {}), sequence)).collect()
}

#[test]
fn an_e_stop_in_a_stream_that_overflowed_its_ring_acts_while_the_stream_goes_on() {
    let lab = Lab::configured();
    let flooding = lab.outside.hosts[1];
    let rounds = (0..100).flat_map(|round: u16| {
        let stop = frame(&Request::EStop(requests::EStop {}), round * 50);
        stop.into_iter().chain(pings(PINGS))
    });
    let mut machine = lab.machine.borrow_mut();
    machine.line(flooding).send(&pings(200));
    machine.run_for(Duration::from_millis(5));
    stall(&mut machine);
    let at = machine.now();
    machine.line(flooding).send(&rounds.collect::<Vec<u8>>());
    let outside = &lab.outside;
    let has_stopped = |machine: &mut Machine| {
        let sent = wire_of(machine, outside, BUS_RMD_AND_THRUSTER, at);
        wire::find(&sent, STOPS[usize::from(RMD)]).is_ok()
    };
    assert!(machine.run_until(Duration::from_millis(200), has_stopped), "no stop");
    assert!(machine.line(flooding).unsent() > 0, "the flood lasts");
    let lines = log::take(&mut machine);
    assert!(lines.iter().any(|line| line == "WARN host link 1: 1 overflows so far"), "{lines:?}");
}

/// Nothing of before an overflow is received again, and nothing behind it is lost.
#[test]
fn what_comes_after_an_overflow_is_received_right() {
    let mut lab = Lab::configured();
    let mut second = lab.second_client();
    {
        let mut machine = lab.machine.borrow_mut();
        machine.line(lab.outside.hosts[1]).send(&pings(200));
        machine.run_for(Duration::from_millis(5));
        stall(&mut machine);
        machine.run_for(Duration::from_millis(30));
        machine.line(lab.outside.hosts[1]).take();
        let lines = log::take(&mut machine);
        assert!(
            lines.iter().any(|line| line == "WARN host link 1: 1 overflows so far"),
            "{lines:?}"
        );
    }
    for _ in 0..20 {
        second.gateway_status().expect("a status");
    }
    assert_eq!(lab.report(RMD).trip, None);
}

/// From the last bit of a stop to the first of its first frame (GUARANTEES G5), and what the bytes
/// before it may take.
const WITHIN: Duration = Duration::from_micros(80);

/// The receiver takes a few bytes at once, and may wait a millisecond for the end of a frame: not
/// where it has come already.
#[test]
fn a_stop_behind_a_backlog_of_any_length_acts_at_once() {
    let lab = Lab::configured();
    let host = lab.outside.hosts[1];
    let stop = Request::Stop(requests::Stop { target: StopTarget::All });
    let mut machine = lab.machine.borrow_mut();
    let data = [0, 1, 100, 105, 110, 127, 128, 129, 140, 200, 230].map(|length| (1, length));
    // Delimiters without an end, which wake nobody one by one.
    let delimiters = [31, 32, 500, 512, 800].map(|length| (0, length));
    for ((byte, backlog), sequence) in data.into_iter().chain(delimiters).zip(1..) {
        let mut bytes = vec![byte; backlog];
        bytes.push(0);
        bytes.extend(frame(&stop, sequence));
        let since = machine.now();
        machine.line(host).send(&bytes);
        let all_sent = |machine: &mut Machine| machine.line(host).unsent() == 0;
        assert!(machine.run_until(Duration::from_millis(10), all_sent));
        let asked = machine.now() + Duration::from_secs_f64(10.0 / 921_600.0);
        machine.run_for(Duration::from_millis(20));
        let sent = wire_of(&mut machine, &lab.outside, BUS_RMD_AND_THRUSTER, since);
        let first = wire::find(&sent, STOPS[usize::from(RMD)]).expect("a stop").first_bit;
        let took = first - asked;
        assert!(first >= asked && took < WITHIN, "behind {backlog} of {byte}: {took:?}");
    }
}
