//! The settings of a motor as a file: what it tells is written, compared, and given back to it.

use std::fmt::Write as _;
use std::path::Path;

use toml::de::{DeTable, DeValue};

use super::change::{all_wrong, change, check, unknown};
use super::settings::{self, Key, Number, Values};
use super::{Motor, Run, failed};
use crate::args::MotorTarget;
use crate::commands::set_motor_id;
use crate::config::Source;
use crate::failure::Failure;
use crate::motor::{Asked, on_motor};
use crate::session::Session;
use crate::written;

/// What the file says of itself.
const HEADING: &str = "\
# The settings of a motor, as `mgw motor … dump` read them. `mgw motor … restore FILE` writes what the
# motor has otherwise, but for id and bitrate, unless they are asked for.
";

/// What a file has.
struct File {
    path: String,
    id: Option<u8>,
    bitrate: Option<u32>,
    settings: Vec<(Key, Number)>,
}

/// What a motor says of itself, by the name of its key.
fn kind(motor: &Motor) -> Vec<(&'static str, String)> {
    let found = motor.found.as_ref();
    let model = found.and_then(|found| found.model.clone());
    let mut kind = vec![("protocol", motor.protocol.name().to_owned())];
    if motor.protocol == host_protocol::Protocol::Rmd {
        kind.push(("rmd_dialect", motor.dialect_names()));
    }
    kind.extend(model.map(|model| ("model", model)));
    kind
}

/// Reads all that the motor tells, and writes it.
pub fn dump(run: &mut Run<'_>, output: Option<&Path>, force: bool) -> Result<(), Failure> {
    let keys = settings::keys(&run.motor);
    let values = settings::read(run, &keys)?;
    let text = text(&run.motor, &values);
    let out = run.session.out;
    let Some(path) = output else {
        if !out.is_json() {
            return text.lines().try_for_each(|line| out.text(line));
        }
        return run.report("dump", &values, None, &[]);
    };
    written::write(path, text, force)?;
    let note = format!("{} settings in {}", values.len(), path.display());
    run.report("dump", &values, None, &[note])
}

fn text(motor: &Motor, values: &Values) -> String {
    let mut text = format!("{HEADING}\n[motor]\n");
    // Writing to a string does not fail.
    for (name, value) in kind(motor) {
        let _ = writeln!(text, "{name} = {value:?}");
    }
    if let Some(firmware) = motor.found.as_ref().and_then(|found| found.firmware.as_ref()) {
        let _ = writeln!(text, "firmware = {firmware:?}");
    }
    let _ = writeln!(text, "id = {}\nbitrate_bit_s = {}", motor.node, motor.bitrate);
    let _ = writeln!(text, "\n[settings]");
    for (name, value) in values {
        let _ = writeln!(text, "{name} = {value}");
    }
    text
}

/// Reads a file for a motor; all that is wrong with it at once.
fn read(motor: &Motor, path: &str) -> Result<File, Failure> {
    let source = Source::read(path)?;
    let (table, errors) = DeTable::parse_recoverable(&source.text);
    let mut wrong: Vec<String> = errors.iter().map(|error| error.message().to_owned()).collect();
    let mut file = File { path: source.path, id: None, bitrate: None, settings: Vec::new() };
    let kind = kind(motor);
    let section = |name: &str| match table.get_ref().get(name).map(|value| value.get_ref()) {
        Some(DeValue::Table(section)) => Some(section),
        _ => None,
    };
    for (name, _) in table.get_ref() {
        if section(name.get_ref()).is_none() || !["motor", "settings"].contains(&&**name.get_ref())
        {
            let name = name.get_ref();
            wrong.push(format!("`{name}` is not a section [motor] or [settings]"));
        }
    }
    let Some(of) = section("motor") else {
        wrong.push("there is no section [motor], which says whose settings these are".to_owned());
        return Err(in_file(motor, &file, &wrong));
    };
    for (name, value) in of.iter() {
        of_motor(&mut file, &kind, name.get_ref(), value.get_ref(), &mut wrong);
    }
    for (name, has) in kind.iter().filter(|(name, _)| of.get(*name).is_none()) {
        wrong.push(format!("{name} is missing in [motor]; the motor has {has:?}"));
    }
    let is_for_it = |(name, has): &(&str, String)| {
        of.get(*name).and_then(|value| value.get_ref().as_str()) == Some(has)
    };
    if !kind.iter().all(is_for_it) {
        // Nothing that follows would be about this motor.
        return Err(in_file(motor, &file, &wrong));
    }
    if section("settings").is_none() {
        wrong.push("there is no section [settings]: the file is not whole".to_owned());
    }
    let keys = settings::keys(motor);
    for (name, value) in section("settings").into_iter().flat_map(|section| section.iter()) {
        let name = name.get_ref().as_ref();
        let key = keys.iter().find(|key| key.name == name);
        match (key, number(value.get_ref())) {
            (Some(key), Some(number)) => file.settings.push((*key, number)),
            (None, _) => wrong.push(unknown(name, &keys)),
            (_, None) => wrong.push(format!("{name} takes a number")),
        }
    }
    wrong.extend(check(motor, &file.settings));
    if wrong.is_empty() { Ok(file) } else { Err(in_file(motor, &file, &wrong)) }
}

fn in_file(motor: &Motor, file: &File, wrong: &[String]) -> Failure {
    let path = &file.path;
    let lines: Vec<String> = wrong.iter().map(|text| format!("{path}: {text}")).collect();
    all_wrong(motor, &lines)
}

fn of_motor(
    file: &mut File,
    kind: &[(&str, String)],
    name: &str,
    value: &DeValue<'_>,
    wrong: &mut Vec<String>,
) {
    if let Some((_, has)) = kind.iter().find(|(key, _)| *key == name) {
        if value.as_str() != Some(has) {
            let of = value.as_str().unwrap_or("something else");
            wrong.push(format!("it is for {name} = {of:?}, and the motor has {has:?}"));
        }
        return;
    }
    match (name, number(value)) {
        ("id", Some(Number::Integer(id))) => match u8::try_from(id) {
            Ok(id) => file.id = Some(id),
            Err(_) => wrong.push(format!("id = {id} is no id")),
        },
        ("bitrate_bit_s", Some(Number::Integer(rate))) => match u32::try_from(rate) {
            Ok(rate) => file.bitrate = Some(rate),
            Err(_) => wrong.push(format!("bitrate_bit_s = {rate} is no bitrate")),
        },
        ("id" | "bitrate_bit_s", _) => wrong.push(format!("{name} takes a whole number")),
        // The firmware may be another one; a model or dialect that this motor does not tell not.
        ("firmware", _) => {}
        ("protocol" | "rmd_dialect" | "model", _) => {
            wrong.push(format!("it is for a motor with {name}, which this one does not tell"));
        }
        _ => wrong.push(format!("[motor] has no key `{name}`")),
    }
}

fn number(value: &DeValue<'_>) -> Option<Number> {
    match value {
        DeValue::Integer(number) => {
            i64::from_str_radix(number.as_str(), number.radix()).ok().map(Number::Integer)
        }
        DeValue::Float(number) => number.as_str().parse().ok().map(Number::Real),
        _ => None,
    }
}

/// What a file has otherwise than the motor.
fn differences(run: &mut Run<'_>, file: &File) -> Result<(Values, Vec<(Key, Number)>), Failure> {
    let keys: Vec<Key> = file.settings.iter().map(|(key, _)| *key).collect();
    let has = settings::read(run, &keys)?;
    let is_other = |(key, value): &&(Key, Number)| has.get(key.name) != Some(value);
    let other = file.settings.iter().filter(is_other).copied().collect();
    Ok((has, other))
}

/// Shows what a file has otherwise than the motor; a failure if anything.
pub fn diff(run: &mut Run<'_>, path: &str) -> Result<(), Failure> {
    let file = read(&run.motor, path)?;
    let (has, other) = differences(run, &file)?;
    let name = |of: &Key| of.name.to_owned();
    let before: Values = other
        .iter()
        .filter_map(|(key, _)| has.get(key.name).map(|value| (name(key), *value)))
        .collect();
    let after: Values = other.iter().map(|(key, value)| (name(key), *value)).collect();
    let mut notes = Vec::new();
    if let Some(id) = file.id.filter(|id| *id != run.motor.node) {
        notes.push(format!("the file has id = {id}, which only --with-id restores"));
    }
    if let Some(rate) = file.bitrate.filter(|rate| *rate != run.motor.bitrate) {
        notes.push(format!(
            "the file has bitrate_bit_s = {rate}, which only --with-bitrate restores"
        ));
    }
    run.report("diff", &before, Some(&after), &notes)?;
    match other.len() {
        0 => Ok(()),
        count => Err(failed(
            "Differs",
            format!("{} has {count} settings otherwise than {}", file.path, run.motor.name()),
        )),
    }
}

/// Gives a motor the settings of a file, then the id and the bitrate where that is asked for.
pub fn restore(
    session: &mut Session,
    target: MotorTarget,
    yes: bool,
    path: &str,
    (with_id, with_bitrate): (bool, bool),
) -> Result<(), Failure> {
    let mut then = None;
    on_motor(session, target, yes, Asked::Write, |run| {
        let file = read(&run.motor, path)?;
        let id = file.id.filter(|id| with_id && *id != run.motor.node);
        let bitrate = file.bitrate.filter(|rate| with_bitrate && *rate != run.motor.bitrate);
        for (asked, has, name) in
            [(with_id, file.id.is_some(), "id"), (with_bitrate, file.bitrate.is_some(), "bitrate")]
        {
            if asked && !has {
                let text = format!("{}: it has no {name}", file.path);
                return Err(failed("NotInFile", text));
            }
        }
        // All that can be wrong is known before anything is written.
        if let Some(id) = id {
            super::identity::check(run, id)?;
        }
        if let Some(bitrate) = bitrate {
            super::identity::refuse_not_offered(run, bitrate)?;
        }
        let keys: Vec<Key> = file.settings.iter().map(|(key, _)| *key).collect();
        change(run, "restore", &keys, file.settings, true)?;
        then = Some((run.motor.clone(), id, bitrate));
        Ok(())
    })?;
    let Some((motor, id, bitrate)) = then else { return Ok(()) };
    let at = |node| match target {
        MotorTarget::Axis(_) => target,
        MotorTarget::Place { bus, bitrate, .. } => {
            MotorTarget::Place { bus, protocol: Some(motor.protocol), node, bitrate }
        }
    };
    let node = match id {
        Some(id) => set_motor_id(session, at(motor.node), yes, Some(id))?,
        None => motor.node,
    };
    match bitrate {
        Some(bitrate) => {
            on_motor(session, at(node), yes, Asked::Write, |run| super::bitrate(run, Some(bitrate)))
        }
        None => Ok(()),
    }
}
