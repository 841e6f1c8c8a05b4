//! A CAN bus that carries nothing.

use std::time::Duration;

use host_protocol::{AxisParameter, AxisState, BusState, TripReason, Value};
use mgw_client::Hold;
use mgw_sim::Injection;
use virtual_board::machine::{CanPort, Machine};
use virtual_stm32::fdcan::Wiring;

use crate::lab::{
    AXES, BUS_D5, BUS_RMD_AND_THRUSTER, D5, Lab, RMD, RMD_RS485, STOPS, THRUSTER, bus_of, trips,
};
use crate::reaction::{FRAME_1M, FRAME_210K, Reaction, stop_within};
use crate::wire::OnWire;

/// No acknowledgement within this and four frame times (GUARANTEES G3), after a frame that is sent
/// at least every 20 ms.
const UNACKNOWLEDGED: Duration = Duration::from_millis(20 + 20);
/// Before a bus that is off is started again.
const BUS_OFF_PAUSE: Duration = Duration::from_millis(100);
/// 129 times 11 recessive bits at 1 Mbit/s.
const RECOVERY: Duration = Duration::from_micros(129 * 11);
/// How often the firmware looks at the controllers' error states.
const STATE_POLL: Duration = Duration::from_millis(10);

fn wire_bus_0(lab: &Lab, wiring: Wiring) {
    lab.machine.borrow_mut().wire_can(CanPort::Bus0, wiring);
}

/// What the gateway tried to send, arrived or not.
fn first_attempt(lab: &Lab, bus: u8, since: Duration, text: &str) -> Option<OnWire> {
    lab.wire(bus, since).into_iter().find(|message| message.by_gateway && message.text == text)
}

/// The motion of each axis of this board: 0xA2 of the RMD, TC with 10 %, speed 115 °/s of the D5.
const MOTIONS: [&str; 3] = ["141#A2000000C32C0000", "30B#544300000000000A", "00B#D50B05032073"];

/// From `since` on no old setpoint leaves the controller.
fn assert_nothing_stale(lab: &Lab, axis: u8, since: Duration) {
    let motions = |from: Duration| {
        let of_axis = |message: &OnWire| {
            message.by_gateway && message.text.starts_with(MOTIONS[usize::from(axis)])
        };
        lab.wire(bus_of(axis), from).into_iter().filter(of_axis).collect::<Vec<_>>()
    };
    assert!(!motions(Duration::ZERO).is_empty(), "axis {axis} was told to move");
    assert_eq!(motions(since), [], "axis {axis}");
}

fn assert_other_buses_move(lab: &mut Lab, axes: &[u8]) {
    for axis in axes {
        lab.assert_turning(*axis);
        assert_eq!(lab.report(*axis).state, AxisState::Active);
    }
}

/// Of two axes of one bus; when the cable is mended the stop comes first and nothing old comes at
/// all.
pub fn a_cut_bus_trips_for_want_of_acknowledgement_and_the_stop_leaves_first_when_it_is_mended()
-> Vec<Reaction> {
    // What nobody acknowledges is tried for ever, and of several the smallest identifier: only
    // where the thruster moves alone its stop is on the wire before the cable is mended.
    let both = cut_and_mend(&[RMD, THRUSTER]);
    let alone = cut_and_mend(&[THRUSTER]);
    both.into_iter().chain(alone).collect()
}

/// The reactions of the axes of the bus that move; of those the first has the smallest identifier.
fn cut_and_mend(moving: &[u8]) -> Vec<Reaction> {
    let mut lab = Lab::configured();
    // Hardly any polls: it is a motion frame that the cut leaves in the controller.
    for axis in [RMD, THRUSTER] {
        for poll in [AxisParameter::StatePollUs, AxisParameter::FaultPollUs] {
            lab.client.configure_axis(axis, poll, Value::Unsigned(1_000_000)).expect("a parameter");
        }
    }
    let holds = lab.moving(&[moving, &[D5, RMD_RS485]].concat());
    lab.events();
    let at = lab.now();
    wire_bus_0(&lab, Wiring::Cut);
    lab.keep(&holds, Duration::from_millis(300));
    let stuck = lab.wire(BUS_RMD_AND_THRUSTER, at).first().expect("it tries").text.clone();
    assert!(moving.iter().any(|axis| stuck == MOTIONS[usize::from(*axis)]), "{stuck}");
    let tripped: Vec<_> = moving.iter().map(|&axis| (axis, TripReason::NotAcknowledged)).collect();
    assert_eq!(trips(&lab.events()), tripped);
    let status = lab.client.bus_status(BUS_RMD_AND_THRUSTER).expect("status");
    assert_eq!((status.state, status.transmit_errors), (BusState::Passive, 128), "never bus-off");
    assert_eq!(status.counters.bus_offs, 0);
    assert!(status.counters.missed_acknowledgements > 0);
    assert!(status.counters.cancelled > 0, "the motion frame was taken back: {status:?}");
    assert_other_buses_move(&mut lab, &[D5, RMD_RS485]);

    let mended = lab.now();
    wire_bus_0(&lab, Wiring::Connected);
    lab.keep(&holds, Duration::from_secs(2));
    for &axis in moving {
        assert_eq!(lab.trip(axis), Some((TripReason::NotAcknowledged, true)), "axis {axis}");
        lab.assert_stopped_by_gateway(axis, at);
        assert_nothing_stale(&lab, axis, mended);
    }
    let status = lab.client.bus_status(BUS_RMD_AND_THRUSTER).expect("status");
    let heals = matches!(status.state, BusState::Active | BusState::Warning);
    assert!(heals && status.counters.bus_offs == 0, "{status:?}");

    let first = moving[0];
    let tried = first_attempt(&lab, BUS_RMD_AND_THRUSTER, at, STOPS[usize::from(first)])
        .expect("a stop on the dead bus");
    let within = UNACKNOWLEDGED + FRAME_1M * 4 + stop_within(first);
    let mut reactions = vec![Reaction::new("CAN bus cut", first, at, &tried, within)];
    // While nobody answers, stops go out every 50 ms, ten times; then every 500 ms.
    reactions.extend(moving.iter().map(|&axis| {
        let cause = "CAN bus cut, from mending it";
        let stop = lab.first_stop(axis, mended);
        Reaction::new(cause, axis, mended, &stop, Duration::from_millis(50))
    }));
    reactions
}

/// The D5 is the only other node of its bus, and is unplugged.
pub fn a_bus_without_another_node_is_passive_and_never_off() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let probe = lab.probes[1];
    lab.machine.borrow_mut().silence_node(probe, true);
    let holds = lab.moving(&AXES);
    lab.events();
    let at = lab.now();
    lab.outside.inject(&mut lab.machine.borrow_mut(), D5.into(), Injection::Unplugged(true));
    lab.keep(&holds, Duration::from_millis(300));
    assert_eq!(trips(&lab.events()), [(D5, TripReason::NotAcknowledged)]);
    let status = lab.client.bus_status(BUS_D5).expect("status");
    assert_eq!(
        (status.state, status.transmit_errors, status.counters.bus_offs),
        (BusState::Passive, 128, 0)
    );
    assert_other_buses_move(&mut lab, &[RMD, THRUSTER, RMD_RS485]);
    let tried =
        first_attempt(&lab, BUS_D5, at, STOPS[usize::from(D5)]).expect("a stop on the dead bus");

    // For longer than any recovery from bus-off would take.
    lab.keep(&holds, Duration::from_secs(2));
    let status = lab.client.bus_status(BUS_D5).expect("status");
    assert_eq!((status.state, status.counters.bus_offs), (BusState::Passive, 0));
    let plugged = lab.now();
    lab.outside.inject(&mut lab.machine.borrow_mut(), D5.into(), Injection::Unplugged(false));
    lab.keep(&holds, Duration::from_secs(2));
    assert_eq!(lab.trip(D5), Some((TripReason::NotAcknowledged, true)));
    assert_nothing_stale(&lab, D5, plugged);
    let stop = lab.first_stop(D5, plugged);
    vec![
        Reaction::new(
            "only other node unplugged",
            D5,
            at,
            &tried,
            UNACKNOWLEDGED + FRAME_210K * 4 + stop_within(D5),
        ),
        // Unreachable by then: a stop every 500 ms, and what is in the controller is sent over and
        // over.
        Reaction::new(
            "only other node unplugged, from plugging it in",
            D5,
            plugged,
            &stop,
            Duration::from_millis(500),
        ),
    ]
}

/// CANH on CANL: the controller goes off within 32 attempts. The core starts it again every 100 ms.
pub fn a_short_trips_as_bus_off_and_the_stop_follows_when_the_bus_is_back() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    lab.events();
    let at = lab.now();
    wire_bus_0(&lab, Wiring::Shorted);
    lab.keep(&holds, Duration::from_millis(50));
    assert_eq!(trips(&lab.events()), [RMD, THRUSTER].map(|axis| (axis, TripReason::BusOff)));
    let status = lab.client.bus_status(BUS_RMD_AND_THRUSTER).expect("status");
    assert_eq!((status.state, status.counters.bus_offs), (BusState::BusOff, 1));
    assert_other_buses_move(&mut lab, &[D5, RMD_RS485]);
    assert!(!lab.machine.borrow().can(CanPort::Bus0).is_on_bus());

    let mended = lab.now();
    wire_bus_0(&lab, Wiring::Connected);
    lab.keep(&holds, Duration::from_secs(1));
    [RMD, THRUSTER].into_iter().for_each(|axis| assert_nothing_stale(&lab, axis, mended));
    let status = lab.client.bus_status(BUS_RMD_AND_THRUSTER).expect("status");
    assert_eq!(status.state, BusState::Active);
    // From the mending at most one pause until the bus is started, and the controller's way back.
    let limit = BUS_OFF_PAUSE + RECOVERY + STATE_POLL;
    let reactions = [RMD, THRUSTER].map(|axis| {
        assert_eq!(lab.trip(axis), Some((TripReason::BusOff, true)), "axis {axis}");
        lab.assert_stopped_by_gateway(axis, at);
        let stop = lab.first_stop(axis, mended);
        Reaction::new(
            "CAN bus short, from mending it",
            axis,
            mended,
            &stop,
            limit + stop_within(axis),
        )
    });
    assert_axis_moves_again(&mut lab, RMD, &holds);
    reactions.to_vec()
}

/// Cleared and armed anew, it moves.
fn assert_axis_moves_again(lab: &mut Lab, axis: u8, others: &[Hold]) {
    lab.client.clear(host_protocol::ClearTarget::Axis(axis)).expect("cleared");
    let mut holds = lab.arm(&[axis]);
    holds.extend(others.iter().filter(|hold| hold.axis != axis));
    lab.keep(&holds, Duration::from_millis(300));
    lab.assert_turning(axis);
}

/// So long that stops which the bus could not take have been counted as unconfirmed: none of them
/// has been sent, so the stop is due as soon as the bus is back.
pub fn a_long_short_is_followed_by_the_stop_as_soon_as_the_bus_is_back() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    let at = lab.now();
    wire_bus_0(&lab, Wiring::Shorted);
    lab.keep(&holds, Duration::from_millis(480));
    wire_bus_0(&lab, Wiring::Connected);
    let on = |machine: &mut Machine| machine.can(CanPort::Bus0).is_on_bus();
    assert!(lab.machine.borrow_mut().run_until(Duration::from_secs(2), on));
    let back = lab.now();
    lab.stay(Duration::from_secs(2));
    [RMD, THRUSTER]
        .map(|axis| {
            let stop = lab.first_stop(axis, back);
            lab.assert_stopped_by_gateway(axis, at);
            assert_eq!(lab.trip(axis), Some((TripReason::BusOff, true)), "axis {axis}");
            let limit = STATE_POLL + stop_within(axis);
            Reaction::new("CAN bus short for 480 ms, from its return", axis, back, &stop, limit)
        })
        .to_vec()
}
