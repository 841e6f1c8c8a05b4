//! The host falls silent.

use std::time::Duration;

use host_protocol::{AxisState, TripReason};
use virtual_board::machine::UartPort;

use super::line_noise::garbage;
use crate::lab::{AXES, Lab, TTL};
use crate::reaction::Reaction;

/// Silence of the host that ends its authority.
const LINK_SILENCE: Duration = Duration::from_millis(250);
/// Long enough for every motor to come to rest and confirm it.
const AFTERWARDS: Duration = Duration::from_millis(1_500);

fn cut(cause: &'static str, reason: TripReason, ttl: Duration, within: Duration) -> Vec<Reaction> {
    let mut lab = Lab::configured();
    AXES.iter().for_each(|axis| lab.set_ttl(*axis, ttl));
    lab.moving(&AXES);
    let at = lab.now();
    lab.machine.borrow_mut().silence_line(UartPort::Host0, true);
    lab.run_for(AFTERWARDS);
    lab.machine.borrow_mut().silence_line(UartPort::Host0, false);
    // A new session: authority has ended already.
    lab.client.reconnect().expect("hello");
    for axis in AXES {
        lab.assert_stopped_by_gateway(axis, at);
        assert_eq!(lab.trip(axis), Some((reason, true)), "axis {axis}");
    }
    lab.reactions(cause, at, within)
}

pub fn a_cut_host_link_expires_the_setpoints() -> Vec<Reaction> {
    cut("host link cut, setpoints valid for 100 ms", TripReason::SetpointExpired, TTL, TTL)
}

pub fn a_cut_host_link_is_silent_before_a_long_setpoint_expires() -> Vec<Reaction> {
    let ttl = Duration::from_secs(10);
    cut("host link cut, setpoints valid for 10 s", TripReason::HostSilent, ttl, LINK_SILENCE)
}

/// Framing errors without a pause on the line: the link is as good as cut, and the firmware keeps
/// its time.
pub fn nothing_but_noise_from_the_host_expires_the_setpoints() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    let at = lab.now();
    let host = lab.outside.hosts[0];
    // 217 ms of it.
    lab.machine.borrow_mut().line(host).send_damaged(&garbage(20_000));
    lab.run_for(Duration::from_millis(200));
    assert!(lab.machine.borrow_mut().line(host).unsent() > 0, "the noise lasts");
    lab.run_for(AFTERWARDS);
    lab.client.reconnect().expect("hello");
    for axis in AXES {
        lab.assert_stopped_by_gateway(axis, at);
        assert_eq!(lab.report(axis).state, AxisState::Tripped { confirmed: true });
        assert_eq!(lab.trip(axis), Some((TripReason::SetpointExpired, true)));
    }
    lab.reactions("framing errors without end on the host link", at, TTL)
}

/// The other host sends without a pause, bytes that are no frames. The host in command goes on
/// undisturbed; cut off, its setpoints expire, and the stops leave in time.
pub fn a_host_that_never_pauses_keeps_nothing_waiting() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    let flooding = lab.outside.hosts[1];
    // More than half a second of it, hardly a delimiter among it.
    lab.machine.borrow_mut().line(flooding).send(&[b'x'; 60_000]);
    lab.keep(&holds, Duration::from_millis(200));
    AXES.iter().for_each(|axis| lab.assert_turning(*axis));
    let at = lab.now();
    lab.machine.borrow_mut().silence_line(UartPort::Host0, true);
    lab.run_for(Duration::from_millis(150));
    assert!(lab.machine.borrow_mut().line(flooding).unsent() > 0, "the flood lasts");
    lab.reactions("host link cut while the other host floods its own", at, TTL)
}
