//! States, reasons and events in words.

use host_protocol::replies::{ImageReport, StoredReport};
use host_protocol::{
    AxisState, BusKind, Event, EventMessage, ImageState, MotorTimeout, Protocol, ProtocolSet,
    StoredState, TripReason,
};
use serde::Serialize;

use crate::explain::Page;
use crate::faults::{self, Protocols};
use crate::json;

/// What stands in a table where nothing is known.
pub const NOTHING: &str = "-";

/// What stands in a table for a value, if there is one.
pub fn or_nothing(value: Option<impl ToString>) -> String {
    value.map_or_else(|| NOTHING.to_owned(), |value| value.to_string())
}

/// What carries a bus, as tables of delays and plans have it.
pub fn kind(kind: Option<&BusKind>) -> &'static str {
    match kind {
        Some(BusKind::Rs485) => "rs485",
        Some(BusKind::Can) | None => "can",
    }
}

/// To a tenth.
pub fn rounded(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

/// So many of something: `1 axis`, `2 axes`.
pub fn count(count: usize, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

const MICROSECONDS_PER_SECOND: f64 = 1e6;
const MICROSECONDS_PER_MILLISECOND: f64 = 1e3;

/// The state of an axis.
pub fn axis_state(state: AxisState) -> &'static str {
    match state {
        AxisState::Unconfigured => "unconfigured",
        AxisState::Idle => "idle",
        AxisState::Holding => "holding",
        AxisState::Arming => "arming",
        AxisState::Armed => "armed",
        AxisState::Active => "active",
        AxisState::Stopping => "stopping",
        AxisState::Tripped { confirmed: true } => "tripped, stop confirmed",
        AxisState::Tripped { confirmed: false } => "tripped, stop not confirmed",
    }
}

/// A variant of the wire: `PowerOn` as `power on`.
pub fn name(value: &impl Serialize) -> String {
    json::name(value).replace('_', " ")
}

/// Why an axis tripped, faults by their names where the protocol of its motor is known.
pub fn trip_reason(reason: &TripReason, protocol: Option<Protocol>) -> String {
    match reason {
        TripReason::MotorFault { faults } => {
            format!("the motor reported a fault: {}", faults::in_words(protocol, *faults))
        }
        TripReason::CommandRefused { faults: Some(faults @ 1..) } => {
            format!("the motor refused a command: {}", faults::in_words(protocol, *faults))
        }
        TripReason::CommandRefused { .. } => "the motor refused a command".to_owned(),
        plain => plain.to_string(),
    }
}

/// That an axis tripped, why, and the page that helps.
pub fn tripped(axis: u8, reason: &TripReason, protocol: Option<Protocol>) -> String {
    format!("axis {axis} tripped: {} {}", trip_reason(reason, protocol), Page::of_trip(reason))
}

/// Why a frame of this host could not be read, as PROTOCOL.md numbers it.
pub fn frame_error(reason: u8) -> Option<&'static str> {
    host_protocol::FrameError::ALL
        .iter()
        .find(|(number, _)| *number == reason)
        .map(|(_, name)| *name)
}

/// What is known of a motor's own timeout.
pub fn motor_timeout(timeout: MotorTimeout) -> String {
    match timeout {
        MotorTimeout::Unknown => "unknown".to_owned(),
        MotorTimeout::Off => "off".to_owned(),
        MotorTimeout::Written { timeout_ms } => format!("{timeout_ms} ms, written by the gateway"),
        MotorTimeout::Verified => "on, read back".to_owned(),
    }
}

/// The protocols of a bus.
pub fn protocols(set: ProtocolSet) -> String {
    let names: Vec<&str> = set.iter().map(|protocol| protocol.name()).collect();
    if names.is_empty() { NOTHING.to_owned() } else { names.join(", ") }
}

/// Who is in command: behind a server the program, as far as that knows it.
pub fn in_command(holder: Option<u8>, commander: Option<&str>) -> String {
    match (holder, commander) {
        (None, _) => "nobody".to_owned(),
        (Some(_), Some(program)) => program.to_owned(),
        (Some(link), None) => format!("host link {link}"),
    }
}

/// What became of the last update, and whether there may be another.
pub fn image(report: &ImageReport) -> String {
    let may = match (report.room, report.needs_signature) {
        (0, _) => "by probe or DFU only",
        (_, false) => "mgw update gives it another firmware",
        (_, true) => "mgw update gives it another firmware, signed with its key",
    };
    match report.state {
        ImageState::Kept => may.to_owned(),
        ImageState::OnTrial { left_ms } => format!(
            "version {} runs on trial and nothing arms: mgw update --confirm keeps it, or the one \
             before runs again in {} s",
            report.version,
            left_ms / 1_000
        ),
        ImageState::RolledBack => format!("the last one was not kept; {may}"),
    }
}

/// What is stored of the configuration.
pub fn stored(report: &StoredReport) -> String {
    let text = match report.state {
        StoredState::NoStorage => "this gateway cannot store its configuration".to_owned(),
        StoredState::SingleBank => {
            "nothing: the flash of this board is one bank (option DBANK = 0), so it cannot store its \
             configuration"
                .to_owned()
        }
        StoredState::Nothing => "no configuration; mgw config save stores what runs".to_owned(),
        StoredState::Kept { differs: false } => "the configuration that runs".to_owned(),
        StoredState::Kept { differs: true } => {
            "another configuration than the one that runs; mgw config save replaces it".to_owned()
        }
        StoredState::Damaged => {
            "a configuration that is damaged, so none of it was loaded; configure, then mgw config \
             save"
                .to_owned()
        }
        StoredState::OtherLayout { layout } => format!(
            "a configuration in layout {layout}, which this firmware does not know, so none of it \
             was loaded; mgw config save replaces it"
        ),
        StoredState::Refused { error } => format!(
            "a configuration that this gateway refuses (error {error}), so none of it was loaded; \
             mgw config save replaces it"
        ),
        StoredState::NotRead => {
            "not read, as start after start had failed; reset the board to try again".to_owned()
        }
    };
    if report.saving { format!("{text}; it is being written") } else { text }
}

/// Gateway time in seconds.
pub fn seconds(time_us: u64) -> String {
    #[allow(clippy::cast_precision_loss)]
    let time = time_us as f64 / MICROSECONDS_PER_SECOND;
    format!("{time:.6} s")
}

/// A span in milliseconds.
pub fn milliseconds(span_us: u32) -> String {
    format!("{:.3} ms", f64::from(span_us) / MICROSECONDS_PER_MILLISECOND)
}

/// An event as one line.
pub fn event(message: &EventMessage, motors: &Protocols) -> String {
    let what = event_in_words(&message.event, motors);
    let lost = if message.dropped == 0 {
        String::new()
    } else {
        format!("  ({} events before it were lost)", message.dropped)
    };
    format!("t={}  {what}{lost}", seconds(message.time_us))
}

/// Of an input, which is closed in the normal state, or of a bus to raw frames.
pub fn open_or_closed(open: bool) -> &'static str {
    if open { "open" } else { "closed" }
}

pub fn yes_or_no(flag: bool) -> &'static str {
    if flag { "yes" } else { "no" }
}

fn event_in_words(event: &Event, motors: &Protocols) -> String {
    match event {
        Event::Tripped { axis, trip } => tripped(*axis, &trip.reason, motors.of(*axis)),
        Event::StopConfirmed { axis, reaction_us, elapsed_us, standstill } => format!(
            "axis {axis} stop confirmed: first stop on the bus after {}, confirmed after {}{}",
            milliseconds(*reaction_us),
            milliseconds(*elapsed_us),
            match standstill {
                Some(true) => ", standing still",
                Some(false) => ", still turning",
                None => "",
            }
        ),
        Event::StateChanged { axis, state } => format!("axis {axis} is {}", axis_state(*state)),
        Event::AuthorityLost { reason } => format!("authority lost: {}", name(reason)),
        Event::EStopLatched {} => "e-stop latched".to_owned(),
        Event::EStopCleared {} => "e-stop cleared".to_owned(),
        Event::EStopInputChanged { open } => {
            format!("the e-stop input is {}", open_or_closed(*open))
        }
        Event::EnableOutputChanged { active } => {
            format!("the enable output is {}", if *active { "active" } else { "inactive" })
        }
        Event::StopDelayed { bus, axis, waiting_us } => {
            format!(
                "axis {axis}: its stop has waited {} on bus {bus} and not left",
                milliseconds(*waiting_us)
            )
        }
        Event::BrakeUnverified { axis, locked } => {
            let told = if *locked { "locked" } else { "freed" };
            format!("axis {axis}: the brake was {told}, and the motor does not show it")
        }
        Event::AngleMismatch { axis, angle_rad, position_rad } => format!(
            "axis {axis}: the replies to setpoints tell {angle_rad} rad, 0x92 tells {position_rad} rad; \
             positions come from 0x92 alone"
        ),
        Event::FrameRejected { reason, count } => {
            let why = frame_error(*reason).map(|name| json::snake(name).replace('_', " "));
            format!(
                "{count} frames from this host were rejected: {}",
                why.as_deref().unwrap_or("unknown reason")
            )
        }
        Event::BusStateChanged { bus, state } => format!("bus {bus} is {state}"),
        Event::MotorNotice { axis, data, length, unreported } => {
            let data = data.get(..usize::from(*length)).unwrap_or(data);
            let before = match unreported {
                0 => String::new(),
                unreported => format!(", and {unreported} frames before it"),
            };
            format!("axis {axis}: the motor sent {} unasked{before}", hex(data))
        }
        Event::AxisUnreachable { axis, stop_transmitted: true } => {
            format!("axis {axis} does not confirm its stops and may be turning: cut its power")
        }
        Event::AxisUnreachable { axis, stop_transmitted: false } => {
            format!(
                "the stop of axis {axis} cannot be sent, its motor may be turning: cut its power"
            )
        }
        Event::Sample { axis, state, .. } => {
            format!("axis {axis}: a sample, {}", axis_state(*state))
        }
        Event::RequestDropped { count: 1 } => "a request of this host was dropped".to_owned(),
        Event::RequestDropped { count } => format!("{count} requests of this host were dropped"),
        Event::Unknown { number } => {
            format!("event {number:#06x}, which this program does not know: update it")
        }
    }
}

/// Bytes in hexadecimal, without spaces.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}
