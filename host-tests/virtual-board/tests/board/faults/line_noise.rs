//! Garbage and framing errors on the serial lines.

use std::time::Duration;

use host_protocol::{AxisState, Bytes, Event, RawFrame, TripReason};
use mgw_client::Hold;

use super::mute_motor::NOTICED;
use crate::lab::{AXES, Lab, RMD, RMD_RS485, THRUSTER, bus_rs485, trips};
use crate::log;
use crate::reaction::{Reaction, stop_within};

/// Bytes that look like anything: every value, delimiters of the host protocol and heads of RMD
/// messages among them.
pub fn garbage(length: usize) -> Vec<u8> {
    let mut random = fastrand::Rng::with_seed(1);
    std::iter::repeat_with(|| random.u8(..)).take(length).collect()
}

/// Between the host's requests comes garbage, every other time with framing errors. A request that
/// is hit is repeated by the client; setpoints that live long enough never expire.
pub fn a_host_that_is_disturbed_now_and_then_stays_in_command() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    AXES.iter().for_each(|axis| lab.set_ttl(*axis, Duration::from_secs(1)));
    let holds = lab.moving(&AXES);
    lab.events();
    log::take(&mut lab.machine.borrow_mut());
    let host = lab.outside.hosts[0];
    for (round, noise) in garbage(400).chunks(20).enumerate() {
        {
            let mut machine = lab.machine.borrow_mut();
            let host = machine.line(host);
            if round % 2 == 0 { host.send(noise) } else { host.send_damaged(noise) }
        }
        lab.keep(&holds, Duration::from_millis(25));
    }
    assert_turning(&mut lab);
    let events = lab.events();
    assert_eq!(trips(&events), []);
    assert!(events.iter().any(|event| matches!(event, Event::FrameRejected { .. })), "{events:?}");
    let lines = log::take(&mut lab.machine.borrow_mut());
    assert!(lines.iter().any(|line| line.starts_with("WARN host link 0: ")), "{lines:?}");
    Vec::new()
}

fn assert_turning(lab: &mut Lab) {
    for axis in AXES {
        lab.assert_turning(axis);
        assert_eq!(lab.report(axis).state, AxisState::Active, "axis {axis}");
    }
}

/// Puts noise on the RS485 line in spells, and keeps the axes moving meanwhile.
fn disturb(lab: &mut Lab, holds: &[Hold], spells: usize, length: usize, pause: Duration) {
    let line = lab.outside.rs485;
    for (nth, noise) in garbage(spells * length).chunks(length).enumerate() {
        lab.machine
            .borrow_mut()
            .drive_line(line, |line, timeline| line.disturb(noise, nth % 2 == 0, timeline));
        lab.keep(holds, pause);
    }
}

/// A single burst costs a reply or two, which are asked for again.
pub fn a_quiet_spell_of_noise_on_rs485_is_only_counted() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    lab.events();
    disturb(&mut lab, &holds, 4, 20, Duration::from_millis(200));
    assert_turning(&mut lab);
    assert_eq!(trips(&lab.events()), []);
    let counters = lab.client.bus_status(bus_rs485()).expect("status").counters;
    assert!(counters.rejected + counters.receive_overflows > 0, "{counters:?}");
    Vec::new()
}

/// Noise falls into every reply: the axis trips, and the stop leaves in the pauses and reaches the
/// motor, which stands. When the line is quiet again it confirms that.
pub fn a_disturbed_rs485_line_loses_its_motor_and_the_stop_gets_through() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let holds = lab.moving(&[RMD, THRUSTER, RMD_RS485]);
    lab.events();
    let at = lab.now();
    while lab.now() < at + Duration::from_millis(300) {
        let next = lab.now() + Duration::from_millis(20);
        for Hold { axis, epoch, setpoint, ttl } in &holds {
            // Refused once it has tripped.
            let set = lab.client.set(*axis, *epoch, *setpoint, *ttl);
            assert!(set.is_ok() || *axis == RMD_RS485, "{set:?}");
            garble_replies(&lab, Duration::ZERO);
        }
        garble_replies(&lab, next.saturating_sub(lab.now()));
    }
    assert_eq!(trips(&lab.events()), [(RMD_RS485, TripReason::MotorSilent)]);
    lab.assert_turning(RMD);
    lab.keep(&holds, Duration::from_secs(2));
    lab.assert_stopped_by_gateway(RMD_RS485, at);
    assert_eq!(lab.trip(RMD_RS485), Some((TripReason::MotorSilent, true)));
    lab.assert_turning(RMD);
    let counters = lab.client.bus_status(bus_rs485()).expect("status").counters;
    assert!(counters.rejected > 0 && counters.receive_overflows > 0, "{counters:?}");
    // Noticed as a mute motor is; then the noise of a reply at most.
    let limit = NOTICED + NOISE + stop_within(RMD_RS485);
    let stop = lab.first_stop(RMD_RS485, at);
    vec![Reaction::new("noise in every reply on RS485", RMD_RS485, at, &stop, limit)]
}

/// 16 bytes at 115200 baud, longer than a reply.
const NOISE: Duration = Duration::from_micros(16 * 87);

/// Runs for a while, and puts noise on the RS485 line behind each message of the gateway, the last
/// one too: every other byte has a framing error.
fn garble_replies(lab: &Lab, duration: Duration) {
    const STEP: Duration = Duration::from_micros(200);
    let line = lab.outside.rs485;
    let mut machine = lab.machine.borrow_mut();
    let end = machine.now() + duration;
    loop {
        let now = machine.now();
        let sent = machine.line(line).sent().last().map_or(Duration::ZERO, |sent| sent.end);
        if (STEP..2 * STEP).contains(&(now - sent)) {
            for (byte, damaged) in garbage(16).into_iter().zip([true, false].into_iter().cycle()) {
                machine.drive_line(line, |line, timeline| line.disturb(&[byte], damaged, timeline));
                machine.run_for(Duration::from_micros(87));
            }
        }
        let has_had_its_noise = machine.now() - sent >= 2 * STEP;
        if machine.now() >= end && has_had_its_noise {
            return;
        }
        machine.run_for(STEP);
    }
}

/// One damaged byte while nothing else happens: nothing is received anew that was received before.
pub fn an_error_on_a_line_brings_nothing_old_back() -> Vec<Reaction> {
    const READ_STATUS_2: [u8; 13] = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    let mut lab = Lab::configured();
    lab.client.raw_open(bus_rs485()).expect("open");
    let bytes = Bytes::from_slice(&READ_STATUS_2).expect("short enough");
    lab.client.raw_send(bus_rs485(), RawFrame::Serial(bytes)).expect("taken over");
    lab.stay(Duration::from_millis(20));
    assert_eq!(raw_bytes(&mut lab).len(), READ_STATUS_2.len(), "the answer");
    let line = lab.outside.rs485;
    for _ in 0..2 {
        lab.machine
            .borrow_mut()
            .drive_line(line, |line, timeline| line.disturb(&[0xFF], true, timeline));
        lab.stay(Duration::from_millis(20));
    }
    let again = raw_bytes(&mut lab);
    assert!(again.len() <= 2, "two damaged bytes, and {again:02X?}");

    let mut second = lab.second_client();
    second.ping().expect("a pong");
    let host = lab.outside.hosts[1];
    lab.stay(Duration::from_millis(20));
    lab.machine.borrow_mut().line(host).take();
    for _ in 0..2 {
        lab.machine.borrow_mut().line(host).send_damaged(&[0xFF]);
        lab.stay(Duration::from_millis(20));
    }
    let answers = lab.machine.borrow_mut().line(host).take();
    assert_eq!(answers, [0; 0], "requests from before were executed or answered again");
    Vec::new()
}

/// The bytes that were received on the RS485 line since the last time.
fn raw_bytes(lab: &mut Lab) -> Vec<u8> {
    let mut bytes = Vec::new();
    for frame in lab.client.raw_receive(bus_rs485()).expect("frames").frames {
        if let RawFrame::Serial(received) = frame.frame {
            bytes.extend_from_slice(&received);
        }
    }
    bytes
}
