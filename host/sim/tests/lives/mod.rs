//! A gateway that hangs, is reset and remembers.

mod flight;
mod images;

use std::time::Duration;

use crate::four_motors::Rig;
use host_protocol::{AxisState, BootReason, Incident};
use mgw_sim::{Station, Wiring};

fn from_gateway(rig: &Rig) -> Vec<(u64, String)> {
    let trace = rig.world.borrow_mut().trace();
    let ours = trace.iter().filter(|entry| entry.from == Station::Gateway);
    ours.map(|entry| (entry.time_us, entry.wire.to_string())).collect()
}

#[test]
fn a_gateway_that_hangs_does_nothing_and_stops_its_motors_when_it_is_reset() {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.move_for(Duration::from_millis(300));
    rig.world.borrow_mut().hang();
    rig.silence(2);
    from_gateway(&rig);
    rig.silence(48);
    assert_eq!(from_gateway(&rig), [], "what was in its controllers has left");
    assert!(rig.client.ping().is_err());
    let reset_us = rig.world.borrow().now().as_micros();
    rig.world.borrow_mut().reset(BootReason::Watchdog, "bus 1 hung");
    rig.silence(5);
    let sent = from_gateway(&rig);
    for stop in ["141#8100000000000000", "30B#5443000000000000", "00B#D50B050320000033"] {
        let first = sent.iter().find(|(_, wire)| wire == stop).map(|(at, _)| at - reset_us);
        assert!(first.is_some_and(|after| after < 1_000), "{stop} after {first:?} in {sent:?}");
    }
    assert_eq!(rig.world.borrow().gateway_now().as_micros(), 5_000);
    rig.client.reconnect().unwrap();
    assert_eq!(rig.client.hello().boot, BootReason::Watchdog);
    assert_eq!(rig.client.crash_report().unwrap(), "bus 1 hung");
    let resets = rig.client.incidents().unwrap();
    assert!(matches!(resets.last(), Some(Incident::Started { start: 1, .. })), "{resets:?}");
}

#[test]
fn nothing_outlives_a_loss_of_power() {
    let mut rig = Rig::new(Wiring::four_motors());
    rig.move_for(Duration::from_millis(300));
    rig.world.borrow_mut().reset(BootReason::PowerOn, "");
    from_gateway(&rig);
    rig.silence(1_000);
    assert_eq!(from_gateway(&rig), []);
    rig.client.reconnect().unwrap();
    let axes = rig.client.list_axes().unwrap();
    assert!(axes.iter().all(|axis| axis.state == AxisState::Unconfigured), "{axes:?}");
}
