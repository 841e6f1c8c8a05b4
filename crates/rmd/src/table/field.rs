//! Every field: its name, unit, range and counts per unit.

use codec::{FieldInfo, FieldKind};

use crate::field::{ACCELERATION_MAX, ACCELERATION_MIN, reply};
use crate::motion_mode::{MotionRanges, RAW_12_MAX, RAW_16_MAX, Span};
use crate::node::Node;

const HUNDREDTHS: f64 = 100.0;
const TENTHS: f64 = 10.0;
const ONES: f64 = 1.0;

const I8: (i64, i64) = (i8::MIN as i64, i8::MAX as i64);
const I16: (i64, i64) = (i16::MIN as i64, i16::MAX as i64);
const I32: (i64, i64) = (i32::MIN as i64, i32::MAX as i64);
const U16: (i64, i64) = (0, u16::MAX as i64);
const U32: (i64, i64) = (0, u32::MAX as i64);

/// The six gains of 0x30 to 0x32, each a byte of 1/256 of the motor model's own maximum.
const fn gain(name: &'static str) -> FieldInfo {
    FieldInfo::integer(name, "", 0, u8::MAX as i64)
}

pub(crate) const CURRENT_KP: FieldInfo = gain("current_kp");
pub(crate) const CURRENT_KI: FieldInfo = gain("current_ki");
pub(crate) const SPEED_KP: FieldInfo = gain("speed_kp");
pub(crate) const SPEED_KI: FieldInfo = gain("speed_ki");
pub(crate) const POSITION_KP: FieldInfo = gain("position_kp");
pub(crate) const POSITION_KI: FieldInfo = gain("position_ki");
pub(crate) const GAINS: &[FieldInfo] =
    &[CURRENT_KP, CURRENT_KI, SPEED_KP, SPEED_KI, POSITION_KP, POSITION_KI];

pub(crate) const RAMP: FieldInfo = FieldInfo::integer("index", "", 0, 3);
pub(crate) const RAMP_NAME: FieldInfo = FieldInfo::other(FieldKind::Text, "index_name");
pub(crate) const ACCELERATION: FieldInfo = FieldInfo::physical(
    "acceleration_dps2",
    "dps/s",
    (ACCELERATION_MIN as i64, ACCELERATION_MAX as i64),
    ONES,
);

pub(crate) const POSITION_PULSES: FieldInfo = FieldInfo::integer("position_pulses", "pulses", I32.0, I32.1);
pub(crate) const OFFSET_PULSES: FieldInfo = FieldInfo::integer("offset_pulses", "pulses", I32.0, I32.1);

pub(crate) const TEMPERATURE: FieldInfo = FieldInfo::physical("temperature_c", "degC", I8, ONES);
pub(crate) const BRAKE_RELEASED: FieldInfo = FieldInfo::boolean("brake_released");
pub(crate) const VOLTAGE: FieldInfo = FieldInfo::physical("voltage_v", "V", U16, TENTHS);
pub(crate) const FAULTS: FieldInfo = FieldInfo::other(FieldKind::Flags, "faults");

/// Torque current, commanded and measured.
pub(crate) const CURRENT: FieldInfo = FieldInfo::physical("current_a", "A", I16, HUNDREDTHS);
pub(crate) const PHASE_A: FieldInfo = FieldInfo::physical("phase_a_current_a", "A", I16, HUNDREDTHS);
pub(crate) const PHASE_B: FieldInfo = FieldInfo::physical("phase_b_current_a", "A", I16, HUNDREDTHS);
pub(crate) const PHASE_C: FieldInfo = FieldInfo::physical("phase_c_current_a", "A", I16, HUNDREDTHS);

/// Commanded by 0xA2.
pub(crate) const SPEED: FieldInfo = FieldInfo::physical("speed_dps", "dps", I32, HUNDREDTHS);
/// In motion replies.
pub(crate) const MEASURED_SPEED: FieldInfo = FieldInfo::physical("speed_dps", "dps", I16, ONES);
/// Of 0xA4 and 0xA8.
pub(crate) const MAX_SPEED: FieldInfo = FieldInfo::physical("max_speed_dps", "dps", U16, ONES);
/// Of 0xA5.
pub(crate) const FINE_MAX_SPEED: FieldInfo = FieldInfo::physical("max_speed_dps", "dps", U16, HUNDREDTHS);
/// Commanded, and read by 0x92.
pub(crate) const ANGLE: FieldInfo = FieldInfo::physical("angle_deg", "deg", I32, HUNDREDTHS);
/// In motion replies.
pub(crate) const MEASURED_ANGLE: FieldInfo =
    FieldInfo::physical("angle_deg", "deg", (reply::ANGLE_MIN as i64, reply::ANGLE_MAX as i64), ONES);
pub(crate) const MOTION: &[FieldInfo] = &[TEMPERATURE, CURRENT, MEASURED_SPEED, MEASURED_ANGLE];

pub(crate) const RUN_MODE: FieldInfo = FieldInfo::integer("run_mode", "", 0, u8::MAX as i64);
pub(crate) const RUN_MODE_NAME: FieldInfo = FieldInfo::other(FieldKind::Text, "run_mode_name");
pub(crate) const POWER: FieldInfo = FieldInfo::physical("power_w", "W", U16, TENTHS);
pub(crate) const RUN_TIME: FieldInfo = FieldInfo::integer("run_time_ms", "ms", U32.0, U32.1);
pub(crate) const VERSION_DATE: FieldInfo = FieldInfo::integer("version_date", "", U32.0, U32.1);
pub(crate) const TIMEOUT: FieldInfo = FieldInfo::integer("timeout_ms", "ms", U32.0, U32.1);
pub(crate) const BAUD_CODE: FieldInfo = FieldInfo::integer("baud_code", "", 0, 4);
pub(crate) const MODEL: FieldInfo = FieldInfo::other(FieldKind::Text, "model");
pub(crate) const ENABLED: FieldInfo = FieldInfo::boolean("enabled");
pub(crate) const ID: FieldInfo = FieldInfo::integer("id", "", Node::MIN as i64, Node::MAX as i64);

/// A motion-mode field, with the default range of `steps` counts.
const fn span(name: &'static str, unit: &'static str, span: Span, last: u16) -> FieldInfo {
    FieldInfo {
        name,
        unit,
        kind: FieldKind::Physical,
        min: span.min,
        max: span.max,
        counts_per_unit: (last as f64 + 1.0) / (span.max - span.min),
    }
}

pub(crate) const POSITION: FieldInfo =
    span("position_rad", "rad", MotionRanges::DEFAULT.position_rad, RAW_16_MAX);
pub(crate) const VELOCITY: FieldInfo =
    span("velocity_rad_s", "rad/s", MotionRanges::DEFAULT.velocity_rad_s, RAW_12_MAX);
pub(crate) const KP: FieldInfo = span("kp", "N*m/rad", MotionRanges::DEFAULT.kp, RAW_12_MAX);
pub(crate) const KD: FieldInfo = span("kd", "N*m*s/rad", MotionRanges::DEFAULT.kd, RAW_12_MAX);
pub(crate) const TORQUE: FieldInfo = span("torque_nm", "N*m", MotionRanges::DEFAULT.torque_nm, RAW_12_MAX);

/// Bytes of unknown meaning: of unknown commands, of the timeout notice and of the reply to 0xB4.
pub(crate) const DATA: FieldInfo = FieldInfo::other(FieldKind::Bytes, "data");
/// Index and value of 0x20 with an index the manual does not list.
pub(crate) const FUNCTION_INDEX: FieldInfo = FieldInfo::integer("function_index", "", 0, u8::MAX as i64);
pub(crate) const FUNCTION_VALUE: FieldInfo = FieldInfo::integer("value", "", U32.0, U32.1);
