//! What requests, replies, events and errors say about axes.

use core::fmt;

use crate::protocol::Protocol;
use crate::size::wire;
use crate::value::Quantity;

wire! {
    /// The state of an axis.
    #[derive(Copy, Eq)]
    pub enum AxisState {
        /// A required parameter is missing.
        Unconfigured,
        /// Nothing moves and nothing may; the gateway has not had the motor hold.
        Idle,
        /// The steps that come before motion are under way.
        Arming,
        /// Motion is allowed; no setpoint has come yet.
        Armed,
        /// A setpoint is in force.
        Active,
        /// The stop action is under way, by request.
        Stopping,
        /// Stopped by the gateway, for a reason that `ReadState` tells; latched until it is
        /// cleared.
        Tripped {
            /// Whether the motor has confirmed the stop.
            confirmed: bool,
        },
        /// At rest, as `Idle`, with the motor's output on: the motor holds its position, until
        /// `OutputOff`.
        Holding,
    }

    /// What an axis should do now.
    #[derive(Copy)]
    pub enum Setpoint {
        /// A fraction of the full signal.
        Signal {
            /// −1 to 1, positive is counter-clockwise.
            fraction: f32,
        },
        /// Current in the winding, which sets the torque.
        Current {
            /// A, positive is counter-clockwise.
            current_a: f32,
        },
        /// Velocity of the shaft.
        Velocity {
            /// rad/s, positive is counter-clockwise.
            velocity_rad_s: f32,
        },
        /// Position of the shaft.
        Position {
            /// rad, positive is counter-clockwise.
            position_rad: f32,
            /// Speed on the way, rad/s, at least one unit of the motor: rounded down to whole ones.
            speed_limit_rad_s: f32,
        },
        /// A spring and a damper at the shaft: torque = stiffness × (position − measured position)
        /// + damping × (velocity − measured velocity) + torque.
        Impedance {
            /// Where the spring is at rest, rad, positive is counter-clockwise.
            position_rad: f32,
            /// Where the damper is at rest, rad/s, positive is counter-clockwise.
            velocity_rad_s: f32,
            /// N·m/rad, from 0.
            stiffness_nm_per_rad: f32,
            /// N·m·s/rad, from 0.
            damping_nm_s_per_rad: f32,
            /// In addition, N·m, positive drives counter-clockwise.
            torque_nm: f32,
        },
    }

    /// Why an axis tripped.
    #[derive(Copy)]
    pub enum TripReason {
        /// No new setpoint came before the last one expired.
        SetpointExpired,
        /// Nothing valid came from the host in command for the configured time.
        HostSilent,
        /// The motor did not reply.
        MotorSilent,
        /// The motor reports a fault.
        MotorFault {
            /// The motor's own fault word.
            faults: u16,
        },
        /// The motor refused a command.
        CommandRefused {
            /// The motor's own fault word, where it has been read since.
            faults: Option<u16>,
        },
        /// No node acknowledged a motion frame in time.
        NotAcknowledged,
        /// The CAN controller of its bus switched itself off.
        BusOff,
        /// A measured value is beyond the limit of this axis.
        LimitExceeded {
            /// Which one.
            quantity: Quantity,
            /// What was measured, in the quantity's unit.
            value: f32,
            /// The limit, in the quantity's unit.
            limit: f32,
        },
        /// Emergency stop, by request or by the input of the board.
        EStop,
        /// The gateway was reset while the axis was in motion.
        Reset,
        /// The gateway found itself in a state that should not be.
        Internal {
            /// Place in the firmware.
            code: u16,
        },
        /// A requested stop was not confirmed by the motor.
        StopUnconfirmed,
        /// Another axis of its trip group tripped.
        Group {
            /// That axis.
            axis: u8,
        },
        /// The motor turned although the axis had no setpoint.
        Uncommanded,
        /// A setpoint was accepted and not sent in time.
        NotDelivered,
        /// The motor restarted by itself: its run time began again.
        MotorRestarted,
    }

    /// A trip: why, when, and the last values before it.
    #[derive(Copy)]
    pub struct Trip {
        /// Why.
        pub reason: TripReason,
        /// Gateway time, µs.
        pub time_us: u64,
        /// rad/s.
        pub velocity_rad_s: Option<f32>,
        /// rad.
        pub position_rad: Option<f32>,
        /// A.
        pub current_a: Option<f32>,
        /// Whether so many stops stayed unconfirmed that the motor counts as unreachable, or none
        /// could be sent.
        pub unreachable: bool,
    }

    /// What is known of the motor's own timeout, the second layer of safety.
    #[derive(Copy, Eq)]
    pub enum MotorTimeout {
        /// Nothing.
        Unknown,
        /// It is off, or longer than 60 s, which is as good as off.
        Off,
        /// Written by this gateway; the motor cannot be asked for it.
        Written {
            /// ms.
            timeout_ms: u32,
        },
        /// Read back as on; the motor does not state its time.
        Verified,
    }

    /// How the answers to a read agree that was asked twice.
    #[derive(Copy, Eq)]
    pub enum Agreement {
        /// It was answered once.
        Once,
        /// Both say the same.
        Twice,
        /// They say different things.
        Different,
    }

    /// A measured value and its age.
    #[derive(Copy)]
    pub struct Reading {
        /// In the unit that the field's name states.
        pub value: f32,
        /// Since it was received, µs.
        pub age_us: u32,
    }

    /// The motor's own fault word and its age.
    #[derive(Copy, Eq)]
    pub struct FaultReading {
        /// Bits as in the manual of the motor; 0 is no fault.
        pub word: u16,
        /// Those of its bits that only warn: they neither bar arming nor trip the axis as it is
        /// configured.
        pub warnings: u16,
        /// Since it was received, µs.
        pub age_us: u32,
    }

    /// One axis of a list.
    #[derive(Copy, Eq)]
    pub struct AxisSummary {
        /// Its number.
        pub axis: u8,
        /// Its bus, once configured.
        pub bus: Option<u8>,
        /// Its protocol, once configured.
        pub protocol: Option<Protocol>,
        /// The motor's id on that bus, once configured.
        pub node: Option<u8>,
        /// Its state.
        pub state: AxisState,
        /// The number of the first required parameter that is not yet set.
        pub missing: Option<u16>,
    }

    /// What to stop.
    #[derive(Copy, Eq)]
    pub enum StopTarget {
        /// This axis.
        Axis(u8),
        /// Every axis.
        All,
    }

    /// What to clear.
    #[derive(Copy, Eq)]
    pub enum ClearTarget {
        /// The trip of this axis.
        Axis(u8),
        /// The latched e-stop of the whole gateway.
        Gateway,
    }
}

impl fmt::Display for AxisState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Unconfigured => "unconfigured",
            Self::Idle => "idle",
            Self::Holding => "holding",
            Self::Arming => "arming",
            Self::Armed => "armed",
            Self::Active => "active",
            Self::Stopping => "stopping",
            Self::Tripped { confirmed: false } => "tripped, its stop not confirmed",
            Self::Tripped { confirmed: true } => "tripped, its stop confirmed",
        })
    }
}

impl fmt::Display for TripReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SetpointExpired => f.write_str("the setpoint expired"),
            Self::HostSilent => f.write_str("the host was silent"),
            Self::MotorSilent => f.write_str("the motor was silent"),
            Self::MotorFault { faults } => {
                write!(f, "the motor reported a fault, fault word {faults:#06x}")
            }
            Self::CommandRefused { faults: Some(faults) } => {
                write!(f, "the motor refused a command, fault word {faults:#06x}")
            }
            Self::CommandRefused { faults: None } => f.write_str("the motor refused a command"),
            Self::NotAcknowledged => f.write_str("no node acknowledged a motion frame"),
            Self::BusOff => f.write_str("the bus went off"),
            Self::LimitExceeded { quantity, value, limit } => {
                let unit = quantity.unit();
                let space = if unit.is_empty() { "" } else { " " };
                write!(
                    f,
                    "{quantity} {value}{space}{unit} is beyond its limit of {limit}{space}{unit}"
                )
            }
            Self::EStop => f.write_str("emergency stop"),
            Self::Reset => f.write_str("the gateway was reset in motion"),
            Self::Internal { code } => write!(f, "internal error {code} of the gateway"),
            Self::StopUnconfirmed => f.write_str("a stop was not confirmed"),
            Self::Group { axis } => write!(f, "axis {axis} of its trip group tripped"),
            Self::Uncommanded => f.write_str("the motor turned without a setpoint"),
            Self::NotDelivered => f.write_str("a setpoint was not sent in time"),
            Self::MotorRestarted => f.write_str("the motor restarted by itself"),
        }
    }
}
