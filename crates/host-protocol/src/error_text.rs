//! Parts of the texts of the errors.

use core::fmt;

use crate::axis::AxisState;
use crate::bus::MAX_BITRATES;
use crate::errors::{NoReplyHint, TogetherBar};
use crate::messages::request_name;
use crate::parameters::{self, AxisParameter, ValueKind};
use crate::protocol::Protocol;
use crate::value::Quantity;

/// The name of a request, or its number.
pub struct RequestName(pub u16);

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
pub struct Faults(pub Option<u16>);

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(word) => write!(f, "fault word {word:#06x}"),
            None => f.write_str("its fault word could not be read"),
        }
    }
}

/// A command that not every dialect has.
pub struct DialectCommand(pub u8);

impl fmt::Display for DialectCommand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => f.write_str("motion mode"),
            command => write!(f, "command {command:#04X}"),
        }
    }
}

/// The dialects of RMD motors, by their numbers in `rmd_dialect`.
const DIALECTS: [&str; 7] = ["unknown", "v3_6", "v3_7", "v3_9", "v4_2", "v4_3", "v4_4"];

/// A dialect, by its number.
pub struct DialectName(pub u8);

impl fmt::Display for DialectName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(DIALECTS.get(usize::from(self.0)).copied().unwrap_or(OTHER_VERSION))
    }
}

/// How a motor answers: a bit for each dialect that it may speak.
pub struct AsDialects(pub u8);

impl fmt::Display for AsDialects {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "as one of ";
        for (name, _) in DIALECTS.iter().zip(0u8..).filter(|(_, bit)| self.0 >> bit & 1 != 0) {
            write!(f, "{separator}{name}")?;
            separator = ", ";
        }
        if self.0 == 0 { f.write_str("now in one way, now in another") } else { Ok(()) }
    }
}

/// Requests or parameters of another version look the same from here.
pub const OTHER_VERSION: &str =
    "host and gateway may be of different versions, compare them with hello";

/// A value outside its bounds.
pub struct Bounds {
    pub quantity: Quantity,
    pub value: f32,
    pub min: f32,
    pub max: f32,
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { quantity, value, min, max } = *self;
        // A D5's timeout has a switch and no time.
        if let (Quantity::MotorTimeout, 0.0, 1.0) = (quantity, min, max) {
            return write!(f, "{quantity} {value} is out of range; allowed are 0 (off) or 1 (on)");
        }
        // The row of its axis says another level than the motor has.
        let is_level = quantity == Quantity::Parameter(AxisParameter::D5AckLevel.number());
        if is_level && min == max {
            return write!(
                f,
                "the motor is at acknowledge level {value}, and {quantity} of its axis says {min}; \
                 set one of them to the other"
            );
        }
        // A thruster stands or has a least speed; a limit of velocity is one of both directions.
        if quantity == Quantity::Velocity && (min > 0.0 || max < 0.0) {
            let (value, least) =
                (Amount(value, quantity), Amount(min.abs().min(max.abs()), quantity));
            let most = Amount(min.abs().max(max.abs()), quantity);
            return write!(
                f,
                "{quantity} {value} is out of range; allowed are 0, and {least} to {most} in either \
                 direction"
            );
        }
        let [value, min, max] = [value, min, max].map(|number| Amount(number, quantity));
        // Of a direction, the only signed parameter, only the bounds are allowed.
        let is_signed = matches!(quantity, Quantity::Parameter(number)
            if parameters::kind(number) == Some(ValueKind::Signed));
        let between = if is_signed { "or" } else { "to" };
        write!(f, "{quantity} {value} is out of range; allowed are {min} {between} {max}")
    }
}

/// How to give a value of the parameter with this number.
pub struct KindOf(pub u16);

impl fmt::Display for KindOf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match parameters::kind(self.0) {
            Some(kind) => write!(f, "give it as {}", kind.name()),
            None => f.write_str(OTHER_VERSION),
        }
    }
}

/// A list of bitrates, 0 behind the last one.
pub struct Offered(pub [u32; MAX_BITRATES]);

impl fmt::Display for Offered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for bitrate in self.0.iter().filter(|bitrate| **bitrate != 0) {
            write!(f, "{separator} {bitrate}")?;
            separator = ",";
        }
        Ok(())
    }
}

/// How an axis in this state becomes idle.
pub fn way_to_idle(state: AxisState) -> &'static str {
    match state {
        AxisState::Holding => "switch its motor's output off",
        _ => "disarm or clear it",
    }
}

/// What motors of a protocol can be asked for; PROTOCOL.md has the table.
pub fn abilities(protocol: Protocol) -> &'static str {
    match protocol {
        Protocol::Rmd => {
            "takes current, velocity, position and (on CAN) impedance setpoints and stops by \
             coast, hold or brake"
        }
        Protocol::Thruster => {
            "takes signal, velocity and, as a position_device, position setpoints and stops by \
             coast"
        }
        Protocol::D5 => "takes velocity setpoints and stops by hold",
    }
}

/// Why several motors are not started by one frame, of the axis in question.
pub fn together_bar(reason: TogetherBar) -> &'static str {
    match reason {
        TogetherBar::TooFew => "would be alone; name two or more",
        TogetherBar::Twice => "is named twice",
        TogetherBar::OtherBus => "is on another bus than the first",
        TogetherBar::SharedBus => {
            "is on a bus that is not declared exclusive, so that motors unknown to the gateway \
             could start too"
        }
        TogetherBar::OtherFrameType => {
            "is asked with CAN ids of another length than the first: no frame reaches both"
        }
        TogetherBar::WriteWaits => {
            "has a speed that waits in its motor and is not to be started; disarm it"
        }
    }
}

/// What to do about a motor that does not reply.
pub fn next_step(hint: NoReplyHint) -> &'static str {
    match hint {
        NoReplyHint::None => {
            "check its power, its cable, its node and the protocol and bitrate of the bus"
        }
        NoReplyHint::AckLevelZero => {
            "it may be at acknowledge level 0, where it answers nothing: set it to 1 or 2"
        }
        NoReplyHint::AckLevelBelow => {
            "it may be at a lower acknowledge level than d5_ack_level says and not answer writes: \
             read register 0x10"
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
    use crate::axis::TripReason;
    use crate::errors::Error;

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

    /// Of a D5 and of a thruster, whose ranges two numbers do not say by themselves.
    #[test]
    fn a_level_of_the_motor_and_the_least_speed_are_told_as_what_they_are() {
        let quantity = Quantity::Parameter(AxisParameter::D5AckLevel.number());
        let error = Error::OutOfRange { quantity, value: 1.0, min: 2.0, max: 2.0 };
        assert_eq!(
            error.to_string(),
            "the motor is at acknowledge level 1, and d5_ack_level of its axis says 2; set one of \
             them to the other"
        );
        let error = Error::OutOfRange { quantity, value: 3.0, min: 0.0, max: 2.0 };
        assert_eq!(error.to_string(), "d5_ack_level 3 is out of range; allowed are 0 to 2");
        let quantity = Quantity::Velocity;
        for (value, min, max) in [(1.0, 3.25, 3431.5), (-1.0, -3431.5, -3.25)] {
            let error = Error::OutOfRange { quantity, value, min, max };
            let told = "is out of range; allowed are 0, and 3.25 rad/s to 3431.5 rad/s in either \
                direction";
            assert!(error.to_string().ends_with(told), "{error}");
        }
    }

    #[test]
    fn a_text_states_the_reason_of_the_trip() {
        let reason =
            TripReason::LimitExceeded { quantity: Quantity::Current, value: 12.0, limit: 10.0 };
        assert_eq!(
            Error::Tripped { axis: 3, reason }.to_string(),
            "axis 3 is tripped: current 12 A is beyond its limit of 10 A; remove the cause, then \
             clear the axis"
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
