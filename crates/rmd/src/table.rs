//! The protocol as data: every command with its code, its section of the manual, and its values
//! with place, name, unit and range. Requests, replies, their bytes, and how tools list, build and
//! print them follow from it.
//!
//! Numbers of a line are counts of the wire; their units and ranges are those of their types.

use codec::{CommandInfo, Effect, FieldInfo, FieldKind};

use crate::baud::BaudCode;
use crate::bus_id;
use crate::faults::Faults;
use crate::field::{ACCELERATION_MAX, ACCELERATION_MIN, DATA_LEN};
use crate::function::Function;
use crate::gain::{Gain, GainValue};
use crate::model::{Model, ModelPart};
use crate::motion::Motion;
use crate::motion_mode::{MotionCommand, MotionFeedback};
use crate::node::Node;
use crate::notice::RawNotice;
use crate::payload::Payload;
use crate::pid::PidGains;
use crate::ramp::Ramp;
use crate::run_mode::RunMode;
use crate::units::{
    Celsius, Centiamps, Centidegrees, CentidegreesPerSecond, Decivolts, Deciwatts,
    DegreesPerSecondSquared, EncoderCounts, EncoderPulses, FeedForward, FineSpeedLimit,
    Milliseconds, SingleTurn, SpeedLimit, TorqueCap, VersionDate,
};

/// Of the functions that are switched.
pub(crate) const ENABLED: FieldInfo = FieldInfo::boolean("enabled");
/// Of the function that sets an id.
pub(crate) const NEXT_ID: FieldInfo =
    FieldInfo::integer("id", "", Node::MIN as i64, Node::MAX as i64);
/// What stands before the number of a part of the model, and the numbers (V4.4 0xB5).
const MODEL_PART: [u8; DATA_LEN - 1] = [1, 0, 0, 0, 0, 0, 0];
pub(crate) const MODEL_PART_MIN: u8 = 1;
pub(crate) const MODEL_PART_MAX: u8 = 3;
/// 0 switches the torque cap of 0xA2 off, and is undefined in 0xA9.
const TORQUE_CAP_MIN: u8 = 1;
/// 359.99° (V3.7 0xA6).
const SINGLE_TURN_MAX: u16 = 35_999;
/// Of the timeout notice.
const DATA: &[FieldInfo] = &[FieldInfo::other(FieldKind::Bytes, "data")];

codec::commands! {
    /// Every command of the manual in its order, what newer manuals add, and the timeout notice.
    COMMANDS of "RMD ";

    /// One command.
    ///
    /// Bytes the manual calls NULL are sent as zero; when received with another value they are passed over.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    enum Request;

    /// One frame from one motor.
    ///
    /// Bytes the manual calls NULL are sent as zero; when received with another value they are passed over.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    enum Reply;

    layout Payload, code u8;

    /// Read the gains.
    READ_PID = 0x30, Reads, "V3.6 §2.1";
        request(ReadPid);
        reply(Pid { gains: PidGains = 2 });
    /// Write the gains; lost with the power.
    WRITE_PID_RAM = 0x31, Changes, "V3.6 §2.2";
        request(WritePidRam { gains: PidGains = 2 });
        reply(/** An echo. */ PidRamWritten { gains: PidGains = 2 });
    /// Write the gains to ROM.
    WRITE_PID_ROM = 0x32, Changes, "V3.6 §2.3", "stored in ROM";
        request(WritePidRom { gains: PidGains = 2 });
        reply(/** An echo. */ PidRomWritten { gains: PidGains = 2 });
    /// Read the acceleration.
    READ_ACCELERATION = 0x42, Reads, "V3.6 §2.4";
        request(ReadAcceleration);
        reply(Acceleration {
            acceleration: DegreesPerSecondSquared = 4
                as "acceleration_dps2" in (ACCELERATION_MIN, ACCELERATION_MAX),
        });
    /// Write one of the four accelerations, to ROM too.
    WRITE_ACCELERATION = 0x43, Changes, "V3.6 §2.5",
        "stored in ROM; index 0 and 1 speed up and slow down position moves, 2 and 3 velocity changes";
        request(WriteAcceleration {
            /// Which of them; only the four the manual lists are encoded.
            ramp: Ramp = 1,
            acceleration: DegreesPerSecondSquared = 4
                as "acceleration_dps2" in (ACCELERATION_MIN, ACCELERATION_MAX),
        });
        reply(/** An echo. */ AccelerationWritten {
            ramp: Ramp = 1,
            acceleration: DegreesPerSecondSquared = 4
                as "acceleration_dps2" in (ACCELERATION_MIN, ACCELERATION_MAX),
        });
    /// Read the multi-turn encoder position, the offset taken off.
    READ_ENCODER_POSITION = 0x60, Reads, "V3.6 §2.6";
        request(ReadEncoderPosition);
        reply(EncoderPosition { position: EncoderPulses = 4 as "position_pulses" });
    /// Read the multi-turn encoder position before the offset is taken off.
    READ_ENCODER_RAW_POSITION = 0x61, Reads, "V3.6 §2.7";
        request(ReadEncoderRawPosition);
        reply(EncoderRawPosition { position: EncoderPulses = 4 as "position_pulses" });
    /// Read the multi-turn encoder offset, the zero point.
    READ_ENCODER_OFFSET = 0x62, Reads, "V3.6 §2.8";
        request(ReadEncoderOffset);
        reply(EncoderOffset { offset: EncoderPulses = 4 as "offset_pulses" });
    /// Write the multi-turn encoder offset, the zero point, to ROM; acts after a restart.
    WRITE_ENCODER_OFFSET = 0x63, Later, "V3.6 §2.9", "stored in ROM, acts after a restart";
        // The table of §2.9.2 shifts the last two bytes by 8, a misprint.
        request(WriteEncoderOffset { offset: EncoderPulses = 4 as "offset_pulses" });
        reply(
            /// An echo.
            EncoderOffsetWritten { offset: EncoderPulses = 4 as "offset_pulses" }
        );
    /// Write the present position to ROM as the zero point; acts after a restart.
    WRITE_POSITION_AS_ZERO = 0x64, Later, "V3.6 §2.10", "stored in ROM, acts after a restart";
        request(WritePositionAsZero);
        reply(
            /// The offset written.
            PositionWrittenAsZero { offset: EncoderPulses = 4 as "offset_pulses" }
        );
    /// Read the multi-turn angle of the output shaft, from the zero point.
    READ_MULTI_TURN_ANGLE = 0x92, Reads, "V3.6 §2.11";
        request(ReadMultiTurnAngle);
        reply(MultiTurnAngle { angle: Centidegrees = 4 as "angle_deg" });
    /// Read temperature, brake, voltage and the error word.
    READ_STATUS_1 = 0x9A, Reads, "V3.6 §2.12";
        request(ReadStatus1);
        reply(
            /// Also sent unasked while a fault stands, if so configured (§2.33.4).
            Status1 {
                temperature: Celsius = 1 as "temperature_c",
                /// Whether the brake is commanded open. Only a wire value of 0 counts as locked.
                brake_released: bool = 3 as "brake_released",
                voltage: Decivolts = 4 as "voltage_v",
                /// Error word with all its bits.
                faults: Faults = 6 as "faults",
            }
        );
    /// Read temperature, current, speed and angle.
    READ_STATUS_2 = 0x9C, Reads, "V3.6 §2.13";
        request(ReadStatus2);
        reply(Status2 { motion: Motion = 1 });
    /// Read temperature and phase currents.
    READ_STATUS_3 = 0x9D, Reads, "V3.6 §2.14";
        request(ReadStatus3);
        reply(Status3 {
            temperature: Celsius = 1 as "temperature_c",
            phase_a: Centiamps = 2 as "phase_a_current_a",
            phase_b: Centiamps = 4 as "phase_b_current_a",
            phase_c: Centiamps = 6 as "phase_c_current_a",
        });
    /// Switch the output off and leave every closed loop; the shaft turns freely.
    SHUTDOWN = 0x80, Changes, "V3.6 §2.15", "output off, the shaft turns freely";
        request(Shutdown);
        reply(/** An echo. */ Shutdown);
    /// Stop and hold the position.
    STOP = 0x81, Changes, "V3.6 §2.16", "stops and holds";
        request(Stop);
        reply(/** An echo that proves receipt, not standstill. */ Stop);
    /// Hold a torque current; runs only without a fault.
    TORQUE_CURRENT = 0xA1, Changes, "V3.6 §2.17", "runs only without a fault";
        request(TorqueCurrent { current: Centiamps = 4 as "current_a" });
        reply(TorqueCurrent { motion: Motion = 1 });
    /// Hold a speed of the output shaft; runs only without a fault.
    VELOCITY = 0xA2, Changes, "V3.6 §2.18", "runs only without a fault";
        request(Velocity { speed: CentidegreesPerSecond = 4 as "speed_dps" });
        reply(Velocity { motion: Motion = 1 });
    /// Follow a multi-turn angle as fast as the motor can; runs only without a fault.
    POSITION_TRACKING = 0xA3, Changes, "V3.6 §2.19",
        "runs only without a fault; nothing limits the speed";
        request(PositionTracking {
            /// From the zero point. Nothing limits the speed towards it.
            angle: Centidegrees = 4 as "angle_deg",
        });
        reply(PositionTracking { motion: Motion = 1 });
    /// Move to a multi-turn angle; runs only without a fault.
    ABSOLUTE_POSITION = 0xA4, Changes, "V3.6 §2.20", "runs only without a fault";
        request(AbsolutePosition {
            /// Of the move. 0 is encoded, though the manual does not say what it does.
            max_speed: SpeedLimit = 2 as "max_speed_dps",
            /// From the zero point.
            angle: Centidegrees = 4 as "angle_deg",
        });
        reply(AbsolutePosition { motion: Motion = 1 });
    /// Follow a multi-turn angle; runs only without a fault.
    LIMITED_POSITION_TRACKING = 0xA5, Changes, "V3.6 §2.21", "runs only without a fault";
        request(LimitedPositionTracking {
            /// 0 is encoded, though the manual does not say what it does.
            max_speed: FineSpeedLimit = 2 as "max_speed_dps",
            /// From the zero point.
            angle: Centidegrees = 4 as "angle_deg",
        });
        reply(LimitedPositionTracking { motion: Motion = 1 });
    /// Move by an angle; runs only without a fault. Every frame adds one more move.
    INCREMENTAL_POSITION = 0xA8, Changes, "V3.6 §2.22",
        "runs only without a fault; every frame adds one more move";
        request(IncrementalPosition {
            /// Of the move. 0 is encoded, though the manual does not say what it does.
            max_speed: SpeedLimit = 2 as "max_speed_dps",
            /// From the present position.
            angle: Centidegrees = 4 as "angle_deg",
        });
        reply(IncrementalPosition { motion: Motion = 1 });
    /// Read the run mode: the control loop that runs.
    READ_RUN_MODE = 0x70, Reads, "V3.6 §2.23";
        request(ReadRunMode);
        reply(RunMode { mode: RunMode = 7 });
    /// Read the motor power.
    READ_POWER = 0x71, Reads, "V3.6 §2.24";
        request(ReadPower);
        reply(Power { power: Deciwatts = 6 as "power_w" });
    /// Restart the motor's firmware; not answered.
    RESET = 0x76, Changes, "V3.6 §2.25", "restarts the motor; not answered";
        request(Reset);
    /// Release the brake.
    RELEASE_BRAKE = 0x77, Changes, "V3.6 §2.26";
        request(ReleaseBrake);
        reply(/** An echo, 50 to 150 ms after the request on observed motors. */ BrakeReleased);
    /// Lock the brake, as it also is without power.
    LOCK_BRAKE = 0x78, Changes, "V3.6 §2.27";
        request(LockBrake);
        reply(/** An echo. */ BrakeLocked);
    /// Read the time since the motor started.
    READ_RUN_TIME = 0xB1, Reads, "V3.6 §2.28";
        request(ReadRunTime);
        reply(RunTime { time: Milliseconds = 4 as "run_time_ms" });
    /// Read the date of the motor's firmware.
    READ_VERSION_DATE = 0xB2, Reads, "V3.6 §2.29";
        request(ReadVersionDate);
        reply(VersionDate { date: VersionDate = 4 as "version_date" });
    /// Cut the output and lock the brake when nothing is received for this long; stored in the motor's ROM.
    SET_COMMUNICATION_TIMEOUT = 0xB3, Changes, "V3.6 §2.30",
        "stored in ROM; 0 switches the protection off";
        request(SetCommunicationTimeout {
            /// 0 switches the protection off.
            timeout: Milliseconds = 4 as "timeout_ms",
        });
        reply(
            /// §2.30.3 says echo, example 2 of §2.30.4 prints all zero: both occur.
            CommunicationTimeout { timeout: Milliseconds = 4 as "timeout_ms" }
        );
    /// Set the rate of both buses, in ROM. When it takes effect is contradictory, and whatever comes back is no answer.
    SET_BAUD_RATE = 0xB4, Changes, "V3.6 §2.31",
        "stored in ROM; RS485 0..4 = 115200, 500k, 1M, 1.5M, 2M; CAN 0 = 500k, 1 = 1M; not answered";
        request(SetBaudRate {
            /// 0..=4 over RS485, 0..=1 over CAN.
            code: BaudCode = 7 as "baud_code",
        });
        reply(
            /// Random by the manual (§2.31.3). Answers nothing.
            BaudRateSet { raw: [u8; 7] = 1 as "data" }
        );
    /// Read the motor model.
    READ_MODEL = 0xB5, Reads, "V3.6 §2.32";
        request(ReadModel);
        reply(Model { model: Model = 1 as "model" });
    /// Function 1: clear the multi-turn value, take the present position as zero and store it.
    CLEAR_MULTI_TURN = 0x20, Later, "V3.6 §2.33", "function 1; stored, acts after a restart";
        fields(&[]);
    /// Function 2: hear only frames with the motor's own CAN id.
    SET_CAN_ID_FILTER = 0x20, Changes, "V3.6 §2.33",
        "function 2; stored in flash; the motor hears 0x280 only with the filter off";
        fields(&[ENABLED]);
    /// Function 3: send 0x9A unasked every 100 ms while a fault stands.
    SET_ERROR_REPORTING = 0x20, Changes, "V3.6 §2.33",
        "function 3; the motor sends 0x9A every 100 ms while a fault stands";
        fields(&[ENABLED]);
    /// Function 4: store the multi-turn value before power is lost.
    SET_MULTI_TURN_SAVING = 0x20, Changes, "V3.6 §2.33",
        "function 4; the motor keeps its multi-turn value over power loss";
        fields(&[ENABLED]);
    /// Function 5: the CAN id from the next restart on (V4.2 and newer).
    SET_NEXT_CAN_ID = 0x20, Later, "V4.0 0x20",
        "V4.2 and newer; function 5, stored in ROM; the motor answers from the new id at once and listens there after a restart";
        fields(&[NEXT_ID]);
    /// Function 8: faults of voltage and speed go away by themselves (V4.4).
    SET_FAULT_RECOVERY = 0x20, Changes, "V4.4 0x20", "V4.4; function 8";
        fields(&[ENABLED]);
    /// Read the CAN id, under CAN id 0x300; every motor on the bus answers.
    READ_CAN_ID = 0x79, Reads, "V3.6 §4", "CAN only, id 0x300: every motor answers";
        request(ReadCanId [bus_id::READ_BYTES]; elsewhere);
        reply(CanId [bus_id::READ_BYTES] { id: Node = 6 as "id" }; elsewhere);
    /// Set the CAN id of every motor on the bus, under CAN id 0x300.
    SET_CAN_ID = 0x79, Changes, "V3.6 §4", "CAN only, id 0x300: every motor obeys";
        request(SetCanId { id: u8 = 7 as "id" in (Node::MIN, Node::MAX) }; elsewhere);
        reply(/** An echo with the new id. */ CanIdSet { id: Node = 7 as "id" }; elsewhere);
    /// Motion mode, under CAN ids of its own, without a code.
    MOTION_MODE = 0x00, Changes, "V3.6 §5",
        "CAN only, ids 0x400 and 0x500 + node; the ranges differ between motors";
        request(MotionMode {
            /// [`MotionRanges`](crate::MotionRanges) give the words their meaning.
            command: MotionCommand = 0,
        }; elsewhere);
        reply(MotionMode {
            /// [`MotionRanges`](crate::MotionRanges) give the words their meaning.
            feedback: MotionFeedback = 0,
        }; elsewhere);
    /// Read the RS485 id, under RS485 id 0xCD; every motor on the line answers.
    READ_RS485_ID = 0x79, Reads, "V3.6 §7", "RS485 only, id 0xCD: every motor answers";
        request(ReadRs485Id [bus_id::READ_BYTES]; elsewhere);
        reply(Rs485Id [bus_id::READ_BYTES] { id: Node = 7 as "id" }; elsewhere);
    /// Set the RS485 id of every motor on the line, under RS485 id 0xCD.
    SET_RS485_ID = 0x79, Changes, "V3.6 §7", "RS485 only, id 0xCD: every motor obeys";
        request(SetRs485Id { id: u8 = 7 as "id" in (Node::MIN, Node::MAX) }; elsewhere);
        reply(/** An echo with the new id. */ Rs485IdSet { id: Node = 7 as "id" }; elsewhere);

    /// Read one gain (V4.2 and newer).
    READ_GAIN = 0x30, Reads, "V4.2 0x30", "V4.2 and newer";
        request(ReadGain { gain: Gain = 1 }; elsewhere);
        reply(Gain { gain: GainValue = 1 }; elsewhere);
    /// Write one gain; lost with the power (V4.2 and newer).
    WRITE_GAIN_RAM = 0x31, Changes, "V4.2 0x31", "V4.2 and newer";
        request(WriteGainRam { gain: GainValue = 1 }; elsewhere);
        reply(/** An echo. */ GainRamWritten { gain: GainValue = 1 }; elsewhere);
    /// Write one gain to ROM (V4.2 and newer).
    WRITE_GAIN_ROM = 0x32, Changes, "V4.2 0x32",
        "V4.2 and newer; stored in ROM, from V4.4 on only while the output is off";
        request(WriteGainRom { gain: GainValue = 1 }; elsewhere);
        reply(/** An echo. */ GainRomWritten { gain: GainValue = 1 }; elsewhere);
    /// Read one of the four accelerations (V3.9 and newer).
    READ_RAMP = 0x42, Reads, "V3.9 0x42", "V3.9 and newer";
        request(ReadRamp { ramp: Ramp = 1 }; elsewhere);
        reply(Ramp {
            ramp: Ramp = 1,
            acceleration: DegreesPerSecondSquared = 4 as "acceleration_dps2",
        }; elsewhere);
    /// Read a third of the motor model (V4.4).
    READ_MODEL_PART = 0xB5, Reads, "V4.4 0xB5", "V4.4; parts 1 to 3 of five characters";
        request(ReadModelPart [MODEL_PART] {
            part: u8 = 2 as "part" in (MODEL_PART_MIN, MODEL_PART_MAX),
        }; elsewhere);
        reply(ModelPart [MODEL_PART] {
            part: u8 = 2 as "part" in (MODEL_PART_MIN, MODEL_PART_MAX),
            text: ModelPart = 3 as "model",
        }; elsewhere);
    /// Read the single-turn encoder of a direct-drive motor (V3.7 to V4.3).
    READ_SINGLE_TURN_ENCODER = 0x90, Reads, "V3.7 0x90", "V3.7 to V4.3, direct drive only";
        request(ReadSingleTurnEncoder);
        reply(SingleTurnEncoder {
            position: EncoderCounts = 2 as "position_counts",
            raw: EncoderCounts = 4 as "raw_counts",
            offset: EncoderCounts = 6 as "offset_counts",
        });
    /// Read the single-turn angle (V3.7 and newer).
    READ_SINGLE_TURN_ANGLE = 0x94, Reads, "V3.7 0x94", "V3.7 and newer; V4.4 answers otherwise";
        request(ReadSingleTurnAngle);
        reply(
            /// To V4.3, 0 to 359.99°.
            SingleTurnAngle { angle: SingleTurn = 6 as "angle_deg" }
        );
    /// Hold a speed with a torque cap of the motor's own (V4.3 and newer).
    CAPPED_VELOCITY = 0xA2, Changes, "V4.3 0xA2", "V4.3 and newer; answered like velocity";
        request(CappedVelocity {
            /// Older motors ignore it and turn with full torque.
            cap: TorqueCap = 1 as "torque_cap_percent" in (TORQUE_CAP_MIN, u8::MAX),
            speed: CentidegreesPerSecond = 4 as "speed_dps",
        }; elsewhere);
    /// Move to a single-turn angle (V3.7 and newer).
    SINGLE_TURN_POSITION = 0xA6, Changes, "V3.7 0xA6", "V3.7 and newer, single-turn mode";
        request(SingleTurnPosition {
            /// Which way round.
            counter_clockwise: bool = 1 as "counter_clockwise",
            max_speed: SpeedLimit = 2 as "max_speed_dps" in (1, u16::MAX),
            angle: SingleTurn = 4 as "angle_deg" in (0, SINGLE_TURN_MAX),
        });
        reply(SingleTurnPosition { motion: Motion = 1 });
    /// Move to a multi-turn angle with a torque cap of the motor's own (V4.3 and newer).
    CAPPED_POSITION = 0xA9, Changes, "V4.3 0xA9", "V4.3 and newer";
        request(CappedPosition {
            /// What 0 means no manual says: it is refused.
            cap: TorqueCap = 1 as "torque_cap_percent" in (TORQUE_CAP_MIN, u8::MAX),
            max_speed: SpeedLimit = 2 as "max_speed_dps" in (1, u16::MAX),
            angle: Centidegrees = 4 as "angle_deg",
        });
        reply(CappedPosition { motion: Motion = 1 });
    /// Move to a multi-turn angle with a speed fed forward (V4.4).
    SPEED_FED_POSITION = 0x72, Changes, "V4.4 0x72", "V4.4";
        request(SpeedFedPosition {
            /// Of the rated speed; acts only where the position acceleration is 0.
            feed: FeedForward = 1 as "feed_forward_percent",
            max_speed: SpeedLimit = 2 as "max_speed_dps" in (1, u16::MAX),
            angle: Centidegrees = 4 as "angle_deg",
        });
        reply(SpeedFedPosition { motion: Motion = 1 });
    /// Move to a multi-turn angle with a torque fed forward (V4.4).
    TORQUE_FED_POSITION = 0x73, Changes, "V4.4 0x73", "V4.4";
        request(TorqueFedPosition {
            /// Of the rated current; early V4.4 firmware may read it without a sign.
            feed: FeedForward = 1 as "feed_forward_percent",
            max_speed: SpeedLimit = 2 as "max_speed_dps" in (1, u16::MAX),
            angle: Centidegrees = 4 as "angle_deg",
        });
        reply(TorqueFedPosition { motion: Motion = 1 });
    /// Have the motor send a reply by itself; it then answers that command no more (V3.9 and newer).
    SET_ACTIVE_REPLY = 0xB6, Changes, "V3.9 0xB6",
        "V3.9 and newer, CAN only; not answered; polls of that command stay unanswered";
        request(SetActiveReply {
            /// Which reply: 0x60 to 0x62, 0x92, 0x9A, 0x9C or 0x9D.
            reply: u8 = 1 as "reply",
            enabled: bool = 2 as "enabled",
            /// In units of 10 ms; some motors count from one more.
            interval: EncoderCounts = 3 as "interval_10ms",
        });

    also request {
        (
            /// 0x20: use or switch one of four functions (RMD V3.6 §2.33).
            Function { function: Function = 1 }
        ) code crate::command::FUNCTION, info function.info(), effect function.effect();
        (
            /// Any other command. It may well move the motor ([`CLOSED_LOOP`](crate::command::CLOSED_LOOP)) or
            /// write its flash.
            Unknown { data: [u8; DATA_LEN] = 0 as "data" }
        ) code first(data), info None, effect Effect::Changes;
    }
    also reply {
        (
            /// 0x94 of V4.4: ±180° in the last four bytes.
            SignedSingleTurnAngle { angle: Centidegrees = 4 as "angle_deg" }
        ) code crate::command::READ_SINGLE_TURN_ANGLE, info Some(&READ_SINGLE_TURN_ANGLE);
        (
            /// 0x20 received; an echo (RMD V3.6 §2.33.3).
            Function { function: Function = 1 }
        ) code crate::command::FUNCTION, info function.info();
        (
            /// 0xF1: an event some motors send every second after their communication timeout has struck. Answers
            /// nothing.
            TimeoutNotice { raw: RawNotice = 1 as "data" }
        ) code crate::command::TIMEOUT_NOTICE, info Some(&TIMEOUT_NOTICE);
        (
            /// The reply to any other command.
            Unknown { data: [u8; DATA_LEN] = 0 as "data" }
        ) code first(data), info None;
    }
    also rows {
        TIMEOUT_NOTICE = CommandInfo::new("timeout_notice", crate::command::TIMEOUT_NOTICE as u16, "not in the manual")
            .with_reply(DATA)
            .with_note("never sent; an event of motors whose communication timeout has struck");
    }
}

const fn first([code, ..]: &[u8; DATA_LEN]) -> u8 {
    *code
}
