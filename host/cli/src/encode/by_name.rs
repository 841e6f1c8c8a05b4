//! Requests by name, alike for the three codecs: each has a table of commands of the same shape.

use codec::{BuildError, CommandInfo, EncodeError, FieldInfo};

use crate::encode::wanted::{Wanted, number};
use crate::failure::Failure;

/// The field of a D5 write that may go by the name of the register's own.
const VALUE: &str = "value";

/// A field's value by its name, as far as it was typed.
type Given<'a> = &'a dyn Fn(&str) -> Option<f64>;

/// What a codec builds requests from.
pub struct Codec<R> {
    name: &'static str,
    pub commands: &'static [CommandInfo],
    build: fn(&str, Given<'_>) -> Result<R, BuildError>,
    /// Reads values that are not numbers.
    word: fn(&str) -> Option<f64>,
    /// Names that a command takes besides those of its table.
    own_fields: fn(&[(&str, f64)]) -> Vec<&'static str>,
}

pub const RMD: Codec<rmd::Request> = Codec {
    name: "rmd",
    commands: rmd::COMMANDS,
    build: |name, given| rmd::Request::build(name, given),
    word: |_| None,
    own_fields: |_| Vec::new(),
};

pub const THRUSTER: Codec<thruster::Request> = Codec {
    name: "thruster",
    commands: thruster::COMMANDS,
    build: |name, given| thruster::Request::build(name, given),
    word: |_| None,
    own_fields: |_| Vec::new(),
};

pub const D5: Codec<d5::Request> = Codec {
    name: "d5",
    commands: d5::COMMANDS,
    build: |name, given| d5::Request::build(name, given),
    word: d5_register,
    own_fields: d5_own_fields,
};

impl<R> Codec<R> {
    /// The request with the fields that were typed.
    pub fn build(&self, wanted: &Wanted) -> Result<R, Failure> {
        let name = wanted.command()?;
        let Some(info) = self.sendable().find(|info| info.name == name) else {
            let names = self.sendable().map(|info| info.name);
            let names: Vec<&str> = names.filter(|name| !wanted.leaves_out(name)).collect();
            let (codec, names) = (self.name, names.join(", "));
            return Err(Failure::Usage(format!(
                "`{name}` is no {codec} command. These are: {names}"
            )));
        };
        let mut values = Vec::new();
        for (field, text) in &wanted.fields {
            let value = number(text).or_else(|| (self.word)(text)).ok_or_else(|| {
                Failure::Usage(format!(
                    "--{field} {text}: not a number; write it like 12.5 or 0x1F"
                ))
            })?;
            values.push((field.as_str(), value));
        }
        let own = (self.own_fields)(&values);
        for (index, (field, _)) in values.iter().enumerate() {
            let is_value = |field: &str| field == VALUE || own.first() == Some(&field);
            let is_again = |other: &str| other == *field || (is_value(other) && is_value(field));
            if values.iter().take(index).any(|(other, _)| is_again(other)) {
                return Err(Failure::Usage(format!(
                    "`{field}` is given twice, or under two names. Give it once"
                )));
            }
        }
        for (field, _) in &values {
            if !info.request.iter().any(|info| info.name == *field) && !own.contains(field) {
                return Err(Failure::Usage(format!(
                    "{name} has no field `{field}`. {}",
                    fields(info)
                )));
            }
        }
        let given =
            |field: &str| values.iter().find(|(given, _)| *given == field).map(|(_, value)| *value);
        (self.build)(name, &given).map_err(|error| not_built(info, error))
    }

    /// Every command that can be sent.
    fn sendable(&self) -> impl Iterator<Item = &'static CommandInfo> {
        self.commands.iter().filter(|info| self.is_sendable(info))
    }

    /// Some frames of the table come from motors only.
    pub fn is_sendable(&self, info: &CommandInfo) -> bool {
        !matches!((self.build)(info.name, &|_| None), Err(BuildError::UnknownCommand))
    }
}

/// Why a codec refuses a value.
pub fn refused(error: EncodeError) -> Failure {
    let (name, field, value, range) = match error {
        EncodeError::OutOfRange { field, value, min, max } => {
            ("OutOfRange", field, value, Some((min as f64, max as f64)))
        }
        EncodeError::Forbidden { field, value, .. } => ("Forbidden", field, value, None),
        EncodeError::Frame => ("Forbidden", "frame", 0, None),
    };
    explained(Failure::Refused {
        name,
        field,
        value: value as f64,
        range,
        message: error.to_string(),
    })
}

fn not_built(info: &CommandInfo, error: BuildError) -> Failure {
    let message = error.to_string();
    match error {
        BuildError::UnknownCommand => Failure::Usage(message),
        BuildError::MissingField { field } => {
            Failure::Usage(format!("{} needs --{field}. {}", info.name, fields(info)))
        }
        BuildError::OutOfRange { field, value, min, max } => explained(Failure::Refused {
            name: "OutOfRange",
            field,
            value,
            range: Some((min, max)),
            message,
        }),
        BuildError::NotAnInteger { field, value } => {
            Failure::Refused { name: "NotAnInteger", field, value, range: None, message }
        }
        BuildError::Encode(error) => refused(error),
    }
}

/// With what is allowed, where a range alone does not tell.
fn explained(failure: Failure) -> Failure {
    let Failure::Refused { name, field, value, range, mut message } = failure else {
        return failure;
    };
    match field {
        "bitrate" | "bitrate_kbps" => {
            let rates: Vec<String> =
                thruster::BITRATES.iter().map(|info| info.setting.0.to_string()).collect();
            message = format!("{message}. Allowed are {} kbit/s", rates.join(", "));
        }
        "timeout" | "timeout_ms"
            if range.is_some_and(|(_, max)| max == f64::from(thruster::TIMEOUT_MAX)) =>
        {
            let (min, max) = (thruster::TIMEOUT_MIN, thruster::TIMEOUT_MAX);
            message = format!(
                "{field} {value} is refused: allowed are 0, which is off, and {min}..={max} ms"
            );
        }
        _ => {}
    }
    Failure::Refused { name, field, value, range, message }
}

/// The fields of a command in one sentence.
fn fields(info: &CommandInfo) -> String {
    if info.request.is_empty() {
        return "It has no fields".to_owned();
    }
    let fields: Vec<String> =
        info.request.iter().map(|field| format!("--{} {}", field.name, range(field))).collect();
    format!("Its fields are: {}", fields.join(", "))
}

/// `-327.68..=327.67 A`.
pub fn range(field: &FieldInfo) -> String {
    format!("{}..={} {}", field.min, field.max, field.unit).trim_end().to_owned()
}

/// A register by its name, for the field that takes its address.
fn d5_register(text: &str) -> Option<f64> {
    d5::REGISTERS.iter().find(|info| info.name == text).map(|info| f64::from(info.register.0))
}

/// What is written may go by the name of the register's own field; behind it that of the register
/// which is written with it.
fn d5_own_fields(values: &[(&str, f64)]) -> Vec<&'static str> {
    let address = values.iter().find(|(name, _)| *name == "register").map(|(_, address)| *address);
    let is_it = |info: &&d5::RegisterInfo| address == Some(f64::from(info.register.0));
    let own = d5::REGISTERS.iter().find(is_it);
    own.into_iter()
        .chain(own.and_then(|own| own.register.written_with()))
        .map(|info| info.field)
        .collect()
}
