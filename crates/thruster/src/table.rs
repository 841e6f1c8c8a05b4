//! The protocol as data: every command with its word, its section of the manual, and its values
//! with place, name, unit and range. Requests, replies, their bytes, and how tools list, build and
//! print them follow from it.
//!
//! Numbers of a line are counts of the wire; their units and ranges are those of their types.

use codec::Effect;

use crate::faults::Faults;
use crate::field::{
    POSITION_MAX, POSITION_MIN, SIGNAL_MAX, SIGNAL_MIN, TIMEOUT_MAX, TIMEOUT_OFF, named_flags,
    named_frames, raw_parameter, set_speed, set_timeout,
};
use crate::node::Node;
use crate::parameter::RawParameter;
use crate::payload::{LIMITS, Payload, REFUSED, SHORT, SHORT_LIMITS};
use crate::refused::{self, Refusal};
use crate::returned::{ReturnFlags, ReturnFrames, ReturnSource, Returned, ReturnedFrame, row};
use crate::units::{
    Celsius, Deciamps, Decidegrees, Decivolts, Kilobits, LimitDecidegrees, Milliseconds, Percent,
    Rpm, RpmLimit,
};

/// The word of two letters.
const fn word(letters: &[u8; 2]) -> u16 {
    u16::from_be_bytes(*letters)
}

codec::commands! {
    /// Every command of the manual, in its order, and the frames that devices return.
    COMMANDS of "Thruster manual ";

    /// A request to one node.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    enum Request;

    /// A reply of one node. It repeats the command word of the request (Thruster manual §1.3).
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    enum Reply;

    layout Payload, code u16;

    /// TC: run at a share of the full signal.
    SIGNAL = word(b"TC"), Changes, "§2.1";
        request(Signal { signal: Percent = 4 as "signal_percent" in (SIGNAL_MIN, SIGNAL_MAX) });
        reply(Signal { signal: Percent = 4 as "signal_percent" in (SIGNAL_MIN, SIGNAL_MAX) });
    /// VC: run at a speed.
    SPEED = word(b"VC"), Changes, "§2.1",
        "0, or at least 30 rpm in either direction; -4370 cannot be sent";
        request(Speed {
            /// 0, or at least 30 rpm in either direction; −4370 rpm cannot be sent, its bytes mean a
            /// refusal.
            speed: Rpm = 4 as "speed_rpm" if set_speed,
        });
        reply(Speed { speed: Rpm = 4 as "speed_rpm" if set_speed });
    /// QV: read the speed.
    READ_SPEED = word(b"QV"), Reads, "§2.1";
        request(ReadSpeed [SHORT]);
        reply(
            /// ML and MM make a device send it unasked.
            MeasuredSpeed {
                /// −4370 is a value like any other here.
                speed: Rpm = 4 as "speed_rpm",
            }
        );
    /// QC: read the current.
    READ_CURRENT = word(b"QC"), Reads, "§2.1";
        request(ReadCurrent [SHORT]);
        reply(
            /// ML and MM make a device send it unasked.
            Current { current: Deciamps = 4 as "current_a" }
        );
    /// QP: read the voltage.
    READ_VOLTAGE = word(b"QP"), Reads, "§2.1";
        request(ReadVoltage [SHORT]);
        reply(Voltage { voltage: Decivolts = 4 as "voltage_v" });
    /// QT: read the motor temperature.
    READ_MOTOR_TEMPERATURE = word(b"QT"), Reads, "§2.1";
        request(ReadMotorTemperature [SHORT]);
        reply(MotorTemperature { temperature: Celsius = 4 as "temperature_c" });
    /// EQ: read the driver temperature.
    READ_DRIVER_TEMPERATURE = word(b"EQ"), Reads, "§2.1";
        request(ReadDriverTemperature [SHORT]);
        reply(DriverTemperature { temperature: Celsius = 4 as "temperature_c" });
    /// EF: read the present faults.
    READ_FAULTS = word(b"EF"), Reads, "§2.1, §3";
        request(ReadFaults [SHORT]);
        reply(/** A timeout is shown once only (§2.3). */ Faults { faults: Faults = 4 as "faults" });
    /// CF: clear the faults. Only a following EF proves them cleared.
    CLEAR_FAULTS = word(b"CF"), Changes, "§2.1", "read_faults proves them cleared";
        request(ClearFaults [SHORT]);
        reply(FaultsCleared);
    /// MQ: answer only when asked; ends what ML and MM began.
    REQUEST_MODE = word(b"MQ"), Changes, "§2.1", "ends low_speed_mode and medium_speed_mode";
        request(RequestMode [SHORT]);
        reply(RequestMode);
    /// ML: return current and speed every second, as replies to QC and QV.
    LOW_SPEED_MODE = word(b"ML"), Changes, "§2.1", "returns current and speed every second";
        request(LowSpeedMode [SHORT]);
        reply(LowSpeedMode);
    /// MM: return current and speed every 100 ms, as replies to QC and QV.
    MEDIUM_SPEED_MODE = word(b"MM"), Changes, "§2.1", "returns current and speed every 100 ms";
        request(MediumSpeedMode [SHORT]);
        reply(MediumSpeedMode);
    /// CI: change the id, from the next power-on.
    SET_ID = word(b"CI"), Later, "§2.2", "acts after a power cycle";
        request(SetId { id: u16 = 4 as "id" in (Node::MIN, Node::MAX) });
        reply(Id { id: u16 = 4 as "id" in (Node::MIN, Node::MAX) });
    /// CB: change the bitrate, from the next power-on.
    SET_BITRATE = word(b"CB"), Later, "§2.2",
        "acts after a power cycle; 1000 800 666 500 400 333 250 200 150 125 100 83 80 66 50 40 33 20 10";
        request(SetBitrate {
            /// One of [`BITRATES`](crate::BITRATES).
            bitrate: Kilobits = 4 as "bitrate_kbps" span (10, 1000),
        });
        reply(Bitrate { bitrate: Kilobits = 4 as "bitrate_kbps" span (10, 1000) });
    /// ST: stop when no command has come for this long.
    SET_TIMEOUT = word(b"ST"), Changes, "§2.3", "0 switches it off, else at least 100 ms";
        request(SetTimeout {
            /// 0 = off, or 100..=60000.
            timeout: Milliseconds = 4 as "timeout_ms" span (TIMEOUT_OFF, TIMEOUT_MAX) if set_timeout,
        });
        reply(Timeout {
            timeout: Milliseconds = 4 as "timeout_ms" span (TIMEOUT_OFF, TIMEOUT_MAX) if set_timeout,
        });
    /// VM: choose what TC and VC return.
    CONFIGURE_RETURN = word(b"VM"), Changes, "§2.4",
        "what signal and speed return; flags: 1 no return, 2 no header; frames: 1, 2 and 4";
        request(ConfigureReturn {
            /// Whether and how.
            flags: ReturnFlags = 6 as "flags" if named_flags,
            /// Which frames; without effect when there is no header.
            frames: ReturnFrames = 7 as "frames" if named_frames,
        });
        reply(ReturnConfigured {
            flags: ReturnFlags = 6 as "flags",
            frames: ReturnFrames = 7 as "frames",
        });
    /// SR: choose the stream that starts with power-on. Acts at once, and is kept.
    CONFIGURE_STREAM = word(b"SR"), Changes, "§2.5", "acts at once and is kept; frames: 1, 2 and 4";
        request(ConfigureStream {
            /// Which frames; none is taken to mean off.
            frames: ReturnFrames = 5 as "frames" if named_frames,
            /// Time between them.
            interval: Milliseconds = 6 as "interval_ms",
        });
        reply(StreamConfigured {
            frames: ReturnFrames = 5 as "frames",
            interval: Milliseconds = 6 as "interval_ms",
        });
    /// FR: read all faults since the start.
    READ_FAULT_RECORD = word(b"FR"), Reads, "§2.6", "since power-on";
        request(ReadFaultRecord [SHORT]);
        reply(FaultRecord { faults: Faults = 4 as "faults" });
    /// SP: write a system parameter, raw.
    SET_PARAMETER = word(b"SP"), Changes, "§2.7",
        "raw; the manual explains no parameter but that of set_position_limits";
        request(SetParameter {
            /// Anything but [`POSITION_LIMITS`](crate::POSITION_LIMITS).
            parameter: u16 = 2 if raw_parameter,
            data: [u8; 4] = 4,
        } via RawParameter);
        reply(ParameterSet {
            parameter: u16 = 2 if raw_parameter,
            data: [u8; 4] = 4,
        } via RawParameter);
    /// RP: read a system parameter.
    READ_PARAMETER = word(b"RP"), Reads, "§2.7",
        "raw; the manual explains no parameter but that of read_position_limits";
        request(ReadParameter [SHORT] {
            /// Anything but [`POSITION_LIMITS`](crate::POSITION_LIMITS).
            parameter: u16 = 2 as "parameter" if raw_parameter,
        });
        reply(Parameter { parameter: u16 = 2 if raw_parameter, data: [u8; 4] = 4 } via RawParameter);
    /// LA: move to an absolute position; devices with an encoder only.
    ABSOLUTE_POSITION = word(b"LA"), Changes, "§4.1",
        "speed 0 does not start the move; rudders, push rods and motors with an encoder only";
        request(AbsolutePosition {
            /// 0 does not start the move.
            speed: RpmLimit = 2 as "speed_rpm",
            position: Decidegrees = 4 as "angle_deg" in (POSITION_MIN, POSITION_MAX),
        });
        reply(AbsolutePosition {
            speed: RpmLimit = 2 as "speed_rpm",
            position: Decidegrees = 4 as "angle_deg" in (POSITION_MIN, POSITION_MAX),
        });
    /// QA: read the absolute position; devices with an encoder only.
    READ_ABSOLUTE_POSITION = word(b"QA"), Reads, "§4.1",
        "rudders, push rods and motors with an encoder only";
        request(ReadAbsolutePosition [SHORT]);
        reply(MeasuredPosition { position: Decidegrees = 4 as "angle_deg" });
    /// AZ: make the present position the absolute zero.
    SET_ABSOLUTE_ZERO = word(b"AZ"), Changes, "§4.1",
        "rudders, push rods and motors with an encoder only";
        request(SetAbsoluteZero);
        reply(AbsoluteZeroSet);
    /// SPLA: set the limits of the absolute position, signs assumed. LA beyond them is not executed.
    SET_POSITION_LIMITS = word(b"SP"), Changes, "§4.1",
        "rudders, push rods and motors with an encoder only";
        request(SetPositionLimits [LIMITS] {
            reverse: LimitDecidegrees = 4 as "reverse_deg" in (i16::MIN, 0),
            forward: LimitDecidegrees = 6 as "forward_deg" in (0, i16::MAX),
        }; elsewhere);
        reply(PositionLimitsSet [LIMITS] {
            reverse: LimitDecidegrees = 4 as "reverse_deg" in (i16::MIN, 0),
            forward: LimitDecidegrees = 6 as "forward_deg" in (0, i16::MAX),
        }; elsewhere);
    /// RPLA: read the limits of the absolute position.
    READ_POSITION_LIMITS = word(b"RP"), Reads, "§4.1",
        "rudders, push rods and motors with an encoder only";
        request(ReadPositionLimits [SHORT_LIMITS]; elsewhere);
        reply(PositionLimits [LIMITS] {
            reverse: LimitDecidegrees = 4 as "reverse_deg" span (i16::MIN, 0),
            forward: LimitDecidegrees = 6 as "forward_deg" span (0, i16::MAX),
        }; elsewhere);
    /// LR: move by a relative position. Each frame with a speed adds to the target.
    RELATIVE_POSITION = word(b"LR"), Changes, "§4.2",
        "every frame with a speed adds one more move; rudders, push rods and motors with an encoder only";
        request(RelativePosition {
            /// 0 neither starts the move nor adds to the target.
            speed: RpmLimit = 2 as "speed_rpm",
            /// 61166 cannot be sent, its bytes mean a refusal. The unit is taken from LA.
            position: Decidegrees = 4 as "angle_deg",
        });
        reply(RelativePosition {
            speed: RpmLimit = 2 as "speed_rpm",
            position: Decidegrees = 4 as "angle_deg",
        });
    /// QR: read the relative position.
    READ_RELATIVE_POSITION = word(b"QR"), Reads, "§4.2",
        "rudders, push rods and motors with an encoder only";
        request(ReadRelativePosition [SHORT]);
        reply(MeasuredRelativePosition { position: Decidegrees = 4 as "angle_deg" });
    /// RZ: make the present position the relative zero.
    SET_RELATIVE_ZERO = word(b"RZ"), Changes, "§4.2",
        "rudders, push rods and motors with an encoder only";
        request(SetRelativeZero);
        reply(RelativeZeroSet);
    /// RC: set the relative position to zero.
    CLEAR_RELATIVE_POSITION = word(b"RC"), Changes, "§4.2",
        "rudders, push rods and motors with an encoder only";
        request(ClearRelativePosition);
        reply(RelativePositionCleared);
    /// LS: emergency stop.
    EMERGENCY_STOP = word(b"LS"), Changes, "§4.3";
        request(EmergencyStop);
        reply(EmergencyStop);

    also request {
        (
            /// A command that has no variant here.
            Unknown { payload: Payload = 0 as "data" }
        ) code payload.command(), info None, effect Effect::Changes;
    }
    also reply {
        (
            /// A frame that VM or SR asked for (Thruster manual §2.4, §2.5). After TC or VC it stands for the echo.
            Returned(returned: Returned = 0)
        ) code returned.header(), info Some(returned.info());
        (
            /// `00 00 EE EE`: the device refuses a set command (Thruster manual §1.3).
            Refused [REFUSED] {
                /// The word of the refused command.
                command: u16 = 0,
                /// What it repeats of bytes 2–3.
                parameter: u16 = 2,
            } via Refusal
        ) code *command, info refused::info(*command, *parameter);
        (
            /// A reply that has no variant here.
            Unknown { payload: Payload = 0 as "data" }
        ) code payload.command(), info None;
    }
    also rows {
        SIGNAL_RETURN_1 = row("signal_return_1", ReturnSource::Signal, ReturnedFrame::MOTION);
        SIGNAL_RETURN_2 = row("signal_return_2", ReturnSource::Signal, ReturnedFrame::CONDITION);
        SIGNAL_RETURN_3 = row("signal_return_3", ReturnSource::Signal, ReturnedFrame::POSITION);
        SPEED_RETURN_1 = row("speed_return_1", ReturnSource::Speed, ReturnedFrame::MOTION);
        SPEED_RETURN_2 = row("speed_return_2", ReturnSource::Speed, ReturnedFrame::CONDITION);
        SPEED_RETURN_3 = row("speed_return_3", ReturnSource::Speed, ReturnedFrame::POSITION);
        STREAM_1 = row("stream_1", ReturnSource::Stream, ReturnedFrame::MOTION);
        STREAM_2 = row("stream_2", ReturnSource::Stream, ReturnedFrame::CONDITION);
        STREAM_3 = row("stream_3", ReturnSource::Stream, ReturnedFrame::POSITION);
    }
}
