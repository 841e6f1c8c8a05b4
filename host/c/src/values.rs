//! Setpoints and states.

use host_protocol::replies::AxisReport;
use host_protocol::{AxisState, CycleResult, CycleState, Reading, Setpoint, TripReason};
use mgw_client::AxisSetpoint;

use crate::error::Failure;

/// What a setpoint is.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum mgw_mode {
    /// A fraction of the full signal, −1 to 1: thrusters.
    Signal = 0,
    /// A current, A; positive drives counter-clockwise.
    Current = 1,
    /// A velocity, rad/s; positive is counter-clockwise.
    Velocity = 2,
    /// A position, rad, approached at most at `speed_limit_rad_s`.
    Position = 3,
    /// A spring to `position_rad` and a damper to `velocity_rad_s`, and a torque: RMD on CAN.
    Impedance = 4,
}

/// A setpoint for an axis. Only what its mode names counts; the rest may be 0.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct mgw_setpoint {
    /// Number of the axis, from 0.
    pub axis: u8,
    /// A `mgw_mode`.
    pub mode: u32,
    /// −1 to 1.
    pub fraction: f32,
    /// A.
    pub current_a: f32,
    /// rad/s.
    pub velocity_rad_s: f32,
    /// rad.
    pub position_rad: f32,
    /// rad/s, above 0.
    pub speed_limit_rad_s: f32,
    /// N·m/rad, from 0.
    pub stiffness_nm_per_rad: f32,
    /// N·m·s/rad, from 0.
    pub damping_nm_s_per_rad: f32,
    /// N·m.
    pub torque_nm: f32,
}

impl mgw_setpoint {
    pub(crate) fn read(&self) -> Result<AxisSetpoint, Failure> {
        let setpoint = match self.mode {
            mode if mode == mgw_mode::Signal as u32 => Setpoint::Signal { fraction: self.fraction },
            mode if mode == mgw_mode::Current as u32 => {
                Setpoint::Current { current_a: self.current_a }
            }
            mode if mode == mgw_mode::Velocity as u32 => {
                Setpoint::Velocity { velocity_rad_s: self.velocity_rad_s }
            }
            mode if mode == mgw_mode::Position as u32 => Setpoint::Position {
                position_rad: self.position_rad,
                speed_limit_rad_s: self.speed_limit_rad_s,
            },
            mode if mode == mgw_mode::Impedance as u32 => Setpoint::Impedance {
                position_rad: self.position_rad,
                velocity_rad_s: self.velocity_rad_s,
                stiffness_nm_per_rad: self.stiffness_nm_per_rad,
                damping_nm_s_per_rad: self.damping_nm_s_per_rad,
                torque_nm: self.torque_nm,
            },
            mode => {
                let axis = self.axis;
                let text = format!("the setpoint of axis {axis} has mode {mode}; there are 0 to 4");
                return Err(Failure::argument(text));
            }
        };
        Ok(AxisSetpoint { axis: self.axis, setpoint })
    }
}

/// The state of an axis.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum mgw_state {
    /// A required parameter is missing.
    Unconfigured = 0,
    /// Nothing moves and nothing may.
    Idle = 1,
    /// The steps before motion are under way.
    Arming = 2,
    /// Motion is allowed; no setpoint has come yet.
    Armed = 3,
    /// A setpoint is in force.
    Active = 4,
    /// The stop is under way.
    Stopping = 5,
    /// The gateway has stopped it; `stop_confirmed` says whether the motor has confirmed that.
    Tripped = 6,
    /// At rest, the motor's output on.
    Holding = 7,
}

/// What became of a setpoint of `mgw_cycle`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum mgw_cycle_result {
    /// The motor has answered it.
    Answered = 0,
    /// It has not, in its time.
    NoReply = 1,
    /// A stop came before.
    Stopped = 2,
    /// A newer setpoint came before.
    Superseded = 3,
    /// It was not taken, for the error in `error`.
    Refused = 4,
    /// It has, and that may be the late answer to one before.
    Ambiguous = 5,
    /// There was no setpoint.
    None = 6,
}

/// Why an axis tripped.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum mgw_trip_reason {
    /// It has not.
    None = 0,
    /// No new setpoint came before the last one expired.
    SetpointExpired = 1,
    /// Nothing valid came from the host in command.
    HostSilent = 2,
    /// The motor did not reply.
    MotorSilent = 3,
    /// The motor reports a fault.
    MotorFault = 4,
    /// The motor refused a command.
    CommandRefused = 5,
    /// No node acknowledged a frame.
    NotAcknowledged = 6,
    /// The CAN controller of its bus switched itself off.
    BusOff = 7,
    /// A measured value is beyond a limit.
    LimitExceeded = 8,
    /// Emergency stop.
    EStop = 9,
    /// The gateway was reset while the axis was in motion.
    Reset = 10,
    /// The gateway found itself in a state that should not be.
    Internal = 11,
    /// A requested stop was not confirmed by the motor.
    StopUnconfirmed = 12,
    /// Another axis of its trip group tripped.
    Group = 13,
    /// The motor turned although the axis had no setpoint.
    Uncommanded = 14,
    /// A setpoint was accepted and not sent in time.
    NotDelivered = 15,
    /// The motor restarted by itself.
    MotorRestarted = 16,
}

impl From<&TripReason> for mgw_trip_reason {
    fn from(reason: &TripReason) -> Self {
        match reason {
            TripReason::SetpointExpired => Self::SetpointExpired,
            TripReason::HostSilent => Self::HostSilent,
            TripReason::MotorSilent => Self::MotorSilent,
            TripReason::MotorFault { .. } => Self::MotorFault,
            TripReason::CommandRefused { .. } => Self::CommandRefused,
            TripReason::NotAcknowledged => Self::NotAcknowledged,
            TripReason::BusOff => Self::BusOff,
            TripReason::LimitExceeded { .. } => Self::LimitExceeded,
            TripReason::EStop => Self::EStop,
            TripReason::Reset => Self::Reset,
            TripReason::Internal { .. } => Self::Internal,
            TripReason::StopUnconfirmed => Self::StopUnconfirmed,
            TripReason::Group { .. } => Self::Group,
            TripReason::Uncommanded => Self::Uncommanded,
            TripReason::NotDelivered => Self::NotDelivered,
            TripReason::MotorRestarted => Self::MotorRestarted,
        }
    }
}

/// How an axis is. What is not known is NaN.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct mgw_axis {
    /// Number of the axis, from 0.
    pub axis: u8,
    /// Of a tripped axis: whether the motor has confirmed its stop.
    pub stop_confirmed: bool,
    /// Whether `faults` is known.
    pub has_faults: bool,
    /// The motor's own fault word.
    pub faults: u16,
    /// Of `mgw_cycle`: the number of the error for which the setpoint was not taken, else 0.
    pub error: u16,
    /// A `mgw_state`.
    pub state: u32,
    /// Of `mgw_cycle`: a `mgw_cycle_result`.
    pub result: u32,
    /// Of `mgw_read` and events: a `mgw_trip_reason`.
    pub trip: u32,
    /// How old the oldest of position, velocity and current is, µs.
    pub age_us: u32,
    /// rad; positive is counter-clockwise.
    pub position_rad: f32,
    /// rad/s.
    pub velocity_rad_s: f32,
    /// A.
    pub current_a: f32,
    /// V.
    pub voltage_v: f32,
    /// °C.
    pub motor_temperature_c: f32,
    /// °C.
    pub driver_temperature_c: f32,
}

impl mgw_axis {
    /// An axis in a state, of which nothing else is known.
    pub(crate) fn in_state(axis: u8, state: AxisState) -> Self {
        let (state, stop_confirmed) = match state {
            AxisState::Unconfigured => (mgw_state::Unconfigured, false),
            AxisState::Idle => (mgw_state::Idle, false),
            AxisState::Arming => (mgw_state::Arming, false),
            AxisState::Armed => (mgw_state::Armed, false),
            AxisState::Active => (mgw_state::Active, false),
            AxisState::Stopping => (mgw_state::Stopping, false),
            AxisState::Tripped { confirmed } => (mgw_state::Tripped, confirmed),
            AxisState::Holding => (mgw_state::Holding, false),
        };
        Self {
            axis,
            stop_confirmed,
            has_faults: false,
            faults: 0,
            error: 0,
            state: state as u32,
            result: mgw_cycle_result::None as u32,
            trip: mgw_trip_reason::None as u32,
            age_us: 0,
            position_rad: f32::NAN,
            velocity_rad_s: f32::NAN,
            current_a: f32::NAN,
            voltage_v: f32::NAN,
            motor_temperature_c: f32::NAN,
            driver_temperature_c: f32::NAN,
        }
    }
}

impl From<&CycleState> for mgw_axis {
    fn from(state: &CycleState) -> Self {
        let known = |value: Option<f32>| value.unwrap_or(f32::NAN);
        let (result, error) = match state.result {
            CycleResult::Answered => (mgw_cycle_result::Answered, 0),
            CycleResult::NoReply => (mgw_cycle_result::NoReply, 0),
            CycleResult::Stopped => (mgw_cycle_result::Stopped, 0),
            CycleResult::Superseded => (mgw_cycle_result::Superseded, 0),
            CycleResult::Refused { error } => (mgw_cycle_result::Refused, error),
            CycleResult::Ambiguous => (mgw_cycle_result::Ambiguous, 0),
        };
        Self {
            result: result as u32,
            error,
            age_us: state.age_us,
            position_rad: known(state.position_rad),
            velocity_rad_s: known(state.velocity_rad_s),
            current_a: known(state.current_a),
            voltage_v: known(state.voltage_v),
            motor_temperature_c: known(state.motor_temperature_c),
            driver_temperature_c: known(state.driver_temperature_c),
            has_faults: state.faults.is_some(),
            faults: state.faults.unwrap_or(0),
            ..Self::in_state(state.axis, state.state)
        }
    }
}

impl From<&AxisReport> for mgw_axis {
    fn from(report: &AxisReport) -> Self {
        let known = |reading: Option<Reading>| reading.map_or(f32::NAN, |reading| reading.value);
        let ages = [report.position_rad, report.velocity_rad_s, report.current_a];
        Self {
            trip: report.trip.as_ref().map_or(mgw_trip_reason::None, |trip| (&trip.reason).into())
                as u32,
            age_us: ages.into_iter().flatten().map(|reading| reading.age_us).max().unwrap_or(0),
            position_rad: known(report.position_rad),
            velocity_rad_s: known(report.velocity_rad_s),
            current_a: known(report.current_a),
            voltage_v: known(report.voltage_v),
            motor_temperature_c: known(report.motor_temperature_c),
            driver_temperature_c: known(report.driver_temperature_c),
            has_faults: report.faults.is_some(),
            faults: report.faults.map_or(0, |faults| faults.word),
            ..Self::in_state(report.axis, report.state)
        }
    }
}
