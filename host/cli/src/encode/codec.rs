//! Requests by name, alike for the three codecs: each has a table of commands of the same shape.

/// What `mgw encode` does with the codec of this name.
macro_rules! codec {
    ($codec:ident) => {
        pub mod $codec {
            use ::$codec::{BuildError, COMMANDS, CommandInfo, EncodeError, FieldInfo, Request};

            use crate::encode::wanted::{Wanted, number};
            use crate::failure::Failure;

            /// The request with the fields that were typed. `word` reads values that are not numbers.
            pub fn build(wanted: &Wanted, word: &dyn Fn(&str) -> Option<f64>) -> Result<Request, Failure> {
                let name = wanted.command()?;
                let Some(info) = sendable().find(|info| info.name == name) else {
                    let names: Vec<&str> = sendable().map(|info| info.name).collect();
                    let (codec, names) = (stringify!($codec), names.join(", "));
                    return Err(Failure::Usage(format!(
                        "`{name}` is no {codec} command. These are: {names}"
                    )));
                };
                let mut values = Vec::new();
                for (field, text) in &wanted.fields {
                    let value = number(text).or_else(|| word(text)).ok_or_else(|| {
                        Failure::Usage(format!("--{field} {text}: not a number; write it like 12.5 or 0x1F"))
                    })?;
                    values.push((field.as_str(), value));
                }
                let own = super::own_fields::$codec(&values);
                for (field, _) in &values {
                    if !info.request.iter().any(|info| info.name == *field) && !own.contains(field) {
                        return Err(Failure::Usage(format!(
                            "{name} has no field `{field}`. {}",
                            fields(info)
                        )));
                    }
                }
                let given = |field: &str| {
                    values.iter().rev().find(|(given, _)| *given == field).map(|(_, value)| *value)
                };
                Request::build(name, &given).map_err(|error| not_built(info, error))
            }

            /// Every command that can be sent.
            pub fn sendable() -> impl Iterator<Item = &'static CommandInfo> {
                COMMANDS.iter().filter(|info| is_sendable(info))
            }

            /// Some frames of the table come from motors only.
            pub fn is_sendable(info: &CommandInfo) -> bool {
                Request::build(info.name, &|_| None) != Err(BuildError::UnknownCommand)
            }

            /// Why the codec refuses a value.
            pub fn refused(error: EncodeError) -> Failure {
                let (name, field, value, range) = match error {
                    EncodeError::OutOfRange { field, value, min, max } => {
                        ("OutOfRange", field, value, Some((min as f64, max as f64)))
                    }
                    EncodeError::Forbidden { field, value, .. } => ("Forbidden", field, value, None),
                    EncodeError::Frame => ("Forbidden", "frame", 0, None),
                };
                Failure::Refused { name, field, value: value as f64, range, message: error.to_string() }
            }

            fn not_built(info: &CommandInfo, error: BuildError) -> Failure {
                let message = error.to_string();
                match error {
                    BuildError::UnknownCommand => Failure::Usage(message),
                    BuildError::MissingField { field } => {
                        Failure::Usage(format!("{} needs --{field}. {}", info.name, fields(info)))
                    }
                    BuildError::OutOfRange { field, value, min, max } => Failure::Refused {
                        name: "OutOfRange",
                        field,
                        value,
                        range: Some((min, max)),
                        message,
                    },
                    BuildError::NotAnInteger { field, value } => {
                        Failure::Refused { name: "NotAnInteger", field, value, range: None, message }
                    }
                    BuildError::Encode(error) => refused(error),
                }
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
        }
    };
}

codec!(rmd);
codec!(thruster);
codec!(d5);

/// Names that a command takes besides those of its table.
mod own_fields {
    pub fn rmd(_: &[(&str, f64)]) -> Vec<&'static str> {
        Vec::new()
    }

    pub fn thruster(_: &[(&str, f64)]) -> Vec<&'static str> {
        Vec::new()
    }

    /// What is written may go by the name of the register's own field.
    pub fn d5(values: &[(&str, f64)]) -> Vec<&'static str> {
        let address = values.iter().find(|(name, _)| *name == "register").map(|(_, address)| *address);
        let is_it = |info: &&::d5::RegisterInfo| address == Some(f64::from(info.register.0));
        ::d5::REGISTERS.iter().filter(is_it).map(|info| info.field).collect()
    }
}
