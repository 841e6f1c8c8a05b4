//! Command codes: data byte 0 of a request and of its reply.

use core::ops::RangeInclusive;

/// Function control (RMD V3.6 §2.33).
pub const FUNCTION: u8 = 0x20;
/// Read the PID gains (RMD V3.6 §2.1).
pub const READ_PID: u8 = 0x30;
/// Write the PID gains until power loss (RMD V3.6 §2.2).
pub const WRITE_PID_RAM: u8 = 0x31;
/// Write the PID gains to ROM (RMD V3.6 §2.3).
pub const WRITE_PID_ROM: u8 = 0x32;
/// Read the acceleration (RMD V3.6 §2.4).
pub const READ_ACCELERATION: u8 = 0x42;
/// Write an acceleration or deceleration to RAM and ROM (RMD V3.6 §2.5).
pub const WRITE_ACCELERATION: u8 = 0x43;
/// Read the multi-turn encoder position (RMD V3.6 §2.6).
pub const READ_ENCODER_POSITION: u8 = 0x60;
/// Read the multi-turn encoder position without the offset (RMD V3.6 §2.7).
pub const READ_ENCODER_RAW_POSITION: u8 = 0x61;
/// Read the multi-turn encoder offset (RMD V3.6 §2.8).
pub const READ_ENCODER_OFFSET: u8 = 0x62;
/// Write the multi-turn encoder offset to ROM (RMD V3.6 §2.9).
pub const WRITE_ENCODER_OFFSET: u8 = 0x63;
/// Write the present position to ROM as the offset (RMD V3.6 §2.10).
pub const WRITE_POSITION_AS_ZERO: u8 = 0x64;
/// Read the run mode (RMD V3.6 §2.23).
pub const READ_RUN_MODE: u8 = 0x70;
/// Read the motor power (RMD V3.6 §2.24).
pub const READ_POWER: u8 = 0x71;
/// Restart the motor's firmware (RMD V3.6 §2.25).
pub const RESET: u8 = 0x76;
/// Release the brake (RMD V3.6 §2.26).
pub const RELEASE_BRAKE: u8 = 0x77;
/// Lock the brake (RMD V3.6 §2.27).
pub const LOCK_BRAKE: u8 = 0x78;
/// Read or set the id, under ids of its own on both buses (RMD V3.6 §4, §7).
pub const BUS_ID: u8 = 0x79;
/// Switch the output off (RMD V3.6 §2.15).
pub const SHUTDOWN: u8 = 0x80;
/// Stop and hold (RMD V3.6 §2.16).
pub const STOP: u8 = 0x81;
/// Read the multi-turn angle (RMD V3.6 §2.11).
pub const READ_MULTI_TURN_ANGLE: u8 = 0x92;
/// Read temperature, brake, voltage and the error word (RMD V3.6 §2.12).
pub const READ_STATUS_1: u8 = 0x9A;
/// Read temperature, current, speed and angle (RMD V3.6 §2.13).
pub const READ_STATUS_2: u8 = 0x9C;
/// Read temperature and phase currents (RMD V3.6 §2.14).
pub const READ_STATUS_3: u8 = 0x9D;
/// Torque current control (RMD V3.6 §2.17).
pub const TORQUE_CURRENT: u8 = 0xA1;
/// Velocity control (RMD V3.6 §2.18).
pub const VELOCITY: u8 = 0xA2;
/// Position tracking (RMD V3.6 §2.19).
pub const POSITION_TRACKING: u8 = 0xA3;
/// Absolute position control with a speed limit (RMD V3.6 §2.20).
pub const ABSOLUTE_POSITION: u8 = 0xA4;
/// Position tracking with a speed limit (RMD V3.6 §2.21).
pub const LIMITED_POSITION_TRACKING: u8 = 0xA5;
/// Incremental position control with a speed limit (RMD V3.6 §2.22).
pub const INCREMENTAL_POSITION: u8 = 0xA8;
/// The closed-loop commands, 0xA1 to 0xA8 (RMD V3.6 §2.17 to §2.22): the ones that move the motor.
pub const CLOSED_LOOP: RangeInclusive<u8> = 0xA1..=0xA8;
/// Read the time since the motor started (RMD V3.6 §2.28).
pub const READ_RUN_TIME: u8 = 0xB1;
/// Read the date of the motor's firmware (RMD V3.6 §2.29).
pub const READ_VERSION_DATE: u8 = 0xB2;
/// Set the motor's communication timeout (RMD V3.6 §2.30).
pub const SET_COMMUNICATION_TIMEOUT: u8 = 0xB3;
/// Set the rates of both buses (RMD V3.6 §2.31).
pub const SET_BAUD_RATE: u8 = 0xB4;
/// Read the motor model (RMD V3.6 §2.32).
pub const READ_MODEL: u8 = 0xB5;
/// Sent by some motors, unasked, once their communication timeout has struck. Not in the manual.
pub const TIMEOUT_NOTICE: u8 = 0xF1;
/// Stands for motion mode where a code is asked for: its frames have none (RMD V3.6 §5).
pub const MOTION_MODE: u8 = 0x00;
