//! The text of the errors for people: what was wrong, what is allowed, the next step.

use core::fmt;

use crate::axis::AxisState;
use crate::can_id::CanId;
use crate::errors::{Error, NoReplyHint, TogetherBar};
use crate::messages::request_name;
use crate::parameters::{self, ValueKind};
use crate::protocol::Protocol;
use crate::value::Quantity;

/// The name of a request, or its number.
struct RequestName(u16);

impl fmt::Display for RequestName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match request_name(self.0) {
            Some(name) => f.write_str(name),
            None => write!(f, "{:#06x}", self.0),
        }
    }
}

/// A number with the unit of its quantity.
struct Amount(f32, Quantity);

impl fmt::Display for Amount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.1.unit() {
            "" => write!(f, "{}", self.0),
            unit => write!(f, "{} {unit}", self.0),
        }
    }
}

/// The motor's own fault word, if it is known.
struct Faults(Option<u16>);

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(word) => write!(f, "fault word {word:#06x}"),
            None => f.write_str("its fault word could not be read"),
        }
    }
}

/// Requests or parameters of another version look the same from here.
const OTHER_VERSION: &str =
    "host and gateway may be of different versions, compare them with hello";

/// Whether nothing between its bounds is allowed: a direction, which is the only signed parameter.
fn takes_only_its_bounds(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Parameter(number) if parameters::kind(number) == Some(ValueKind::Signed))
}

impl fmt::Display for Error {
    #[expect(clippy::too_many_lines, reason = "one line for each error of the table")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::UnknownRequest { number } => {
                write!(f, "the gateway knows no request {number:#06x}; {OTHER_VERSION}")
            }
            Self::BadBody { number } => {
                write!(f, "the body of request {} cannot be read; {OTHER_VERSION}", RequestName(number))
            }
            Self::UnsupportedVersion { gateway_major, host_major } => write!(
                f,
                "the gateway speaks version {gateway_major} of the protocol and the host version \
                {host_major}; update the older of the two"
            ),
            Self::NotInCommand { holder } => write!(
                f,
                "host link {holder} is in command; wait until it releases authority or falls silent \
                 (stop, disarm and e-stop work from here too)"
            ),
            Self::UnknownAxis { axis, max_axes } => {
                write!(f, "there is no axis {axis}; axes are numbered below {max_axes}")
            }
            Self::UnknownBus { bus, buses } => {
                write!(f, "there is no bus {bus}; buses are numbered below {buses}")
            }
            Self::NotConfigured { axis, parameter } => {
                write!(f, "axis {axis} lacks {}; set it first", Quantity::Parameter(parameter))
            }
            // A D5's timeout has a switch and no time.
            Self::OutOfRange { quantity: quantity @ Quantity::MotorTimeout, value, min: 0.0, max: 1.0 } => {
                write!(f, "{quantity} {value} is out of range; allowed are 0 (off) or 1 (on)")
            }
            Self::OutOfRange { quantity, value, min, max } => write!(
                f,
                "{quantity} {} is out of range; allowed are {} {} {}",
                Amount(value, quantity),
                Amount(min, quantity),
                if takes_only_its_bounds(quantity) { "or" } else { "to" },
                Amount(max, quantity)
            ),
            Self::NotANumber { quantity } => {
                write!(f, "{quantity} is not a finite number; give one")
            }
            Self::UnknownParameter { parameter } => {
                write!(f, "no parameter here has the number {parameter}; {OTHER_VERSION}")
            }
            Self::WrongType { parameter } => {
                let quantity = Quantity::Parameter(parameter);
                match parameters::kind(parameter) {
                    Some(kind) => {
                        write!(f, "{quantity} takes another kind of value; give it as {}", kind.name())
                    }
                    None => write!(f, "{quantity} takes another kind of value; {OTHER_VERSION}"),
                }
            }
            Self::NotArmed { axis, state } => write!(f, "axis {axis} is {state}; arm it first"),
            Self::Tripped { axis, reason } => {
                write!(f, "axis {axis} is tripped: {reason}; remove the cause, then clear the axis")
            }
            Self::Stale { now_us, expires_at_us } => write!(
                f,
                "the setpoint expires at {expires_at_us} µs and it is {now_us} µs; send one that expires \
                later, within the axis's TTL"
            ),
            Self::StaleEpoch { current: Some(current) } => write!(
                f,
                "the setpoint belongs to an epoch that is over; use {current}, which arming returned last"
            ),
            Self::StaleEpoch { current: None } => {
                f.write_str("the setpoint belongs to an epoch that is over; arm the axis again")
            }
            Self::Busy { axis } => {
                write!(f, "axis {axis} is carrying out another request; send this one after its reply")
            }
            Self::Unsupported { axis, protocol } => write!(
                f,
                "axis {axis} speaks {protocol}, which has no such command; it {}",
                abilities(protocol)
            ),
            Self::NoReply { axis, hint } => {
                write!(f, "the motor of axis {axis} did not reply; {}", next_step(hint))
            }
            Self::BusOff { bus } => write!(
                f,
                "bus {bus} is off after too many errors; check its cable for a short and its bitrate, it \
                recovers by itself"
            ),
            Self::CannotConfirm { axis } => write!(
                f,
                "the motor of axis {axis} is set so that it could not confirm a stop; give a D5 an \
                acknowledge level above 0, and a thruster a VM that returns something"
            ),
            Self::NotStandstill { axis, velocity_rad_s } => write!(
                f,
                "the motor of axis {axis} turns at {velocity_rad_s} rad/s; let it come to a standstill first"
            ),
            Self::MotorFault { axis, faults } => write!(
                f,
                "the motor of axis {axis} reports a fault, {}; remove its cause first",
                Faults(Some(faults))
            ),
            Self::MotorTimeoutUnknown { axis } => write!(
                f,
                "nothing is known of the timeout of the motor of axis {axis}; provision it, or set \
                 allow_unknown_motor_timeout"
            ),
            Self::EStopped {} => f.write_str("the e-stop is latched; clear the gateway first"),
            Self::BusOverloaded { bus, needed_permille, available_permille } => write!(
                f,
                "this would take {needed_permille} ‰ of bus {bus}, of which {available_permille} ‰ are \
                available; refresh or poll less often, or use a higher bitrate, or have motors \
                send less by themselves"
            ),
            Self::RawNotOpen { bus } => {
                write!(f, "bus {bus} is not open for raw frames; open it first")
            }
            Self::RawOpen { bus } => {
                write!(f, "bus {bus} is open for raw frames; close it first")
            }
            Self::BrakeLocked { axis } => write!(
                f,
                "the brake of the motor of axis {axis} is locked; set release_brake_when_arming, or allow_unverified_brake \
                 too where its firmware does not tell (0x9A byte 3)"
            ),
            Self::RestartOwed { axis } => write!(
                f,
                "the motor of axis {axis} has a new zero point that acts after a restart, and was not seen to restart: have it do so \
                 (0x76), and arm the axis"
            ),
            Self::NotRestarted { axis } => write!(
                f,
                "the motor of axis {axis} was told to restart and did not within 3 s; switch it off and on"
            ),
            Self::BrakeStaysOpen { axis } => write!(
                f,
                "axis {axis} frees its brake when it is armed, and a stop by coast leaves it open: choose hold or brake"
            ),
            Self::NotHolding { axis, state } => {
                write!(f, "axis {axis} is {state}; only the output of a holding motor can be switched off")
            }
            Self::ParameterNeedsProtocol { axis, parameter, protocol } => write!(
                f,
                "{} means something to {protocol} motors only, and that of axis {axis} is another: give it its default, or remove the axis first",
                Quantity::Parameter(parameter)
            ),
            Self::BrakeOn { axis } => write!(
                f,
                "axis {axis} is not armed: register 0x2B of its motor is 1, so it holds by its brake and ignores speeds"
            ),
            Self::CannotStartTogether { axis, reason } => {
                write!(f, "the motors are not started together: axis {axis} {}", together_bar(reason))
            }
            Self::NotACanId { parameter, value } => write!(
                f,
                "{}: 0x{value:X} is no CAN id; there are {}",
                Quantity::Parameter(parameter),
                CanId::ALLOWED
            ),
            Self::NotIdle { axis, state: AxisState::Holding } => {
                write!(
                    f,
                    "axis {axis} is holding and this needs it idle; switch its motor's output off first"
                )
            }
            Self::NotIdle { axis, state } => {
                write!(f, "axis {axis} is {state} and this needs it idle; disarm or clear it first")
            }
            Self::NodeInUse { axis } => {
                write!(f, "axis {axis} has this bus and node; choose another node or remove that axis")
            }
            Self::ProtocolNotOnBus { bus, protocol } => {
                write!(f, "bus {bus} is not configured for {protocol}; configure it so first")
            }
            Self::WrongBusKind { bus, kind } => {
                write!(f, "bus {bus} is {kind}; use a bus of the other kind")
            }
            Self::StopNotConfirmed { axis } => write!(
                f,
                "the motor of axis {axis} has not confirmed its stop; see that it has power and replies, the \
                stop is being repeated"
            ),
            Self::CauseRemains { axis, reason } => {
                write!(f, "what tripped axis {axis} is still there: {reason}; remove it first")
            }
            Self::Refused { axis, faults } => write!(
                f,
                "the motor of axis {axis} refused the command, {}; remove the fault or the limit first",
                Faults(faults)
            ),
            Self::ArmingAborted { axis, state } => {
                write!(f, "arming was interrupted and axis {axis} is {state}; see why, then arm again")
            }
            Self::SpeedLimitZero { axis } => write!(
                f,
                "a position setpoint for axis {axis} needs a speed limit above 0; some motors take 0 as no limit"
            ),
            Self::BusNotConfigured { bus } => {
                write!(f, "bus {bus} is not configured; configure it first")
            }
            Self::QueueFull { bus } => {
                write!(f, "too many frames wait for bus {bus}; send more slowly")
            }
            Self::BusInUse { bus, axis } => {
                write!(f, "axis {axis} on bus {bus} is not idle; disarm or clear it first")
            }
            Self::NothingToClear { axis } => {
                write!(
                    f,
                    "axis {axis} has nothing that this clears: clear needs a trip, clear-unreachable a motor that does not confirm its \
                     stop"
                )
            }
            Self::MotorTimeoutOff { axis } => {
                write!(
                    f,
                    "the timeout of the motor of axis {axis} is off, or longer than 60 s; provision it, or set \
                     allow_no_motor_timeout"
                )
            }
            Self::Superseded { axis } => write!(
                f,
                "a newer setpoint for axis {axis} came before the motor had answered this; send one at a time"
            ),
            Self::NotACommand { axis, protocol } => write!(
                f,
                "axis {axis} speaks {protocol}, and these bytes are no command of that manual or carry a value \
                 that it does not allow; see mgw encode --protocol {} --list",
                protocol.name()
            ),
            Self::NotThisNode { axis, node } => write!(
                f,
                "the bytes are not for node {node}, the motor of axis {axis}; broadcasts and other motors are \
                 reached with raw frames only"
            ),
            Self::CannotCheckLimit { axis, quantity } => write!(
                f,
                "this command does not say what {quantity} the motor of axis {axis} would reach, so that no limit can be kept; use a \
                 setpoint, or a command that says it"
            ),
            Self::EStopInputOpen {} => f.write_str(
                "the e-stop input is open; release its button or mend its cable, then clear the gateway",
            ),
            Self::IdInUse { axis, id, other } => write!(
                f,
                "axis {axis} would be sent frames on CAN id {id}, on which the motor of axis {other} acts or \
                 answers; choose another node or d5_request_id, or another bus"
            ),
            Self::RawNotHarmless { bus } => write!(
                f,
                "the frame may do more than read a motor of bus {bus}; use an axis, or remove the axes of this bus and \
                 open it for unsafe access"
            ),
            Self::AxisOnBus { bus, axis } => {
                write!(
                    f,
                    "axis {axis} is configured on bus {bus}; unsafe raw access needs a bus without axes"
                )
            }
            Self::CannotMeasure { axis, parameter } => write!(
                f,
                "{} would limit nothing on axis {axis}: its motor does not measure that, and takes no such \
                 setpoint; leave it out (a thruster measures positions as a position_device, an RMD torque on CAN)",
                Quantity::Parameter(parameter)
            ),
            Self::BitrateNotOffered { bus, bitrate, offered } => {
                write!(f, "bus {bus} cannot run at {bitrate} bit/s; it offers")?;
                for (index, offered) in offered.iter().filter(|offered| **offered != 0).enumerate() {
                    write!(f, "{} {offered}", if index == 0 { "" } else { "," })?;
                }
                Ok(())
            }
            Self::NeedsOwnBus { bus, protocol } => {
                write!(f, "{protocol} motors share no bus with others; configure bus {bus} for {protocol} alone")
            }
            Self::NoRandomNumber {} => f.write_str(
                "the chip's random generator gave no number at the start, so epochs could repeat and nothing is armed; \
                 start the gateway again, and replace its board if that does not help",
            ),
            Self::Unknown { number } => write!(f, "the gateway answers with error {number}; {OTHER_VERSION}"),
        }
    }
}

/// What motors of a protocol can be asked for; PROTOCOL.md has the table.
fn abilities(protocol: Protocol) -> &'static str {
    match protocol {
        Protocol::Rmd => {
            "takes current, velocity, position and (on CAN) impedance setpoints and stops by coast, hold or brake"
        }
        Protocol::Thruster => {
            "takes signal, velocity and, as a position_device, position setpoints and stops by coast"
        }
        Protocol::D5 => "takes velocity setpoints and stops by hold",
    }
}

fn together_bar(reason: TogetherBar) -> &'static str {
    match reason {
        TogetherBar::TooFew => "would be alone; name two or more",
        TogetherBar::Twice => "is named twice",
        TogetherBar::OtherBus => "is on another bus than the first",
        TogetherBar::SharedBus => {
            "is on a bus that is not declared exclusive, so that motors unknown to the gateway could start too"
        }
        TogetherBar::OtherFrameType => {
            "is asked with CAN ids of another length than the first: no frame reaches both"
        }
        TogetherBar::WriteWaits => {
            "has a speed that waits in its motor and is not to be started; disarm it"
        }
    }
}

fn next_step(hint: NoReplyHint) -> &'static str {
    match hint {
        NoReplyHint::None => {
            "check its power, its cable, its node and the protocol and bitrate of the bus"
        }
        NoReplyHint::AckLevelZero => {
            "it may be at acknowledge level 0, where it answers nothing: set it to 1 or 2"
        }
        NoReplyHint::AckLevelBelow => {
            "it may be at a lower acknowledge level than d5_ack_level says and not answer writes: read register 0x10"
        }
        NoReplyHint::NotAcknowledged => {
            "no node on the bus acknowledges frames: check cable, termination, power and bitrate"
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;

    use super::*;
    use crate::axis::{AxisState, TripReason};

    #[test]
    fn a_text_states_the_value_the_bounds_and_the_unit() {
        let error =
            Error::OutOfRange { quantity: Quantity::Velocity, value: 12.5, min: -10.0, max: 10.0 };
        assert_eq!(
            error.to_string(),
            "velocity 12.5 rad/s is out of range; allowed are -10 rad/s to 10 rad/s"
        );
        let error = Error::OutOfRange {
            quantity: Quantity::Parameter(6),
            value: 1.0,
            min: 5_000.0,
            max: 60_000_000.0,
        };
        assert_eq!(
            error.to_string(),
            "ttl_us 1 µs is out of range; allowed are 5000 µs to 60000000 µs"
        );
        let error =
            Error::OutOfRange { quantity: Quantity::Parameter(4), value: 0.0, min: -1.0, max: 1.0 };
        assert_eq!(error.to_string(), "direction 0 is out of range; allowed are -1 or 1");
        let error = Error::OutOfRange {
            quantity: Quantity::MotorTimeout,
            value: 300.0,
            min: 0.0,
            max: 1.0,
        };
        assert_eq!(
            error.to_string(),
            "motor timeout 300 is out of range; allowed are 0 (off) or 1 (on)"
        );
        assert_eq!(
            Error::WrongType { parameter: 4 }.to_string(),
            "direction takes another kind of value; give it as signed"
        );
    }

    #[test]
    fn a_text_states_the_reason_of_the_trip() {
        let reason =
            TripReason::LimitExceeded { quantity: Quantity::Current, value: 12.0, limit: 10.0 };
        assert_eq!(
            Error::Tripped { axis: 3, reason }.to_string(),
            "axis 3 is tripped: current 12 A is beyond its limit of 10 A; remove the cause, then clear the axis"
        );
        assert_eq!(
            Error::NotArmed { axis: 1, state: AxisState::Tripped { confirmed: false } }.to_string(),
            "axis 1 is tripped, its stop not confirmed; arm it first"
        );
    }

    #[test]
    fn what_has_no_name_here_is_called_by_its_number() {
        let text = Error::BadBody { number: 0x30 }.to_string();
        assert!(text.starts_with("the body of request Arm cannot be read;"), "{text}");
        let text = Error::BadBody { number: 0x0FFF }.to_string();
        assert!(text.starts_with("the body of request 0x0fff cannot be read;"), "{text}");
        assert!(
            Error::NotConfigured { axis: 0, parameter: 999 }.to_string().contains("parameter 999")
        );
    }
}
