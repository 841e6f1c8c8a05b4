//! What a thruster returns for TC and VC instead of the echo, as its VM is set (Thruster manual
//! §2.4; PROTOCOL-NOTES T8, T9, T22).

use super::convert;
use crate::axis::{AxisConfig, Observation};
use host_protocol::AxisParameter;
use thruster::{
    Deciamps, Decivolts, Headerless, Request, ReturnFlags, ReturnFrames, ReturnedFrame, Rpm,
};

/// What answers TC and VC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ReturnMode {
    /// The echo, which says the value that was taken.
    Echo,
    /// These frames with a header. Exactly one of them acknowledges: the lowest that is asked for.
    Frames(ReturnFrames),
    /// One frame without a header.
    Headerless,
    /// Nothing.
    Nothing,
}

impl ReturnMode {
    /// The mode that the axis says its device is set to: bytes 6 and 7 of VM.
    pub fn of(config: &AxisConfig) -> Self {
        let word = config.unsigned(AxisParameter::ReturnMode).unwrap_or_default();
        let [.., flags, frames] = word.to_be_bytes();
        let (flags, frames) =
            (ReturnFlags::from_bits_truncate(flags), ReturnFrames::from_bits_truncate(frames));
        if flags.contains(ReturnFlags::NO_RETURN) {
            Self::Nothing
        } else if flags.contains(ReturnFlags::NO_HEADER) {
            Self::Headerless
        } else if frames.is_empty() {
            Self::Echo
        } else {
            Self::Frames(frames)
        }
    }

    /// Whether a frame with a header acknowledges TC or VC. With several for one command the others
    /// could be taken for the acknowledgement of the next.
    pub fn acknowledges(self, frame: &ReturnedFrame) -> bool {
        let Self::Frames(frames) = self else { return false };
        u32::from(frame.number()) == frames.bits().trailing_zeros() + 1
    }

    /// Whether the same reply may answer two different requests: a returned frame does not say the
    /// value that was taken, and one without a header not even the command.
    pub fn answers_alike(self, one: &Request, other: &Request) -> bool {
        match self {
            Self::Echo | Self::Nothing => false,
            Self::Frames(_) => is_motion(one) && one.command() == other.command(),
            Self::Headerless => is_motion(one) && is_motion(other),
        }
    }

    /// How many frames answer one TC or VC.
    pub fn count(self) -> u8 {
        match self {
            Self::Frames(frames) => u8::try_from(frames.bits().count_ones()).unwrap_or(u8::MAX),
            Self::Echo | Self::Headerless | Self::Nothing => 1,
        }
    }
}

/// Whether VM changes what answers this request: signal and speed.
pub(super) fn is_motion(request: &Request) -> bool {
    matches!(request, Request::Signal { .. } | Request::Speed { .. })
}

/// What a frame without a header tells.
pub(super) fn of_headerless(told: &Headerless, sign: f32) -> Observation {
    let Headerless { speed, voltage, current, faults } = *told;
    Observation { faults: Some(faults.bits()), ..motion_of(speed, voltage, current, sign) }
}

/// Speed, voltage and current as one frame tells them.
fn motion_of(speed: Rpm, voltage: Decivolts, current: Deciamps, sign: f32) -> Observation {
    Observation {
        velocity_rad_s: Some(sign * convert::rpm_to_rad_s(i32::from(speed.0))),
        voltage_v: Some(convert::from_tenths(i32::from(voltage.0))),
        current_a: Some(sign * convert::from_tenths(i32::from(current.0))),
        ..Observation::default()
    }
}

/// What a frame with a header tells.
pub(super) fn of_frame(frame: &ReturnedFrame, sign: f32) -> Observation {
    match *frame {
        ReturnedFrame::Motion { speed, voltage, current } => {
            motion_of(speed, voltage, current, sign)
        }
        ReturnedFrame::Condition { faults, motor_temperature, driver_temperature } => Observation {
            faults: Some(faults.bits()),
            motor_temperature_c: Some(f32::from(motor_temperature.0)),
            driver_temperature_c: Some(f32::from(driver_temperature.0)),
            ..Observation::default()
        },
        // How six bytes hold the two positions is not given (T9).
        ReturnedFrame::Position { .. } => Observation::default(),
    }
}
