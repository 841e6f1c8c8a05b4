//! Every field: its name, unit, range and counts per unit.

use codec::{FieldInfo, FieldKind};

use crate::field::{POSITION_MAX, POSITION_MIN, SIGNAL_MAX, SIGNAL_MIN, TIMEOUT_MAX, TIMEOUT_OFF};
use crate::node::Node;
use crate::returned::{ReturnFlags, ReturnFrames};

const TENTHS: f64 = 10.0;
const ONES: f64 = 1.0;

const I16: (i64, i64) = (i16::MIN as i64, i16::MAX as i64);
const I32: (i64, i64) = (i32::MIN as i64, i32::MAX as i64);
const U16: (i64, i64) = (0, u16::MAX as i64);

pub(crate) const SIGNAL: FieldInfo =
    FieldInfo::physical("signal_percent", "%", (SIGNAL_MIN as i64, SIGNAL_MAX as i64), ONES);
/// Commanded by VC and measured; what VC may carry besides is the codec's to check.
pub(crate) const SPEED: FieldInfo = FieldInfo::physical("speed_rpm", "rpm", I16, ONES);
/// Of LA and LR.
pub(crate) const MOVE_SPEED: FieldInfo = FieldInfo::physical("speed_rpm", "rpm", U16, ONES);
pub(crate) const CURRENT: FieldInfo = FieldInfo::physical("current_a", "A", I16, TENTHS);
pub(crate) const VOLTAGE: FieldInfo = FieldInfo::physical("voltage_v", "V", U16, TENTHS);
pub(crate) const TEMPERATURE: FieldInfo = FieldInfo::physical("temperature_c", "degC", I16, ONES);
pub(crate) const MOTOR_TEMPERATURE: FieldInfo = FieldInfo::physical("motor_temperature_c", "degC", I16, ONES);
pub(crate) const DRIVER_TEMPERATURE: FieldInfo =
    FieldInfo::physical("driver_temperature_c", "degC", I16, ONES);
pub(crate) const FAULTS: FieldInfo = FieldInfo::other(FieldKind::Flags, "faults");

pub(crate) const ID: FieldInfo = FieldInfo::integer("id", "", Node::MIN as i64, Node::MAX as i64);
pub(crate) const BITRATE: FieldInfo = FieldInfo::integer("bitrate_kbps", "kbit/s", 10, 1000);
pub(crate) const TIMEOUT: FieldInfo =
    FieldInfo::integer("timeout_ms", "ms", TIMEOUT_OFF as i64, TIMEOUT_MAX as i64);
pub(crate) const FLAGS: FieldInfo = FieldInfo::flags("flags", ReturnFlags::all().bits() as i64);
pub(crate) const FRAMES: FieldInfo = FieldInfo::flags("frames", ReturnFrames::all().bits() as i64);
pub(crate) const INTERVAL: FieldInfo = FieldInfo::integer("interval_ms", "ms", U16.0, U16.1);

/// Sub-command of SP and RP.
pub(crate) const PARAMETER: FieldInfo = FieldInfo::integer("parameter", "", U16.0, U16.1);
/// The four bytes of a system parameter as one big-endian number.
pub(crate) const VALUE: FieldInfo = FieldInfo::integer("value", "", 0, u32::MAX as i64);

/// Target of LA.
pub(crate) const ANGLE: FieldInfo =
    FieldInfo::physical("angle_deg", "deg", (POSITION_MIN as i64, POSITION_MAX as i64), TENTHS);
/// Of LR, and measured.
pub(crate) const WIDE_ANGLE: FieldInfo = FieldInfo::physical("angle_deg", "deg", I32, TENTHS);
pub(crate) const REVERSE: FieldInfo = FieldInfo::physical("reverse_deg", "deg", (i16::MIN as i64, 0), TENTHS);
pub(crate) const FORWARD: FieldInfo = FieldInfo::physical("forward_deg", "deg", (0, i16::MAX as i64), TENTHS);
/// The first word of a returned frame 3.
pub(crate) const ABSOLUTE_ANGLE: FieldInfo = FieldInfo::physical("absolute_angle_deg", "deg", I16, TENTHS);

/// In a reply that refuses.
pub(crate) const REFUSED: FieldInfo = FieldInfo::boolean("refused");
/// Bytes of unknown meaning: of unknown commands, and the two positions of a returned frame 3.
pub(crate) const DATA: FieldInfo = FieldInfo::other(FieldKind::Bytes, "data");

pub(crate) const MOTION: &[FieldInfo] = &[SPEED, VOLTAGE, CURRENT];
pub(crate) const CONDITION: &[FieldInfo] = &[FAULTS, MOTOR_TEMPERATURE, DRIVER_TEMPERATURE];
pub(crate) const POSITION: &[FieldInfo] = &[ABSOLUTE_ANGLE, DATA];
