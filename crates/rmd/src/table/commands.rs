//! Every command: its name, code, section and fields.

use codec::{CommandInfo, FieldInfo};

use super::field as f;
use crate::command;

/// Defines each command as a constant and all of them as [`COMMANDS`].
macro_rules! commands {
    ($($constant:ident = $info:expr;)*) => {
        $(pub(crate) const $constant: CommandInfo = $info;)*

        /// Every command of the manual and the timeout notice, in the order of the manual.
        pub const COMMANDS: &[CommandInfo] = &[$($constant),*];
    };
}

/// A command with this name, code and section "RMD V3.6 §…".
const fn named(name: &'static str, code: u8, section: &'static str) -> CommandInfo {
    CommandInfo::new(name, code as u16, section)
}

/// A closed-loop command.
const fn closed_loop(
    name: &'static str,
    code: u8,
    section: &'static str,
    request: &'static [FieldInfo],
) -> CommandInfo {
    named(name, code, section)
        .with_request(request)
        .with_reply(f::MOTION)
        .with_note("runs only without a fault")
}

/// 0x20 with one of its functions.
const fn function(name: &'static str, fields: &'static [FieldInfo], note: &'static str) -> CommandInfo {
    named(name, command::FUNCTION, "RMD V3.6 §2.33").with_request(fields).with_reply(fields).with_note(note)
}

commands! {
    READ_PID = named("read_pid", command::READ_PID, "RMD V3.6 §2.1").with_reply(f::GAINS);
    WRITE_PID_RAM =
        named("write_pid_ram", command::WRITE_PID_RAM, "RMD V3.6 §2.2").with_request(f::GAINS).with_reply(f::GAINS);
    WRITE_PID_ROM = named("write_pid_rom", command::WRITE_PID_ROM, "RMD V3.6 §2.3")
        .with_request(f::GAINS)
        .with_reply(f::GAINS)
        .with_note("stored in ROM");
    READ_ACCELERATION =
        named("read_acceleration", command::READ_ACCELERATION, "RMD V3.6 §2.4").with_reply(&[f::ACCELERATION]);
    WRITE_ACCELERATION = named("write_acceleration", command::WRITE_ACCELERATION, "RMD V3.6 §2.5")
        .with_request(&[f::RAMP, f::ACCELERATION])
        .with_reply(&[f::RAMP, f::RAMP_NAME, f::ACCELERATION])
        .with_note("stored in ROM; index 0 and 1 speed up and slow down position moves, 2 and 3 velocity changes");
    READ_ENCODER_POSITION = named("read_encoder_position", command::READ_ENCODER_POSITION, "RMD V3.6 §2.6")
        .with_reply(&[f::POSITION_PULSES]);
    READ_ENCODER_RAW_POSITION =
        named("read_encoder_raw_position", command::READ_ENCODER_RAW_POSITION, "RMD V3.6 §2.7")
            .with_reply(&[f::POSITION_PULSES]);
    READ_ENCODER_OFFSET =
        named("read_encoder_offset", command::READ_ENCODER_OFFSET, "RMD V3.6 §2.8").with_reply(&[f::OFFSET_PULSES]);
    WRITE_ENCODER_OFFSET = named("write_encoder_offset", command::WRITE_ENCODER_OFFSET, "RMD V3.6 §2.9")
        .with_request(&[f::OFFSET_PULSES])
        .with_reply(&[f::OFFSET_PULSES])
        .with_note("stored in ROM, acts after a restart");
    WRITE_POSITION_AS_ZERO =
        named("write_position_as_zero", command::WRITE_POSITION_AS_ZERO, "RMD V3.6 §2.10")
            .with_reply(&[f::OFFSET_PULSES])
            .with_note("stored in ROM, acts after a restart");
    READ_MULTI_TURN_ANGLE =
        named("read_multi_turn_angle", command::READ_MULTI_TURN_ANGLE, "RMD V3.6 §2.11").with_reply(&[f::ANGLE]);
    READ_STATUS_1 = named("read_status_1", command::READ_STATUS_1, "RMD V3.6 §2.12")
        .with_reply(&[f::TEMPERATURE, f::BRAKE_RELEASED, f::VOLTAGE, f::FAULTS]);
    READ_STATUS_2 = named("read_status_2", command::READ_STATUS_2, "RMD V3.6 §2.13").with_reply(f::MOTION);
    READ_STATUS_3 = named("read_status_3", command::READ_STATUS_3, "RMD V3.6 §2.14")
        .with_reply(&[f::TEMPERATURE, f::PHASE_A, f::PHASE_B, f::PHASE_C]);
    SHUTDOWN = named("shutdown", command::SHUTDOWN, "RMD V3.6 §2.15").with_note("output off, the shaft turns freely");
    STOP = named("stop", command::STOP, "RMD V3.6 §2.16").with_note("stops and holds");
    TORQUE_CURRENT =
        closed_loop("torque_current", command::TORQUE_CURRENT, "RMD V3.6 §2.17", &[f::CURRENT]);
    VELOCITY = closed_loop("velocity", command::VELOCITY, "RMD V3.6 §2.18", &[f::SPEED]);
    POSITION_TRACKING =
        closed_loop("position_tracking", command::POSITION_TRACKING, "RMD V3.6 §2.19", &[f::ANGLE])
            .with_note("runs only without a fault; nothing limits the speed");
    ABSOLUTE_POSITION = closed_loop(
        "absolute_position",
        command::ABSOLUTE_POSITION,
        "RMD V3.6 §2.20",
        &[f::MAX_SPEED, f::ANGLE],
    );
    LIMITED_POSITION_TRACKING = closed_loop(
        "limited_position_tracking",
        command::LIMITED_POSITION_TRACKING,
        "RMD V3.6 §2.21",
        &[f::FINE_MAX_SPEED, f::ANGLE],
    );
    INCREMENTAL_POSITION = closed_loop(
        "incremental_position",
        command::INCREMENTAL_POSITION,
        "RMD V3.6 §2.22",
        &[f::MAX_SPEED, f::ANGLE],
    )
    .with_note("runs only without a fault; every frame adds one more move");
    READ_RUN_MODE = named("read_run_mode", command::READ_RUN_MODE, "RMD V3.6 §2.23")
        .with_reply(&[f::RUN_MODE, f::RUN_MODE_NAME]);
    READ_POWER = named("read_power", command::READ_POWER, "RMD V3.6 §2.24").with_reply(&[f::POWER]);
    RESET = named("reset", command::RESET, "RMD V3.6 §2.25").with_note("restarts the motor; not answered");
    RELEASE_BRAKE = named("release_brake", command::RELEASE_BRAKE, "RMD V3.6 §2.26");
    LOCK_BRAKE = named("lock_brake", command::LOCK_BRAKE, "RMD V3.6 §2.27");
    READ_RUN_TIME = named("read_run_time", command::READ_RUN_TIME, "RMD V3.6 §2.28").with_reply(&[f::RUN_TIME]);
    READ_VERSION_DATE =
        named("read_version_date", command::READ_VERSION_DATE, "RMD V3.6 §2.29").with_reply(&[f::VERSION_DATE]);
    SET_COMMUNICATION_TIMEOUT =
        named("set_communication_timeout", command::SET_COMMUNICATION_TIMEOUT, "RMD V3.6 §2.30")
            .with_request(&[f::TIMEOUT])
            .with_reply(&[f::TIMEOUT])
            .with_note("stored in ROM; 0 switches the protection off");
    SET_BAUD_RATE = named("set_baud_rate", command::SET_BAUD_RATE, "RMD V3.6 §2.31")
        .with_request(&[f::BAUD_CODE])
        .with_reply(&[f::DATA])
        .with_note("stored in ROM; RS485 0..4 = 115200, 500k, 1M, 1.5M, 2M; CAN 0 = 500k, 1 = 1M; not answered");
    READ_MODEL = named("read_model", command::READ_MODEL, "RMD V3.6 §2.32").with_reply(&[f::MODEL]);
    CLEAR_MULTI_TURN = function("clear_multi_turn", &[], "function 1; stored, acts after a restart");
    SET_CAN_ID_FILTER = function(
        "set_can_id_filter",
        &[f::ENABLED],
        "function 2; stored in flash; the motor hears 0x280 only with the filter off",
    );
    SET_ERROR_REPORTING = function(
        "set_error_reporting",
        &[f::ENABLED],
        "function 3; the motor sends 0x9A every 100 ms while a fault stands",
    );
    SET_MULTI_TURN_SAVING = function(
        "set_multi_turn_saving",
        &[f::ENABLED],
        "function 4; the motor keeps its multi-turn value over power loss",
    );
    READ_CAN_ID = named("read_can_id", command::BUS_ID, "RMD V3.6 §4")
        .with_reply(&[f::ID])
        .with_note("CAN only, id 0x300: every motor answers");
    SET_CAN_ID = named("set_can_id", command::BUS_ID, "RMD V3.6 §4")
        .with_request(&[f::ID])
        .with_reply(&[f::ID])
        .with_note("CAN only, id 0x300: every motor obeys");
    MOTION_MODE = named("motion_mode", command::MOTION_MODE, "RMD V3.6 §5")
        .with_request(&[f::POSITION, f::VELOCITY, f::KP, f::KD, f::TORQUE])
        .with_reply(&[f::ID, f::POSITION, f::VELOCITY, f::TORQUE])
        .with_note("CAN only, ids 0x400 and 0x500 + node; the ranges differ between motors");
    READ_RS485_ID = named("read_rs485_id", command::BUS_ID, "RMD V3.6 §7")
        .with_reply(&[f::ID])
        .with_note("RS485 only, id 0xCD: every motor answers");
    SET_RS485_ID = named("set_rs485_id", command::BUS_ID, "RMD V3.6 §7")
        .with_request(&[f::ID])
        .with_reply(&[f::ID])
        .with_note("RS485 only, id 0xCD: every motor obeys");
    TIMEOUT_NOTICE = named("timeout_notice", command::TIMEOUT_NOTICE, "not in the manual")
        .with_reply(&[f::DATA])
        .with_note("never sent; an event of motors whose communication timeout has struck");
}
