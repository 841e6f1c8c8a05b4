//! The errors: one table of number, name and data. A request that was not executed is answered with
//! one of them.

use core::fmt;

use crate::axis::{AxisState, TripReason};
use crate::bus::{BusKind, MAX_BITRATES};
use crate::can_id::CanId;
use crate::encode::{EncodeError, write_message};
use crate::error_text::{
    AsDialects, Bounds, DialectCommand, DialectName, Faults, KindOf, OTHER_VERSION, Offered,
    RequestName, abilities, next_step, together_bar, way_to_idle,
};
use crate::field_doc::field_doc;
use crate::frame::Kind;
use crate::image::{FirmwareVersion, IMAGE_UNIT, MAX_IMAGE_BYTES};
use crate::messages::{DecodeError, decode_body, numbered};
use crate::names::{MAX_NAME, Subject};
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
        /// CAN: no node acknowledges frames; the cable, the power of the motor or the bitrate is
        /// wrong.
        NotAcknowledged,
        /// D5: a write, which the motor does not answer if its acknowledge level is below the
        /// axis's `d5_ack_level`.
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
        /// The bus is not declared exclusive: motors that are no axis could obey as well.
        SharedBus,
        /// A speed waits in the motor, which is not among those to be started.
        WriteWaits,
        /// The axis is asked with ids of another length than the first: no one frame reaches both.
        OtherFrameType,
    }
}

/// One table: the number in the header, the variant, its data, which is the body, and its text for
/// people: what was wrong, what is allowed, the next step.
macro_rules! errors {
    ($(
        $(#[$meta:meta])+
        $number:literal $name:ident { $($field:ident: $type:ty),* } $text:literal $(, $value:expr)*;
    )+) => {
        /// Why a request was refused or failed. The number is in the header of the frame, the data
        /// is its body. It is serialised by names for who reads it on the host; on the wire is what
        /// [`encode_frame`](Self::encode_frame) writes.
        #[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[serde(rename_all = "snake_case")]
        pub enum Error {
            $($(#[$meta])+ $name { $(#[doc = field_doc!($field)] $field: $type),* },)+
            /// On the host: an error of a later version, its data left unread. A gateway never
            /// sends it.
            Unknown {
                /// Its number.
                number: u16,
            },
        }

        numbered! { Error ERRORS $($number $name)+ }

        /// Longest body of an error, bytes.
        pub(crate) const MAX_ERROR_BODY: usize =
            crate::size::largest(&[$(0 $(+ <$type as MaxSize>::MAX_SIZE)*),+]);

        impl Error {
            /// The error of a frame with this number and body; [`Error::Unknown`] if the number is
            /// not in the table.
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
                let number = self.number();
                match self {
                    $(Self::$name { $($field),* } => {
                        write_message(Kind::Error, sequence, number, &($($field,)*), out)
                    })+
                    Self::Unknown { .. } => write_message(Kind::Error, sequence, number, &(), out),
                }
            }
        }

        #[cfg(test)]
        impl Error {
            /// The largest of each kind, and the bytes of its data.
            pub(crate) fn largest_ones() -> impl Iterator<Item = (Self, usize)> {
                [$((
                    Self::$name { $($field: $crate::largest::Largest::largest()),* },
                    0 $(+ <$type as MaxSize>::MAX_SIZE)*,
                )),+]
                .into_iter()
            }
        }

        impl fmt::Display for Error {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                match *self {
                    $(Self::$name { $($field),* } => {
                        $(let _ = $field;)*
                        write!(f, $text $(, $value)*)
                    })+
                    Self::Unknown { number } => {
                        write!(f, "the gateway answers with error {number}; {OTHER_VERSION}")
                    }
                }
            }
        }
    };
}

errors! {
    /// No request has this number.
    1 UnknownRequest { number: u16 } "the gateway knows no request {number:#06x}; {OTHER_VERSION}";
    /// The body is not the one of this request.
    2 BadBody { number: u16 }
        "the body of request {} cannot be read; {OTHER_VERSION}", RequestName(number);
    /// The host speaks a major version of the protocol that this gateway does not.
    3 UnsupportedVersion { gateway_major: u16, host_major: u16 }
        "the gateway speaks version {gateway_major} of the protocol and the host version \
        {host_major}; update the older of the two";
    /// Another host link has the right to command.
    4 NotInCommand { holder: u8 }
        "host link {holder} is in command; wait until it releases authority or falls silent (stop, \
        disarm and e-stop work from here too)";
    /// There is no such axis.
    5 UnknownAxis { axis: u8, max_axes: u8 }
        "there is no axis {axis}; axes are numbered below {max_axes}";
    /// There is no such bus.
    6 UnknownBus { bus: u8, buses: u8 } "there is no bus {bus}; buses are numbered below {buses}";
    /// A required parameter of the axis is not set.
    7 NotConfigured { axis: u8, parameter: u16 }
        "axis {axis} lacks {}; set it first", Quantity::Parameter(parameter);
    /// A value is not in its range; nothing was changed, nothing is clamped.
    8 OutOfRange { quantity: Quantity, value: f32, min: f32, max: f32 }
        "{}", Bounds { quantity, value, min, max };
    /// A value is NaN or infinite.
    9 NotANumber { quantity: Quantity } "{quantity} is not a finite number; give one";
    /// No parameter has this number.
    10 UnknownParameter { parameter: u16 }
        "no parameter here has the number {parameter}; {OTHER_VERSION}";
    /// The parameter takes another kind of value.
    11 WrongType { parameter: u16 }
        "{} takes another kind of value; {}", Quantity::Parameter(parameter), KindOf(parameter);
    /// The axis is not armed.
    12 NotArmed { axis: u8, state: AxisState } "axis {axis} is {state}; arm it first";
    /// The axis is tripped.
    13 Tripped { axis: u8, reason: TripReason }
        "axis {axis} is tripped: {reason}; remove the cause, then clear the axis";
    /// The setpoint had expired when it arrived.
    14 Stale { now_us: u32, expires_at_us: u32 }
        "the setpoint expires at {expires_at_us} µs and it is {now_us} µs; send one that expires \
        later, within the axis's TTL";
    /// The setpoint belongs to an epoch that is over.
    15 StaleEpoch { axis: u8, current: u32 }
        "the setpoint for axis {axis} belongs to an epoch that is over; use {current}, which \
        arming returned last";
    /// The axis is carrying out another request.
    16 Busy { axis: u8 }
        "axis {axis} is carrying out another request; send this one after its reply";
    /// The protocol of the motor has no such command.
    17 Unsupported { axis: u8, protocol: Protocol }
        "axis {axis} speaks {protocol}, which has no such command; it {}", abilities(protocol);
    /// The motor did not reply.
    18 NoReply { axis: u8, hint: NoReplyHint }
        "the motor of axis {axis} did not reply; {}", next_step(hint);
    /// The CAN controller of the bus is bus-off.
    19 BusOff { bus: u8 }
        "bus {bus} is off after too many errors; check its cable for a short and its bitrate, it \
        recovers by itself";
    /// The motor as it is set could not confirm a stop.
    20 CannotConfirm { axis: u8 }
        "the motor of axis {axis} is set so that it could not confirm a stop; give a D5 an \
        acknowledge level above 0, and a thruster a VM that returns something";
    /// The motor turns; arming needs standstill, and so does a native read of a motor that should be
    /// at rest.
    21 NotStandstill { axis: u8, velocity_rad_s: f32 }
        "the motor of axis {axis} turns at {velocity_rad_s} rad/s; let it come to a standstill \
        first";
    /// The motor reports a fault.
    22 MotorFault { axis: u8, faults: u16 }
        "the motor of axis {axis} reports a fault, {}; remove its cause first",
        Faults(Some(faults));
    /// Nothing is known of the motor's own timeout, and the axis does not allow that.
    23 MotorTimeoutUnknown { axis: u8 }
        "nothing is known of the timeout of the motor of axis {axis}; provision it, or set \
        allow_unknown_motor_timeout";
    /// The e-stop of the gateway is latched.
    24 EStopped {} "the e-stop is latched; clear the gateway first";
    /// What this configuration has to send does not fit onto the bus.
    25 BusOverloaded { bus: u8, needed_permille: u32, available_permille: u32 }
        "this would take {needed_permille} ‰ of bus {bus}, of which {available_permille} ‰ are \
        available; refresh or poll less often, or use a higher bitrate, or have motors send less \
        by themselves";
    /// The bus is not open for raw frames.
    26 RawNotOpen { bus: u8 } "bus {bus} is not open for raw frames; open it first";
    /// The bus is open for raw frames, so nothing on it can be armed, or configured there while it
    /// is open for unsafe access.
    27 RawOpen { bus: u8 } "bus {bus} is open for raw frames; close it first";
    /// This needs the axis to be idle.
    29 NotIdle { axis: u8, state: AxisState }
        "axis {axis} is {state} and this needs it idle; {} first", way_to_idle(state);
    /// Another axis has this bus and node.
    30 NodeInUse { axis: u8 }
        "axis {axis} has this bus and node; choose another node or remove that axis";
    /// The bus is not configured for this protocol.
    31 ProtocolNotOnBus { bus: u8, protocol: Protocol }
        "bus {bus} is not configured for {protocol}; configure it so first";
    /// The bus is not of the kind that this needs.
    32 WrongBusKind { bus: u8, kind: BusKind } "bus {bus} is {kind}; use a bus of the other kind";
    /// The motor has not confirmed its stop.
    33 StopNotConfirmed { axis: u8 }
        "the motor of axis {axis} has not confirmed its stop; see that it has power and replies, \
        the stop is being repeated";
    /// What tripped the axis is still there.
    34 CauseRemains { axis: u8, reason: TripReason }
        "what tripped axis {axis} is still there: {reason}; remove it first";
    /// The motor refused the command.
    35 Refused { axis: u8, faults: Option<u16> }
        "the motor of axis {axis} refused the command, {}; remove the fault or the limit first",
        Faults(faults);
    /// A stop or a disarm came between, or one of several that were to be armed had tripped.
    36 Aborted { axis: u8, state: AxisState }
        "axis {axis} was stopped meanwhile and is {state}; see why, then ask again";
    /// A position setpoint with speed limit 0, which some motors take as no limit.
    37 SpeedLimitZero { axis: u8 }
        "a position setpoint for axis {axis} needs a speed limit above 0; some motors take 0 as no \
        limit";
    /// The bus is not configured.
    38 BusNotConfigured { bus: u8 } "bus {bus} is not configured; configure it first";
    /// More frames wait for the bus than it can hold.
    39 QueueFull { bus: u8 } "too many frames wait for bus {bus}; send more slowly";
    /// The bus carries an axis that is not idle, so it cannot be configured.
    40 BusInUse { bus: u8, axis: u8 }
        "axis {axis} on bus {bus} is not idle; disarm or clear it first, or, where the axis is \
        holding, switch its motor's output off";
    /// The axis has not tripped, or its motor confirms its stop: it has nothing that the request
    /// clears.
    41 NothingToClear { axis: u8 }
        "axis {axis} has nothing that this clears: clear needs a trip, clear-unreachable a motor \
        that does not confirm its stop";
    /// The motor's own timeout is off.
    42 MotorTimeoutOff { axis: u8 }
        "the timeout of the motor of axis {axis} is off, or longer than 60 s; provision it, or set \
        allow_no_motor_timeout";
    /// A newer setpoint has taken the place of this motion before the motor had answered it.
    43 Superseded { axis: u8 }
        "a newer setpoint for axis {axis} came before the motor had answered this; send one at a \
        time";
    /// The bytes are no command of the motor's manual, or carry a value that it does not allow.
    44 NotACommand { axis: u8, protocol: Protocol }
        "axis {axis} speaks {protocol}, and these bytes are no command of that manual or carry a \
        value that it does not allow; see mgw encode --protocol {} --list", protocol.name();
    /// The bytes name another motor than that of the axis, or all motors.
    45 NotThisNode { axis: u8, node: u8 }
        "the bytes are not for node {node}, the motor of axis {axis}; broadcasts and other motors \
        are reached with raw frames only";
    /// What this native command makes the motor do is not known, so that no limit can be held
    /// against it.
    46 CannotCheckLimit { axis: u8, quantity: Quantity }
        "this command does not say what {quantity} the motor of axis {axis} would reach, so that \
        no limit can be kept; use a setpoint, or a command that says it";
    /// The e-stop input is open: the e-stop cannot be cleared.
    47 EStopInputOpen {}
        "the e-stop input is open; release its button or mend its cable, then clear the gateway";
    /// An axis would be sent frames on a CAN id on which the motor of another axis of the bus acts
    /// or answers.
    48 IdInUse { axis: u8, id: CanId, other: u8 }
        "axis {axis} would be sent frames on CAN id {id}, on which the motor of axis {other} acts \
        or answers; choose another node or d5_request_id, or another bus";
    /// The raw frame may do more than read a motor, and the bus is not open for unsafe access.
    49 RawNotHarmless { bus: u8 }
        "the frame may do more than read a motor of bus {bus}; use an axis, or remove the axes of \
        this bus and open it for unsafe access";
    /// An axis is configured on the bus, so it cannot be opened for unsafe raw access.
    50 AxisOnBus { bus: u8, axis: u8 }
        "axis {axis} is configured on bus {bus}; unsafe raw access needs a bus without axes";
    /// Nothing on this axis measures what the parameter limits, nor does a setpoint carry it.
    53 CannotMeasure { axis: u8, parameter: u16 }
        "{} would limit nothing on axis {axis}: its motor does not measure that, and takes no such \
        setpoint; leave it out (a thruster measures positions as a position_device, an RMD torque \
        on CAN)", Quantity::Parameter(parameter);
    /// The chip's random generator gave no number, so epochs could repeat.
    58 NoRandomNumber {}
        "the chip's random generator gave no number at the start, so epochs could repeat and \
        nothing is armed; start the gateway again, and replace its board if that does not help";
    /// This needs an axis whose motor holds.
    60 NotHolding { axis: u8, state: AxisState }
        "axis {axis} is {state}; only the output of a holding motor can be switched off";
    /// The motor's holding brake is locked: a motion would end in a stall.
    61 BrakeLocked { axis: u8 }
        "the brake of the motor of axis {axis} is locked; set release_brake_when_arming, or \
        allow_unverified_brake too where its firmware does not tell (0x9A byte 3)";
    /// Arming frees the brake, and the stop action would leave it open with the motor's output off:
    /// what hangs on it would fall.
    62 BrakeStaysOpen { axis: u8 }
        "axis {axis} frees its brake when it is armed, and a stop by coast leaves it open: choose \
        hold or brake";
    /// The motor did not restart within 3 s: it has not been silent, or its run time did not begin
    /// again.
    63 NotRestarted { axis: u8 }
        "the motor of axis {axis} was told to restart and did not within 3 s; switch it off and on";
    /// The motor was told something that acts after a restart, and has not restarted since.
    64 RestartOwed { axis: u8 }
        "the motor of axis {axis} has a new zero point that acts after a restart, and was not seen \
        to restart: have it do so (0x76), and arm the axis; one that is gone is given up by \
        clear-unreachable";
    /// A bus cannot run at this bitrate: as it was to be configured, or as a motor on it was to be
    /// set.
    65 BitrateNotOffered { bus: u8, bitrate: u32, offered: [u32; MAX_BITRATES] }
        "bus {bus} cannot run at {bitrate} bit/s; it offers{}", Offered(offered);
    /// The protocol shares a bus with no other.
    66 NeedsOwnBus { bus: u8, protocol: Protocol }
        "{protocol} motors share no bus with others; configure bus {bus} for {protocol} alone";
    /// The parameter means nothing to the motor of the axis: only motors of this protocol have what
    /// it sets.
    67 ParameterNeedsProtocol { axis: u8, parameter: u16, protocol: Protocol }
        "{} means something to {protocol} motors only, and that of axis {axis} is another: give it \
        its default, or remove the axis first", Quantity::Parameter(parameter);
    /// D5: register 0x2B of the motor is 1. It holds by its brake and ignores speeds, and no
    /// command of the manual frees it.
    68 BrakeOn { axis: u8 }
        "axis {axis} is not armed: register 0x2B of its motor is 1, so it holds by its brake and \
        ignores speeds";
    /// `StartTogether` is refused because of this axis; see the reason.
    69 CannotStartTogether { axis: u8, reason: TogetherBar }
        "the motors are not started together: axis {axis} {}", together_bar(reason);
    /// The value of this parameter is no CAN id: bits 0 to 30 are one of 11 bits, or with bit 31
    /// set one of 29 bits.
    70 NotACanId { parameter: u16, value: u32 }
        "{}: 0x{value:X} is no CAN id; there are {}",
        Quantity::Parameter(parameter), CanId::ALLOWED;
    /// No list of changes is open: none was begun, or it was forgotten with the right to command.
    71 NoChangesBegun {}
        "no list of changes is open: it is forgotten when its host loses the right to command; \
        begin again, nothing was changed";
    /// The list of changes is full, and forgotten.
    72 TooManyChanges { most: u16 }
        "more than {most} parameters of axes, and pieces of four letters of names, cannot change at once; \
        nothing was changed, make the change in several steps";
    /// The dialect of the motor lacks this command or has it in another form, or its dialect is not
    /// known; 0: motion mode.
    75 NotInDialect { axis: u8, command: u8 }
        "the motor of axis {axis} speaks a dialect that lacks {}, or has it in another form; see \
        docs/rmd-dialects.md and state its rmd_dialect", DialectCommand(command);
    /// RMD v4_4: the motor would echo this and store nothing, as its output stays on.
    76 OutputStaysOn { axis: u8 }
        "the motor of axis {axis} stores this only while its output is off, which a stop by hold \
        leaves on; set stop_action=coast, or brake, first";
    /// There is nowhere to store the configuration.
    80 NoStorage {}
        "this gateway has nowhere to store its configuration: keep the file, and apply it after each \
        loss of power";
    /// The configuration is being stored: until then it does not change and nothing is armed.
    81 Saving {}
        "the configuration is being stored just now, which takes up to some seconds; ask again then";
    /// The configuration could not be stored; what was stored before still is.
    82 SaveFailed {}
        "the flash did not take the configuration; what was stored before still is, see mgw info";
    /// The configuration is longer than what there is to store it in.
    83 StorageFull {}
        "the configuration is too long to be stored; what was stored before still is";
    /// The link cannot run at this rate.
    89 BaudNotOffered { baud: u32, offered: [u32; MAX_BITRATES] }
        "this host link cannot run at {baud} baud; it offers{}", Offered(offered);
    /// The link is no UART.
    90 LinkHasNoBaud {}
        "this host link is USB, which has no baud rate: leave it out";
    /// A request of a watcher takes authority, which nobody has: a watcher does not take it.
    96 NobodyInCommand {}
        "nobody is in command, and who only watches does not take it; send it as a request";
    /// A server has no gateway now: it is unplugged, or it starts.
    97 GatewayAway {}
        "the server has lost the gateway, whose armed axes stop by themselves: it is unplugged, \
        without power, starting or being updated. The server connects again when it is back; then \
        clear what has tripped";
    /// Nothing was opened here: a request of a watcher needs a link that has said hello, a server
    /// may want its token first.
    98 NoSession {}
        "no session is open here: say hello first, or to a server that wants a token show it \
        (MGW_TOKEN)";
    /// The answers of the motor do not fit the dialect that its axis states, v3_6 where it states
    /// none. `possible`: bit n is the dialect with number n; none where the answers contradict each
    /// other.
    103 DialectContradicted { axis: u8, stated: u8, possible: u8 }
        "axis {axis} is not armed: its rmd_dialect is {}, and its motor answers {}; set \
        rmd_dialect to what the motor speaks, or to unknown (mgw info shows the answers)",
        DialectName(stated), AsDialects(possible);
    /// The bus is open to listen only.
    104 BusOnlyListens { bus: u8 }
        "bus {bus} is open to listen only: nothing is sent there; open it otherwise first";
    /// The flash is one bank, from which the program runs: nothing can be stored.
    113 SingleBank {}
        "the flash of this board is one bank, from which its program runs, so nothing can be stored: \
        set its option DBANK = 1 (docs/boards), or keep the file and apply it after each loss of \
        power";
    /// The text is no name.
    120 NotAName { of: Subject }
        "the name of {of} is 1 to {MAX_NAME} letters, digits, - and _, begins with a letter, and is \
        not `all` or `gateway`";
    /// Another bus, or another axis, has this name.
    121 NameTaken { of: Subject, by: Subject }
        "{by} has the name that {of} is given; choose another, or give {by} another";
    /// This board takes no firmware over a host link.
    122 NoImageRoom {}
        "this board takes no firmware over a host link: flash it by its probe, or over USB by DFU \
        (docs/usb.md)";
    /// The image is for another board.
    123 ImageForAnotherBoard {}
        "the image is for another board; nothing was written";
    /// The image is older than the one that runs.
    124 OlderImage { running: FirmwareVersion }
        "the image is older than version {running}, which runs; nothing was written. Ask for it with \
        --allow-older if that is meant";
    /// No image has so many bytes.
    125 ImageLength { room: u32 }
        "an image has 1 to {} units of {IMAGE_UNIT} bytes; nothing was written", room as usize / IMAGE_UNIT;
    /// These are not the bytes of the image that come next.
    126 ImageGap { next: u32 }
        "the next bytes of the image are those from {next} on, 1 to {} units of {IMAGE_UNIT}, and \
        no more than were announced", MAX_IMAGE_BYTES / IMAGE_UNIT;
    /// No image was begun, or bytes of it are missing.
    127 ImageIncomplete { missing: u32 }
        "{missing} bytes of the image are missing, or none was begun: the firmware that runs stays; \
        send it again";
    /// What was written is not the image that was announced.
    128 ImageDamaged {}
        "what was written is not the image that was announced (its checksum, board or version \
        differs): the firmware that runs stays; send it again";
    /// The image lacks the signature of the key that the firmware carries, or where that has none
    /// the image.
    129 ImageNotSigned {}
        "the firmware that runs, or the image, carries a key, and this signature is none of that key: \
        the firmware stays";
    /// The flash did not take the image.
    130 ImageNotWritten {}
        "the flash did not take the image: the firmware that runs stays; send it again, and replace \
        the board if that does not help";
    /// The firmware runs on trial: until it is confirmed nothing is armed or stored.
    131 ImageOnTrial {}
        "this firmware runs on trial since its update, and until it is confirmed nothing is armed or \
        stored; confirm it (mgw update --confirm), or the one before runs again within 60 s";
    /// No firmware runs on trial.
    132 NoImageOnTrial {}
        "no firmware runs on trial, so there is none to confirm; see mgw info";
    /// The gateway starts anew in a moment.
    133 Restarting {}
        "the gateway starts anew in a moment; connect to it again";
    /// This gateway has no flight recorder.
    134 NoFlightRecorder {}
        "this gateway has no flight recorder: what it remembers of a trip is in mgw trips";
    /// The flight recorder records, as an axis is armed.
    135 FlightRecording {}
        "the flight recorder records, as an axis is armed: read it when none is";
    /// The flight recorder has not answered somebody else yet, or does not answer.
    136 FlightRecorderBusy {}
        "the flight recorder is read by somebody else just now, or does not answer; ask again";
    /// What the flight recorder has kept ends before what was asked for.
    137 BeyondFlightRecord { parts: u16, length: u32 }
        "the flight recorder has kept {parts} parts, {length} bytes in this one, and nothing beyond; \
        read it from the beginning";
    /// The motor's own timeout acts before its bus has surely had time for what the motor hears
    /// every third of it: behind the stops of all others there, or a lost reply.
    138 MotorTimeoutTooShort { axis: u8, motor_timeout_ms: u32, least_ms: u32 }
        "the motor of axis {axis} lets go after {motor_timeout_ms} ms, and its bus may keep it waiting \
        for so long: the stops of all others there go first, and a lost reply takes two reply \
        windows; {least_ms} ms and more outlast that";
}

impl core::error::Error for Error {}
