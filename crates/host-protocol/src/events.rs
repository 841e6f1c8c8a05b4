//! The events: what a gateway says without being asked. One table of number, name and fields.

use crate::axis::{AxisState, FaultReading, Reading, Trip};
use crate::bus::BusState;
use crate::encode::{EncodeError, encode};
use crate::field_doc::field_doc;
use crate::frame::Kind;
use crate::messages::{DecodeError, decode_body, numbered};
use crate::protocol::StateField;
use crate::size::{MaxSize, largest, wire};

/// Events have numbers from here on.
pub const EVENT_BASE: u16 = 0x8000;

wire! {
    /// Why a host link lost the right to command.
    #[derive(Copy, Eq)]
    pub enum AuthorityLossReason {
        /// Nothing valid came from it for the configured time.
        Silence,
        /// The host released it.
        Released,
    }
}

/// An event as it was received.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EventMessage {
    /// Events that were lost on this link since the last one that was sent.
    pub dropped: u32,
    /// Gateway time of the event, µs.
    pub time_us: u64,
    /// What happened.
    pub event: Event,
}

/// One table: the number in the header, the variant and its fields, which follow `dropped` and
/// `time_us` in the body.
macro_rules! events {
    ($(
        $(#[$meta:meta])+
        $number:literal $name:ident { $($(#[$field_meta:meta])* $field:ident: $type:ty),* $(,)? }
    )+) => {
        /// What happened.
        #[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[serde(rename_all = "snake_case")]
        pub enum Event {
            $($(#[$meta])+ $name { $(
                $(#[$field_meta])*
                #[doc = field_doc!($field $(#[$field_meta])*)]
                $field: $type
            ),* },)+
            /// On the host: an event of a later version, its fields left unread. A gateway never
            /// sends it.
            Unknown {
                /// Its number.
                number: u16,
            },
        }

        numbered! { Event EVENTS $($number $name)+ }

        /// Longest body of an event, bytes.
        pub(crate) const MAX_EVENT_BODY: usize =
            u32::MAX_SIZE + u64::MAX_SIZE + largest(&[$(0 $(+ <$type as MaxSize>::MAX_SIZE)*),+]);

        impl Event {
            /// Writes the whole delimited frame and returns its length. `sequence` counts the
            /// events of the link.
            ///
            /// # Errors
            /// `out` is too small; [`MAX_FRAME`](crate::MAX_FRAME) bytes are always enough.
            pub fn encode_frame(
                &self,
                sequence: u16,
                dropped: u32,
                time_us: u64,
                out: &mut [u8],
            ) -> Result<usize, EncodeError> {
                let number = self.number();
                match self {
                    $(Self::$name { $($field),* } => {
                        encode(Kind::Event, sequence, number, &(dropped, time_us, $($field,)*), out)
                    })+
                    Self::Unknown { .. } => {
                        encode(Kind::Event, sequence, number, &(dropped, time_us), out)
                    }
                }
            }
        }

        #[cfg(test)]
        impl Event {
            /// The largest of each kind, and the bytes of its data.
            pub(crate) fn largest_ones() -> impl Iterator<Item = (Self, usize)> {
                [$((
                    Self::$name { $($field: $crate::largest::Largest::largest()),* },
                    0 $(+ <$type as MaxSize>::MAX_SIZE)*,
                )),+]
                .into_iter()
            }
        }

        impl EventMessage {
            /// The event of a frame with this number and body.
            ///
            /// # Errors
            /// The body is not that of this number.
            pub fn decode(number: u16, body: &[u8]) -> Result<Self, DecodeError> {
                match number {
                    $($number => {
                        type Body = (u32, u64, $($type,)*);
                        let (dropped, time_us, $($field,)*): Body = decode_body(number, body)?;
                        Ok(Self { dropped, time_us, event: Event::$name { $($field),* } })
                    })+
                    _ => Self::decode_unknown(number, body),
                }
            }
        }
    };
}

events! {
    /// An axis tripped.
    0x8001 Tripped {
        axis: u8,
        /// Why, and its last values.
        trip: Trip,
    }
    /// The motor has confirmed the stop of an axis.
    0x8002 StopConfirmed {
        axis: u8,
        /// From the trip or the stop request until the first stop frame was transmitted, µs.
        reaction_us: u32,
        /// From the trip or the stop request until the confirmation, µs.
        elapsed_us: u32,
        /// Whether it stands still, where that could be measured.
        standstill: Option<bool>,
    }
    /// An axis changed its state.
    0x8003 StateChanged { axis: u8, state: AxisState }
    /// This host link no longer has the right to command.
    0x8004 AuthorityLost { reason: AuthorityLossReason }
    /// The e-stop is latched: every axis trips, none can be armed.
    0x8005 EStopLatched {}
    /// The e-stop is cleared.
    0x8006 EStopCleared {}
    /// Frames of this host link could not be read.
    0x8007 FrameRejected {
        /// Number of the [`FrameError`](crate::FrameError).
        reason: u8,
        /// How many since the last such event with this reason.
        count: u32,
    }
    /// A bus changed its error state.
    0x8008 BusStateChanged { bus: u8, state: BusState }
    /// A motor sent something that was not asked for.
    0x8009 MotorNotice {
        axis: u8,
        /// Its data bytes; those after `length` are 0.
        data: [u8; 8],
        /// How many of them were sent.
        length: u8,
        /// Frames of this axis that were not asked for and not reported since the event before.
        unreported: u16,
    }
    /// So many stops of an axis stayed unconfirmed that its motor counts as unreachable, or none
    /// could be sent. It may be turning.
    0x800A AxisUnreachable {
        axis: u8,
        /// Stops were sent and not confirmed; else its bus carries none, and they go out when it
        /// does.
        stop_transmitted: bool,
    }
    /// Requests of this host link were not executed or not answered, because too many replies were
    /// waiting.
    0x800B RequestDropped {
        /// How many since the last such event.
        count: u32,
    }
    /// How an axis is, by subscription. What was not subscribed to or has not been measured is
    /// missing.
    0x800C Sample {
        axis: u8,
        state: AxisState,
        /// rad.
        position_rad: Option<Reading>,
        /// rad/s.
        velocity_rad_s: Option<Reading>,
        /// A.
        current_a: Option<Reading>,
        /// V.
        voltage_v: Option<Reading>,
        /// °C.
        motor_temperature_c: Option<Reading>,
        /// °C.
        driver_temperature_c: Option<Reading>,
        /// What is wrong with the motor now.
        faults: Option<FaultReading>,
    }
    /// The e-stop input of the board has changed.
    0x800D EStopInputChanged {
        /// Open: its button is pressed or its cable cut.
        open: bool,
    }
    /// The enable output of the board has changed.
    0x800E EnableOutputChanged {
        /// Its new level.
        active: bool,
    }
    /// The first stop frame of an axis was not transmitted within its bound, once for each stop:
    /// others fill the bus, or it is dead.
    0x800F StopDelayed {
        bus: u8,
        axis: u8,
        /// From the trip or the stop request until now, µs.
        waiting_us: u32,
    }
    /// The motor has echoed what its brake was told and does not show it; the axis has
    /// `allow_unverified_brake`.
    0x8010 BrakeUnverified {
        axis: u8,
        /// What the brake was told: locked, or freed.
        locked: bool,
    }
    /// RMD: the angle in the replies to setpoints is not the position that 0x92 tells. Told once,
    /// until they agree again; positions come from 0x92 alone meanwhile.
    0x8012 AngleMismatch {
        axis: u8,
        /// The angle of the replies, which starts again after 65 536°, rad.
        angle_rad: f32,
        /// The position from 0x92, rad.
        position_rad: f32,
    }
}

impl Event {
    /// A field of a [`Sample`](Event::Sample) that is a number: all but the fault word. Nothing of
    /// another event.
    #[must_use]
    pub fn reading(&self, field: StateField) -> Option<Reading> {
        let Self::Sample {
            position_rad,
            velocity_rad_s,
            current_a,
            voltage_v,
            motor_temperature_c,
            driver_temperature_c,
            ..
        } = self
        else {
            return None;
        };
        match field {
            StateField::Position => *position_rad,
            StateField::Velocity => *velocity_rad_s,
            StateField::Current => *current_a,
            StateField::Voltage => *voltage_v,
            StateField::MotorTemperature => *motor_temperature_c,
            StateField::DriverTemperature => *driver_temperature_c,
            StateField::Faults => None,
        }
    }

    /// How old a field of a [`Sample`](Event::Sample) is, µs, the fault word too. Nothing of
    /// another event.
    #[must_use]
    pub fn age_us(&self, field: StateField) -> Option<u32> {
        match (field, self) {
            (StateField::Faults, Self::Sample { faults, .. }) => faults.map(|faults| faults.age_us),
            _ => self.reading(field).map(|reading| reading.age_us),
        }
    }
}

impl EventMessage {
    /// Every version's events begin alike.
    fn decode_unknown(number: u16, body: &[u8]) -> Result<Self, DecodeError> {
        let ((dropped, time_us), _) = postcard::take_from_bytes::<(u32, u64)>(body)
            .map_err(|_| DecodeError::BadBody { number })?;
        Ok(Self { dropped, time_us, event: Event::Unknown { number } })
    }
}
