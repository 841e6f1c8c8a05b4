//! The replies: the results of requests that were executed. [`messages`](crate::messages) says
//! which belongs to which.

use crate::axis::{Agreement, AxisState, AxisSummary, FaultReading, MotorTimeout, Reading, Trip};
use crate::bus::{BusCapability, BusConfig, BusCounters, BusLimit, BusState, ReceivedFrame};
use crate::can_frame::MAX_CAN_DATA;
use crate::changes::{Setting, StoredState};
use crate::cycle::{FixedU32, MAX_STATES};
use crate::image::{FirmwareVersion, ImageState};
use crate::incident::{BootReason, Incident};
use crate::names::{Named, Subject};
use crate::protocol::StateFields;
use crate::size::wire;
use crate::text::{Bytes, Text, Vec};
use crate::value::Value;

/// Buses that [`HelloReply`] can describe.
pub const MAX_BUS_CAPABILITIES: usize = 8;
/// Axes of one [`AxisList`].
pub const MAX_AXIS_SUMMARIES: usize = 16;
/// Names of one [`NameList`].
pub const MAX_NAMES: usize = 16;
/// Parameters of one [`AxisSettings`].
pub const MAX_SETTINGS: usize = 16;
/// Incidents of one [`IncidentPage`].
pub const MAX_INCIDENTS: usize = 8;
/// Bytes of [`CrashReport`].
pub const MAX_CRASH_REPORT: usize = 240;
/// Bytes of one [`FlightRecordPage`]: about as many as a message holds.
pub const MAX_FLIGHT_RECORD_BYTES: usize = 480;
/// Answers of one [`Recognition`].
pub const MAX_VERSION_ANSWERS: usize = 3;
/// Frames of one [`RawFrames`]: as many of the longest as a message holds.
pub const MAX_RAW_FRAMES: usize = 6;

wire! {
    /// Executed; there is nothing more to say.
    #[derive(Copy, Eq)]
    pub struct Done {}

    /// Who answers, and what it can do. Fixed for ever, as [`Hello`](crate::requests::Hello) is.
    #[derive(Eq)]
    pub struct HelloReply {
        /// [`PROTOCOL_MAJOR`](crate::PROTOCOL_MAJOR) of the gateway.
        pub protocol_major: u16,
        /// [`PROTOCOL_MINOR`](crate::PROTOCOL_MINOR) of the gateway.
        pub protocol_minor: u16,
        /// Version of the firmware.
        pub firmware: Text<24>,
        /// The exact build.
        pub build_id: Text<40>,
        /// Name of the board.
        pub board: Text<24>,
        /// Why it started last.
        pub boot: BootReason,
        /// Whether the run before left a crash report.
        pub has_crash_report: bool,
        /// Trips and resets recorded.
        pub trips_recorded: u16,
        /// Axes are numbered from 0 to one less than this.
        pub max_axes: u8,
        /// The longest message the gateway takes or sends, bytes before COBS.
        pub max_message: u16,
        /// Its buses, in the order of their numbers.
        pub buses: Vec<BusCapability, MAX_BUS_CAPABILITIES>,
        /// Gateway time, µs.
        pub time_us: u64,
    }

    /// The gateway's clock.
    #[derive(Copy, Eq)]
    pub struct Pong {
        /// Gateway time at which the ping was executed, µs.
        pub time_us: u64,
    }

    /// Which firmware runs, and whether another may take its place.
    #[derive(Copy, Eq)]
    pub struct ImageReport {
        /// Its version.
        pub version: FirmwareVersion,
        /// Bytes of the longest image that may take its place; 0: this board takes none over a host
        /// link.
        pub room: u32,
        /// Whether only images that are signed with its key may.
        pub needs_signature: bool,
        /// What became of the last one that was sent.
        pub state: ImageState,
    }

    /// How a bus is.
    #[derive(Copy, Eq)]
    pub struct BusReport {
        /// Its configuration, once it has one.
        pub config: Option<BusConfig>,
        /// Its error state.
        pub state: BusState,
        /// CAN: transmit error counter.
        pub transmit_errors: u16,
        /// CAN: receive error counter.
        pub receive_errors: u16,
        /// What happened since it was configured.
        pub counters: BusCounters,
        /// Whether it is open for raw frames.
        pub raw_open: bool,
    }

    /// How the gateway itself is.
    #[derive(Copy, Eq)]
    pub struct GatewayReport {
        /// Gateway time, µs.
        pub time_us: u64,
        /// Starts since power came on, this one included.
        pub starts: u32,
        /// The host link that commands, if one does.
        pub holder: Option<u8>,
        /// Whether the e-stop is latched, so that nothing can be armed.
        pub e_stop_latched: bool,
        /// Whether the e-stop input is open: its button is pressed or its cable cut. Nothing where
        /// the board has no such input.
        pub e_stop_input_open: Option<bool>,
        /// Whether the enable output is active. Nothing where the board has no such output.
        pub enable_output: Option<bool>,
        /// Whether the chip's random generator gave the number from which epochs count. Without it
        /// nothing is armed.
        pub random_number: bool,
        /// Whether a word that a reset should have left alone had changed at this start: the e-stop
        /// was latched and every axis tripped.
        pub memory_damaged: bool,
        /// Why the board offers a bus without bitrates, if it does.
        pub bus_limit: Option<BusLimit>,
    }

    /// What is stored of the configuration.
    #[derive(Copy, Eq)]
    pub struct StoredReport {
        /// What is stored.
        pub state: StoredState,
        /// Whether it is being written just now.
        pub saving: bool,
    }

    /// The value of a parameter.
    #[derive(Copy)]
    pub struct ParameterValue {
        /// The value in force: the default where none was set, nothing where there is no default.
        pub value: Option<Value>,
    }

    /// The names that there are.
    #[derive(Eq)]
    pub struct NameList {
        /// The gateway's, those of buses and those of axes, each in the order of their numbers.
        pub names: Vec<Named, MAX_NAMES>,
        /// Where the list goes on, if it does.
        pub next: Option<Subject>,
    }

    /// The parameters of an axis that are set, and what its motor was told.
    pub struct AxisSettings {
        /// In the order of their numbers.
        pub settings: Vec<Setting, MAX_SETTINGS>,
        /// Number of the parameter where the list goes on, if it does.
        pub next: Option<u16>,
        /// What is known of the motor's own timeout, or what arming writes again.
        pub motor_timeout: MotorTimeout,
    }

    /// Axes that have at least one parameter set.
    #[derive(Eq)]
    pub struct AxisList {
        /// In the order of their numbers.
        pub axes: Vec<AxisSummary, MAX_AXIS_SUMMARIES>,
        /// Where the list goes on, if it does.
        pub next: Option<u8>,
    }

    /// What is known of the motor's own timeout now.
    #[derive(Copy, Eq)]
    pub struct MotorTimeoutReport {
        /// The timeout.
        pub timeout: MotorTimeout,
    }

    /// The axis is armed.
    #[derive(Copy, Eq)]
    pub struct Armed {
        /// What every setpoint has to carry until the axis leaves this state.
        pub epoch: u32,
        /// What is known of the motor's own timeout.
        pub motor_timeout: MotorTimeout,
    }

    /// Every axis is armed.
    #[derive(Copy, Eq)]
    pub struct ArmedTogether {
        /// What every cycle and setpoint has to carry; of an axis that leaves this state no longer.
        pub epoch: u32,
    }

    /// How the axes of a cycle are at its end.
    #[derive(Eq)]
    pub struct CycleReport {
        /// Low 32 bits of the gateway time at its end, µs.
        pub time_us: FixedU32,
        /// What is told of each.
        pub fields: StateFields,
        /// The axes: bit 0 is axis 0.
        pub axes: u32,
        /// Their [states](Self::states), one behind the other.
        #[serde(serialize_with = "crate::text::in_one_piece")]
        pub states: Bytes<MAX_STATES>,
    }

    /// How an axis is.
    #[derive(Copy)]
    pub struct AxisReport {
        pub axis: u8,
        pub state: AxisState,
        /// Its epoch, while it is armed.
        pub epoch: Option<u32>,
        /// Why it tripped, while it is tripped.
        pub trip: Option<Trip>,
        /// rad, positive is counter-clockwise.
        pub position_rad: Option<Reading>,
        pub velocity_rad_s: Option<Reading>,
        /// A, positive drives counter-clockwise.
        pub current_a: Option<Reading>,
        /// Supply of the motor, V.
        pub voltage_v: Option<Reading>,
        /// °C.
        pub motor_temperature_c: Option<Reading>,
        /// °C.
        pub driver_temperature_c: Option<Reading>,
        /// What is wrong with the motor now.
        pub faults: Option<FaultReading>,
        /// The fault word that the motor had kept from before arming, where its protocol keeps one.
        pub fault_record: Option<u16>,
        /// What is known of the motor's own timeout.
        pub motor_timeout: MotorTimeout,
        /// Whether it stands still, where that was measured after a stop.
        pub standstill: Option<bool>,
        /// Whether the motor has acknowledged the last stop.
        pub stop_acknowledged: bool,
    }

    /// What the answers of an RMD motor say of its dialect.
    #[derive(Eq)]
    pub struct Recognition {
        /// The dialect, by its number in `rmd_dialect`: the only one that two or more agreeing
        /// answers leave. 0: unknown.
        pub dialect: u8,
        /// The dialects that all agreeing answers allow: bit n is number n. None: they contradict
        /// each other.
        pub possible: u8,
        /// The answers that tell something.
        pub answers: Vec<VersionAnswer, MAX_VERSION_ANSWERS>,
    }

    /// What a motor answered to one read, which was asked twice.
    #[derive(Copy, Eq)]
    pub struct VersionAnswer {
        /// Data bytes of the read.
        pub request: [u8; 8],
        /// Data bytes of its first answer.
        pub answer: [u8; 8],
        /// The dialects whose motors answer so: bit n is number n.
        pub dialects: u8,
        pub agreement: Agreement,
    }

    /// Where a relative move goes.
    #[derive(Copy)]
    pub struct MoveTarget {
        /// The position it starts from, rad.
        pub start_rad: f32,
        /// The position that is held from now on, rad.
        pub target_rad: f32,
    }

    /// What the motor answered to a native command.
    #[derive(Eq)]
    pub struct NativeReply {
        /// The data field of its reply; empty where the motor does not answer the command, and
        /// where the command was carried out as a stop of the axis.
        pub data: Bytes<MAX_CAN_DATA>,
    }

    /// Raw frames, the oldest first.
    #[derive(Eq)]
    pub struct RawFrames {
        /// Received and not yet fetched; as many as fit, ask again until there are none.
        pub frames: Vec<ReceivedFrame, MAX_RAW_FRAMES>,
        /// Received since the last time and lost, because nobody fetched them.
        pub dropped: u32,
    }

    /// Trips and starts, the latest first.
    pub struct IncidentPage {
        /// As many as a message holds.
        pub incidents: Vec<Incident, MAX_INCIDENTS>,
        /// Where the list goes on, if it does.
        pub next: Option<u8>,
    }

    /// Why the run before failed.
    #[derive(Eq)]
    pub struct CrashReport {
        /// The message of a panic, of a processor fault or of the watchdog; empty if there was
        /// none.
        pub text: Text<MAX_CRASH_REPORT>,
    }

    /// Bytes of what the flight recorder has kept: some parts, which one behind the other are a
    /// file of it without the checksum at its end (docs/flight-recorder.md).
    #[derive(Eq)]
    pub struct FlightRecordPage {
        /// Another one where something else is kept: a host that sees it change begins anew.
        pub id: u32,
        /// How many parts there are; 0: nothing has been kept.
        pub parts: u16,
        /// Bytes of the part that was asked for; 0: it has none.
        pub length: u32,
        /// Those from the offset on: at least one where there is one.
        pub bytes: Bytes<MAX_FLIGHT_RECORD_BYTES>,
    }
}
