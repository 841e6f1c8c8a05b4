//! What the motor sends: the data bytes of each reply and of the timeout notice.

mod bytes;
mod fields;
mod motion;

pub use self::motion::Motion;
use crate::command;
use crate::faults::Faults;
use crate::field::DATA_LEN;
use crate::function::Function;
use crate::model::Model;
use crate::motion_mode::MotionFeedback;
use crate::node::Node;
use crate::notice::RawNotice;
use crate::pid::PidGains;
use crate::ramp::Ramp;
use crate::run_mode::RunMode;
use crate::units::{
    Celsius, Centiamps, Centidegrees, Decivolts, Deciwatts, DegreesPerSecondSquared, EncoderPulses,
    Milliseconds, VersionDate,
};

/// One frame from one motor.
///
/// Bytes the manual calls NULL are sent as zero; when received with another value they are passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reply {
    /// 0x30: the gains (RMD V3.6 §2.1.3).
    Pid {
        /// All six gains.
        gains: PidGains,
    },
    /// 0x31 received; an echo (RMD V3.6 §2.2.3).
    PidRamWritten {
        /// The gains echoed.
        gains: PidGains,
    },
    /// 0x32 received; an echo (RMD V3.6 §2.3.3).
    PidRomWritten {
        /// The gains echoed.
        gains: PidGains,
    },
    /// 0x42: the acceleration (RMD V3.6 §2.4.3).
    Acceleration {
        /// 100..=60000 by the manual; kept as received.
        acceleration: DegreesPerSecondSquared,
    },
    /// 0x43 received; an echo (RMD V3.6 §2.5.3).
    AccelerationWritten {
        /// Which of the four.
        ramp: Ramp,
        /// The acceleration echoed.
        acceleration: DegreesPerSecondSquared,
    },
    /// 0x60: the multi-turn encoder position, the offset taken off (RMD V3.6 §2.6.3).
    EncoderPosition {
        /// Position from the zero point.
        position: EncoderPulses,
    },
    /// 0x61: the multi-turn encoder position as it is (RMD V3.6 §2.7.3).
    EncoderRawPosition {
        /// Position before the offset is taken off.
        position: EncoderPulses,
    },
    /// 0x62: the multi-turn encoder offset (RMD V3.6 §2.8.3).
    EncoderOffset {
        /// The zero point.
        offset: EncoderPulses,
    },
    /// 0x63 received; an echo (RMD V3.6 §2.9.3).
    EncoderOffsetWritten {
        /// The offset echoed.
        offset: EncoderPulses,
    },
    /// 0x64 carried out (RMD V3.6 §2.10.3).
    PositionWrittenAsZero {
        /// The offset written.
        offset: EncoderPulses,
    },
    /// 0x92: the multi-turn angle (RMD V3.6 §2.11.3).
    MultiTurnAngle {
        /// Angle of the output shaft from the zero point.
        angle: Centidegrees,
    },
    /// 0x9A, also sent unasked while a fault stands if so configured (RMD V3.6 §2.12.3, §2.33.4).
    Status1 {
        /// Motor temperature.
        temperature: Celsius,
        /// Whether the brake is commanded open. Only a wire value of 0 counts as locked.
        brake_released: bool,
        /// Supply voltage.
        voltage: Decivolts,
        /// Error word with all its bits.
        faults: Faults,
    },
    /// 0x9C: motion state (RMD V3.6 §2.13.3).
    Status2 {
        /// The state read.
        motion: Motion,
    },
    /// 0x9D: temperature and phase currents (RMD V3.6 §2.14.3).
    Status3 {
        /// Motor temperature.
        temperature: Celsius,
        /// Current of phase A.
        phase_a: Centiamps,
        /// Current of phase B.
        phase_b: Centiamps,
        /// Current of phase C.
        phase_c: Centiamps,
    },
    /// 0x80 received; an echo (RMD V3.6 §2.15.3).
    Shutdown,
    /// 0x81 received; an echo that proves receipt, not standstill (RMD V3.6 §2.16.3).
    Stop,
    /// 0xA1 received (RMD V3.6 §2.17.3).
    TorqueCurrent {
        /// The state at that moment.
        motion: Motion,
    },
    /// 0xA2 received (RMD V3.6 §2.18.3).
    Velocity {
        /// The state at that moment.
        motion: Motion,
    },
    /// 0xA3 received (RMD V3.6 §2.19.3).
    PositionTracking {
        /// The state at that moment.
        motion: Motion,
    },
    /// 0xA4 received (RMD V3.6 §2.20.3).
    AbsolutePosition {
        /// The state at that moment.
        motion: Motion,
    },
    /// 0xA5 received (RMD V3.6 §2.21.3).
    LimitedPositionTracking {
        /// The state at that moment.
        motion: Motion,
    },
    /// 0xA8 received (RMD V3.6 §2.22.3).
    IncrementalPosition {
        /// The state at that moment.
        motion: Motion,
    },
    /// 0x70: the run mode (RMD V3.6 §2.23.3).
    RunMode {
        /// The control loop that runs.
        mode: RunMode,
    },
    /// 0x71: the motor power (RMD V3.6 §2.24.3).
    Power {
        /// Power at that moment.
        power: Deciwatts,
    },
    /// 0x77 received; an echo, 50 to 150 ms after the request on observed motors (RMD V3.6 §2.26.3).
    BrakeReleased,
    /// 0x78 received; an echo (RMD V3.6 §2.27.3).
    BrakeLocked,
    /// 0xB1: the time since the motor started (RMD V3.6 §2.28.3).
    RunTime {
        /// Time since start or reset.
        time: Milliseconds,
    },
    /// 0xB2: the date of the motor's firmware (RMD V3.6 §2.29.3).
    VersionDate {
        /// The date as a decimal number.
        date: VersionDate,
    },
    /// 0xB3 received. §2.30.3 says echo, example 2 of §2.30.4 prints all zero: both occur.
    CommunicationTimeout {
        /// The timeout echoed, or 0.
        timeout: Milliseconds,
    },
    /// What comes back after 0xB4, if anything: random by the manual (RMD V3.6 §2.31.3). Answers nothing.
    BaudRateSet {
        /// The bytes after the command byte.
        raw: [u8; DATA_LEN - 1],
    },
    /// 0xB5: the motor model (RMD V3.6 §2.32.3).
    Model {
        /// Seven characters.
        model: Model,
    },
    /// 0x20 received; an echo (RMD V3.6 §2.33.3).
    Function {
        /// The function echoed.
        function: Function,
    },
    /// 0x79 under CAN id 0x300: the CAN id (RMD V3.6 §4.3).
    CanId {
        /// Id of the motor that answers.
        id: Node,
    },
    /// 0x79 under CAN id 0x300 received; an echo with the new id (RMD V3.6 §4.3).
    CanIdSet {
        /// The new id.
        id: Node,
    },
    /// Motion mode, under a CAN id of its own (RMD V3.6 §5.3).
    MotionMode {
        /// The words of the frame; [`MotionRanges`](crate::MotionRanges) gives them their meaning.
        feedback: MotionFeedback,
    },
    /// 0x79 under RS485 id 0xCD: the RS485 id (RMD V3.6 §7.3).
    Rs485Id {
        /// Id of the motor that answers.
        id: Node,
    },
    /// 0x79 under RS485 id 0xCD received; an echo with the new id (RMD V3.6 §7.3).
    Rs485IdSet {
        /// The new id.
        id: Node,
    },
    /// 0xF1: an event some motors send every second after their communication timeout has struck. Answers nothing.
    TimeoutNotice {
        /// What followed the command byte, if anything.
        raw: RawNotice,
    },
    /// The reply to any other command.
    Unknown {
        /// The data bytes as received, the command byte first.
        data: [u8; DATA_LEN],
    },
}

impl Reply {
    /// The command code: data byte 0, except for motion mode, which has none ([`command::MOTION_MODE`]).
    pub const fn command(&self) -> u8 {
        match self {
            Reply::Pid { .. } => command::READ_PID,
            Reply::PidRamWritten { .. } => command::WRITE_PID_RAM,
            Reply::PidRomWritten { .. } => command::WRITE_PID_ROM,
            Reply::Acceleration { .. } => command::READ_ACCELERATION,
            Reply::AccelerationWritten { .. } => command::WRITE_ACCELERATION,
            Reply::EncoderPosition { .. } => command::READ_ENCODER_POSITION,
            Reply::EncoderRawPosition { .. } => command::READ_ENCODER_RAW_POSITION,
            Reply::EncoderOffset { .. } => command::READ_ENCODER_OFFSET,
            Reply::EncoderOffsetWritten { .. } => command::WRITE_ENCODER_OFFSET,
            Reply::PositionWrittenAsZero { .. } => command::WRITE_POSITION_AS_ZERO,
            Reply::MultiTurnAngle { .. } => command::READ_MULTI_TURN_ANGLE,
            Reply::Status1 { .. } => command::READ_STATUS_1,
            Reply::Status2 { .. } => command::READ_STATUS_2,
            Reply::Status3 { .. } => command::READ_STATUS_3,
            Reply::Shutdown => command::SHUTDOWN,
            Reply::Stop => command::STOP,
            Reply::TorqueCurrent { .. } => command::TORQUE_CURRENT,
            Reply::Velocity { .. } => command::VELOCITY,
            Reply::PositionTracking { .. } => command::POSITION_TRACKING,
            Reply::AbsolutePosition { .. } => command::ABSOLUTE_POSITION,
            Reply::LimitedPositionTracking { .. } => command::LIMITED_POSITION_TRACKING,
            Reply::IncrementalPosition { .. } => command::INCREMENTAL_POSITION,
            Reply::RunMode { .. } => command::READ_RUN_MODE,
            Reply::Power { .. } => command::READ_POWER,
            Reply::BrakeReleased => command::RELEASE_BRAKE,
            Reply::BrakeLocked => command::LOCK_BRAKE,
            Reply::RunTime { .. } => command::READ_RUN_TIME,
            Reply::VersionDate { .. } => command::READ_VERSION_DATE,
            Reply::CommunicationTimeout { .. } => command::SET_COMMUNICATION_TIMEOUT,
            Reply::BaudRateSet { .. } => command::SET_BAUD_RATE,
            Reply::Model { .. } => command::READ_MODEL,
            Reply::Function { .. } => command::FUNCTION,
            Reply::CanId { .. }
            | Reply::CanIdSet { .. }
            | Reply::Rs485Id { .. }
            | Reply::Rs485IdSet { .. } => command::BUS_ID,
            Reply::MotionMode { .. } => command::MOTION_MODE,
            Reply::TimeoutNotice { .. } => command::TIMEOUT_NOTICE,
            Reply::Unknown { data: [command, ..] } => *command,
        }
    }

    /// Whether nobody has asked for it. A [`Reply::Status1`] may be an event too (RMD V3.6 §2.33.4); only the pending
    /// request tells, as [`answer`](crate::answer) does.
    pub const fn is_event(&self) -> bool {
        matches!(self, Reply::TimeoutNotice { .. })
    }
}

#[cfg(test)]
mod tests;
