//! Two hosts on the two UARTs: one commands, the other may read and stop.

use std::time::Duration;

use host_protocol::requests::{EStop, Stop};
use host_protocol::{
    AxisState, Call, Error, Event, Kind, MAX_FRAME, Setpoint, StopTarget, TripReason, encode,
};
use mgw_sim::Motor;

use virtual_board::host_uart::HostUart;
use virtual_board::machine::{Line, Machine};

use crate::lab::{AXES, Lab, RMD, THRUSTER, TTL, refused, trips, turning, wire_of};
use crate::reaction::Reaction;

/// Of a byte: start, 8 data, stop.
const BITS_PER_BYTE: u64 = 10;
/// A sequence number that the client has not used lately.
const SEQUENCE: u16 = 0x7000;

/// Sends a request as a host would, without waiting for the answer. Returns when the last bit of
/// its closing delimiter has been sent.
fn send<C: Call>(machine: &mut Machine, host: Line<HostUart>, request: &C) -> Duration {
    let mut frame = [0; MAX_FRAME];
    let length = encode(Kind::Request, SEQUENCE, C::NUMBER, request, &mut frame).expect("it fits");
    let host = machine.line(host);
    assert_eq!(host.unsent(), 0, "the line is free");
    let bit_ps = host.settings().bit_ps;
    host.send(&frame[..length]);
    let bits = BITS_PER_BYTE * u64::try_from(length).expect("short");
    machine.now() + Duration::from_nanos(bits * bit_ps / 1_000)
}

pub fn the_second_host_may_read_and_stop_and_not_command() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    let holds = lab.moving(&AXES);
    let mut second = lab.second_client();
    lab.keep(&holds, Duration::from_millis(50));
    let holder = Error::NotInCommand { holder: 0 };
    assert_eq!(refused(second.arm(RMD)), holder);
    assert_eq!(refused(second.take_authority()), holder);
    assert_eq!(
        refused(second.set(RMD, holds[0].epoch, Setpoint::Current { current_a: 1.0 }, TTL)),
        holder
    );
    assert_eq!(refused(second.raw_open(0)), holder);
    lab.keep(&holds, Duration::from_millis(50));
    for axis in AXES {
        let report = second.read_state(axis).expect("it may read");
        assert_eq!(report.state, AxisState::Active);
        lab.keep(&holds, Duration::from_millis(20));
        lab.assert_turning(axis);
    }
    lab.run_for(Duration::from_millis(5));
    let at = {
        let mut machine = lab.machine.borrow_mut();
        send(&mut machine, lab.outside.hosts[1], &Stop { target: StopTarget::All })
    };
    lab.stay(Duration::from_secs(1));
    let cause = "stop from the second host, from its final delimiter";
    let reactions = lab.reactions(cause, at, Duration::ZERO);
    for axis in AXES {
        let rest = if axis == THRUSTER { AxisState::Idle } else { AxisState::Holding };
        assert_eq!(lab.report(axis).state, rest, "a stop on request trips nothing");
        lab.assert_stopped_by_gateway(axis, at);
    }
    // Both hosts have learnt of it, and the first one is still in command.
    let holding = Event::StateChanged { axis: RMD, state: AxisState::Holding };
    assert!(lab.events().contains(&holding));
    let told = std::iter::from_fn(|| second.poll_event(Duration::ZERO).expect("the link"));
    assert!(told.map(|message| message.event).any(|event| event == holding));
    let hold = lab.arm(&[RMD])[0];
    lab.client.set(RMD, hold.epoch, turning(RMD), TTL).expect("taken over");
    lab.stay(Duration::from_millis(50));
    assert!(lab.motor(RMD, Motor::speed_rad_s) > 0.5);
    reactions
}

/// At any moment of the buses' traffic: from one snapshot in motion, 1.77 ms apart. The worst of
/// them counts.
pub fn an_emergency_stop_from_the_second_host_reaches_every_bus_at_once() -> Vec<Reaction> {
    let mut lab = Lab::configured();
    lab.moving(&AXES);
    let _second = lab.second_client();
    lab.events();
    let worst = Reaction::worst_of_12(&lab, |machine, outside| {
        let at = send(machine, outside.hosts[1], &EStop {});
        machine.run_for(Duration::from_millis(20));
        let cause = "e-stop from the second host, the latest of 12";
        Reaction::of_all(cause, at, Duration::ZERO, |bus| wire_of(machine, outside, bus, at))
    });
    let at = {
        let mut machine = lab.machine.borrow_mut();
        send(&mut machine, lab.outside.hosts[1], &EStop {})
    };
    lab.stay(Duration::from_secs(1));
    let events = lab.events();
    assert_eq!(trips(&events), AXES.map(|axis| (axis, TripReason::EStop)));
    assert!(events.contains(&Event::EStopLatched {}));
    let tripped = Error::Tripped { axis: RMD, reason: TripReason::EStop };
    assert_eq!(refused(lab.client.set(RMD, 0, turning(RMD), TTL)), tripped);
    for axis in AXES {
        lab.assert_stopped_by_gateway(axis, at);
        assert_eq!(lab.trip(axis), Some((TripReason::EStop, true)));
    }
    worst
}
