//! What a gateway would refuse of a configuration: asked of the gateway's own core, which runs here
//! on a board like the one that it is for. It is asked row by row, so that all errors are found.

use std::mem::{discriminant, replace};

use gateway::{Board, BusPort, Event, Gateway, Instant, LinkPort};
use host_protocol::{
    AxisParameter, BootReason, BusKind, Change, Deframer, Error, Kind, MAX_FRAME, PROTOCOL_MAJOR,
    PROTOCOL_MINOR, ProtocolSet, Quantity, Request, StopAction, Subject, Value, requests,
};

use super::file::{File, Source, parse};
use super::{BoardPorts, Configuration, Finding, MOTOR_TIMEOUT, NAME};
use crate::failure::Failure;
use crate::parameters;

impl Source {
    /// What the file makes of a configuration, if a gateway on this board would take it.
    pub fn onto(&self, base: Configuration, board: &BoardPorts) -> Result<Configuration, Failure> {
        let file = parse(self, &base);
        let wanted = file.onto(base);
        refuse(&self.path, check(&file, &wanted, board))?;
        Ok(wanted)
    }

    /// What the file makes of nothing, if any gateway would take it.
    pub fn for_any_board(&self) -> Result<Configuration, Failure> {
        let nothing = Configuration::default();
        let file = parse(self, &nothing);
        let wanted = file.onto(nothing);
        refuse(&self.path, check_without_board(&file, &wanted))?;
        Ok(wanted)
    }
}

/// Refuses what has findings.
pub fn refuse(path: &str, findings: Vec<Finding>) -> Result<(), Failure> {
    if findings.is_empty() {
        return Ok(());
    }
    Err(Failure::Configuration { path: path.to_owned(), findings })
}

/// What is wrong with what a file makes of a configuration, for a board.
pub fn check(file: &File, configuration: &Configuration, board: &BoardPorts) -> Vec<Finding> {
    let mut check = Check { file, core: Core::new(board), findings: file.findings.clone() };
    for parameter in host_protocol::GatewayParameter::ALL.iter().copied() {
        if let Some(value) = configuration.gateway.get(&parameter).copied() {
            let change = Change::Gateway { parameter: parameter.number(), value };
            if let Err(error) = check.core.change(&[change]) {
                check.finds(Subject::Gateway, key_of(&error), &error);
            }
        }
    }
    for (bus, config) in &configuration.buses {
        check.bus(*bus, config);
    }
    for axis in configuration.axes.keys() {
        check.axis(*axis, configuration, board);
    }
    check.motor_timeouts(configuration);
    check.names(configuration);
    let mut findings = check.findings;
    findings.sort_by_key(|finding| finding.line);
    findings
}

/// What is wrong with a configuration whatever its board: the least that any board would refuse.
pub(super) fn check_without_board(file: &File, configuration: &Configuration) -> Vec<Finding> {
    let findings =
        BoardPorts::possible(configuration).map(|board| check(file, configuration, &board));
    findings.min_by_key(Vec::len).unwrap_or_default()
}

/// A gateway's core with this configuration, on a board with these buses.
pub fn core_of(configuration: &Configuration, board: &BoardPorts) -> Result<Box<Gateway>, Error> {
    Core::of(configuration, board).map(|core| core.gateway)
}

/// Refuses more changes from one configuration to another than a gateway makes together.
pub fn check_count(
    from: &Configuration,
    to: &Configuration,
    board: &BoardPorts,
) -> Result<(), Error> {
    Core::of(from, board)?.begin(&from.changes_to(to))
}

struct Check<'a> {
    file: &'a File,
    core: Core,
    findings: Vec<Finding>,
}

impl Check<'_> {
    /// How long those last at least depends on all that is on their buses.
    fn motor_timeouts(&mut self, configuration: &Configuration) {
        for (axis, timeout_ms) in &configuration.motor_timeouts {
            let row = Subject::Axis(*axis);
            let its_own = configuration.check_motor_timeout(*axis);
            let refused =
                its_own.and_then(|()| self.core.gateway.check_timeout(*axis, *timeout_ms));
            if self.file.names(row)
                && let Err(error) = refused
                && !matches!(error, Error::UnknownAxis { .. })
            {
                self.finds(row, Some(MOTOR_TIMEOUT), &error);
            }
        }
    }

    fn bus(&mut self, bus: u8, config: &host_protocol::BusConfig) {
        let row = Subject::Bus(bus);
        let mut is_complete = true;
        // None at all are protocols, too, where only raw frames are sent.
        let lacks_protocols = config.protocols == ProtocolSet::NONE
            && self.file.must_be_whole(row)
            && !self.file.sets_protocols(bus);
        let lacks = [
            (config.bitrate == 0, "bitrate", "bitrate = 1_000_000"),
            (lacks_protocols, "protocols", "protocols = [\"rmd\"]"),
        ];
        for (is_missing, key, example) in lacks {
            if is_missing {
                is_complete = false;
                self.lacks(row, key, &format!("for example {example}"));
            }
        }
        if is_complete
            && let Err(error) = self.core.change(&[Change::Bus { bus, config: Some(*config) }])
        {
            self.finds(row, bus_key_of(&error), &error);
        }
    }

    fn axis(&mut self, axis: u8, configuration: &Configuration, board: &BoardPorts) {
        let row = Subject::Axis(axis);
        if axis >= board.max_axes {
            let error = Error::UnknownAxis { axis, max_axes: board.max_axes };
            return self.finds(row, Some("axis"), &error);
        }
        let mut values = configuration.axes.get(&axis).cloned().unwrap_or_default();
        if self.file.must_be_whole(row) {
            for parameter in configuration.missing(axis) {
                let takes = format!("it takes {}", parameters::allowed(parameter.info()));
                self.lacks(row, parameter.text().name, &takes);
            }
            if let Some(bus) = configuration.idle_bus_of(axis)
                && usize::from(bus) < board.ports.len()
            {
                let text = format!("bus {bus} is not configured; add [[bus]] with bus = {bus}");
                self.says(row, Some("bus"), "BusNotConfigured", text);
            }
        }
        // One refusal may hide another: it is tried again without the parameter that was refused, or
        // with a stop action that every motor has.
        let mut stands_in = false;
        loop {
            let changes: Vec<Change> = values
                .iter()
                .map(|(parameter, value)| Change::Axis {
                    axis,
                    parameter: parameter.number(),
                    value: Some(*value),
                })
                .collect();
            let Err(error) = self.core.change(&changes) else { return };
            let parameter = parameter_of(&error);
            // Of the stop action that stands in for the one that was refused.
            if stands_in && matches!(error, Error::BrakeStaysOpen { .. }) {
                return;
            }
            let key = parameter.map(|parameter| parameter.text().name).or(key_of(&error));
            self.finds(row, key, &error);
            let coast = Value::Unsigned(StopAction::Coast.into());
            if key == Some("stop_action") && !replace(&mut stands_in, true) {
                values.insert(AxisParameter::StopAction, coast);
                continue;
            }
            let optional = parameter.filter(|parameter| !parameter.info().required);
            if optional.and_then(|parameter| values.remove(&parameter)).is_none() {
                return;
            }
        }
    }

    /// Of two rows of a kind with one name the second is wrong.
    fn names(&mut self, configuration: &Configuration) {
        let names = &configuration.names;
        for (row, name) in names {
            let same = |(other, its): &(&Subject, _)| {
                other < &row && discriminant(*other) == discriminant(row) && its == &name
            };
            if let Some((by, _)) = names.iter().find(same) {
                let error = Error::NameTaken { of: *row, by: *by };
                self.finds(*row, Some(NAME), &error);
            }
        }
    }

    /// A required key is missing, unless it is there with a value that it cannot have.
    fn lacks(&mut self, row: Subject, key: &str, what: &str) {
        if !self.file.has_slip(row, key) {
            self.says(row, Some(key), "NotConfigured", format!("lacks {key}; {what}"));
        }
    }

    fn finds(&mut self, row: Subject, key: Option<&str>, error: &Error) {
        self.says(row, key, error.name(), error.to_string());
    }

    fn says(&mut self, row: Subject, key: Option<&str>, name: &'static str, text: String) {
        let line = self.file.line(row, key);
        self.findings.push(Finding {
            line,
            row: Some(row),
            key: key.map(str::to_owned),
            name,
            text,
        });
    }
}

/// The parameter that an error is about.
fn parameter_of(error: &Error) -> Option<AxisParameter> {
    match *error {
        Error::CannotMeasure { parameter, .. }
        | Error::ParameterNeedsProtocol { parameter, .. }
        | Error::NotACanId { parameter, .. }
        | Error::OutOfRange { quantity: Quantity::Parameter(parameter), .. } => {
            AxisParameter::from_number(parameter)
        }
        Error::BrakeStaysOpen { .. } => Some(AxisParameter::ReleaseBrakeWhenArming),
        _ => None,
    }
}

/// The key of an axis that an error is about where it names no parameter.
fn key_of(error: &Error) -> Option<&'static str> {
    match error {
        Error::NodeInUse { .. }
        | Error::IdInUse { .. }
        | Error::OutOfRange { quantity: Quantity::Node, .. } => Some("node"),
        Error::ProtocolNotOnBus { .. } => Some("protocol"),
        Error::UnknownBus { .. } | Error::WrongBusKind { .. } => Some("bus"),
        Error::Unsupported { .. } => Some("stop_action"),
        _ => None,
    }
}

/// The key of a bus that an error is about.
fn bus_key_of(error: &Error) -> Option<&'static str> {
    match error {
        Error::BitrateNotOffered { .. } | Error::OutOfRange { quantity: Quantity::Bitrate, .. } => {
            Some("bitrate")
        }
        Error::WrongBusKind { .. } | Error::NeedsOwnBus { .. } => Some("protocols"),
        Error::UnknownBus { .. } => Some("bus"),
        _ => None,
    }
}

/// A gateway's core with nothing configured.
struct Core {
    gateway: Box<Gateway>,
    sequence: u16,
}

impl Core {
    fn new(board: &BoardPorts) -> Self {
        let port = |(kind, rates): &(BusKind, Vec<u32>)| BusPort {
            kind: *kind,
            // The core's board is part of a program that never ends; this one lives on as well.
            bitrates: rates.clone().leak(),
        };
        let board = Board {
            name: "",
            firmware: "",
            build_id: "",
            boot: BootReason::Simulated,
            crash_report: "",
            e_stop_input: false,
            enable_output: false,
            buses: board.ports.iter().map(port).collect::<Vec<_>>().leak(),
            bus_limit: None,
            links: &[LinkPort { bauds: &[] }],
        };
        let gateway = Box::new(Gateway::new(Box::leak(Box::new(board)), Some(0)));
        let mut core = Self { gateway, sequence: 0 };
        let (protocol_major, protocol_minor) = (PROTOCOL_MAJOR, PROTOCOL_MINOR);
        let _ = core.ask(&requests::Hello { protocol_major, protocol_minor, session: 0 }.into());
        core
    }

    /// One with this configuration, which may be more than one list of changes holds.
    fn of(configuration: &Configuration, board: &BoardPorts) -> Result<Self, Error> {
        let mut core = Self::new(board);
        let is_same_axis = |one: &Change, other: &Change| match (one, other) {
            (Change::Axis { axis: one, .. }, Change::Axis { axis: other, .. }) => one == other,
            _ => false,
        };
        let changes = Configuration::default().changes_to(configuration);
        changes.chunk_by(is_same_axis).try_for_each(|row| core.change(row))?;
        Ok(core)
    }

    /// Makes changes together.
    fn change(&mut self, changes: &[Change]) -> Result<(), Error> {
        self.begin(changes)?;
        self.ask(&requests::ApplyChanges {}.into())
    }

    /// Begins a list of changes, and makes none of them.
    fn begin(&mut self, changes: &[Change]) -> Result<(), Error> {
        self.ask(&requests::BeginChanges {}.into())?;
        for changes in changes.chunks(requests::MAX_CHANGES_AT_ONCE) {
            let changes = changes.iter().cloned().collect();
            self.ask(&requests::AddChanges { changes }.into())?;
        }
        Ok(())
    }

    fn ask(&mut self, request: &Request) -> Result<(), Error> {
        self.sequence = self.sequence.wrapping_add(1);
        let mut frame = [0; MAX_FRAME];
        let length = request.encode_frame(self.sequence, &mut frame).unwrap_or(0);
        let (now, store) = (Instant::from_micros(1), &mut |_: usize, _: u32| {});
        self.gateway.handle(now, Event::HostBytes { link: 0, bytes: &frame[..length] }, store);
        let mut result = Ok(());
        while let Some(length) = self.gateway.poll_host(0, &mut frame, store) {
            let mut deframer = Deframer::new();
            for byte in &frame[..length] {
                if let Some(Ok(answer)) = deframer.push(*byte)
                    && answer.kind == Kind::Error
                    && answer.sequence == self.sequence
                    && let Ok(error) = Error::decode(answer.number, answer.body)
                {
                    result = Err(error);
                }
            }
        }
        result
    }
}
