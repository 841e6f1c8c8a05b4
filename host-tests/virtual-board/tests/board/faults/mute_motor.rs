//! A motor that hears and obeys and answers nothing.

use std::time::Duration;

use host_protocol::{Event, TripReason};
use mgw_sim::Injection;

use crate::lab::{AXES, Lab, trips};
use crate::reaction::{Reaction, stop_within};

/// Three missed replies that span 50 ms (GUARANTEES G3). The axis is asked at least every 20 ms,
/// and waits 5 ms each time, and as long again before it asks next.
pub const NOTICED: Duration = Duration::from_millis(50 + 20 + 2 * 5);

pub fn a_mute_motor_is_stopped_although_it_answers_nothing() -> Vec<Reaction> {
    let mut reactions = Vec::new();
    for axis in AXES {
        let mut lab = Lab::configured();
        let holds = lab.moving(&AXES);
        lab.events();
        let at = lab.now();
        lab.outside.inject(&mut lab.machine.borrow_mut(), axis.into(), Injection::Mute(true));
        lab.keep(&holds, Duration::from_millis(300));
        let mut events = lab.events();
        assert_eq!(trips(&events), [(axis, TripReason::MotorSilent)]);
        let stop = lab.first_stop(axis, at);
        assert_eq!(lab.trip(axis), Some((TripReason::MotorSilent, false)));
        AXES.iter().filter(|other| **other != axis).for_each(|other| lab.assert_turning(*other));
        // It heard the stop. Ten stops without an answer, then two every now and then, until it is
        // found again.
        lab.keep(&holds, Duration::from_secs(2));
        events.extend(lab.events());
        assert!(
            events.contains(&Event::AxisUnreachable { axis, stop_transmitted: true }),
            "{events:?}"
        );
        lab.assert_stopped_by_gateway(axis, at);
        lab.outside.inject(&mut lab.machine.borrow_mut(), axis.into(), Injection::Mute(false));
        lab.keep(&holds, Duration::from_secs(2));
        assert_eq!(lab.trip(axis), Some((TripReason::MotorSilent, true)));
        let limit = NOTICED + stop_within(axis);
        reactions.push(Reaction::new("motor mute", axis, at, &stop, limit));
    }
    reactions
}
