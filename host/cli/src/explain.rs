//! Errors, trips and findings to the page that helps with them: one table, and `mgw explain`.
//!
//! A page is for one symptom. Its code stands at the end of the text that leads to it, as
//! `[E-bus-off]`, and in JSON as `explain`.

use std::fmt;

use host_protocol::{Error, NoReplyHint, TripReason};
use mgw_client::{ClientError, ConnectError};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::output::Output;
use crate::table::Table;

macro_rules! pages {
    ($($name:ident $file:literal)+) => {
        /// A page of docs/troubleshooting.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Page { $($name),+ }

        impl Page {
            /// Every page.
            const ALL: &[Self] = &[$(Self::$name),+];

            /// What leads to it: `E-` and the name of its file.
            pub const fn code(self) -> &'static str {
                match self { $(Self::$name => concat!("E-", $file)),+ }
            }

            /// The page itself, so that nobody needs the network.
            const fn text(self) -> &'static str {
                match self {
                    $(Self::$name => include_str!(concat!(
                        "../../../docs/troubleshooting/", $file, ".md"
                    ))),+
                }
            }
        }
    };
}

pages! {
    NoPort "no-port"
    NoPermission "no-permission"
    PortInUse "port-in-use"
    NoAnswer "no-answer"
    BaudRate "baud-rate"
    ConnectionLost "connection-lost"
    OtherVersion "other-version"
    NotInCommand "not-in-command"
    NotConfigured "not-configured"
    ValueRefused "value-refused"
    NotSupported "not-supported"
    ConfigurationRefused "configuration-refused"
    ConfigurationDiffers "configuration-differs"
    NotStored "not-stored"
    BusOverloaded "bus-overloaded"
    Overruns "overruns"
    DoesNotArm "does-not-arm"
    MotorTimeout "motor-timeout"
    MotorTurns "motor-turns"
    BrakeLocked "brake-locked"
    WrongState "wrong-state"
    EStop "e-stop"
    SetpointExpired "setpoint-expired"
    HostSilent "host-silent"
    NotDelivered "not-delivered"
    MotorSilent "motor-silent"
    MotorFault "motor-fault"
    MotorRestarted "motor-restarted"
    LimitExceeded "limit-exceeded"
    TripGroup "trip-group"
    NotAcknowledged "not-acknowledged"
    BusOff "bus-off"
    BusErrors "bus-errors"
    StopNotConfirmed "stop-not-confirmed"
    GatewayRestarted "gateway-restarted"
    InternalError "internal-error"
    NotArrived "not-arrived"
    FirmwareUpdate "firmware-update"
    FlightRecorder "flight-recorder"
    ScanFindsNothing "scan-finds-nothing"
    DoubledId "doubled-id"
    Dialect "dialect"
    MotorSetting "motor-setting"
    RawFrames "raw-frames"
}

impl Page {
    /// What the page is about: its heading.
    fn title(self) -> &'static str {
        self.text().lines().next().unwrap_or_default().trim_start_matches("# ")
    }

    /// The page of a refusal.
    pub const fn of_error(error: &Error) -> Self {
        match error {
            Error::UnknownRequest { .. }
            | Error::BadBody { .. }
            | Error::UnsupportedVersion { .. }
            | Error::UnknownParameter { .. }
            | Error::Unknown { .. } => Self::OtherVersion,
            Error::NotInCommand { .. } | Error::NobodyInCommand {} => Self::NotInCommand,
            Error::NoSession {}
            | Error::GatewayAway {}
            | Error::NoChangesBegun {}
            | Error::Restarting {} => Self::ConnectionLost,
            Error::BaudNotOffered { .. } | Error::LinkHasNoBaud {} => Self::BaudRate,
            Error::NotConfigured { .. } | Error::BusNotConfigured { .. } => Self::NotConfigured,
            Error::OutOfRange { .. }
            | Error::NotANumber { .. }
            | Error::WrongType { .. }
            | Error::SpeedLimitZero { .. }
            | Error::UnknownAxis { .. }
            | Error::UnknownBus { .. } => Self::ValueRefused,
            Error::Unsupported { .. }
            | Error::CannotCheckLimit { .. }
            | Error::NotACommand { .. }
            | Error::NotThisNode { .. } => Self::NotSupported,
            Error::NodeInUse { .. }
            | Error::IdInUse { .. }
            | Error::NotACanId { .. }
            | Error::ProtocolNotOnBus { .. }
            | Error::WrongBusKind { .. }
            | Error::BitrateNotOffered { .. }
            | Error::NeedsOwnBus { .. }
            | Error::ParameterNeedsProtocol { .. }
            | Error::CannotMeasure { .. }
            | Error::BrakeStaysOpen { .. }
            | Error::TooManyChanges { .. }
            | Error::NotAName { .. }
            | Error::NameTaken { .. } => Self::ConfigurationRefused,
            Error::NoStorage {}
            | Error::SingleBank {}
            | Error::Saving {}
            | Error::SaveFailed {}
            | Error::StorageFull {} => Self::NotStored,
            Error::BusOverloaded { .. } => Self::BusOverloaded,
            Error::CannotConfirm { .. }
            | Error::NoRandomNumber {}
            | Error::CannotStartTogether { .. } => Self::DoesNotArm,
            Error::MotorTimeoutUnknown { .. }
            | Error::MotorTimeoutOff { .. }
            | Error::MotorTimeoutTooShort { .. } => Self::MotorTimeout,
            Error::NotStandstill { .. } => Self::MotorTurns,
            Error::BrakeLocked { .. } | Error::BrakeOn { .. } => Self::BrakeLocked,
            Error::NotArmed { .. }
            | Error::NotIdle { .. }
            | Error::NotHolding { .. }
            | Error::Busy { .. }
            | Error::Aborted { .. }
            | Error::BusInUse { .. }
            | Error::NothingToClear { .. }
            | Error::Superseded { .. }
            | Error::QueueFull { .. } => Self::WrongState,
            Error::EStopped {} | Error::EStopInputOpen {} => Self::EStop,
            Error::Tripped { reason, .. } | Error::CauseRemains { reason, .. } => {
                Self::of_trip(reason)
            }
            Error::Stale { .. } | Error::StaleEpoch { .. } => Self::SetpointExpired,
            Error::NoReply { hint: NoReplyHint::NotAcknowledged, .. } => Self::NotAcknowledged,
            Error::NoReply { .. } => Self::MotorSilent,
            Error::BusOff { .. } => Self::BusOff,
            Error::MotorFault { .. } | Error::Refused { .. } => Self::MotorFault,
            Error::NotRestarted { .. } | Error::RestartOwed { .. } => Self::MotorRestarted,
            Error::StopNotConfirmed { .. } => Self::StopNotConfirmed,
            Error::NotInDialect { .. } | Error::DialectContradicted { .. } => Self::Dialect,
            Error::OutputStaysOn { .. } => Self::MotorSetting,
            Error::NoImageRoom {}
            | Error::ImageForAnotherBoard {}
            | Error::OlderImage { .. }
            | Error::ImageLength { .. }
            | Error::ImageGap { .. }
            | Error::ImageIncomplete { .. }
            | Error::ImageDamaged {}
            | Error::ImageNotSigned {}
            | Error::ImageNotWritten {}
            | Error::ImageOnTrial {}
            | Error::NoImageOnTrial {} => Self::FirmwareUpdate,
            Error::NoFlightRecorder {}
            | Error::FlightRecording {}
            | Error::FlightRecorderBusy {}
            | Error::BeyondFlightRecord { .. } => Self::FlightRecorder,
            Error::RawNotOpen { .. }
            | Error::RawOpen { .. }
            | Error::RawNotHarmless { .. }
            | Error::AxisOnBus { .. }
            | Error::BusOnlyListens { .. } => Self::RawFrames,
        }
    }

    /// The page of a trip.
    pub const fn of_trip(reason: &TripReason) -> Self {
        match reason {
            TripReason::SetpointExpired => Self::SetpointExpired,
            TripReason::HostSilent => Self::HostSilent,
            TripReason::MotorSilent => Self::MotorSilent,
            TripReason::MotorFault { .. } | TripReason::CommandRefused { .. } => Self::MotorFault,
            TripReason::NotAcknowledged => Self::NotAcknowledged,
            TripReason::BusOff => Self::BusOff,
            TripReason::LimitExceeded { .. } => Self::LimitExceeded,
            TripReason::EStop => Self::EStop,
            TripReason::Reset => Self::GatewayRestarted,
            TripReason::Internal { .. } => Self::InternalError,
            TripReason::StopUnconfirmed => Self::StopNotConfirmed,
            TripReason::Group { .. } => Self::TripGroup,
            TripReason::Uncommanded => Self::MotorTurns,
            TripReason::NotDelivered => Self::NotDelivered,
            TripReason::MotorRestarted => Self::MotorRestarted,
        }
    }

    /// The page of a request that has no result; none where its text says all there is.
    const fn of_client(error: &ClientError) -> Option<Self> {
        Some(match error {
            ClientError::Gateway(error) => Self::of_error(error),
            ClientError::NoAnswer { request, .. } if is_hello(request) => Self::NoAnswer,
            ClientError::NoAnswer { .. } | ClientError::Transport(_) => Self::ConnectionLost,
            ClientError::StopUnanswered { .. } => Self::StopNotConfirmed,
            ClientError::Incompatible { .. } | ClientError::UnreadableReply { .. } => {
                Self::OtherVersion
            }
            ClientError::BaudFailed { .. } => Self::BaudRate,
            ClientError::LinksTaken => Self::PortInUse,
            ClientError::Connect(ConnectError::BadBaud { .. } | ConnectError::RateOfOne { .. }) => {
                Self::BaudRate
            }
            ClientError::Connect(_) => Self::NoPort,
            ClientError::Interrupted { .. }
            | ClientError::NamedTwice { .. }
            | ClientError::NoSuchAxis { .. }
            | ClientError::TooLong { .. } => return None,
        })
    }

    /// The page of a failure; none where its text says all there is, as of a word typed wrong or a
    /// file that is not there.
    pub fn of_failure(failure: &Failure) -> Option<Self> {
        Some(match failure {
            Failure::Explained { error, .. } => Self::of_error(error),
            Failure::Client(error) | Failure::Lost { cause: error, .. } => {
                return Self::of_client(error);
            }
            Failure::NoGateway { .. } => Self::NoPort,
            Failure::Port { name, .. } => match *name {
                "NoPermission" => Self::NoPermission,
                "PortInUse" => Self::PortInUse,
                _ => Self::NoAnswer,
            },
            Failure::Server { .. } => Self::PortInUse,
            Failure::Configuration { findings, .. } => match findings.as_slice() {
                [one] if one.name == "BusOverloaded" => Self::BusOverloaded,
                _ => Self::ConfigurationRefused,
            },
            Failure::Differs { .. } => Self::ConfigurationDiffers,
            Failure::Refused { .. } => Self::ValueRefused,
            Failure::Named { page, .. } => return *page,
            Failure::Tripped { reason, .. } => Self::of_trip(reason),
            Failure::StoppedElsewhere { .. } => Self::NotInCommand,
            Failure::NotArrived { .. } => Self::NotArrived,
            Failure::StopNotConfirmed { .. } | Failure::StopTaken { .. } => Self::StopNotConfirmed,
            Failure::Usage(_)
            | Failure::File { .. }
            | Failure::Terminal(_)
            | Failure::Unwritten { .. }
            | Failure::Undecoded { .. }
            | Failure::Unwell { .. }
            | Failure::Output(_)
            | Failure::CutShort => return None,
        })
    }

    /// The page with this code, however it is written: `E-bus-off`, `[E-bus-off]`, `bus-off`.
    fn find(code: &str) -> Option<Self> {
        let code = code.trim_matches(['[', ']']).to_ascii_lowercase();
        let name = code.strip_prefix("e-").filter(|name| *name != "stop").unwrap_or(&code);
        Self::ALL.iter().copied().find(|page| page.code().strip_prefix("E-") == Some(name))
    }
}

/// `const` needs it spelled out.
const fn is_hello(request: &str) -> bool {
    matches!(request.as_bytes(), b"Hello")
}

impl fmt::Display for Page {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}]", self.code())
    }
}

/// What failed as a sentence, and the code of its page.
pub fn with_page(failure: &Failure) -> String {
    let page = Page::of_failure(failure).map(|page| format!(" {page}")).unwrap_or_default();
    format!("{failure}.{page}")
}

/// Prints the page of a code, or which codes there are.
pub fn run(code: Option<&str>, out: Output) -> Result<(), Failure> {
    let Some(code) = code else {
        let mut table = Table::new(&["code", "what it is about"]);
        for page in Page::ALL {
            table.row([page.code().to_owned(), page.title().to_owned()]);
        }
        out.table(&table)?;
        return out.object(&json!({ "pages": Page::ALL.iter().map(line).collect::<Value>() }));
    };
    let page = Page::find(code).ok_or_else(|| {
        Failure::Usage(format!("there is no page `{code}`. `mgw explain` lists them all"))
    })?;
    let mut object = line(&page);
    object["text"] = json!(page.text());
    page.text().lines().try_for_each(|line| out.text(line))?;
    out.object(&object)
}

fn line(page: &Page) -> Value {
    json!({ "explain": page.code(), "title": page.title() })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use clap::{CommandFactory, Parser};

    use super::*;
    use crate::args::Cli;

    const PAGES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/troubleshooting");
    /// What stands for a file of the reader's.
    const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/four-motors.toml");
    const INDEX: &str = include_str!("../../../docs/troubleshooting/README.md");

    /// Every command of a page, its lines typed and what stands in backquotes, word by word.
    fn commands(text: &'static str) -> Vec<Vec<&'static str>> {
        let typed = text.lines().filter_map(|line| line.trim_start().strip_prefix("$ "));
        let prose = text.split("```").step_by(2);
        let quoted = prose.flat_map(|prose| prose.split('`').skip(1).step_by(2));
        let file = |word| if ["robot.toml", "FILE"].contains(&word) { FILE } else { word };
        let words = |command: &'static str| command.split_whitespace().map(file).collect();
        let all = typed.chain(quoted).map(words);
        all.filter(|words: &Vec<&str>| words.first() == Some(&"mgw") && words.len() > 1).collect()
    }

    #[test]
    fn each_file_is_a_page_of_the_table_and_of_the_index() {
        let files: BTreeSet<String> = std::fs::read_dir(PAGES)
            .unwrap()
            .filter_map(|file| file.unwrap().path().file_stem()?.to_str().map(str::to_owned))
            .filter(|name| name != "README")
            .map(|name| format!("E-{name}"))
            .collect();
        let table: BTreeSet<String> = Page::ALL.iter().map(|page| page.code().to_owned()).collect();
        assert_eq!(files, table);
        for page in Page::ALL {
            let file = page.code().trim_start_matches("E-");
            let row = format!("| [`{}`]({file}.md) | {} |", page.code(), page.title());
            assert!(INDEX.lines().any(|line| line == row), "the index lacks: {row}");
        }
        assert_eq!(INDEX.matches(".md) |").count(), Page::ALL.len());
    }

    #[test]
    fn each_page_has_a_heading_and_a_way_out() {
        for page in Page::ALL {
            let text = page.text();
            assert!(text.starts_with("# ") && text.lines().nth(1) == Some(""), "{page}");
            assert!(!commands(text).is_empty(), "{page} names no command");
        }
    }

    #[test]
    fn each_command_of_a_page_is_one() {
        Cli::command().debug_assert();
        for text in Page::ALL.iter().map(|page| page.text()).chain([INDEX]) {
            for command in commands(text) {
                // One that is only named goes without its arguments.
                let is_named =
                    command.len() == 2 && Cli::command().find_subcommand(command[1]).is_some();
                if let Err(error) = Cli::try_parse_from(&command)
                    && error.use_stderr()
                    && !is_named
                {
                    panic!("{}: {error}", command.join(" "));
                }
            }
        }
    }

    #[test]
    fn links_of_a_page_lead_somewhere() {
        for page in Page::ALL {
            for link in page.text().split("](").skip(1) {
                let target = link.split([')', '#']).next().unwrap();
                let is_there = target.is_empty() || Path::new(PAGES).join(target).exists();
                assert!(is_there, "{page}: {target}");
            }
        }
    }

    #[test]
    fn a_code_is_found_however_it_is_written() {
        for code in ["E-e-stop", "[E-e-stop]", "e-stop", "E-STOP", "e-e-stop"] {
            assert_eq!(Page::find(code), Some(Page::EStop), "{code}");
        }
        for page in Page::ALL {
            assert_eq!(Page::find(page.code()), Some(*page));
            assert_eq!(Page::find(page.code().strip_prefix("E-").unwrap()), Some(*page));
        }
        assert_eq!(Page::find("E-"), None);
        assert_eq!(Page::find("308"), None);
    }

    /// A page that nothing leads to is read by nobody: each code is used outside the table, too.
    #[test]
    fn each_page_is_reached_by_something() {
        let sources = sources(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src")));
        let table = include_str!("explain.rs").split("mod tests").next().unwrap();
        for page in Page::ALL {
            let own = table.matches(&format!("Self::{page:?}")).count();
            let others = sources.matches(&format!("Page::{page:?}")).count();
            assert!(own + others > 0, "nothing leads to {page}");
        }
    }

    fn sources(directory: &Path) -> String {
        let mut all = String::new();
        for entry in std::fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                all += &sources(&path);
            } else if !path.ends_with("explain.rs") {
                all += &std::fs::read_to_string(&path).unwrap();
            }
        }
        all
    }
}
