//! One host: what it sends, byte for byte, and what it has learnt.

use crate::action::{Ask, Goal, Number, Permit};
use crate::bus::can_frame;
use crate::plant::{BUS_SETUP, LINE};
use host_protocol::{
    BusMode, Bytes, Change, ClearTarget, Deframer, FixedU32, MAX_FRAME, Member, Protocol,
    ProtocolSet, RawFrame, Request, Setpoint, StateField, StateFields, StopTarget, Subject, Text,
    Value, requests,
};
use std::collections::VecDeque;

/// Members of a start together, at most.
const MAX_MEMBERS: usize = 8;
/// Requests that a host remembers, to send them again.
const REMEMBERED: usize = 16;

/// One host.
#[derive(Debug, Clone, Default)]
pub struct Host {
    sequence: u16,
    sent: VecDeque<Vec<u8>>,
    /// Until when it reads nothing.
    pub unread_until: u64,
}

impl Host {
    /// The bytes of a request, or of one that it passes on for who `watches`; `epochs`: what the
    /// host knows of each axis.
    pub fn ask(&mut self, now: u64, ask: &Ask, epochs: &[u32], watches: bool) -> Vec<u8> {
        let request = request(now, ask, epochs);
        let mut frame = [0; MAX_FRAME];
        self.sequence = self.sequence.wrapping_add(1);
        let length = request.encode_frame(self.sequence, &mut frame).unwrap_or(0);
        let mut bytes = frame[..length].to_vec();
        if watches {
            bytes = for_watcher(&bytes);
        }
        self.sent.push_front(bytes.clone());
        self.sent.truncate(REMEMBERED);
        bytes
    }

    /// The bytes of an earlier request.
    pub fn again(&self, back: u8) -> Option<Vec<u8>> {
        self.sent.get(usize::from(back)).cloned()
    }
}

/// The frame of the same request of who only watches.
fn for_watcher(frame: &[u8]) -> Vec<u8> {
    let mut deframer = Deframer::new();
    let Some(Ok(frame)) = deframer.take(&mut &frame[..]) else { return Vec::new() };
    promise_model::frame(5, frame.sequence, frame.number, frame.body)
}

fn wire_value(number: Number) -> Value {
    match number {
        Number::Bool(value) => Value::Bool(value),
        Number::Unsigned(value) => Value::Unsigned(value),
        Number::Signed(value) => Value::Signed(value),
        Number::Float(value) => Value::Float(value),
    }
}

fn request(now: u64, ask: &Ask, epochs: &[u32]) -> Request {
    #[allow(clippy::cast_possible_truncation)] // the low 32 bits are what the wire carries
    let at = |lead_us| (now as u32).wrapping_add_signed(lead_us);
    let expiry = |permit: &Permit| at(permit.lead_us);
    let known = |axis: u8| epochs.get(usize::from(axis)).copied().unwrap_or(0);
    let epoch = |permit: &Permit| known(permit.axis).wrapping_add_signed(permit.epoch);
    match *ask {
        Ask::Hello => {
            Request::Hello(requests::Hello { protocol_major: 1, protocol_minor: 0, session: 1 })
        }
        Ask::Ping => Request::Ping(requests::Ping {}),
        Ask::Take => Request::TakeAuthority(requests::TakeAuthority {}),
        Ask::Release => Request::ReleaseAuthority(requests::ReleaseAuthority {}),
        Ask::Silence { us } => Request::ConfigureGateway(requests::ConfigureGateway {
            parameter: host_protocol::GatewayParameter::LinkSilenceUs.number(),
            value: Value::Unsigned(us),
        }),
        Ask::Bus { bus, window_us, protocols, exclusive } => {
            let (bitrate, _) = BUS_SETUP[usize::from(bus) % BUS_SETUP.len()];
            let all = [Protocol::Rmd, Protocol::Thruster, Protocol::D5].into_iter().enumerate();
            let spoken: Vec<Protocol> = all
                .filter(|(bit, _)| protocols >> bit & 1 == 1)
                .map(|(_, protocol)| protocol)
                .collect();
            Request::ConfigureBus(requests::ConfigureBus {
                bus,
                bitrate,
                protocols: ProtocolSet::of(&spoken),
                exclusive,
                reply_window_us: window_us,
            })
        }
        Ask::Set { axis, parameter, value } => {
            let value = wire_value(value);
            Request::ConfigureAxis(requests::ConfigureAxis { axis, parameter, value })
        }
        Ask::Begin => Request::BeginChanges(requests::BeginChanges {}),
        Ask::Change { axis, parameter, value } => {
            let change = Change::Axis { axis, parameter, value: value.map(wire_value) };
            Request::AddChanges(requests::AddChanges { changes: [change].into_iter().collect() })
        }
        Ask::Name { kind, number, ref name } => {
            let of = match kind {
                0 => Subject::Gateway,
                1 => Subject::Bus(number),
                _ => Subject::Axis(number),
            };
            let name = name.as_deref().map(|name| Text::try_from(name).unwrap_or_default());
            let changes = [Change::Name { of, name }].into_iter().collect();
            Request::AddChanges(requests::AddChanges { changes })
        }
        Ask::Apply => Request::ApplyChanges(requests::ApplyChanges {}),
        Ask::Save => Request::SaveConfiguration(requests::SaveConfiguration {}),
        Ask::Forget => Request::ForgetStored(requests::ForgetStored {}),
        Ask::Remove { axis } => Request::RemoveAxis(requests::RemoveAxis { axis }),
        Ask::Provision { axis, timeout_ms } => {
            Request::ProvisionMotorTimeout(requests::ProvisionMotorTimeout { axis, timeout_ms })
        }
        Ask::Arm { axis } => Request::Arm(requests::Arm { axis }),
        Ask::Disarm { axis } => Request::Disarm(requests::Disarm { axis }),
        Ask::Stop { axis } => Request::Stop(requests::Stop { target: StopTarget::Axis(axis) }),
        Ask::StopAll => Request::Stop(requests::Stop { target: StopTarget::All }),
        Ask::EStop => Request::EStop(requests::EStop {}),
        Ask::ClearGateway => Request::Clear(requests::Clear { target: ClearTarget::Gateway }),
        Ask::Clear { axis } => Request::Clear(requests::Clear { target: ClearTarget::Axis(axis) }),
        Ask::ClearByRestart { axis } => Request::ClearByRestart(requests::ClearByRestart { axis }),
        Ask::ClearUnreachable { axis } => {
            Request::ClearUnreachable(requests::ClearUnreachable { axis })
        }
        Ask::OutputOff { axis } => Request::OutputOff(requests::OutputOff { axis }),
        Ask::Setpoint { ref permit, goal } => Request::Setpoint(requests::Setpoint {
            axis: permit.axis,
            epoch: epoch(permit),
            expires_at_us: expiry(permit),
            setpoint: setpoint(goal),
        }),
        Ask::Move { ref permit, distance, speed } => {
            Request::MoveRelative(requests::MoveRelative {
                axis: permit.axis,
                epoch: epoch(permit),
                expires_at_us: expiry(permit),
                distance_rad: distance,
                speed_limit_rad_s: speed,
            })
        }
        Ask::Native { ref permit, ref data } => Request::Native(requests::Native {
            axis: permit.axis,
            epoch: epoch(permit),
            expires_at_us: expiry(permit),
            data: data.iter().copied().take(8).collect(),
        }),
        Ask::Together { lead_us, ref members } => {
            let member = |(axis, epoch, velocity_rad_s): &(u8, i32, f32)| Member {
                axis: *axis,
                epoch: known(*axis).wrapping_add_signed(*epoch),
                velocity_rad_s: *velocity_rad_s,
            };
            let members = members.iter().take(MAX_MEMBERS).map(member).collect();
            Request::StartTogether(requests::StartTogether { expires_at_us: at(lead_us), members })
        }
        Ask::ArmTogether { axes } => Request::ArmTogether(requests::ArmTogether { axes }),
        Ask::Cycle { lead_us, epoch, ref members } => {
            let first = members.first().map_or(0, |(axis, _)| *axis);
            Request::Cycle(requests::Cycle {
                epoch: FixedU32(known(first).wrapping_add_signed(epoch)),
                expires_at_us: FixedU32(at(lead_us)),
                fields: StateFields::of(StateField::ALL),
                axes: members.iter().fold(0, |axes, (axis, _)| axes | 1 << axis),
                setpoints: members.iter().take(16).map(|(_, goal)| setpoint(*goal)).collect(),
            })
        }
        Ask::RunCycle { axes, period_us } => {
            let fields = StateFields::of(StateField::ALL);
            Request::RunCycle(requests::RunCycle { axes, fields, period_us })
        }
        Ask::Read { axis } => Request::ReadState(requests::ReadState { axis }),
        Ask::Subscribe { axes, period_us } => {
            let fields = StateFields::of(StateField::ALL);
            Request::Subscribe(requests::Subscribe { axes, fields, period_us })
        }
        Ask::Incidents { first } => Request::ReadIncidents(requests::ReadIncidents { first }),
        Ask::FlightRecord { offset } => {
            Request::ReadFlightRecord(requests::ReadFlightRecord { part: 0, offset })
        }
        Ask::BusStatus { bus } => Request::BusStatus(requests::BusStatus { bus }),
        Ask::List => Request::ListAxes(requests::ListAxes { first: 0 }),
        Ask::Status => Request::GatewayStatus(requests::GatewayStatus {}),
        Ask::RawOpen { bus, unsafe_access } => {
            Request::RawOpen(requests::RawOpen { bus, unsafe_access })
        }
        Ask::RawOpenAt { bus, mode } => {
            // There are fewer buses than what may be asked for.
            let (bitrate, protocols) =
                BUS_SETUP.get(usize::from(bus)).copied().unwrap_or(BUS_SETUP[0]);
            let mode = match mode {
                0 => BusMode::Normal,
                1 => BusMode::ListenOnly,
                _ => BusMode::OneShot,
            };
            let protocols = ProtocolSet::from_bits(protocols);
            let reply_window_us = 2_000;
            Request::RawOpenAt(requests::RawOpenAt {
                bus,
                bitrate,
                protocols,
                reply_window_us,
                mode,
            })
        }
        Ask::RawSend { bus, id, ref data } => {
            let can = can_frame(id, data).map(RawFrame::Can);
            let serial = || RawFrame::Serial(data.iter().copied().take(64).collect::<Bytes<_>>());
            let frame = can.filter(|_| bus != LINE).unwrap_or_else(serial);
            Request::RawSend(requests::RawSend { bus, frame })
        }
        Ask::RawReceive { bus } => Request::RawReceive(requests::RawReceive { bus }),
        Ask::RawClose { bus } => Request::RawClose(requests::RawClose { bus }),
    }
}

fn setpoint(goal: Goal) -> Setpoint {
    match goal {
        Goal::Signal(fraction) => Setpoint::Signal { fraction },
        Goal::Current(current_a) => Setpoint::Current { current_a },
        Goal::Velocity(velocity_rad_s) => Setpoint::Velocity { velocity_rad_s },
        Goal::Position(position_rad, speed_limit_rad_s) => {
            Setpoint::Position { position_rad, speed_limit_rad_s }
        }
        Goal::Impedance(position_rad) => Setpoint::Impedance {
            position_rad,
            velocity_rad_s: 0.0,
            stiffness_nm_per_rad: 10.0,
            damping_nm_s_per_rad: 1.0,
            torque_nm: 0.0,
        },
    }
}
