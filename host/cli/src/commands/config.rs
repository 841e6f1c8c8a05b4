//! `mgw config`

use std::collections::BTreeMap;

use host_protocol::{AxisParameter, Change, Error, Subject};
use mgw_client::ClientError;
use serde_json::{Value as Json, json};

use crate::args::{ConfigAction, ConfigFile, ConfigRow};
use crate::config::{self, BoardPorts, Configuration, MOTOR_TIMEOUT, NEW_BUS, Source};
use crate::failure::Failure;
use crate::json;
use crate::motor::Unfinished;
use crate::output::Output;
use crate::parameters;
use crate::session::Session;
use crate::table::Table;
use crate::words::{self, NOTHING};

/// What a check without a gateway leaves open.
const WITHOUT_BOARD: &str = "not looked at without a gateway: whether its board has these buses, \
    of that kind, with these bitrates. Add --port";

/// Carries out what needs no gateway, if it is such a thing and none is named.
pub fn run_alone(
    action: &ConfigAction,
    has_port: bool,
    out: Output,
) -> Option<Result<(), Failure>> {
    match action {
        ConfigAction::Schema => Some(print_schema(out)),
        ConfigAction::Apply { file, check: true } | ConfigAction::Check { file } if !has_port => {
            Some(check_alone(file, out))
        }
        _ => None,
    }
}

/// Refuses a file that no gateway would take.
pub fn refuse_without_board(action: &ConfigAction) -> Result<(), Failure> {
    match action {
        ConfigAction::Apply { file, .. }
        | ConfigAction::Check { file }
        | ConfigAction::Diff { file }
            if !file.merge =>
        {
            file.source.for_any_board().map(drop)
        }
        _ => Ok(()),
    }
}

fn check_alone(file: &ConfigFile, out: Output) -> Result<(), Failure> {
    if file.merge {
        let text = "--merge starts from what a gateway has. Add --port".to_owned();
        return Err(Failure::Usage(text));
    }
    let wanted = file.source.for_any_board()?;
    let nothing = Configuration::default();
    if let Some(board) = BoardPorts::possible(&wanted).next() {
        config::check_count(&nothing, &wanted, &board).or_else(refuse_count)?;
    }
    let line = format!("{}: {}; {WITHOUT_BOARD}", file.source.path, counted(&wanted));
    out.either(line, &json!({ "checked": counts(&wanted), "board": null, "changes": null }))
}

/// Other rows than how many were looked at before.
fn refuse_count(error: Error) -> Result<(), Failure> {
    match error {
        Error::TooManyChanges { .. } => Err(Failure::would_be_refused(error)),
        _ => Ok(()),
    }
}

fn print_schema(out: Output) -> Result<(), Failure> {
    let schema = config::schema();
    let pretty = serde_json::to_string_pretty(&schema).unwrap_or_default();
    pretty.lines().try_for_each(|line| out.text(line))?;
    out.object(&schema)
}

/// Carries out the others.
pub fn run(session: &mut Session, action: &ConfigAction) -> Result<(), Failure> {
    match action {
        // Without a gateway to ask: it never comes here.
        ConfigAction::Schema => print_schema(session.out),
        ConfigAction::Apply { file, check: false } => apply(session, file),
        ConfigAction::Apply { file, .. } | ConfigAction::Check { file } => check(session, file),
        ConfigAction::Diff { file } => diff(session, file),
        ConfigAction::Dump { template } => dump(session, template.as_ref()),
        ConfigAction::Save => {
            session.client.take_authority()?;
            session.client.save_configuration()?;
            done(session, "saved: it runs again after a loss of power".to_owned(), 0)
        }
        ConfigAction::Reset { stored: true } => {
            session.client.take_authority()?;
            session.client.forget_stored()?;
            let line = "nothing is stored any more; what runs stays until the power is lost";
            done(session, line.to_owned(), 0)
        }
        ConfigAction::Reset { stored: false } => {
            let running = begin(session)?;
            let changes = running.changes_to(&Configuration::default());
            make(session, &changes)?;
            done(session, format!("reset: {} removed", counted(&running)), changes.len())
        }
        ConfigAction::Unset { row } => {
            let (row, names) = row.parts(session)?;
            change(session, row, |wanted| names.iter().try_for_each(|name| wanted.unset(row, name)))
        }
        ConfigAction::Set(row) => {
            let (row, assignments) = row.parts(session)?;
            let entries = config::assignments(row, assignments, |bus| session.bus(bus))?;
            let buses = session.client.hello().buses.len();
            change(session, row, |wanted| {
                entries.iter().for_each(|entry| wanted.set(entry));
                match row {
                    Subject::Axis(axis) if wanted.has(row) => wanted.refuse_incomplete(axis, buses),
                    _ => Ok(()),
                }
            })
        }
        ConfigAction::Timeout { axis, milliseconds } => {
            let axis = session.axis(axis)?;
            let timeout = session.client.provision_motor_timeout(axis, *milliseconds)?;
            let line = format!(
                "axis {axis}: the motor's own timeout is {}",
                words::motor_timeout(timeout)
            );
            let mut fields = json!({ "axis": axis });
            json::extend(&mut fields, json::axis::motor_timeout(timeout));
            session.out.either(line, &fields)
        }
        ConfigAction::Show { axis } => {
            let axis = session.axis(axis)?;
            show(session, axis)
        }
        ConfigAction::Remove { axis } => {
            let axis = session.axis(axis)?;
            session.refuse_unconfigured(&[axis], "there is nothing to remove")?;
            session.client.remove_axis(axis)?;
            done(session, format!("axis {axis} removed"), 1)
        }
    }
}

/// Takes authority, so that nobody else changes what is read now.
fn begin(session: &mut Session) -> Result<Configuration, Failure> {
    session.client.take_authority()?;
    Ok(config::read(&mut session.client)?)
}

/// What a file makes of the configuration of the gateway, if that would take it.
fn wanted(
    session: &Session,
    file: &ConfigFile,
    running: &Configuration,
) -> Result<Configuration, Failure> {
    let base = if file.merge { running.clone() } else { Configuration::default() };
    file.source.onto(base, &BoardPorts::of(session.client.hello()))
}

fn apply(session: &mut Session, file: &ConfigFile) -> Result<(), Failure> {
    let running = begin(session)?;
    let wanted = wanted(session, file, &running)?;
    let changes = running.changes_to(&wanted);
    make(session, &changes)?;
    Unfinished::new().forget(&running);
    let timeouts = config::write_timeouts(&mut session.client, &wanted)?;
    let line = format!(
        "configured: {}; {}, {} written",
        counted(&wanted),
        changed(changes.len()),
        words::count(timeouts, "motor timeout", "motor timeouts")
    );
    session.out.either(
        line,
        &json!({
            "configured": counts(&wanted),
            "changes": changes.len(), "motor_timeouts_written": timeouts,
        }),
    )
}

fn check(session: &mut Session, file: &ConfigFile) -> Result<(), Failure> {
    let running = config::read(&mut session.client)?;
    let wanted = wanted(session, file, &running)?;
    let board = BoardPorts::of(session.client.hello());
    config::check_count(&running, &wanted, &board).or_else(refuse_count)?;
    let changes = running.changes_to(&wanted).len();
    let board = session.client.hello().board.as_str().to_owned();
    let line = format!("{}: {}; {}", file.source.path, counted(&wanted), changed(changes));
    session
        .out
        .either(line, &json!({ "checked": counts(&wanted), "board": board, "changes": changes }))
}

fn diff(session: &mut Session, file: &ConfigFile) -> Result<(), Failure> {
    let running = config::read(&mut session.client)?;
    let wanted = wanted(session, file, &running)?;
    let changes = running.changes_to(&wanted);
    let mut lines: Vec<String> = changes.iter().map(|change| running.shown(change)).collect();
    let mut objects: Vec<Json> = changes.iter().map(config::change_to_json).collect();
    for (axis, timeout_ms) in &wanted.motor_timeouts {
        let known = running.motor_timeouts.get(axis);
        if known.is_none_or(|known| known != timeout_ms) {
            let known = known.map_or("not known".to_owned(), |known| format!("{known} ms"));
            lines.push(format!("axis {axis}: {MOTOR_TIMEOUT} {known} -> {timeout_ms} ms"));
            objects.push(json!({ "axis": axis, "parameter": MOTOR_TIMEOUT, "value": timeout_ms }));
        }
    }
    let count = objects.len();
    let printed = lines
        .iter()
        .try_for_each(|line| session.out.text(line))
        .and_then(|()| session.out.object(&json!({ "differences": objects })));
    let differs = Failure::Differs { path: file.source.path.clone(), count };
    Failure::first([if count == 0 { Ok(()) } else { Err(differs) }, printed])
}

fn dump(session: &mut Session, template: Option<&Source>) -> Result<(), Failure> {
    let running = config::read(&mut session.client)?;
    let text = match template {
        None => config::dump(&running),
        Some(Source { path, text }) => config::dump_like(text, &running)
            .map_err(|error| Failure::Usage(format!("{path}: {error}")))?,
    };
    text.lines().try_for_each(|line| session.out.text(line))?;
    session.out.object(&json!({ "toml": text }))
}

/// Changes a row of the configuration of the gateway.
fn change(
    session: &mut Session,
    row: Subject,
    alter: impl FnOnce(&mut Configuration) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let running = begin(session)?;
    let mut wanted = running.clone();
    alter(&mut wanted)?;
    if let Subject::Bus(bus) = row
        && !running.has(row)
        && let Some(config) = wanted.buses.get(&bus)
        && (config.bitrate == NEW_BUS.bitrate || config.protocols == NEW_BUS.protocols)
    {
        let text = "a bus needs bitrate= and protocols=, for example bitrate=1000000 \
            protocols=rmd,thruster";
        return Err(Failure::Usage(text.to_owned()));
    }
    wanted.refuse_name_of_nothing(row)?;
    let changes = running.changes_to(&wanted);
    make(session, &changes)?;
    done(session, format!("{} configured", config::title(row)), changes.len())
}

/// Makes all changes or none.
fn make(session: &mut Session, changes: &[Change]) -> Result<(), Failure> {
    config::make(&mut session.client, changes).map_err(|error| match error {
        ClientError::Gateway(error) => {
            let text = match error {
                // A file or this command is where it is to be written into.
                Error::NotConfigured { .. } | Error::BusNotConfigured { .. } => error.to_string(),
                error => Failure::would_be_refused(error).to_string(),
            };
            // Of a list that is full or forgotten the gateway says so itself.
            let says_so = text.contains("nothing was changed");
            let text = if says_so { text } else { format!("{text}. Nothing was changed") };
            Failure::Explained { error, text }
        }
        error => error.into(),
    })
}

fn done(session: &Session, line: String, changes: usize) -> Result<(), Failure> {
    session.out.either(line, &json!({ "done": true, "changes": changes }))
}

fn counted(configuration: &Configuration) -> String {
    let buses = words::count(configuration.buses.len(), "bus", "buses");
    format!("{buses} and {}", words::count(configuration.axes.len(), "axis", "axes"))
}

fn changed(changes: usize) -> String {
    words::count(changes, "change", "changes")
}

fn counts(configuration: &Configuration) -> Json {
    json!({ "buses": configuration.buses.len(), "axes": configuration.axes.len() })
}

fn show(session: &mut Session, axis: u8) -> Result<(), Failure> {
    let mut table = Table::new(&["parameter", ">value", "allowed", "meaning"]);
    let mut object = serde_json::Map::new();
    let (settings, _) = session.client.axis_settings(axis)?;
    let set: BTreeMap<u16, _> =
        settings.iter().map(|setting| (setting.parameter, setting.value)).collect();
    for parameter in AxisParameter::ALL {
        let (info, text) = (parameter.info(), parameter.text());
        let value = set.get(&parameter.number()).copied().or(info.default);
        let json = value.map_or(Json::Null, |value| parameters::to_json(info, value));
        object.insert(text.name.to_owned(), json);
        let nothing = if info.required { "missing" } else { NOTHING };
        table.row([
            text.name.to_owned(),
            value.map_or(nothing.to_owned(), |value| parameters::shown(info, value)),
            parameters::allowed(info),
            text.doc.to_owned(),
        ]);
    }
    let name = session.known_names().axis(axis).map(str::to_owned);
    if let Some(name) = &name {
        session.out.text(format!("axis {axis} is called {name}"))?;
    }
    session.out.table(&table)?;
    session.out.object(&json!({ "axis": axis, "name": name, "parameters": object }))
}

impl ConfigRow {
    /// Which row, and what is said of it.
    fn parts(&self, session: &mut Session) -> Result<(Subject, &[String]), Failure> {
        Ok(match self {
            Self::Gateway { words } => (Subject::Gateway, words),
            Self::Bus { bus, words } => (Subject::Bus(session.bus(bus)?), words),
            Self::Axis { axis, words } => (Subject::Axis(session.axis(axis)?), words),
        })
    }
}
