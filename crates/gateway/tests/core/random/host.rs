//! The hosts: what they have asked, what they were answered, and what they know of the axes.

use super::dice::Dice;
use super::plant::{AXES, BUS_SETUP, MOTORS, POSITION_DEVICE, Purpose};
use host_protocol::{
    AxisParameter, AxisState, Bytes, CanFrame, ClearTarget, Deframer, Event as HostEvent,
    EventMessage, Kind, Protocol, ProtocolSet, RawFrame, Reply, Request, Setpoint, StateFields,
    StopTarget, Value, requests,
};
use std::collections::BTreeMap;

/// Requests that a link remembers: a host that waits for its answers has no more under way.
const WINDOW: usize = 8;
/// However a job ends, it has ended by then.
const ANSWERED_WITHIN_US: u64 = 3_000_000;

/// One host link.
pub struct Host {
    deframer: Deframer,
    sequence: u16,
    /// Requests without an answer: when they were made.
    asked: BTreeMap<u16, (u64, Request)>,
}

impl Host {
    pub fn new() -> Self {
        Self { deframer: Deframer::new(), sequence: 0, asked: BTreeMap::new() }
    }

    pub fn may_ask(&self) -> bool {
        self.asked.len() < WINDOW
    }

    /// The bytes of a request.
    pub fn ask(&mut self, now_us: u64, request: Request) -> Vec<u8> {
        let mut frame = [0; host_protocol::MAX_FRAME];
        self.sequence = self.sequence.wrapping_add(1);
        let length = request.encode_frame(self.sequence, &mut frame).unwrap();
        if matches!(request, Request::Hello(_)) {
            self.asked.clear();
        }
        self.asked.insert(self.sequence, (now_us, request));
        frame[..length].to_vec()
    }

    /// Takes in what the gateway says. A host that is `watching` tells the knowledge of the axes.
    pub fn hear(&mut self, bytes: &[u8], knowledge: &mut Knowledge, watching: bool) {
        for byte in bytes {
            let Some(frame) = self.deframer.push(*byte) else { continue };
            let frame = frame.expect("every frame of a gateway can be read");
            match frame.kind {
                Kind::Reply | Kind::Error => {
                    let (_, request) = self
                        .asked
                        .remove(&frame.sequence)
                        .expect("one answer to every request, no more");
                    if frame.kind == Kind::Reply
                        && let (Request::Arm(arm), Reply::Arm(armed)) =
                            (request, Reply::decode(frame.number, frame.body).unwrap())
                    {
                        knowledge.epochs[usize::from(arm.axis)] = armed.epoch;
                    }
                }
                Kind::Event => {
                    let message = EventMessage::decode(frame.number, frame.body).unwrap();
                    assert_eq!(message.dropped, 0, "a host that reads loses no event");
                    if watching {
                        knowledge.learn(&message.event);
                    }
                }
                Kind::Request => panic!("a gateway sends no requests"),
            }
        }
    }

    /// A request that has waited too long.
    pub fn unanswered(&self, now_us: u64) -> Option<&Request> {
        let late = |(at, _): &&(u64, Request)| now_us - at > ANSWERED_WITHIN_US;
        self.asked.values().find(late).map(|(_, request)| request)
    }
}

/// What the events have told of the axes.
#[derive(Debug, Default)]
pub struct Knowledge {
    states: [Option<AxisState>; AXES],
    /// Nothing but a stop may be sent.
    owes_stop: [bool; AXES],
    epochs: [u32; AXES],
    pub seen: Seen,
}

/// What has happened, so that a run which reaches nothing is noticed.
#[derive(Debug, Default, Clone, Copy)]
pub struct Seen {
    pub motion: u32,
    pub trips: u32,
    pub confirmed: u32,
    pub unreachable: u32,
}

impl Knowledge {
    fn learn(&mut self, event: &HostEvent) {
        match *event {
            HostEvent::StateChanged { axis, state } => {
                let axis = usize::from(axis);
                match state {
                    AxisState::Stopping => self.owes_stop[axis] = true,
                    AxisState::Idle | AxisState::Holding => self.owes_stop[axis] = false,
                    _ => {}
                }
                self.states[axis] = Some(state);
            }
            HostEvent::Tripped { axis, .. } => {
                let axis = usize::from(axis);
                // A stop that is under way goes on.
                self.owes_stop[axis] |= self.states[axis] != Some(AxisState::Stopping);
                self.states[axis] = Some(AxisState::Tripped { confirmed: false });
                self.seen.trips += 1;
            }
            HostEvent::StopConfirmed { .. } => self.seen.confirmed += 1,
            HostEvent::AxisUnreachable { .. } => self.seen.unreachable += 1,
            HostEvent::RequestDropped { .. } => {
                panic!("a request was dropped although there was room")
            }
            _ => {}
        }
    }

    /// No axis moves, and none has a stop that its motor has not confirmed.
    pub fn all_at_rest(&self) -> bool {
        let at_rest = |state: &Option<AxisState>| {
            matches!(
                state,
                None | Some(
                    AxisState::Idle | AxisState::Holding | AxisState::Tripped { confirmed: true }
                )
            )
        };
        self.states.iter().all(at_rest)
    }

    /// Judges a request that the gateway hands to a bus.
    pub fn judge(&mut self, axis: usize, purpose: Purpose) {
        let state = self.states[axis];
        match purpose {
            Purpose::Motion => {
                assert_eq!(
                    state,
                    Some(AxisState::Active),
                    "motion of axis {axis} although it is not active"
                );
                self.seen.motion += 1;
            }
            Purpose::Stop => self.owes_stop[axis] = false,
            Purpose::Other => {}
        }
        assert!(!self.owes_stop[axis], "axis {axis} is sent something else before its stop");
    }
}

pub fn hello(session: u32) -> Request {
    Request::Hello(requests::Hello { protocol_major: 1, protocol_minor: 0, session })
}

/// Everything that link 0 configures.
pub fn configuration() -> Vec<Request> {
    let mut all = vec![configure_bus(0), configure_bus(1), configure_bus(2)];
    for (axis, motor) in (0..).zip(&MOTORS) {
        let unsigned = |number: u8| Value::Unsigned(number.into());
        let parameters = [
            (AxisParameter::Bus, unsigned(motor.bus)),
            (AxisParameter::Protocol, unsigned(motor.protocol.number())),
            (AxisParameter::Node, unsigned(motor.node)),
            (AxisParameter::StopAction, unsigned(motor.stop.number())),
            (AxisParameter::AllowUnknownMotorTimeout, Value::Bool(true)),
        ];
        all.extend(parameters.map(|(parameter, value)| configure(axis, parameter, value)));
    }
    all.push(configure(POSITION_DEVICE, AxisParameter::PositionDevice, Value::Bool(true)));
    all
}

fn configure(axis: u8, parameter: AxisParameter, value: Value) -> Request {
    Request::ConfigureAxis(requests::ConfigureAxis { axis, parameter: parameter.number(), value })
}

fn configure_bus(bus: u8) -> Request {
    let (bitrate, protocols) = BUS_SETUP[usize::from(bus)];
    let protocols = ProtocolSet::of(protocols);
    let request = requests::ConfigureBus {
        bus,
        bitrate,
        protocols,
        exclusive: false,
        reply_window_us: 3_000,
    };
    Request::ConfigureBus(request)
}

/// Any request, mostly of the kind that leads to motion.
pub fn any_request(dice: &mut Dice, now_us: u64, knowledge: &Knowledge) -> Request {
    let axis = dice.pick(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    let bus = dice.pick(&[0, 1, 2]);
    match dice.below(68) {
        0 if dice.percent(3) => hello(7),
        1 => Request::TakeAuthority(requests::TakeAuthority {}),
        2 if dice.percent(1) => Request::ReleaseAuthority(requests::ReleaseAuthority {}),
        3..=12 => Request::Arm(requests::Arm { axis }),
        13 if dice.percent(20) => Request::Disarm(requests::Disarm { axis }),
        14 if dice.percent(20) => {
            let target = if dice.percent(20) { StopTarget::All } else { StopTarget::Axis(axis) };
            Request::Stop(requests::Stop { target })
        }
        15 if dice.percent(2) => Request::EStop(requests::EStop {}),
        16..=18 => Request::Clear(requests::Clear { target: ClearTarget::Gateway }),
        19..=24 => Request::Clear(requests::Clear { target: ClearTarget::Axis(axis) }),
        25 if dice.percent(50) => Request::ClearUnreachable(requests::ClearUnreachable { axis }),
        25 => Request::OutputOff(requests::OutputOff { axis }),
        26..=45 => any_setpoint(dice, now_us, axis, knowledge.epochs[usize::from(axis)]),
        46..=49 => Request::ReadState(requests::ReadState { axis }),
        50 => {
            let timeout_ms = dice.pick(&[0, 1, 99, 100, 1_000]);
            Request::ProvisionMotorTimeout(requests::ProvisionMotorTimeout { axis, timeout_ms })
        }
        51 if dice.percent(5) => Request::RawOpen(requests::RawOpen {
            bus: dice.pick(&[0, 1, 2, 3]),
            unsafe_access: dice.percent(50),
        }),
        52 => {
            let frame = if bus == 2 {
                RawFrame::Serial(dice.bytes(5).into_iter().collect::<Bytes<_>>())
            } else {
                RawFrame::Can(CanFrame::standard(0x700, &[1, 2]).unwrap())
            };
            Request::RawSend(requests::RawSend { bus, frame })
        }
        53 => Request::RawClose(requests::RawClose { bus }),
        54 => configure_bus(bus),
        55 => {
            let parameter = dice.pick(&[
                AxisParameter::TtlUs,
                AxisParameter::FaultPollUs,
                AxisParameter::StatePollUs,
                AxisParameter::StandstillRadS,
                AxisParameter::VelocityLimitRadS,
                AxisParameter::LimitMargin,
            ]);
            let value =
                dice.pick(&[Value::Unsigned(50_000), Value::Float(f32::NAN), Value::Float(1.0)]);
            configure(axis, parameter, value)
        }
        56 => {
            let parameter = AxisParameter::TtlUs.number();
            Request::ReadAxisParameter(requests::ReadAxisParameter { axis, parameter })
        }
        57..=61 => any_native(dice, now_us, axis, knowledge.epochs[usize::from(axis)]),
        62..=63 => {
            let distance_rad = (f32::from(dice.byte()) - 128.0) / 40.0;
            let (expires_at_us, epoch) = permit(dice, now_us, knowledge.epochs[usize::from(axis)]);
            let speed_limit_rad_s = dice.pick(&[0.0, 1.0, 5.0]);
            let request = requests::MoveRelative {
                axis,
                epoch,
                expires_at_us,
                distance_rad,
                speed_limit_rad_s,
            };
            Request::MoveRelative(request)
        }
        64 => {
            let fields = StateFields::from_bits(dice.byte());
            let axes = dice.pick(&[0, 1, 0b10_1010_1010, u32::MAX]);
            Request::Subscribe(requests::Subscribe {
                axes,
                fields,
                period_us: dice.pick(&[999, 5_000, 100_000]),
            })
        }
        _ => Request::Ping(requests::Ping {}),
    }
}

/// Whether the setpoint is meant in good time and for the right epoch: mostly.
fn permit(dice: &mut Dice, now_us: u64, epoch: u32) -> (u32, u32) {
    let ttl_us = if dice.percent(95) { 90_000 } else { dice.below(100_100) };
    let expires_at_us = gateway::Instant::from_micros(now_us + ttl_us).low_bits();
    (expires_at_us, epoch.wrapping_add(u32::from(dice.percent(5))))
}

/// A command of the manual, or bytes that are none.
fn any_native(dice: &mut Dice, now_us: u64, axis: u8, epoch: u32) -> Request {
    let motor = &MOTORS[usize::from(axis)];
    let random = dice.bytes(9);
    let data = match motor.protocol {
        _ if dice.percent(10) => random,
        Protocol::Rmd => {
            let command = dice.pick(&[
                0x30, 0x43, 0x64, 0x70, 0x76, 0x77, 0x78, 0x80, 0x81, 0x92, 0x9A, 0xA1, 0xA2, 0xA3,
                0xA4, 0xA8, 0xB3,
            ]);
            vec![command, 0, dice.byte(), 0, dice.byte(), dice.byte(), 0, 0]
        }
        Protocol::Thruster => {
            let command =
                dice.pick(&[b"TC", b"VC", b"QV", b"EF", b"LA", b"LR", b"LS", b"ST", b"CI", b"MQ"]);
            let [first, second] = *command;
            let long = vec![first, second, 0, dice.byte(), 0, 0, 0, dice.byte()];
            let short = vec![first, second, 0, 0];
            dice.pick(&[long, short])
        }
        Protocol::D5 => {
            let command = dice.pick(&[1, 2, 3, 4, 5]);
            let body = [
                motor.node,
                5,
                command,
                dice.pick(&[0x20, 0x26, 0x15]),
                dice.byte(),
                dice.pick(&[0, 2]),
            ];
            let sum = body.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
            std::iter::once(0xD5).chain(body).chain([sum]).collect()
        }
    };
    let (expires_at_us, epoch) = permit(dice, now_us, epoch);
    let data = data.into_iter().take(8).collect();
    Request::Native(requests::Native { axis, epoch, expires_at_us, data })
}

fn any_setpoint(dice: &mut Dice, now_us: u64, axis: u8, epoch: u32) -> Request {
    let value = match dice.below(40) {
        0 => f32::NAN,
        1 => f32::INFINITY,
        2 => 1e30,
        3 => 0.0,
        _ => (f32::from(dice.byte()) - 128.0) / 40.0,
    };
    let signal = Setpoint::Signal { fraction: value / 5.0 };
    let current = Setpoint::Current { current_a: value };
    let velocity = Setpoint::Velocity { velocity_rad_s: value };
    let position = Setpoint::Position { position_rad: value, speed_limit_rad_s: value.abs() };
    let impedance = Setpoint::Impedance {
        position_rad: value,
        velocity_rad_s: 0.0,
        stiffness_nm_per_rad: value.abs(),
        damping_nm_s_per_rad: 1.0,
        torque_nm: value,
    };
    let setpoint = match MOTORS[usize::from(axis)].protocol {
        _ if dice.percent(10) => dice.pick(&[signal, current, velocity, position]),
        Protocol::Thruster => signal,
        Protocol::D5 => velocity,
        _ => dice.pick(&[current, velocity, position, impedance]),
    };
    let (expires_at_us, epoch) = permit(dice, now_us, epoch);
    Request::Setpoint(requests::Setpoint { axis, epoch, expires_at_us, setpoint })
}
