//! The part is reset in mid-motion. Nothing is remembered over a reset yet, so the motors' own timeouts act, or the host.

use std::time::Duration;

use host_protocol::{AxisState, BootReason, StopTarget};
use mgw_sim::MotorEvent;

use crate::lab::{AXES, Lab, NAMES, bus_of};
use crate::log;
use crate::reaction::Reaction;

/// The D5's own timeout.
const D5_TIMEOUT: Duration = Duration::from_secs(2);

fn reset_in_motion() -> (Lab, Duration) {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    log::take(&mut lab.machine.borrow_mut());
    let at = lab.now();
    lab.machine.borrow_mut().reset_by_pin();
    (lab, at)
}

/// Nobody says a word to the motors: each stops when its own timeout strikes, and not before.
pub fn after_a_reset_the_motors_stop_by_their_own_timeouts() -> Vec<Reaction> {
    let (mut lab, at) = reset_in_motion();
    lab.run_for(Duration::from_millis(500));
    AXES.iter().for_each(|axis| lab.assert_turning(*axis));
    lab.run_for(D5_TIMEOUT);
    for axis in AXES {
        let log = lab.motor_log(axis, at);
        assert!(log.iter().any(|event| matches!(event, MotorEvent::Timeout { .. })), "axis {axis}: {log:?}");
        lab.assert_standing(axis);
        let said: Vec<_> =
            lab.wire(bus_of(axis), at).into_iter().filter(|message| message.by_gateway).collect();
        assert_eq!(said, [], "the gateway said nothing");
    }
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.hello().boot, BootReason::Pin);
    assert_eq!(lab.client.list_axes().expect("a list"), [], "nothing is configured, nothing is armed");
    let lines = log::take(&mut lab.machine.borrow_mut());
    let boots: Vec<_> = lines.iter().filter(|line| line.contains("motor gateway")).collect();
    assert!(matches!(&boots[..], [boot] if boot.ends_with("started by Pin")), "{lines:?}");
    Vec::new()
}

/// The host notices, configures and stops, long before the motors' own timeouts.
pub fn after_a_reset_the_host_configures_again_and_stops() -> Vec<Reaction> {
    let (mut lab, at) = reset_in_motion();
    lab.run_for(Duration::from_millis(20));
    lab.client.reconnect().expect("hello");
    assert_eq!(lab.client.hello().boot, BootReason::Pin);
    lab.configure();
    AXES.iter().for_each(|axis| lab.assert_turning(*axis));
    lab.client.stop(StopTarget::All).expect("stopped");
    lab.stay(Duration::from_secs(1));
    AXES.into_iter()
        .map(|axis| {
            assert_eq!(lab.report(axis).state, AxisState::Idle, "axis {axis}");
            lab.assert_stopped_by_gateway(axis, at);
            let stop = lab.first_stop(axis, at);
            let cause = "reset by pin, configured again by the host";
            Reaction::new(cause, NAMES[usize::from(axis)], at, &stop, Duration::from_millis(500))
        })
        .collect()
}
