//! The one table of the command set: number, request, reply.
//!
//! A new message is one line here and its struct in [`requests`] or
//! [`replies`]. Released messages never change: a new field is a new number.

use core::fmt;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::encode::{EncodeError, write_message};
use crate::errors::{ERRORS, Error, MAX_ERROR_BODY};
use crate::events::{EVENT_BASE, EVENTS, MAX_EVENT_BODY};
use crate::frame::{Kind, MAX_BODY};
use crate::size::MaxSize;
use crate::{replies, requests};

/// A row of a table: a message's number and name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageInfo {
    /// The number in the header.
    pub number: u16,
    /// The name, as in PROTOCOL.md.
    pub name: &'static str,
}

/// A request with the type of its reply.
pub trait Call: Serialize {
    /// The number of both.
    const NUMBER: u16;
    /// What comes back if it was executed.
    type Reply: DeserializeOwned;
}

/// Why a message from the gateway could not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DecodeError {
    /// No reply has this number.
    UnknownNumber {
        /// The number in the header.
        number: u16,
    },
    /// The body is not the one of this number, or bytes follow it.
    BadBody {
        /// The number in the header.
        number: u16,
    },
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownNumber { number } => {
                write!(f, "message with unknown number {number:#06x}")
            }
            Self::BadBody { number } => {
                write!(f, "message {number:#06x} with a body that is not its own")
            }
        }
    }
}

impl core::error::Error for DecodeError {}

/// Reads the whole of `body`; bytes left over are an error.
pub(crate) fn decode_body<T: DeserializeOwned>(number: u16, body: &[u8]) -> Result<T, DecodeError> {
    match postcard::take_from_bytes(body) {
        Ok((value, [])) => Ok(value),
        _ => Err(DecodeError::BadBody { number }),
    }
}

/// The name of the request with this number.
#[must_use]
pub fn request_name(number: u16) -> Option<&'static str> {
    REQUESTS.iter().find(|info| info.number == number).map(|info| info.name)
}

/// Numbers, names and frames of requests or replies; a reply has those of its request.
macro_rules! frames {
    ($kind:ident $($number:literal $name:ident)+) => {
        impl $kind {
            /// The number in the header.
            #[must_use]
            pub const fn number(&self) -> u16 {
                match self { $(Self::$name(_) => $number),+ }
            }

            /// The name of the request, as in the table of PROTOCOL.md.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                match self { $(Self::$name(_) => stringify!($name)),+ }
            }

            $crate::encode::encode_frame!();

            /// Writes the message to where it lies in its frame and returns where it ends, for
            /// [`frame_message`](crate::frame_message).
            ///
            /// # Errors
            /// As [`encode_frame`](Self::encode_frame).
            pub fn write_message(
                &self,
                sequence: u16,
                out: &mut [u8],
            ) -> Result<usize, EncodeError> {
                match self {
                    $(Self::$name(body) => {
                        write_message(Kind::$kind, sequence, $number, body, out)
                    }),+
                }
            }
        }
    };
}

/// Numbers and names of errors or events, and the table of them.
macro_rules! numbered {
    ($kind:ident $table:ident $($number:literal $name:ident)+) => {
        /// The number and the name of each.
        pub const $table: &[$crate::MessageInfo] =
            &[$($crate::MessageInfo { number: $number, name: stringify!($name) }),+];

        impl $kind {
            /// The number in the header.
            #[must_use]
            pub const fn number(&self) -> u16 {
                match self {
                    $(Self::$name { .. } => $number,)+
                    Self::Unknown { number } => *number,
                }
            }

            /// The name, as in the table of PROTOCOL.md.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                match self {
                    $(Self::$name { .. } => stringify!($name),)+
                    Self::Unknown { .. } => "Unknown",
                }
            }
        }
    };
}
pub(crate) use numbered;

/// What holds for a request, whatever its fields: a bit each. Of a native command only its bytes
/// tell.
pub mod class {
    /// Only who has authority may ask for it, and it takes authority that is free.
    pub const COMMANDS: u8 = 1;
    /// Begins what may move a motor, or has something stored that outlives a start: neither goes
    /// with an image on trial, nor while something is stored.
    pub const BEGINS: u8 = 2;
    /// Changes what is stored: it waits while that is under way.
    pub const CHANGES: u8 = 4;
    /// Makes things safer: it is executed each time it comes, whether or not its result has a place
    /// (GUARANTEES G9).
    pub const STOPS: u8 = 8;
}

macro_rules! messages {
    ($($number:literal $name:ident -> $reply:ident [$($class:ident)*])+) => {
        /// Every request.
        #[allow(clippy::large_enum_variant, reason = "there is one at a time, and no heap")]
        #[derive(Debug, Clone, PartialEq, Serialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[serde(rename_all = "snake_case")]
        pub enum Request {
            $(#[doc = concat!("[`", stringify!($name), "`](requests::", stringify!($name), ")")]
                $name(requests::$name)),+
        }

        /// Every reply, named for its request.
        #[derive(Debug, Clone, PartialEq, Serialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[serde(rename_all = "snake_case")]
        pub enum Reply {
            $(#[doc = concat!("To [`", stringify!($name), "`](requests::", stringify!($name), ")")]
                $name(replies::$reply)),+
        }

        /// Every request's number and name.
        pub const REQUESTS: &[MessageInfo] =
            &[$(MessageInfo { number: $number, name: stringify!($name) }),+];

        frames! { Request $($number $name)+ }
        frames! { Reply $($number $name)+ }

        impl Request {
            /// What holds for the request of a number, as bits of [`class`]; nothing where there is
            /// none.
            #[must_use]
            pub const fn classes(number: u16) -> u8 {
                match number {
                    $($number => 0 $(| class::$class)*,)+
                    _ => 0,
                }
            }

            /// Whether it is of one of these [classes](class).
            #[must_use]
            pub const fn is(&self, classes: u8) -> bool {
                Self::classes(self.number()) & classes != 0
            }

            /// The request of a frame with this number and body.
            ///
            /// # Errors
            /// [`Error::UnknownRequest`] or [`Error::BadBody`], which are the answer.
            pub fn decode(number: u16, body: &[u8]) -> Result<Self, Error> {
                match number {
                    $($number => match decode_body(number, body) {
                        Ok(body) => Ok(Self::$name(body)),
                        Err(_) => Err(Error::BadBody { number }),
                    },)+
                    _ => Err(Error::UnknownRequest { number }),
                }
            }
        }

        impl Reply {
            /// The reply of a frame with this number and body.
            ///
            /// # Errors
            /// No request has this number, or the body is not that of its reply.
            pub fn decode(number: u16, body: &[u8]) -> Result<Self, DecodeError> {
                match number {
                    $($number => decode_body(number, body).map(Self::$name),)+
                    _ => Err(DecodeError::UnknownNumber { number }),
                }
            }
        }

        /// The largest of each request and reply, and the bound of its body.
        #[cfg(test)]
        pub(crate) fn largest_ones() -> impl Iterator<Item = ((Request, usize), (Reply, usize))> {
            use crate::largest::Largest;
            [$((
                (Request::$name(Largest::largest()), <requests::$name>::MAX_SIZE),
                (Reply::$name(Largest::largest()), <replies::$reply>::MAX_SIZE),
            )),+]
            .into_iter()
        }

        $(
            impl Call for requests::$name {
                const NUMBER: u16 = $number;
                type Reply = replies::$reply;
            }

            impl From<requests::$name> for Request {
                fn from(request: requests::$name) -> Self {
                    Self::$name(request)
                }
            }

            const _: () = assert!(<requests::$name>::MAX_SIZE <= MAX_BODY, "request too long");
            const _: () = assert!(<replies::$reply>::MAX_SIZE <= MAX_BODY, "reply too long");
        )+
    };
}

messages! {
    0x0001 Hello -> HelloReply []
    0x0002 Ping -> Pong []
    0x0003 TakeAuthority -> Done [COMMANDS]
    0x0004 ReleaseAuthority -> Done []
    0x0005 SetBaud -> Done []

    0x0010 ConfigureGateway -> Done [COMMANDS CHANGES]
    0x0011 ConfigureBus -> Done [COMMANDS CHANGES]
    0x0012 BusStatus -> BusReport []
    0x0013 GatewayStatus -> GatewayReport []
    0x0014 BeginChanges -> Done [COMMANDS CHANGES]
    0x0015 AddChanges -> Done [COMMANDS CHANGES]
    0x0016 ApplyChanges -> Done [COMMANDS CHANGES]
    0x0017 ReadGatewayParameter -> ParameterValue []
    0x0018 SaveConfiguration -> Done [COMMANDS BEGINS]
    0x0019 ForgetStored -> Done [COMMANDS BEGINS]
    0x001A ReadStored -> StoredReport []
    0x001B ReadNames -> NameList []

    0x0020 ConfigureAxis -> Done [COMMANDS CHANGES]
    0x0021 ReadAxisParameter -> ParameterValue []
    0x0022 ListAxes -> AxisList []
    0x0023 RemoveAxis -> Done [COMMANDS CHANGES]
    0x0024 ProvisionMotorTimeout -> MotorTimeoutReport [COMMANDS CHANGES]
    0x0025 ReadAxisSettings -> AxisSettings []

    0x0030 Arm -> Armed [COMMANDS BEGINS]
    0x0031 Disarm -> Done [STOPS]
    0x0032 Stop -> Done [STOPS]
    0x0033 EStop -> Done [STOPS]
    0x0034 Clear -> Done [COMMANDS]
    0x0035 ClearUnreachable -> Done [COMMANDS]
    0x0036 OutputOff -> Done [COMMANDS]
    0x0037 ClearByRestart -> Done [COMMANDS]
    0x0038 ArmTogether -> ArmedTogether [COMMANDS BEGINS]

    0x0040 Setpoint -> Done [COMMANDS]
    0x0041 ReadState -> AxisReport []
    0x0042 MoveRelative -> MoveTarget [COMMANDS]
    0x0043 Native -> NativeReply []
    0x0044 Subscribe -> Done []
    0x0045 StartTogether -> Done [COMMANDS]
    0x0046 Cycle -> CycleReport [COMMANDS]
    0x0047 RunCycle -> Done [COMMANDS]

    0x0050 RawOpen -> Done [COMMANDS BEGINS]
    0x0051 RawSend -> Done [COMMANDS]
    0x0052 RawReceive -> RawFrames [COMMANDS]
    0x0053 RawClose -> Done [COMMANDS]

    0x0060 ReadIncidents -> IncidentPage []
    0x0061 ReadCrashReport -> CrashReport []
    0x0062 ReadFlightRecord -> FlightRecordPage []

    0x0072 Recognise -> Recognition []
    0x0073 RawOpenAt -> Done [COMMANDS]

    0x0080 ReadImage -> ImageReport []
    0x0081 BeginImage -> Done [COMMANDS BEGINS]
    0x0082 WriteImage -> Done [COMMANDS BEGINS]
    0x0083 FinishImage -> Done [COMMANDS BEGINS]
    0x0084 ConfirmImage -> Done [COMMANDS CHANGES]
}

const _: () = assert!(MAX_ERROR_BODY <= MAX_BODY, "error longer than a message");
const _: () = assert!(MAX_EVENT_BODY <= MAX_BODY, "event longer than a message");
const _: () =
    assert!(ascending(REQUESTS, 1, EVENT_BASE - 1), "a request's number is taken or an event's");
const _: () = assert!(ascending(ERRORS, 1, u16::MAX), "an error's number is taken");
const _: () =
    assert!(ascending(EVENTS, EVENT_BASE, u16::MAX), "an event's number is taken or a request's");

/// Whether the numbers of `table` rise and stay within bounds; rising, none comes twice.
const fn ascending(table: &[MessageInfo], min: u16, max: u16) -> bool {
    let mut lowest = min as u32;
    let mut rest = table;
    while let [first, others @ ..] = rest {
        if (first.number as u32) < lowest || first.number > max {
            return false;
        }
        lowest = first.number as u32 + 1;
        rest = others;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn row(number: u16) -> MessageInfo {
        MessageInfo { number, name: "" }
    }

    #[test]
    fn a_number_that_comes_twice_is_found() {
        assert!(ascending(&[row(1), row(2), row(5)], 1, 5));
        assert!(!ascending(&[row(1), row(2), row(2)], 1, 5));
        assert!(!ascending(&[row(1), row(6)], 1, 5));
        assert!(!ascending(&[row(0), row(6)], 1, 6));
    }

    #[test]
    fn an_unknown_number_and_a_bad_body_are_told_apart() {
        assert_eq!(Request::decode(0x7777, &[]), Err(Error::UnknownRequest { number: 0x7777 }));
        assert_eq!(Request::decode(0x0030, &[]), Err(Error::BadBody { number: 0x0030 }));
        assert_eq!(Request::decode(0x0030, &[4, 0]), Err(Error::BadBody { number: 0x0030 }));
        assert_eq!(Request::decode(0x0030, &[4]), Ok(Request::Arm(requests::Arm { axis: 4 })));
        assert_eq!(Reply::decode(0x7777, &[]), Err(DecodeError::UnknownNumber { number: 0x7777 }));
        assert_eq!(Reply::decode(0x0033, &[0]), Err(DecodeError::BadBody { number: 0x0033 }));
        assert_eq!(Error::decode(999, &[1, 2, 3]), Ok(Error::Unknown { number: 999 }));
    }

    #[test]
    fn every_error_number_belongs_to_its_name() {
        assert_eq!((Error::EStopped {}.number(), Error::EStopped {}.name()), (24, "EStopped"));
        assert_eq!(request_name(0x0035), Some("ClearUnreachable"));
    }
}
