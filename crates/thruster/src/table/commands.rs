//! Every command: its name, word, section and fields.

use codec::CommandInfo;

use super::field as f;
use crate::field::command;
use crate::returned::{ReturnSource, ReturnedFrame, header};

/// Defines each command as a constant and all of them as [`COMMANDS`].
macro_rules! commands {
    ($($constant:ident = $info:expr;)*) => {
        $(pub(crate) const $constant: CommandInfo = $info;)*

        /// Every command of the manual, in its order, and the frames that devices return.
        pub const COMMANDS: &[CommandInfo] = &[$($constant),*];
    };
}

/// A command with this name, word and section "Thruster manual §…".
const fn named(name: &'static str, code: u16, section: &'static str) -> CommandInfo {
    CommandInfo::new(name, code, section)
}

/// Frame 1, 2 or 3 of a source; never sent by a host.
const fn returned(name: &'static str, source: ReturnSource, number: u8) -> CommandInfo {
    let section = match source {
        ReturnSource::Signal | ReturnSource::Speed => "Thruster manual §2.4",
        ReturnSource::Stream => "Thruster manual §2.5",
    };
    let fields = match number {
        ReturnedFrame::MOTION => f::MOTION,
        ReturnedFrame::CONDITION => f::CONDITION,
        _ => f::POSITION,
    };
    let note = match source {
        ReturnSource::Signal | ReturnSource::Speed => {
            "never sent; returned instead of an echo, see configure_return"
        }
        ReturnSource::Stream => "never sent; an event, see configure_stream",
    };
    named(name, header(source, number), section).with_reply(fields).with_note(note)
}

/// Devices with an encoder only.
const ENCODER: &str = "rudders, push rods and motors with an encoder only";
/// CI and CB.
const AFTER_RESTART: &str = "acts after a power cycle";

commands! {
    SIGNAL = named("signal", command::TC, "Thruster manual §2.1").with_request(&[f::SIGNAL]).with_reply(&[f::SIGNAL]);
    SPEED = named("speed", command::VC, "Thruster manual §2.1")
        .with_request(&[f::SPEED])
        .with_reply(&[f::SPEED])
        .with_note("0, or at least 30 rpm in either direction; -4370 cannot be sent");
    READ_SPEED = named("read_speed", command::QV, "Thruster manual §2.1").with_reply(&[f::SPEED]);
    READ_CURRENT = named("read_current", command::QC, "Thruster manual §2.1").with_reply(&[f::CURRENT]);
    READ_VOLTAGE = named("read_voltage", command::QP, "Thruster manual §2.1").with_reply(&[f::VOLTAGE]);
    READ_MOTOR_TEMPERATURE =
        named("read_motor_temperature", command::QT, "Thruster manual §2.1").with_reply(&[f::TEMPERATURE]);
    READ_DRIVER_TEMPERATURE =
        named("read_driver_temperature", command::EQ, "Thruster manual §2.1").with_reply(&[f::TEMPERATURE]);
    READ_FAULTS = named("read_faults", command::EF, "Thruster manual §2.1, §3").with_reply(&[f::FAULTS]);
    CLEAR_FAULTS = named("clear_faults", command::CF, "Thruster manual §2.1").with_note("read_faults proves them cleared");
    REQUEST_MODE =
        named("request_mode", command::MQ, "Thruster manual §2.1").with_note("ends low_speed_mode and medium_speed_mode");
    LOW_SPEED_MODE = named("low_speed_mode", command::ML, "Thruster manual §2.1")
        .with_note("returns current and speed every second");
    MEDIUM_SPEED_MODE = named("medium_speed_mode", command::MM, "Thruster manual §2.1")
        .with_note("returns current and speed every 100 ms");
    SET_ID =
        named("set_id", command::CI, "Thruster manual §2.2").with_request(&[f::ID]).with_reply(&[f::ID]).with_note(AFTER_RESTART);
    SET_BITRATE = named("set_bitrate", command::CB, "Thruster manual §2.2")
        .with_request(&[f::BITRATE])
        .with_reply(&[f::BITRATE])
        .with_note("acts after a power cycle; 1000 800 666 500 400 333 250 200 150 125 100 83 80 66 50 40 33 20 10");
    SET_TIMEOUT = named("set_timeout", command::ST, "Thruster manual §2.3")
        .with_request(&[f::TIMEOUT])
        .with_reply(&[f::TIMEOUT])
        .with_note("0 switches it off, else at least 100 ms");
    CONFIGURE_RETURN = named("configure_return", command::VM, "Thruster manual §2.4")
        .with_request(&[f::FLAGS, f::FRAMES])
        .with_reply(&[f::FLAGS, f::FRAMES])
        .with_note("what signal and speed return; flags: 1 no return, 2 no header; frames: 1, 2 and 4");
    CONFIGURE_STREAM = named("configure_stream", command::SR, "Thruster manual §2.5")
        .with_request(&[f::FRAMES, f::INTERVAL])
        .with_reply(&[f::FRAMES, f::INTERVAL])
        .with_note("acts at once and is kept; frames: 1, 2 and 4");
    READ_FAULT_RECORD =
        named("read_fault_record", command::FR, "Thruster manual §2.6").with_reply(&[f::FAULTS]).with_note("since power-on");
    SET_PARAMETER = named("set_parameter", command::SP, "Thruster manual §2.7")
        .with_request(&[f::PARAMETER, f::VALUE])
        .with_reply(&[f::PARAMETER, f::VALUE])
        .with_note("raw; the manual explains no parameter but that of set_position_limits");
    READ_PARAMETER = named("read_parameter", command::RP, "Thruster manual §2.7")
        .with_request(&[f::PARAMETER])
        .with_reply(&[f::PARAMETER, f::VALUE])
        .with_note("raw; the manual explains no parameter but that of read_position_limits");
    ABSOLUTE_POSITION = named("absolute_position", command::LA, "Thruster manual §4.1")
        .with_request(&[f::MOVE_SPEED, f::ANGLE])
        .with_reply(&[f::MOVE_SPEED, f::ANGLE])
        .with_note("speed 0 does not start the move; rudders, push rods and motors with an encoder only");
    READ_ABSOLUTE_POSITION = named("read_absolute_position", command::QA, "Thruster manual §4.1")
        .with_reply(&[f::WIDE_ANGLE])
        .with_note(ENCODER);
    SET_ABSOLUTE_ZERO = named("set_absolute_zero", command::AZ, "Thruster manual §4.1").with_note(ENCODER);
    SET_POSITION_LIMITS = named("set_position_limits", command::SP, "Thruster manual §4.1")
        .with_request(&[f::REVERSE, f::FORWARD])
        .with_reply(&[f::REVERSE, f::FORWARD])
        .with_note(ENCODER);
    READ_POSITION_LIMITS = named("read_position_limits", command::RP, "Thruster manual §4.1")
        .with_reply(&[f::REVERSE, f::FORWARD])
        .with_note(ENCODER);
    RELATIVE_POSITION = named("relative_position", command::LR, "Thruster manual §4.2")
        .with_request(&[f::MOVE_SPEED, f::WIDE_ANGLE])
        .with_reply(&[f::MOVE_SPEED, f::WIDE_ANGLE])
        .with_note("every frame with a speed adds one more move; rudders, push rods and motors with an encoder only");
    READ_RELATIVE_POSITION = named("read_relative_position", command::QR, "Thruster manual §4.2")
        .with_reply(&[f::WIDE_ANGLE])
        .with_note(ENCODER);
    SET_RELATIVE_ZERO = named("set_relative_zero", command::RZ, "Thruster manual §4.2").with_note(ENCODER);
    CLEAR_RELATIVE_POSITION = named("clear_relative_position", command::RC, "Thruster manual §4.2").with_note(ENCODER);
    EMERGENCY_STOP = named("emergency_stop", command::LS, "Thruster manual §4.3");
    SIGNAL_RETURN_1 = returned("signal_return_1", ReturnSource::Signal, ReturnedFrame::MOTION);
    SIGNAL_RETURN_2 = returned("signal_return_2", ReturnSource::Signal, ReturnedFrame::CONDITION);
    SIGNAL_RETURN_3 = returned("signal_return_3", ReturnSource::Signal, ReturnedFrame::POSITION);
    SPEED_RETURN_1 = returned("speed_return_1", ReturnSource::Speed, ReturnedFrame::MOTION);
    SPEED_RETURN_2 = returned("speed_return_2", ReturnSource::Speed, ReturnedFrame::CONDITION);
    SPEED_RETURN_3 = returned("speed_return_3", ReturnSource::Speed, ReturnedFrame::POSITION);
    STREAM_1 = returned("stream_1", ReturnSource::Stream, ReturnedFrame::MOTION);
    STREAM_2 = returned("stream_2", ReturnSource::Stream, ReturnedFrame::CONDITION);
    STREAM_3 = returned("stream_3", ReturnSource::Stream, ReturnedFrame::POSITION);
}

/// A returned frame without a header.
pub(crate) const HEADERLESS: &str = "headerless_return";
