//! The parameters of an axis and of the gateway: one table each, with number, name, bounds and
//! default.
//!
//! The two tables share one space of numbers, so that a number in an error names exactly one
//! parameter.

use core::fmt;

use crate::can_id::CanId;
use crate::errors::Error;
use crate::value::{Quantity, Value};

/// The kind of value a parameter takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ValueKind {
    /// [`Value::Bool`]
    Bool,
    /// [`Value::Unsigned`]
    Unsigned,
    /// [`Value::Signed`]
    Signed,
    /// [`Value::Float`]
    Float,
}

impl ValueKind {
    /// The name, in lower case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::Unsigned => "unsigned",
            Self::Signed => "signed",
            Self::Float => "float",
        }
    }
}

/// What a parameter can be; all that a gateway needs to know of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterInfo {
    /// The number on the wire.
    pub number: u16,
    /// The kind of value it takes.
    pub kind: ValueKind,
    /// The value in force until one is set.
    pub default: Option<Value>,
    /// The smallest value allowed.
    pub min: Value,
    /// The largest value allowed.
    pub max: Value,
    /// Whether the axis stays `Unconfigured` without it.
    pub required: bool,
}

/// What people call a parameter. Apart from [`ParameterInfo`], so that no firmware carries the
/// texts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParameterText {
    /// The name, with its unit.
    pub name: &'static str,
    /// The unit; empty where it has none.
    pub unit: &'static str,
    /// What it means.
    pub doc: &'static str,
}

impl ParameterInfo {
    /// Whether `value` is one that this parameter can have.
    ///
    /// # Errors
    /// [`Error::WrongType`], [`Error::NotANumber`], [`Error::NotACanId`] or [`Error::OutOfRange`]
    /// with the bounds.
    pub fn check(&self, value: Value) -> Result<(), Error> {
        let inside = match (value, self.min, self.max) {
            (Value::Bool(_), Value::Bool(_), Value::Bool(_)) => true,
            (Value::Unsigned(value), Value::Unsigned(min), Value::Unsigned(max)) => {
                if self.is_can_id() && CanId::from_wire(value).is_none() {
                    return Err(Error::NotACanId { parameter: self.number, value });
                }
                (min..=max).contains(&value)
            }
            // The only signed parameter is a direction: one of its two bounds and nothing between.
            (Value::Signed(value), Value::Signed(min), Value::Signed(max)) => {
                value == min || value == max
            }
            (Value::Float(value), Value::Float(_), Value::Float(_)) if value.is_nan() => {
                return Err(Error::NotANumber { quantity: Quantity::Parameter(self.number) });
            }
            (Value::Float(value), Value::Float(min), Value::Float(max)) => {
                (min..=max).contains(&value)
            }
            _ => return Err(Error::WrongType { parameter: self.number }),
        };
        if inside { Ok(()) } else { Err(self.out_of_range(value)) }
    }

    /// Whether its values are ids of CAN frames, as the numbers of [`CanId::to_wire`].
    #[must_use]
    pub const fn is_can_id(&self) -> bool {
        self.number == AxisParameter::D5RequestId.number()
            || self.number == AxisParameter::D5ReplyId.number()
    }

    fn out_of_range(&self, value: Value) -> Error {
        Error::OutOfRange {
            quantity: Quantity::Parameter(self.number),
            value: approximate(value),
            min: approximate(self.min),
            max: approximate(self.max),
        }
    }
}

/// `value` as errors state it: rounded to 24 significant bits.
#[expect(clippy::cast_precision_loss, reason = "for people to read")]
fn approximate(value: Value) -> f32 {
    match value {
        Value::Bool(value) => f32::from(u8::from(value)),
        Value::Unsigned(value) => value as f32,
        Value::Signed(value) => value as f32,
        Value::Float(value) => value,
    }
}

/// The default of a row: a value, `required` or `optional`.
macro_rules! default_of {
    ($kind:ident required) => {
        None
    };
    ($kind:ident optional) => {
        None
    };
    ($kind:ident $default:expr) => {
        Some(Value::$kind($default))
    };
}

macro_rules! is_required {
    (required) => {
        true
    };
    ($other:tt) => {
        false
    };
}

macro_rules! parameters {
    (
        $(#[$meta:meta])*
        $name:ident;
        $(
            $(#[doc = $doc:literal])+
            $number:literal $variant:ident $text:literal:
                $kind:ident($unit:literal) [$min:expr, $max:expr] $default:tt;
        )+
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u16)]
        pub enum $name { $($(#[doc = $doc])+ $variant = $number),+ }

        impl $name {
            /// Every parameter, in the order of their numbers.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The number on the wire.
            #[must_use]
            pub const fn number(self) -> u16 {
                self as u16
            }

            /// The place in [`ALL`](Self::ALL), from 0. Numbers may have gaps between them, places
            /// have none.
            #[must_use]
            pub const fn place(self) -> usize {
                enum Place { $($variant),+ }
                match self { $(Self::$variant => Place::$variant as usize),+ }
            }

            /// The parameter with this number.
            #[must_use]
            pub const fn from_number(number: u16) -> Option<Self> {
                match number { $($number => Some(Self::$variant),)+ _ => None }
            }

            /// The parameter with this name.
            #[must_use]
            pub fn from_name(name: &str) -> Option<Self> {
                match name { $($text => Some(Self::$variant),)+ _ => None }
            }

            /// What it can be.
            #[must_use]
            pub const fn info(self) -> &'static ParameterInfo {
                match self {
                    $(Self::$variant => {
                        const INFO: &ParameterInfo = &ParameterInfo {
                            number: $number,
                            kind: ValueKind::$kind,
                            default: default_of!($kind $default),
                            min: Value::$kind($min),
                            max: Value::$kind($max),
                            required: is_required!($default),
                        };
                        INFO
                    })+
                }
            }

            /// What people call it.
            #[must_use]
            pub const fn text(self) -> &'static ParameterText {
                match self {
                    $(Self::$variant => {
                        const TEXT: &ParameterText = &ParameterText {
                            name: $text,
                            unit: $unit,
                            doc: concat!($($doc),+).trim_ascii(),
                        };
                        TEXT
                    })+
                }
            }

            /// Whether `value` is one that this parameter can have.
            ///
            /// # Errors
            /// [`Error::WrongType`], [`Error::NotANumber`], [`Error::NotACanId`] or
            /// [`Error::OutOfRange`] with the bounds.
            pub fn check(self, value: Value) -> Result<(), Error> {
                self.info().check(value)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.text().name)
            }
        }
    };
}

parameters! {
    /// A parameter of an axis.
    AxisParameter;

    /// Number of the bus that the motor is on.
    1 Bus "bus": Unsigned("") [0, 7] required;
    /// What the motor speaks: 1 rmd, 2 thruster, 3 d5.
    2 Protocol "protocol": Unsigned("") [1, 3] required;
    /// The motor's id on its bus, as its manual counts it.
    3 Node "node": Unsigned("") [1, 253] required;
    /// −1 turns the sense of rotation around, 1 keeps it; nothing else.
    4 Direction "direction": Signed("") [-1, 1] 1;
    /// What a stop does: 1 coast, 2 hold, 3 brake.
    5 StopAction "stop_action": Unsigned("") [1, 3] required;
    /// How far ahead a setpoint may expire.
    6 TtlUs "ttl_us": Unsigned("µs") [5_000, 60_000_000] 100_000;
    /// How often a setpoint in force is sent to the motor again; at least every third of the
    /// motor's own timeout, every 20 ms where that is unknown, as a D5's is: it can be switched on
    /// and off, and nothing tells how long it is.
    7 RefreshUs "refresh_us": Unsigned("µs") [1_000, 1_000_000] 20_000;
    /// How often the fault word of an armed axis is read.
    8 FaultPollUs "fault_poll_us": Unsigned("µs") [20_000, 1_000_000] 100_000;
    /// How often the position of the motor is read, and one other value beside it.
    9 StatePollUs "state_poll_us": Unsigned("µs") [5_000, 1_000_000] 50_000;
    /// Missing replies in a row that trip the axis.
    10 MissedReplies "missed_replies": Unsigned("") [2, 20] 3;
    /// Up to this speed the motor counts as standing; at least one unit of its reading: 1 °/s of an
    /// RMD and a D5, 1 rpm of a thruster.
    11 StandstillRadS "standstill_rad_s": Float("rad/s") [0.0, 10.0] 0.105;
    /// Unconfirmed stops after which the motor counts as unreachable.
    12 StopsBeforeUnreachable "stops_before_unreachable": Unsigned("") [3, 100] 10;
    /// How often a confirmed stop is repeated while the axis is tripped.
    13 StopRepeatUs "stop_repeat_us": Unsigned("µs") [100_000, 5_000_000] 500_000;
    /// The largest speed, in setpoints and measured.
    14 VelocityLimitRadS "velocity_limit_rad_s": Float("rad/s") [0.0, 10_000.0] optional;
    /// The largest current, in setpoints and measured.
    15 CurrentLimitA "current_limit_a": Float("A") [0.0, 1_000.0] optional;
    /// The lowest position, in setpoints and measured.
    16 PositionMinRad "position_min_rad": Float("rad") [-1e6, 1e6] optional;
    /// The highest position, in setpoints and measured.
    17 PositionMaxRad "position_max_rad": Float("rad") [-1e6, 1e6] optional;
    /// The largest fraction of the full signal in setpoints.
    18 SignalLimit "signal_limit": Float("") [0.0, 1.0] optional;
    /// The highest temperature of motor or driver.
    19 TemperatureLimitC "temperature_limit_c": Float("°C") [-40.0, 200.0] optional;
    /// How far beyond a limit a measured value may be before it trips the axis, as a fraction of
    /// the limit, for positions of at least 1 rad.
    20 LimitMargin "limit_margin": Float("") [0.0, 1.0] 0.1;
    /// Lets the axis arm though nothing is known of the motor's own timeout.
    21 AllowUnknownMotorTimeout "allow_unknown_motor_timeout": Bool("") [false, true] false;
    /// D5: the acknowledge level that the motor is set to.
    22 D5AckLevel "d5_ack_level": Unsigned("") [0, 2] 2;
    /// D5: CAN id of requests, of 11 bits, or with bit 31 set of 29, where it is not the number of
    /// the motor as one of 11 bits. The manual gives neither ids nor frame type: that it is this
    /// number is an assumption.
    23 D5RequestId "d5_request_id": Unsigned("") [0, 0x9FFF_FFFF] optional;
    /// D5: CAN id of replies, of 11 bits, or with bit 31 set of 29; without it any will do, as the
    /// frame itself names its motor. That a reply has the id of its request is an assumption.
    24 D5ReplyId "d5_reply_id": Unsigned("") [0, 0x9FFF_FFFF] optional;
    /// Thruster protocol: the device has an encoder.
    25 PositionDevice "position_device": Bool("") [false, true] false;
    /// Lets arming release a mechanical brake.
    26 ReleaseBrakeWhenArming "release_brake_when_arming": Bool("") [false, true] false;
    /// Unsafe: setpoints do not expire; only a silent host link stops the motor.
    27 UnsafeInfiniteTtl "unsafe_infinite_ttl": Bool("") [false, true] false;
    /// The largest torque, in impedance setpoints and measured.
    28 TorqueLimitNm "torque_limit_nm": Float("N·m") [0.0, 10_000.0] optional;
    /// RMD motion mode: the position that the ends of its range stand for, to both sides of zero.
    29 MotionPositionRad "motion_position_rad": Float("rad") [0.1, 1_000.0] 12.5;
    /// RMD motion mode: the velocity that the ends of its range stand for, to both sides of zero.
    30 MotionVelocityRadS "motion_velocity_rad_s": Float("rad/s") [0.1, 1_000.0] 45.0;
    /// RMD motion mode: the torque that the ends of its range stand for, to both sides of zero.
    31 MotionTorqueNm "motion_torque_nm": Float("N·m") [0.1, 10_000.0] 24.0;
    /// RMD motion mode: the stiffness that the upper end of its range stands for.
    32 MotionStiffness "motion_stiffness_nm_per_rad": Float("N·m/rad") [0.1, 10_000.0] 500.0;
    /// RMD motion mode: the damping that the upper end of its range stands for.
    33 MotionDamping "motion_damping_nm_s_per_rad": Float("N·m·s/rad") [0.01, 1_000.0] 5.0;
    /// Axes with the same number trip together, and none of them is armed while another is tripped.
    34 TripGroup "trip_group": Unsigned("") [1, 32] optional;
    /// Lets the axis arm though the motor's own timeout is off, or longer than 60 s.
    35 AllowNoMotorTimeout "allow_no_motor_timeout": Bool("") [false, true] false;
    /// Above this speed an armed axis without a setpoint trips; 5 times standstill_rad_s unless
    /// set.
    36 UncommandedRadS "uncommanded_rad_s": Float("rad/s") [0.0, 10_000.0] optional;
    /// Lets the motor of an armed axis turn without a setpoint: by hand, by wind or water.
    37 AllowUncommanded "allow_uncommanded": Bool("") [false, true] false;
    /// RMD: what the motor says of its brake (0x9A byte 3) is not believed, as newer firmware does
    /// not tell: an echoed 0x77 counts as released, an echoed 0x78 and 1 s as locked.
    38 AllowUnverifiedBrake "allow_unverified_brake": Bool("") [false, true] false;
    /// Thruster protocol: bytes 5 to 7 of the SR that the device is set to, as one number: 0x10000,
    /// 0x20000 and 0x40000 for the frames 1, 2 and 3 that it sends by itself, plus the milliseconds
    /// between them. The load of the bus counts them; a native SR that the device takes sets it.
    39 Stream "stream": Unsigned("") [0, 0xFF_FFFF] 0;
    /// Thruster protocol: over-voltage, under-voltage and a broken temperature sensor, which the
    /// device only reports, bar arming and trip like its faults. A broken sensor does anyway where
    /// the axis has temperature_limit_c.
    44 WarningsAreFaults "warnings_are_faults": Bool("") [false, true] false;
    /// Thruster protocol: bytes 6 and 7 of the VM that the device is set to, as one number. 0: it
    /// echoes; 0x0001 to 0x0007: frames with a header; 0x0200 to 0x0207: one frame without; with
    /// bit 8 it returns nothing and cannot be armed. A native VM that the device takes sets it.
    45 ReturnMode "return_mode": Unsigned("") [0, 0x0307] 0;
    /// RMD: the version of the protocol that the motor speaks: 0 unknown, 1 v3_6, 2 v3_7 (and 3.8),
    /// 3 v3_9 (to 4.1), 4 v4_2, 5 v4_3, 6 v4_4. Native commands and impedance follow it; unknown
    /// has what all versions have in common.
    46 RmdDialect "rmd_dialect": Unsigned("") [0, 6] 1;
    /// RMD of v4_3 and v4_4: with every velocity and position setpoint the motor is told to keep
    /// its torque below this part of its rated current. Above its stall current nothing is capped.
    47 TorqueCap "torque_cap_percent": Unsigned("%") [1, 255] optional;
}

parameters! {
    /// A parameter of the gateway.
    GatewayParameter;

    /// Without a valid request from the host in command for this long, every axis stops.
    0x0100 LinkSilenceUs "link_silence_us": Unsigned("µs") [50_000, 10_000_000] 250_000;
}

/// How long a reply may be awaited on a bus, at least and at most, µs.
pub const REPLY_WINDOW_US: (u32, u32) = (100, 200_000);

/// The parameter with this number, of an axis or of the gateway.
fn find(number: u16) -> Option<&'static ParameterInfo> {
    let axis = AxisParameter::from_number(number).map(AxisParameter::info);
    axis.or_else(|| GatewayParameter::from_number(number).map(GatewayParameter::info))
}

fn text(number: u16) -> Option<&'static ParameterText> {
    let axis = AxisParameter::from_number(number).map(AxisParameter::text);
    axis.or_else(|| GatewayParameter::from_number(number).map(GatewayParameter::text))
}

/// The name of the parameter with this number, of an axis or of the gateway.
#[must_use]
pub fn name(number: u16) -> Option<&'static str> {
    text(number).map(|text| text.name)
}

/// The unit of the parameter with this number, of an axis or of the gateway.
#[must_use]
pub fn unit(number: u16) -> Option<&'static str> {
    text(number).map(|text| text.unit)
}

/// The kind of value that the parameter with this number takes.
#[must_use]
pub fn kind(number: u16) -> Option<ValueKind> {
    find(number).map(|info| info.kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every_parameter() -> impl Iterator<Item = &'static ParameterInfo> {
        let axis = AxisParameter::ALL.iter().map(|parameter| parameter.info());
        axis.chain(GatewayParameter::ALL.iter().map(|parameter| parameter.info()))
    }

    #[test]
    fn numbers_and_names_are_unique() {
        for (index, info) in every_parameter().enumerate() {
            assert_eq!(find(info.number), Some(info));
            let is_other = |other: &ParameterInfo| name(other.number) != name(info.number);
            assert!(every_parameter().take(index).all(is_other), "{:?}", name(info.number));
        }
    }

    #[test]
    fn a_parameter_is_at_its_place() {
        for (index, parameter) in AxisParameter::ALL.iter().enumerate() {
            assert_eq!(parameter.place(), index, "{parameter}");
        }
    }

    #[test]
    fn every_default_and_both_bounds_pass_the_check() {
        for info in every_parameter() {
            for value in info.default.into_iter().chain([info.min, info.max]) {
                assert_eq!(info.check(value), Ok(()), "{:?}", name(info.number));
            }
            assert!(!info.required || info.default.is_none(), "{:?}", name(info.number));
        }
    }

    #[test]
    fn a_refused_value_is_named_with_its_bounds() {
        let ttl = AxisParameter::TtlUs;
        assert_eq!(
            ttl.check(Value::Unsigned(4_999)),
            Err(Error::OutOfRange {
                quantity: Quantity::Parameter(6),
                value: 4_999.0,
                min: 5_000.0,
                max: 60_000_000.0
            })
        );
        assert_eq!(ttl.check(Value::Signed(5_000)), Err(Error::WrongType { parameter: 6 }));
        assert_eq!(
            AxisParameter::SignalLimit.check(Value::Float(f32::NAN)),
            Err(Error::NotANumber { quantity: Quantity::Parameter(18) })
        );
        assert!(AxisParameter::SignalLimit.check(Value::Float(f32::INFINITY)).is_err());
        assert!(AxisParameter::Direction.check(Value::Signed(0)).is_err());
    }

    #[test]
    fn a_value_between_the_ids_of_11_and_of_29_bits_is_no_id() {
        for parameter in [AxisParameter::D5RequestId, AxisParameter::D5ReplyId] {
            for id in [0, 0x7FF, 0x8000_0000, 0x9FFF_FFFF] {
                assert_eq!(parameter.check(Value::Unsigned(id)), Ok(()), "{id:#X}");
            }
            for value in [0x800, 0x7FFF_FFFF, 0xA000_0000, u32::MAX] {
                let refusal = Error::NotACanId { parameter: parameter.number(), value };
                assert_eq!(parameter.check(Value::Unsigned(value)), Err(refusal), "{value:#X}");
            }
        }
    }

    #[test]
    fn the_stop_action_has_no_default() {
        let info = AxisParameter::StopAction.info();
        assert!(info.required && info.default.is_none());
    }

    #[test]
    fn the_text_of_a_parameter_is_its_documentation() {
        assert_eq!(
            AxisParameter::PositionDevice.text().doc,
            "Thruster protocol: the device has an encoder."
        );
    }
}
