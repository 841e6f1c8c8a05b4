//! The e-stop input, the enable output and the light, on the pins (GUARANTEES G6).

use std::time::Duration;

use host_protocol::{ClearTarget, Error, Event, TripReason};
use mgw_sim::Injection;
use rigless::device::Level;
use virtual_board::machine::{Fault, Place};
use virtual_board::nodes::since_start;
use virtual_board::pins::Change;

use super::reset::{HANG, RESET_AT, reset_by_software};
use crate::lab::{AXES, Lab, RMD, STOPS, bus_of, refused, trips, wire_of};
use crate::reaction::Reaction;

/// How long the input must be open to count as pressed.
const PRESSED: Duration = Duration::from_millis(1);

/// What the gateway refuses.
fn enable_changes(lab: &Lab, since: Duration) -> Vec<Change> {
    let changes = lab.machine.borrow_mut().enable_output().changes();
    changes.into_iter().filter(|change| change.at >= since).collect()
}

fn enabled(lab: &Lab) -> bool {
    lab.machine.borrow_mut().enable_output().driven() == Some(Level::High)
}

pub fn an_opened_e_stop_input_stops_every_axis() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    lab.events();
    Reaction::worst_of_12(&lab, |machine, outside| {
        let at = machine.now();
        machine.open_e_stop(true);
        machine.run_for(Duration::from_millis(20));
        let cause = "e-stop input opened, the latest of 12";
        Reaction::of_all(cause, at, PRESSED, |bus| wire_of(machine, outside, bus, at))
    })
}

/// Latched until it is closed and cleared, over a reset too; a pulse that is shorter than any
/// contact's is none.
pub fn an_opened_e_stop_input_stays_latched_over_a_reset() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    lab.events();
    lab.machine.borrow_mut().open_e_stop(true);
    lab.run_for(Duration::from_micros(300));
    lab.machine.borrow_mut().open_e_stop(false);
    lab.run_for(Duration::from_millis(20));
    AXES.iter().for_each(|axis| lab.assert_turning(*axis));

    let at = lab.now();
    lab.machine.borrow_mut().open_e_stop(true);
    lab.stay(Duration::from_secs(1));
    let events = lab.events();
    assert_eq!(trips(&events), AXES.map(|axis| (axis, TripReason::EStop)));
    assert!(events.contains(&Event::EStopInputChanged { open: true }), "{events:?}");
    assert!(events.contains(&Event::EStopLatched {}));
    AXES.iter().for_each(|axis| lab.assert_stopped_by_gateway(*axis, at));
    assert_eq!(refused(lab.client.clear(ClearTarget::Gateway)), Error::EStopInputOpen {});

    lab.machine.borrow_mut().open_e_stop(false);
    lab.stay(Duration::from_millis(100));
    assert!(lab.events().contains(&Event::EStopInputChanged { open: false }));
    lab.machine.borrow_mut().reset_by_pin();
    lab.run_for(Duration::from_secs(1));
    lab.client.reconnect().expect("hello");
    let status = lab.client.gateway_status().expect("a status");
    assert!(status.e_stop_latched && status.e_stop_input_open == Some(false), "{status:?}");
    assert_eq!(refused(lab.client.arm(RMD)), Error::EStopped {});
    lab.client.clear(ClearTarget::Gateway).expect("cleared");
    lab.client.clear(ClearTarget::Axis(RMD)).expect("cleared");
    let holds = lab.arm(&[RMD]);
    lab.keep(&holds, Duration::from_millis(300));
    lab.assert_turning(RMD);
    Vec::new()
}

/// From the first instruction of the panic, undriven at the reset, and low again until the core has
/// taken over what it knew.
pub fn the_enable_output_is_inactive_from_a_panic_until_the_firmware_runs_again() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let never = lab.machine.borrow_mut().enable_output().changes();
    assert!(
        never.first().is_some_and(|change| change.level != Some(Level::High)),
        "inactive first: {never:?}"
    );
    lab.moving(&AXES);
    assert!(enabled(&lab));
    let before = lab.now();
    {
        let mut machine = lab.machine.borrow_mut();
        machine.plant(Place::Task("motor_gateway::tasks::can::can", 0), &Fault::Panic);
        machine.run_for(Duration::from_millis(500));
    }
    let struck = lab.machine.borrow_mut().struck().expect("it struck");
    let reset = since_start(lab.machine.borrow_mut().reports().resets[0].at);
    let changes = enable_changes(&lab, before);
    let [panicked, gone, .., back] = &changes[..] else { panic!("{changes:?}") };
    assert_eq!(
        (panicked.level, gone.level, gone.at),
        (Some(Level::Low), None, reset),
        "{changes:?}"
    );
    let took = panicked.at - struck;
    assert!(took < Duration::from_micros(5), "{took:?}");
    assert!(
        changes[..changes.len() - 1].iter().all(|change| change.level != Some(Level::High)),
        "{changes:?}"
    );
    assert_eq!(back.level, Some(Level::High), "{changes:?}");
    Vec::new()
}

/// While an axis is unreachable the motors have no power; found again or given up, they have.
pub fn the_enable_output_is_inactive_while_an_axis_is_unreachable() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    lab.events();
    let at = lab.now();
    lab.outside.inject(&mut lab.machine.borrow_mut(), RMD.into(), Injection::Mute(true));
    lab.keep(&holds, Duration::from_secs(2));
    let events = lab.events();
    assert!(
        events.contains(&Event::AxisUnreachable { axis: RMD, stop_transmitted: true }),
        "{events:?}"
    );
    assert!(events.contains(&Event::EnableOutputChanged { active: false }), "{events:?}");
    assert!(!enabled(&lab));
    assert_eq!(lab.client.gateway_status().expect("a status").enable_output, Some(false));
    lab.outside.inject(&mut lab.machine.borrow_mut(), RMD.into(), Injection::Mute(false));
    lab.keep(&holds, Duration::from_secs(2));
    assert!(enabled(&lab), "found again");
    let levels: Vec<_> = enable_changes(&lab, at).iter().map(|change| change.level).collect();
    assert_eq!(levels, [Some(Level::Low), Some(Level::High)]);
    Vec::new()
}

/// From the reset on, through the start, and for as long as the motor confirms no stop: whoever has
/// cut its power for that does not give it back.
pub fn the_enable_output_stays_inactive_over_a_reset_while_an_axis_is_unreachable() -> Vec<Reaction>
{
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    let at = lab.now();
    lab.outside.inject(&mut lab.machine.borrow_mut(), RMD.into(), Injection::Mute(true));
    lab.keep(&holds, Duration::from_secs(1));
    assert!(!enabled(&lab));
    let before = lab.now();
    {
        let mut machine = lab.machine.borrow_mut();
        machine.plant(RESET_AT, &reset_by_software());
        machine.run_for(Duration::from_secs(2));
    }
    let resets = lab.machine.borrow_mut().reports().resets;
    let [reset] = &resets[..] else { panic!("{resets:?}") };
    let reset = since_start(reset.at);
    assert!(reset > before);
    AXES.iter().for_each(|axis| assert!(lab.first_stop(*axis, reset).first_bit < reset + HANG));
    // Two stops at once, and no ten that fail: two every 500 ms.
    let stops = lab.wire(bus_of(RMD), reset);
    let stops = stops.iter().filter(|one| one.text == STOPS[usize::from(RMD)]);
    assert_eq!(stops.count(), 8);
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.gateway_status().expect("a status").enable_output, Some(false));
    let changes = enable_changes(&lab, at);
    let levels: Vec<_> = changes.iter().map(|change| change.level).collect();
    assert_eq!(levels, [Some(Level::Low), None, Some(Level::Low)], "{changes:?}");
    assert_eq!(changes[1].at, reset);

    lab.outside.inject(&mut lab.machine.borrow_mut(), RMD.into(), Injection::Mute(false));
    lab.stay(Duration::from_secs(2));
    assert_eq!(lab.trip(RMD), Some((TripReason::MotorSilent, true)));
    assert!(enabled(&lab), "found again");
    Vec::new()
}

/// How long the light is on and off in turn, in tenths of a second, beginning with the first change
/// after `since`.
fn light(lab: &Lab, since: Duration) -> Vec<(bool, u128)> {
    let changes = lab.machine.borrow_mut().light().changes();
    let changes: Vec<_> = changes.into_iter().filter(|change| change.at >= since).collect();
    let span = |pair: &[Change]| {
        (pair[0].level == Some(Level::High), (pair[1].at - pair[0].at).as_millis().div_ceil(100))
    };
    changes.windows(2).map(span).collect()
}

/// In tenths of a second.
fn assert_light(lab: &Lab, since: Duration, on_and_off: &[(bool, u128)]) {
    let seen = light(lab, since);
    assert!(seen.len() > 2, "{seen:?}");
    assert!(seen.iter().all(|span| on_and_off.contains(span)), "{seen:?}");
    assert!(on_and_off.iter().all(|span| seen.contains(span)), "{seen:?}");
}

/// As the table of patterns says.
pub fn the_light_shows_the_state() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let since = lab.now();
    lab.run_for(Duration::from_millis(3_500));
    assert_light(&lab, since, &[(true, 8), (false, 8)]);

    let holds = lab.moving(&[RMD]);
    let since = lab.now();
    lab.keep(&holds, Duration::from_secs(2));
    assert_eq!(light(&lab, since), [], "armed: it stays on");
    assert_eq!(lab.machine.borrow_mut().light().driven(), Some(Level::High));

    // The setpoint expires: tripped, and the host is heard all the while.
    lab.stay(Duration::from_millis(500));
    assert!(lab.trip(RMD).is_some());
    let since = lab.now();
    lab.stay(Duration::from_secs(2));
    assert_light(&lab, since, &[(true, 1), (false, 1)]);

    lab.client.clear(ClearTarget::Axis(RMD)).expect("cleared");
    lab.client.take_authority().expect("in command");
    lab.run_for(Duration::from_secs(1));
    let since = lab.now();
    lab.run_for(Duration::from_secs(5));
    assert_light(&lab, since, &[(true, 1), (false, 1), (false, 13)]);

    lab.client.reconnect().expect("hello");
    lab.client.estop().expect("stopped");
    lab.stay(Duration::from_millis(200));
    let since = lab.now();
    lab.stay(Duration::from_secs(5));
    assert_light(&lab, since, &[(false, 1), (true, 1), (true, 13)]);
    Vec::new()
}
