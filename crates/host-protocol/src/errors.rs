//! The errors: one table of number, name and data. A request that was not executed is answered with
//! one of them.

use crate::axis::{AxisState, TripReason};
use crate::bus::{BusKind, MAX_BITRATES};
use crate::can_id::CanId;
use crate::encode::{EncodeError, encode};
use crate::frame::Kind;
use crate::messages::{DecodeError, MessageInfo, decode_body};
use crate::protocol::Protocol;
use crate::size::{MaxSize, wire};
use crate::value::Quantity;

wire! {
    /// What may be behind a motor that does not reply.
    #[derive(Copy, Eq)]
    pub enum NoReplyHint {
        /// Nothing is known.
        None,
        /// D5: it looks like acknowledge level 0, at which the motor answers nothing.
        AckLevelZero,
        /// CAN: no node acknowledges frames; the cable, the power of the motor or the bitrate is wrong.
        NotAcknowledged,
        /// D5: a write, which the motor does not answer if its acknowledge level is below the axis's `d5_ack_level`.
        AckLevelBelow,
    }
}

wire! {
    /// What bars several motors from being started by one frame.
    #[derive(Copy, Eq)]
    pub enum TogetherBar {
        /// There is one axis, or none.
        TooFew,
        /// The axis is named twice.
        Twice,
        /// The axis is on another bus than the first.
        OtherBus,
        /// The bus is not declared exclusive: who is no axis could obey as well.
        SharedBus,
        /// A speed waits in the motor, which is not among those that are to be started.
        WriteWaits,
        /// The axis is asked with ids of another length than the first: no one frame reaches both.
        OtherFrameType,
    }
}

/// One table: the number in the header, the variant and its data, which is the body.
macro_rules! errors {
    ($(
        $(#[$meta:meta])+
        $number:literal $name:ident { $($(#[$field_meta:meta])+ $field:ident: $type:ty),* $(,)? }
    )+) => {
        /// Why a request was refused or failed. The number is in the header of the frame, the data is its
        /// body.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum Error {
            $($(#[$meta])+ $name { $($(#[$field_meta])+ $field: $type),* },)+
            /// On the host: an error of a later version, its data left unread. A gateway never sends it.
            Unknown {
                /// Its number.
                number: u16,
            },
        }

        /// Every error's number and name.
        pub const ERRORS: &[MessageInfo] = &[$(MessageInfo { number: $number, name: stringify!($name) }),+];

        /// Longest body of an error, bytes.
        pub(crate) const MAX_ERROR_BODY: usize =
            crate::size::largest(&[$(0 $(+ <$type as MaxSize>::MAX_SIZE)*),+]);

        impl Error {
            /// The number in the header.
            #[must_use]
            pub const fn number(&self) -> u16 {
                match self { $(Self::$name { .. } => $number,)+ Self::Unknown { number } => *number }
            }

            /// The name, as in the table of PROTOCOL.md.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                match self { $(Self::$name { .. } => stringify!($name),)+ Self::Unknown { .. } => "Unknown" }
            }

            /// The error of a frame with this number and body; [`Error::Unknown`] if the number is not in the
            /// table.
            ///
            /// # Errors
            /// The body is not that of this number.
            pub fn decode(number: u16, body: &[u8]) -> Result<Self, DecodeError> {
                match number {
                    $($number => {
                        type Body = ($($type,)*);
                        let ($($field,)*): Body = decode_body(number, body)?;
                        Ok(Self::$name { $($field),* })
                    })+
                    _ => Ok(Self::Unknown { number }),
                }
            }

            /// Writes the whole delimited frame and returns its length.
            ///
            /// # Errors
            /// `out` is too small; [`MAX_FRAME`](crate::MAX_FRAME) bytes are always enough.
            pub fn encode_frame(&self, sequence: u16, out: &mut [u8]) -> Result<usize, EncodeError> {
                let number = self.number();
                match self {
                    $(Self::$name { $($field),* } => {
                        encode(Kind::Error, sequence, number, &($($field,)*), out)
                    })+
                    Self::Unknown { .. } => encode(Kind::Error, sequence, number, &(), out),
                }
            }
        }
    };
}

errors! {
    /// No request has this number.
    1 UnknownRequest {
        /// The number.
        number: u16,
    }
    /// The body is not the one of this request.
    2 BadBody {
        /// The request.
        number: u16,
    }
    /// The host speaks a major version of the protocol that this gateway does not.
    3 UnsupportedVersion {
        /// What the gateway speaks.
        gateway_major: u16,
        /// What the host speaks.
        host_major: u16,
    }
    /// Another host link has the right to command.
    4 NotInCommand {
        /// That link.
        holder: u8,
    }
    /// There is no such axis.
    5 UnknownAxis {
        /// What was asked for.
        axis: u8,
        /// Axes are numbered from 0 to one less than this.
        max_axes: u8,
    }
    /// There is no such bus.
    6 UnknownBus {
        /// What was asked for.
        bus: u8,
        /// Buses are numbered from 0 to one less than this.
        buses: u8,
    }
    /// A required parameter of the axis is not set.
    7 NotConfigured {
        /// The axis.
        axis: u8,
        /// Number of the first parameter that is missing.
        parameter: u16,
    }
    /// A value is not in its range; nothing was changed, nothing is clamped.
    8 OutOfRange {
        /// Which value.
        quantity: Quantity,
        /// What was asked for, in the quantity's unit.
        value: f32,
        /// The smallest allowed.
        min: f32,
        /// The largest allowed.
        max: f32,
    }
    /// A value is NaN or infinite.
    9 NotANumber {
        /// Which value.
        quantity: Quantity,
    }
    /// No parameter has this number.
    10 UnknownParameter {
        /// The number.
        parameter: u16,
    }
    /// The parameter takes another kind of value.
    11 WrongType {
        /// Number of the parameter.
        parameter: u16,
    }
    /// The axis is not armed.
    12 NotArmed {
        /// The axis.
        axis: u8,
        /// Its state.
        state: AxisState,
    }
    /// The axis is tripped.
    13 Tripped {
        /// The axis.
        axis: u8,
        /// Why.
        reason: TripReason,
    }
    /// The setpoint had expired when it arrived.
    14 Stale {
        /// Low 32 bits of the gateway time, µs.
        now_us: u32,
        /// When it expired, µs.
        expires_at_us: u32,
    }
    /// The setpoint belongs to an epoch that is over.
    15 StaleEpoch {
        /// The epoch of the axis, if it is armed.
        current: Option<u32>,
    }
    /// The axis is carrying out another request.
    16 Busy {
        /// The axis.
        axis: u8,
    }
    /// The protocol of the motor has no such command.
    17 Unsupported {
        /// The axis.
        axis: u8,
        /// Its protocol.
        protocol: Protocol,
    }
    /// The motor did not reply.
    18 NoReply {
        /// The axis.
        axis: u8,
        /// What may be behind it.
        hint: NoReplyHint,
    }
    /// The CAN controller of the bus is bus-off.
    19 BusOff {
        /// The bus.
        bus: u8,
    }
    /// The motor as it is set could not confirm a stop.
    20 CannotConfirm {
        /// The axis.
        axis: u8,
    }
    /// The motor turns; arming needs standstill.
    21 NotStandstill {
        /// The axis.
        axis: u8,
        /// Its speed, rad/s.
        velocity_rad_s: f32,
    }
    /// The motor reports a fault.
    22 MotorFault {
        /// The axis.
        axis: u8,
        /// The motor's own fault word.
        faults: u16,
    }
    /// Nothing is known of the motor's own timeout, and the axis does not allow that.
    23 MotorTimeoutUnknown {
        /// The axis.
        axis: u8,
    }
    /// The e-stop of the gateway is latched.
    24 EStopped {}
    /// What this configuration has to send does not fit onto the bus.
    25 BusOverloaded {
        /// The bus.
        bus: u8,
        /// What is needed, 1/1000 of the bitrate.
        needed_permille: u32,
        /// What is available, 1/1000 of the bitrate.
        available_permille: u32,
    }
    /// The bus is not open for raw frames.
    26 RawNotOpen {
        /// The bus.
        bus: u8,
    }
    /// The bus is open for raw frames, so nothing on it can be armed, or configured there while it is open for unsafe access.
    27 RawOpen {
        /// The bus.
        bus: u8,
    }
    /// This needs the axis to be idle.
    29 NotIdle {
        /// The axis.
        axis: u8,
        /// Its state.
        state: AxisState,
    }
    /// Another axis has this bus and node.
    30 NodeInUse {
        /// The other axis.
        axis: u8,
    }
    /// The bus is not configured for this protocol.
    31 ProtocolNotOnBus {
        /// The bus.
        bus: u8,
        /// The protocol.
        protocol: Protocol,
    }
    /// The bus is not of the kind that this needs.
    32 WrongBusKind {
        /// The bus.
        bus: u8,
        /// What it is.
        kind: BusKind,
    }
    /// The motor has not confirmed its stop.
    33 StopNotConfirmed {
        /// The axis.
        axis: u8,
    }
    /// What tripped the axis is still there.
    34 CauseRemains {
        /// The axis.
        axis: u8,
        /// Why it tripped.
        reason: TripReason,
    }
    /// The motor refused the command.
    35 Refused {
        /// The axis.
        axis: u8,
        /// The motor's own fault word, where it could be read.
        faults: Option<u16>,
    }
    /// Arming was interrupted by a stop, a disarm or a trip.
    36 ArmingAborted {
        /// The axis.
        axis: u8,
        /// What it became.
        state: AxisState,
    }
    /// A position setpoint with speed limit 0, which some motors take as no limit.
    37 SpeedLimitZero {
        /// The axis.
        axis: u8,
    }
    /// The bus is not configured.
    38 BusNotConfigured {
        /// The bus.
        bus: u8,
    }
    /// More frames wait for the bus than it can hold.
    39 QueueFull {
        /// The bus.
        bus: u8,
    }
    /// The bus carries an axis that is not idle, so it cannot be configured.
    40 BusInUse {
        /// The bus.
        bus: u8,
        /// That axis.
        axis: u8,
    }
    /// The axis has not tripped, or its motor confirms its stop: it has nothing that the request clears.
    41 NothingToClear {
        /// The axis.
        axis: u8,
    }
    /// The motor's own timeout is off.
    42 MotorTimeoutOff {
        /// The axis.
        axis: u8,
    }
    /// A newer setpoint has taken the place of this motion before the motor had answered it.
    43 Superseded {
        /// The axis.
        axis: u8,
    }
    /// The bytes are no command of the motor's manual, or carry a value that it does not allow.
    44 NotACommand {
        /// The axis.
        axis: u8,
        /// Its protocol.
        protocol: Protocol,
    }
    /// The bytes name another motor than that of the axis, or all motors.
    45 NotThisNode {
        /// The axis.
        axis: u8,
        /// The node of its motor.
        node: u8,
    }
    /// What this native command makes the motor do is not known, so that no limit can be held against it.
    46 CannotCheckLimit {
        /// The axis.
        axis: u8,
        /// What is limited.
        quantity: Quantity,
    }
    /// The e-stop input is open: the e-stop cannot be cleared.
    47 EStopInputOpen {}
    /// An axis would be sent frames on a CAN id on which the motor of another axis of the bus acts or answers.
    48 IdInUse {
        /// The axis that is sent frames.
        axis: u8,
        /// The id.
        id: CanId,
        /// The axis whose motor uses it.
        other: u8,
    }
    /// The raw frame may do more than read a motor, and the bus is not open for unsafe access.
    49 RawNotHarmless {
        /// The bus.
        bus: u8,
    }
    /// An axis is configured on the bus, so it cannot be opened for unsafe raw access.
    50 AxisOnBus {
        /// The bus.
        bus: u8,
        /// That axis.
        axis: u8,
    }
    /// Nothing on this axis measures what the parameter limits, nor does a setpoint carry it.
    53 CannotMeasure {
        /// The axis.
        axis: u8,
        /// Number of the limit.
        parameter: u16,
    }
    /// The chip's random generator gave no number, so epochs could repeat.
    58 NoRandomNumber {}
    /// This needs an axis whose motor holds.
    60 NotHolding {
        /// The axis.
        axis: u8,
        /// Its state.
        state: AxisState,
    }
    /// The motor's holding brake is locked: a motion would end in a stall.
    61 BrakeLocked {
        /// The axis.
        axis: u8,
    }
    /// Arming frees the brake, and the stop action would leave it open with the motor's output off: what hangs on it would fall.
    62 BrakeStaysOpen {
        /// The axis.
        axis: u8,
    }
    /// The motor did not restart within 3 s: it has not been silent, or its run time did not begin again.
    63 NotRestarted {
        /// The axis.
        axis: u8,
    }
    /// The motor was told something that acts after a restart, and has not restarted since.
    64 RestartOwed {
        /// The axis.
        axis: u8,
    }
    /// A bus cannot run at this bitrate: as it was to be configured, or as a motor on it was to be set.
    65 BitrateNotOffered {
        /// The bus.
        bus: u8,
        /// What was asked for, bit/s.
        bitrate: u32,
        /// What could be had there instead, bit/s; 0 behind the last one.
        offered: [u32; MAX_BITRATES],
    }
    /// The protocol shares a bus with no other.
    66 NeedsOwnBus {
        /// The bus.
        bus: u8,
        /// The protocol.
        protocol: Protocol,
    }
    /// The parameter means nothing to the motor of the axis: only motors of this protocol have what it sets.
    67 ParameterNeedsProtocol {
        /// The axis.
        axis: u8,
        /// The parameter.
        parameter: u16,
        /// The protocol.
        protocol: Protocol,
    }
    /// D5: register 0x2B of the motor is 1. It holds by its brake and ignores speeds, and no command of the manual frees it.
    68 BrakeOn {
        /// The axis.
        axis: u8,
    }
    /// `StartTogether` is refused because of this axis; see the reason.
    69 CannotStartTogether {
        /// The axis.
        axis: u8,
        /// Why.
        reason: TogetherBar,
    }
    /// The value of this parameter is no CAN id: bits 0 to 30 are one of 11 bits, or with bit 31 set one of 29 bits.
    70 NotACanId {
        /// The parameter.
        parameter: u16,
        /// Its value.
        value: u32,
    }
}

impl core::error::Error for Error {}
