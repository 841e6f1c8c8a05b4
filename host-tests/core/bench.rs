//! A rig with configured motors, and what a host does with them.

use crate::motors::{self, Play, Shared};
use crate::rig::{Instead, Rig, Said};
use host_protocol::{
    AxisParameter, AxisState, ClearTarget, CycleEvent, Error, Event as HostEvent, Protocol,
    ProtocolSet, Reply, Request, Setpoint, StateFields, StopAction, StopTarget, TripReason, Value,
    replies, requests,
};
use std::cell::RefCell;
use std::rc::Rc;

/// 100 °/s, on the wire of an RMD `A200000010270000` (RMD V3.6 §2.18.4, example 1).
pub const VELOCITY: Setpoint = Setpoint::Velocity { velocity_rad_s: 1.745_329_3 };
/// 600 °/s, what the D5 manual prints.
pub const D5_VELOCITY: Setpoint = Setpoint::Velocity { velocity_rad_s: 10.471_976 };

/// RMD node 1 stops by holding.
pub const HOLD: &str = "141#8100000000000000";
/// RMD node 1 switches its output off.
pub const COAST: &str = "141#8000000000000000";

/// What the bench's setpoints live, µs.
pub const TTL_US: u64 = 80_000;

fn play() -> Shared {
    Rc::new(RefCell::new(Play::default()))
}

pub fn configure_bus(rig: &mut Rig, bus: u8, bitrate: u32, protocols: &[Protocol]) {
    let request = requests::ConfigureBus {
        bus,
        bitrate,
        protocols: ProtocolSet::of(protocols),
        exclusive: false,
        reply_window_us: 5_000,
    };
    rig.ask(Request::ConfigureBus(request)).unwrap();
}

pub fn parameter(rig: &mut Rig, axis: u8, parameter: AxisParameter, value: Value) {
    let request = requests::ConfigureAxis { axis, parameter: parameter.number(), value };
    rig.ask(Request::ConfigureAxis(request)).unwrap();
}

/// An axis on a bus, motor timeouts not asked for.
pub fn configure_axis(
    rig: &mut Rig,
    axis: u8,
    bus: u8,
    protocol: Protocol,
    node: u8,
    stop: StopAction,
) {
    let unsigned = |number: u8| Value::Unsigned(u32::from(number));
    parameter(rig, axis, AxisParameter::Bus, unsigned(bus));
    parameter(rig, axis, AxisParameter::Protocol, unsigned(protocol.number()));
    parameter(rig, axis, AxisParameter::Node, unsigned(node));
    parameter(rig, axis, AxisParameter::StopAction, unsigned(stop.number()));
    parameter(rig, axis, AxisParameter::AllowUnknownMotorTimeout, Value::Bool(true));
}

/// RMD node 1 on CAN bus 0.
pub fn rmd(stop: StopAction) -> (Rig, Shared) {
    let (mut rig, play) = (Rig::new(), play());
    rig.motor = Box::new(motors::rmd(play.clone()));
    hello(&mut rig);
    configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd, Protocol::Thruster]);
    configure_axis(&mut rig, 0, 0, Protocol::Rmd, 1, stop);
    (rig, play)
}

/// So many RMD axes on CAN bus 0, which hold; the node of each is one more than its number.
pub fn rmd_axes(count: u8) -> Rig {
    let (mut rig, _) = rmd(StopAction::Hold);
    for axis in 1..count {
        configure_axis(&mut rig, axis, 0, Protocol::Rmd, axis + 1, StopAction::Hold);
    }
    rig
}

/// Thruster node 0x0B on CAN bus 0.
pub fn thruster() -> (Rig, Shared) {
    let (mut rig, play) = (Rig::new(), play());
    rig.motor = Box::new(motors::thruster(play.clone()));
    hello(&mut rig);
    configure_bus(&mut rig, 0, 500_000, &[Protocol::Thruster]);
    configure_axis(&mut rig, 0, 0, Protocol::Thruster, 0x0B, StopAction::Coast);
    (rig, play)
}

/// A thruster that is armed and falls silent, and has just been given a setpoint of 0, which reads
/// as its stop does.
pub fn thruster_that_owes_the_reply_to_a_setpoint_of_0() -> (Rig, Shared) {
    let (mut rig, play) = thruster();
    let epoch = arm(&mut rig);
    rig.run(10_000);
    play.borrow_mut().mute = true;
    let request = setpoint(&rig, epoch, TTL_US, Setpoint::Signal { fraction: 0.0 });
    rig.ask(request).unwrap();
    (rig, play)
}

/// D5 id 0x0B on CAN bus 1.
pub fn d5() -> (Rig, Shared) {
    let (mut rig, play) = (Rig::new(), play());
    rig.motor = Box::new(motors::d5(play.clone()));
    hello(&mut rig);
    configure_bus(&mut rig, 1, 210_526, &[Protocol::D5]);
    configure_axis(&mut rig, 0, 1, Protocol::D5, 0x0B, StopAction::Hold);
    (rig, play)
}

/// D5 id 0x0B on CAN bus 1 at acknowledgement level 1: it answers reads and no writes.
pub fn d5_that_answers_reads_only() -> Rig {
    let (mut rig, _) = d5();
    parameter(&mut rig, 0, AxisParameter::D5AckLevel, Value::Unsigned(1));
    rig.instead(|text| match text.get(10..14) {
        Some("0210") => Instead::Says("00B#5D0B040210010022"),
        Some(write) if write.starts_with("03") => Instead::Nothing,
        _ => Instead::AsUsual,
    });
    rig
}

/// RMD node 1 on CAN bus 0 that holds, and was told its own timeout.
pub fn rmd_with_timeout(timeout_ms: u32) -> (Rig, Shared) {
    let (mut rig, play) = rmd(StopAction::Hold);
    provision(&mut rig, timeout_ms).unwrap();
    (rig, play)
}

/// RMD node 1 on RS485 bus 2.
pub fn rmd_serial(stop: StopAction) -> (Rig, Shared) {
    let (mut rig, play) = (Rig::new(), play());
    rig.motor = Box::new(motors::rmd_serial(play.clone()));
    hello(&mut rig);
    configure_bus(&mut rig, 2, 115_200, &[Protocol::Rmd]);
    configure_axis(&mut rig, 0, 2, Protocol::Rmd, 1, stop);
    (rig, play)
}

pub fn hello(rig: &mut Rig) {
    rig.ask(Request::Hello(requests::Hello { protocol_major: 1, protocol_minor: 0, session: 7 }))
        .unwrap();
}

/// The host begins another session.
pub fn hello_again(rig: &mut Rig) {
    rig.ask(Request::Hello(requests::Hello { protocol_major: 1, protocol_minor: 0, session: 8 }))
        .unwrap();
}

/// Arms axis 0 and returns its epoch.
pub fn arm(rig: &mut Rig) -> u32 {
    arm_axis(rig, 0)
}

pub fn arm_axis(rig: &mut Rig, axis: u8) -> u32 {
    match rig.ask(Request::Arm(requests::Arm { axis })) {
        Ok(Reply::Arm(replies::Armed { epoch, .. })) => epoch,
        other => panic!("arming was answered {other:?}"),
    }
}

/// Tells the motor of axis 0 its own timeout.
pub fn provision(rig: &mut Rig, timeout_ms: u32) -> Result<Reply, Error> {
    rig.ask(Request::ProvisionMotorTimeout(requests::ProvisionMotorTimeout { axis: 0, timeout_ms }))
}

pub fn disarm(rig: &mut Rig) {
    disarm_axis(rig, 0);
}

pub fn disarm_axis(rig: &mut Rig, axis: u8) {
    rig.ask(Request::Disarm(requests::Disarm { axis })).unwrap();
}

/// A setpoint of axis 0 that lives `ttl_us` from now.
pub fn setpoint(rig: &Rig, epoch: u32, ttl_us: u64, setpoint: Setpoint) -> Request {
    axis_setpoint(rig, 0, epoch, ttl_us, setpoint)
}

/// The low 32 bits of the time `ttl_us` from now.
pub fn expiry(rig: &Rig, ttl_us: u64) -> u32 {
    (rig.now() + gateway::Duration::from_micros(ttl_us)).low_bits()
}

/// A native command of axis 0, its data in hex; what moves lives 80 ms.
pub fn native(rig: &Rig, epoch: u32, data: &str) -> Request {
    let data = host_protocol::Bytes::from_slice(&crate::text::unhex(data)).unwrap();
    Request::Native(requests::Native { axis: 0, epoch, expires_at_us: expiry(rig, TTL_US), data })
}

/// The data of a native command's reply in hex.
pub fn answered(result: Result<Reply, Error>) -> String {
    match result {
        Ok(Reply::Native(reply)) => crate::text::hex(&reply.data),
        other => panic!("{other:?}"),
    }
}

/// A setpoint of any axis that lives `ttl_us` from now.
pub fn axis_setpoint(rig: &Rig, axis: u8, epoch: u32, ttl_us: u64, setpoint: Setpoint) -> Request {
    let expires_at_us = expiry(rig, ttl_us);
    Request::Setpoint(requests::Setpoint { axis, epoch, expires_at_us, setpoint })
}

/// Arms axis 0 and sets it in motion for 80 ms.
pub fn move_axis(rig: &mut Rig, value: Setpoint) -> u32 {
    let epoch = arm(rig);
    let request = setpoint(rig, epoch, TTL_US, value);
    rig.ask(request).unwrap();
    epoch
}

/// Keeps axes, each with its epoch, moving at a setpoint for a while.
pub fn keep_moving(rig: &mut Rig, axes: &[(u8, u32)], value: Setpoint, us: u64) {
    const PERIOD_US: u64 = 10_000;
    let end = rig.now_us + us;
    while rig.now_us < end {
        for (axis, epoch) in axes {
            let request = axis_setpoint(rig, *axis, *epoch, TTL_US, value);
            rig.send(&request);
        }
        rig.run(PERIOD_US.min(end - rig.now_us));
    }
}

/// Lets time pass with pings, so that the link is not silent.
pub fn run_with_host(rig: &mut Rig, us: u64) {
    const PERIOD_US: u64 = 50_000;
    let end = rig.now_us + us;
    while rig.now_us < end {
        rig.send(&Request::Ping(requests::Ping {}));
        rig.run(PERIOD_US.min(end - rig.now_us));
    }
}

/// Has the gateway drive these axes in a period of its own.
pub fn run_cycle(
    rig: &mut Rig,
    axes: u32,
    fields: StateFields,
    period_us: u32,
) -> Result<(), Error> {
    let request = Request::RunCycle(requests::RunCycle { axes, fields, period_us });
    rig.ask(request).map(|reply| assert_eq!(reply, Reply::RunCycle(replies::Done {})))
}

/// What was told of its periods.
pub fn periods(rig: &Rig) -> Vec<&CycleEvent> {
    let periods = rig.said.iter().filter_map(|said| match said {
        Said::Cycle(message) => Some(&message.event),
        _ => None,
    });
    periods.collect()
}

/// Stops axis 0.
pub fn stop(rig: &mut Rig) {
    rig.ask(Request::Stop(requests::Stop { target: StopTarget::Axis(0) })).unwrap();
}

/// What is remembered, the latest first.
pub fn incidents(rig: &mut Rig, first: u8) -> replies::IncidentPage {
    match rig.ask(Request::ReadIncidents(requests::ReadIncidents { first })) {
        Ok(Reply::ReadIncidents(page)) => page,
        other => panic!("{other:?}"),
    }
}

pub fn e_stop(rig: &mut Rig) {
    rig.ask(Request::EStop(requests::EStop {})).unwrap();
}

/// Switches the output of axis 0's motor off.
pub fn output_off(rig: &mut Rig) -> Result<Reply, Error> {
    rig.ask(Request::OutputOff(requests::OutputOff { axis: 0 }))
}

/// Clears the trip of axis 0.
pub fn clear(rig: &mut Rig) -> Result<Reply, Error> {
    rig.ask(Request::Clear(requests::Clear { target: ClearTarget::Axis(0) }))
}

/// Axis 0 as its motor tells.
pub fn state(rig: &mut Rig) -> replies::AxisReport {
    match rig.ask(Request::ReadState(requests::ReadState { axis: 0 })) {
        Ok(Reply::ReadState(state)) => state,
        other => panic!("{other:?}"),
    }
}

/// An axis as the gateway knows it without asking the motor.
pub fn listed(rig: &mut Rig, axis: u8) -> AxisState {
    match rig.ask(Request::ListAxes(requests::ListAxes { first: axis })) {
        Ok(Reply::ListAxes(list)) => list.axes[0].state,
        other => panic!("{other:?}"),
    }
}

pub fn assert_tripped(rig: &mut Rig, reason: TripReason, confirmed: bool) {
    let state = state(rig);
    assert_eq!(state.trip.map(|trip| trip.reason), Some(reason));
    assert_eq!(state.state, AxisState::Tripped { confirmed });
}

/// Within 2 s axis 0 is out of reach, and its stop is not confirmed.
#[track_caller]
pub fn assert_becomes_unreachable(rig: &mut Rig) {
    run_with_host(rig, 2_000_000);
    assert_eq!(outcomes(rig), [HostEvent::AxisUnreachable { axis: 0, stop_transmitted: true }]);
    assert_eq!(listed(rig, 0), AxisState::Tripped { confirmed: false });
}

/// Confirmed stops and axes out of reach, as the host was told.
pub fn outcomes(rig: &Rig) -> Vec<HostEvent> {
    let is_outcome = |event: &&HostEvent| {
        matches!(event, HostEvent::StopConfirmed { .. } | HostEvent::AxisUnreachable { .. })
    };
    rig.events().into_iter().filter(is_outcome).copied().collect()
}
