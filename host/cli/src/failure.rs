//! Why a command failed, for people and for programs.

use std::fmt;
use std::io;

use host_protocol::{AxisParameter, AxisState, Error, Quantity, Trip, TripReason};
use mgw_client::{ClientError, ConnectError};
use serde_json::{Value, json};

use crate::config::Finding;
use crate::explain::Page;
use crate::faults::Protocols;
use crate::interrupt;
use crate::json;
use crate::output::number;
use crate::words;

/// Exit code of a command that was refused or failed.
const FAILED: u8 = 1;
/// Exit code of wrong usage, and of a file that cannot be read; clap uses the same.
const WRONG_USAGE: u8 = 2;
/// Exit code of a stop that was sent and is not confirmed.
const NOT_CONFIRMED: u8 = 3;

/// Why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// The gateway refused, or could not be reached.
    Client(ClientError),
    /// What the gateway would refuse, or does, in words of its own.
    Explained { error: Error, text: String },
    /// No port was named, and none was found.
    NoGateway { text: String },
    /// A port that is there cannot be used.
    Port { name: &'static str, text: String },
    /// What was typed, or stands in a file, makes no sense.
    Usage(String),
    /// A configuration has errors.
    Configuration { path: String, findings: Vec<Finding> },
    /// The configuration of the gateway is not that of the file.
    Differs { path: String, count: usize },
    /// A codec refuses a value.
    Refused {
        name: &'static str,
        field: &'static str,
        value: f64,
        range: Option<(f64, f64)>,
        message: String,
    },
    /// What else did not succeed, by its own name, and the page that says more.
    Named { name: &'static str, page: Option<Page>, text: String },
    /// A file could not be read.
    File { path: String, source: io::Error },
    /// The gateway is out of reach while axes are armed.
    Lost { axes: Vec<u8>, cause: ClientError },
    /// Captured frames that have no meaning.
    Undecoded { failed: u64, total: u64 },
    /// An axis tripped while it was to be held.
    Tripped { axis: u8, reason: TripReason, text: String },
    /// An axis that was to be held is no longer armed, and nobody here has stopped it.
    StoppedElsewhere { axis: u8, state: AxisState },
    /// A move ended on the way.
    NotArrived { axis: u8, place: String, target_rad: f32 },
    /// The motor did not confirm its stop in time.
    StopNotConfirmed { axis: u8 },
    /// The gateway took the stop, and could not be asked what came of it.
    StopTaken { cause: String },
    /// The server of the simulation could not start or go on.
    Server { address: String, source: io::Error, another: &'static str },
    /// The terminal cannot be used.
    Terminal(io::Error),
    /// A file could not be written.
    Unwritten { path: String, source: io::Error },
    /// `mgw doctor` has found something.
    Unwell { wrong: usize },
    /// Nobody reads what is printed, or it cannot be written.
    Output(io::Error),
    /// What was under way ended because nobody reads what is printed.
    CutShort,
}

impl Failure {
    /// Nothing can listen on a TCP port.
    pub fn no_port(address: String, source: io::Error) -> Self {
        Self::Server { address, source, another: "another port, or 0 for a free one" }
    }

    /// A name that programs can rely on: the gateway's own for its errors.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Explained { error, .. } => error.name(),
            Self::Client(error) | Self::Lost { cause: error, .. } => client_name(error),
            Self::Port { name, .. } | Self::Named { name, .. } => name,
            Self::Usage(_) | Self::NoGateway { .. } => "Usage",
            Self::Configuration { findings, .. } => match findings.as_slice() {
                [one] => one.name,
                _ => "Configuration",
            },
            Self::Differs { .. } => "Differs",
            Self::Refused { name, .. } => name,
            Self::File { .. } => "File",
            Self::Undecoded { .. } => "Undecoded",
            Self::Tripped { .. } => "Tripped",
            Self::StoppedElsewhere { .. } => "StoppedElsewhere",
            Self::NotArrived { .. } => "NotArrived",
            Self::StopNotConfirmed { .. } | Self::StopTaken { .. } => "StopNotConfirmed",
            Self::Server { .. } => "Server",
            Self::Terminal(_) => "Terminal",
            Self::Unwritten { .. } => "Unwritten",
            Self::Unwell { .. } => "Unwell",
            Self::Output(_) => "Output",
            Self::CutShort => "CutShort",
        }
    }

    /// What did not succeed, by a name of its own.
    pub fn named(
        name: &'static str,
        page: impl Into<Option<Page>>,
        text: impl Into<String>,
    ) -> Self {
        Self::Named { name, page: page.into(), text: text.into() }
    }

    /// A measurement, or a picture of one, could not go on.
    pub fn not_measured(text: impl Into<String>) -> Self {
        Self::named("NotMeasured", None, text)
    }

    /// Of axes that were armed, and what became of the connection to the gateway.
    pub fn lost(axes: &[u8], cause: ClientError) -> Self {
        match cause {
            ClientError::Gateway(_) => Self::Client(cause),
            cause => Self::Lost { axes: axes.to_vec(), cause },
        }
    }

    /// An axis that was to be held has tripped.
    pub fn tripped(axis: u8, trip: &Trip, motors: Protocols) -> Self {
        let text = words::trip_reason(&trip.reason, motors.of(axis));
        Self::Tripped { axis, reason: trip.reason, text }
    }

    /// An axis lacks a parameter, as the gateway would say.
    pub fn lacks(axis: u8, parameter: AxisParameter) -> Self {
        let parameter = parameter.number();
        Self::Client(ClientError::Gateway(Error::NotConfigured { axis, parameter }))
    }

    /// What the gateway would refuse, found before it is asked.
    pub fn would_be_refused(error: Error) -> Self {
        Self::Explained { error, text: with_way_out(&error) }
    }

    /// What the gateway refused it with, or would.
    pub fn gateway_error(&self) -> Option<&Error> {
        match self {
            Self::Client(ClientError::Gateway(error)) | Self::Explained { error, .. } => {
                Some(error)
            }
            _ => None,
        }
    }

    /// The object that `--json` prints on standard error.
    pub fn to_json(&self) -> Value {
        let mut error = json!({ "name": json::snake(self.name()), "message": self.to_string() });
        let more = match self {
            Self::Client(ClientError::Gateway(cause)) | Self::Explained { error: cause, .. } => {
                error["number"] = json!(cause.number());
                data(cause)
            }
            Self::Tripped { axis, reason, .. } => tripped(*axis, reason),
            Self::StoppedElsewhere { axis, state } => json::axis::in_state(*axis, *state),
            Self::StopNotConfirmed { axis } => json!({ "axis": axis }),
            Self::Undecoded { failed, total } => json!({ "failed": failed, "total": total }),
            Self::Configuration { path, findings } => json!({
                "file": path, "findings": findings.iter().map(Finding::to_json).collect::<Value>(),
            }),
            Self::Refused { field, value, range, .. } => json!({
                "field": field, "value": value,
                "min": range.map(|(min, _)| min), "max": range.map(|(_, max)| max),
            }),
            _ => Value::Null,
        };
        json::extend(&mut error, more);
        if let Some(page) = Page::of_failure(self) {
            error["explain"] = json!(page.code());
        }
        json!({ "error": error })
    }

    /// The exit code of the program.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::NoGateway { .. } | Self::File { .. } => WRONG_USAGE,
            Self::Configuration { findings, .. }
                if findings.iter().all(|finding| finding.name == "Usage") =>
            {
                WRONG_USAGE
            }
            Self::Client(ClientError::Connect(error)) if is_no_port(error) => WRONG_USAGE,
            Self::StopNotConfirmed { .. }
            | Self::StopTaken { .. }
            | Self::Lost { cause: ClientError::StopUnanswered { .. }, .. }
            | Self::Client(ClientError::StopUnanswered { .. }) => NOT_CONFIRMED,
            // The reader of a pipe has seen enough: `mgw watch | head` is no failure.
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => 0,
            _ => FAILED,
        }
    }

    /// Whether the gateway can still be talked to.
    pub fn is_from_gateway(&self) -> bool {
        match self {
            Self::Client(error) => matches!(error, ClientError::Gateway(_)),
            Self::Lost { .. } | Self::Port { .. } | Self::NoGateway { .. } => false,
            _ => true,
        }
    }

    /// Whether there is nothing to tell: the reader has seen enough.
    pub fn is_silent(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// Of what does more than print: it was not done when its reader went. After an interrupt,
    /// which may have ended the reader too, it was to end.
    pub fn cut_short(self) -> Self {
        if self.is_silent() && !interrupt::is_raised() { Self::CutShort } else { self }
    }

    /// The first failure; that something could not be printed only where nothing else failed.
    pub fn first(results: impl IntoIterator<Item = Result<(), Self>>) -> Result<(), Self> {
        let mut first = Ok(());
        for next in results {
            first = match (first, next) {
                (Err(Self::Output(_)), Err(next)) => Err(next),
                (first, next) => first.and(next),
            };
        }
        first
    }
}

fn client_name(error: &ClientError) -> &'static str {
    match error {
        ClientError::Gateway(error) => error.name(),
        ClientError::NoAnswer { .. } => "NoAnswer",
        ClientError::StopUnanswered { .. } => "StopUnanswered",
        ClientError::Interrupted { .. } => "Interrupted",
        ClientError::Incompatible { .. } => "Incompatible",
        ClientError::UnreadableReply { .. } => "UnreadableReply",
        ClientError::NamedTwice { .. } => "NamedTwice",
        ClientError::NoSuchAxis { .. } => "NoSuchAxis",
        ClientError::TooLong { .. } => "TooLong",
        ClientError::BaudFailed { .. } => "BaudFailed",
        ClientError::LinksTaken => "LinksTaken",
        ClientError::Connect(error) if is_no_port(error) => "Usage",
        ClientError::Connect(_) => "NoConnection",
        ClientError::Transport(_) => "ConnectionLost",
    }
}

/// `0, 2 and 3`
pub fn list(axes: &[u8]) -> String {
    let numbers: Vec<String> = axes.iter().map(u8::to_string).collect();
    match numbers.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} and {last}", before.join(", ")),
        _ => numbers.concat(),
    }
}

/// What the gateway has refused, with the command that helps where there is one.
fn with_way_out(error: &Error) -> String {
    let not_configured = |what: String, missing: String| {
        format!(
            "{what} is not configured: {missing}. Write it into a file, then `mgw config apply \
                FILE`"
        )
    };
    match *error {
        Error::NotConfigured { axis, parameter } => not_configured(
            format!("axis {axis}"),
            format!("it has no {}", Quantity::Parameter(parameter)),
        ),
        Error::BusNotConfigured { bus } => {
            not_configured(format!("bus {bus}"), "it has no bitrate".to_owned())
        }
        Error::MotorTimeoutUnknown { axis } | Error::MotorTimeoutOff { axis } => {
            format!("{error}: `mgw config timeout {axis} 300`")
        }
        Error::MotorTimeoutTooShort { axis, least_ms, .. } => {
            format!("{error}: `mgw config timeout {axis} {least_ms}`, or a shorter reply_window_us")
        }
        Error::NotIdle { axis, state: AxisState::Holding } | Error::BusInUse { axis, .. } => {
            format!("{error}: `mgw output-off {axis}`")
        }
        Error::NotIdle { axis, state: AxisState::Tripped { .. } } | Error::Tripped { axis, .. } => {
            format!("{error}: `mgw clear {axis}`")
        }
        Error::TooManyChanges { .. } => format!(
            "{error}: `mgw config remove AXIS`, or parts of a file one after the other by `mgw config \
                apply --merge`"
        ),
        Error::NothingToClear { axis } => format!(
            "axis {axis} has nothing that this clears: `mgw clear` needs a trip, `--unreachable` a \
                motor that does not confirm its stop"
        ),
        _ => error.to_string(),
    }
}

/// Whether the text is no name of a port at all.
fn is_no_port(error: &ConnectError) -> bool {
    matches!(
        error,
        ConnectError::NoPort
            | ConnectError::NoPath
            | ConnectError::BadAddress { .. }
            | ConnectError::BadBaud { .. }
            | ConnectError::RateOfOne { .. }
    )
}

/// The data of those errors whose data a program may act on.
pub fn data(error: &Error) -> Value {
    match error {
        Error::OutOfRange { quantity, value, min, max } => json!({
            "quantity": quantity.to_string().replace(' ', "_"), "unit": quantity.unit(),
            "value": number(*value), "min": number(*min), "max": number(*max)
        }),
        Error::Tripped { axis, reason } | Error::CauseRemains { axis, reason } => {
            tripped(*axis, reason)
        }
        Error::NotArmed { axis, state }
        | Error::NotIdle { axis, state }
        | Error::Aborted { axis, state } => json::axis::in_state(*axis, *state),
        Error::NotInCommand { holder } => json!({ "holder": holder }),
        _ => Value::Null,
    }
}

/// The axis and the reason of its trip; the faults have no names here.
fn tripped(axis: u8, reason: &TripReason) -> Value {
    let mut value = json::axis::reason(reason, None);
    value["axis"] = json!(axis);
    value
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Client(ClientError::Gateway(error)) => f.write_str(&with_way_out(error)),
            Self::Client(error) => error.fmt(f),
            Self::Lost { axes, cause } => {
                let (them, trip) = match axes.as_slice() {
                    [axis] => (format!("axis {axis}"), "trips"),
                    axes => (format!("axes {}", list(axes)), "trip"),
                };
                write!(
                    f,
                    "{cause}. Without this host {them} {trip}: the gateway stops what it holds. \
                        When the gateway answers again, `mgw state` shows the trip and `mgw clear \
                        AXIS` clears it"
                )
            }
            Self::Usage(text)
            | Self::Named { text, .. }
            | Self::Explained { text, .. }
            | Self::Port { text, .. }
            | Self::NoGateway { text }
            | Self::Refused { message: text, .. } => f.write_str(text),
            Self::Configuration { path, findings } => {
                for (index, finding) in findings.iter().enumerate() {
                    let before = if index > 0 { "\n" } else { "" };
                    write!(f, "{before}{path}: {finding}")?;
                }
                Ok(())
            }
            Self::Differs { path, count } => {
                write!(f, "the gateway has {count} settings other than {path}")
            }
            Self::Unwell { wrong: 1 } => write!(f, "one thing is wrong"),
            Self::Unwell { wrong } => write!(f, "{wrong} things are wrong"),
            Self::Unwritten { path, source } if source.kind() == io::ErrorKind::AlreadyExists => {
                write!(f, "{path} is there already. Name another file, or add --force")
            }
            Self::Unwritten { path, source } => {
                use io::ErrorKind::{FileTooLarge, QuotaExceeded, ResourceBusy, StorageFull};
                let advice = match source.kind() {
                    StorageFull | QuotaExceeded | FileTooLarge => {
                        "Make room, or name another place"
                    }
                    ResourceBusy => "Name another file, or end what uses this one",
                    _ => "Check the path",
                };
                write!(f, "cannot write {path} ({source}). {advice}")
            }
            Self::File { path, source } => {
                write!(f, "cannot read {path} ({source}). Check the path")
            }
            Self::Terminal(error) => write!(f, "the terminal: {error}"),
            Self::Undecoded { failed, total } => {
                write!(f, "{failed} of {total} lines are no frame that could be decoded")
            }
            Self::Tripped { axis, text, .. } => write!(
                f,
                "axis {axis} tripped: {text}. Remove the cause, then `mgw clear {axis}`; `mgw \
                    state {axis}` shows the last values"
            ),
            Self::StoppedElsewhere { axis, state } => write!(
                f,
                "axis {axis} was stopped by another host, or by the gateway because it had not \
                    heard from this one; it is {}",
                words::axis_state(*state)
            ),
            Self::NotArrived { axis, place, target_rad } => write!(
                f,
                "axis {axis} has not arrived: it is at {place} and was to go to {target_rad:.3} \
                    rad. Give it more time with --for, or a greater --speed-limit"
            ),
            Self::StopNotConfirmed { axis } => write!(
                f,
                "axis {axis} has not confirmed its stop; the gateway goes on stopping it. Cut its \
                    power if it turns, then look at `mgw state {axis}`"
            ),
            Self::StopTaken { cause } => write!(
                f,
                "the gateway took the stop; whether the motors are at rest is not known ({cause}). \
                    Look at `mgw state`, and cut their power if they turn"
            ),
            Self::Server { address, source, another } => {
                write!(f, "cannot serve on {address} ({source}). Choose {another}")
            }
            Self::Output(error) => write!(f, "standard output: {error}"),
            Self::CutShort => f.write_str(
                "this ended before it was done, as nobody reads its output any more; what it had \
                    armed is stopped",
            ),
        }
    }
}

impl std::error::Error for Failure {}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        Self::Client(error)
    }
}

impl From<ConnectError> for Failure {
    fn from(error: ConnectError) -> Self {
        Self::Client(error.into())
    }
}
